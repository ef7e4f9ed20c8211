"""A daemon that is killed again and again while files come, and what must hold after that."""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from acceptance.support import (
    GLIDERWATCH,
    Daemon,
    Mail,
    Mailbox,
    Site,
    command,
    healthy,
    remora,
    results,
    until,
)
from gliderwatch.delivery.mail import message_id
from gliderwatch.errors import StateError
from gliderwatch.simulate.delivery import FileForm, Names, arrivals
from gliderwatch.simulate.scenario import Mission
from gliderwatch.store.maintenance import damage
from gliderwatch.store.state_file import Status, Store

SENDER = "gliderwatch@dockserver.local"
HOOK = Path(__file__).with_name("hook")
DEADLINE = 30.0
"""Seconds after which a daemon that found no commit to be killed at is killed all the same."""
AFTER_ACCEPTANCE = 5.0
"""Seconds at most from the acceptance of a mail to a kill for it to come twice, if it could be marked."""

ON_ITS_WAY = 1.0
"""Seconds, at most, in which a server still accepts what a daemon sent before it was killed."""


def hooked(**faults: object) -> dict[str, str]:
    """The environment in which `hook/sitecustomize.py` makes these faults happen."""
    path = os.pathsep.join(filter(None, [str(HOOK), os.environ.get("PYTHONPATH")]))
    return {"PYTHONPATH": path} | {name: str(value) for name, value in faults.items()}


def flood(folder: Path) -> None:
    """Twice the events of a folder that inotify keeps for one that does not read them."""
    here, there = folder / ".one", folder / ".two"
    here.touch()
    for _ in range(int(Path("/proc/sys/fs/inotify/max_queued_events").read_text(encoding="ascii")) // 2):
        here.rename(there)
        there.rename(here)
    here.unlink()


@dataclass(frozen=True, slots=True)
class Sent:
    """A file as it comes: name and content."""

    glider: str
    name: str
    data: bytes


def fleet(days: float) -> list[Mission]:
    """Three gliders; two of them catch a remora."""
    return [
        remora(days, onset=days / 2),
        healthy(days),
        remora(days, onset=days / 3, seed=9, glider="carol"),
    ]


def coming(missions: list[Mission], chance: random.Random) -> list[Sent]:
    """The files of a fleet, nearly in order; a third are first seen cut short, a quarter come twice."""
    files: list[tuple[float, Sent]] = []
    for mission in missions:
        glider = mission.scenario.glider
        both = zip(arrivals(mission), arrivals(mission, FileForm(Names.SHORT)), strict=True)
        for number, (long, short) in enumerate(both):
            when = number + chance.uniform(0.0, 4.0)
            files.append((when, Sent(glider, long.name, long.data)))
            if number % 3 == 0:
                files.append((when - 1.0, Sent(glider, short.name, short.data[: len(short.data) // 2])))
            if number % 4 == 0:
                files.append((when + 1.0, Sent(glider, short.name, short.data)))
    return [file for _, file in sorted(files, key=lambda pair: pair[0])]


@dataclass(slots=True)
class Tally:
    """What was done and seen; ``at`` are the times of kills, in ``held`` no mail could be marked."""

    kills: Counter[str] = field(default_factory=Counter)
    at: list[float] = field(default_factory=list)
    held: list[tuple[float, float]] = field(default_factory=list)
    copies: int = 0
    broken: list[str] = field(default_factory=list)
    files: int = 0
    doubles: int = 0
    alerts: int = 0
    refused: int = 0
    dives: int = 0
    incidents: int = 0


class Chaos:
    """One live feed with kills; every moment and place of them follows from the seed."""

    def __init__(
        self, site: Site, missions: list[Mission], seed: int, program: Sequence[object] = (GLIDERWATCH,)
    ) -> None:
        self.site, self.chance, self.tally = site, random.Random(seed), Tally()
        self._files: Iterator[Sent] = iter(files := coming(missions, self.chance))
        self._last, self._copies, self.total = files[0], 0, len(files)
        self.sizes: dict[str, int] = {}
        self.daemon = Daemon(site, program)

    def kill(self, times: int) -> None:
        """Let it live and die so many times."""
        for number in range(times):
            self._life(number % 2 == 0)
            self.copy()

    def finish(self) -> None:
        """Let the rest come, and a last daemon do its work to the end."""
        while self.put():
            pass
        self.daemon.env = {}
        self.daemon.start().ready()
        until(self.is_settled, "all files judged", 600.0)
        until(lambda: self.site.undelivered() == 0, "all delivered")
        assert self.daemon.stop() == 0

    def _life(self, at_commit: bool) -> None:
        when, number = self.chance.choice(["before", "after"]), self.chance.randint(1, 6)
        self.daemon.env = hooked(CHAOS_KILL=f"{when}:{number}") if at_commit else {}
        self.daemon.start()
        end = (DEADLINE if at_commit else self._moment()) + time.monotonic()
        while self.daemon.alive() and time.monotonic() < end:
            path = self._put_any()  # mostly one at a time, so that each has its own say
            wait = time.monotonic() + (2.0 if self.chance.random() < 0.8 else 0.05)
            while self.daemon.alive() and time.monotonic() < min(wait, end) and not self._is_known(path):
                time.sleep(0.02)
        died = not self.daemon.alive()
        self.daemon.kill()
        self.tally.at.append(time.monotonic())
        self.tally.kills[f"{when} commit {number}" if at_commit and died else "at a random moment"] += 1

    def _moment(self) -> float:
        """How long a daemon lives that is killed at random: one in six dies while it starts."""
        if self.chance.random() < 1 / 6:
            return self.chance.uniform(0.0, 1.5)
        self.daemon.ready()
        return self.chance.uniform(0.0, 2.0)

    def put(self) -> Path | None:
        """The next file comes; None: there is none any more."""
        file = next(self._files, None)
        if file is None:
            return None
        self._last = file
        return self._deliver(file)

    def _put_any(self) -> Path:
        path = self.put()
        if path is not None:
            return path
        self._copies += 1  # another copy of what is known: the ledger grows, nothing else may
        return self._deliver(Sent(self._last.glider, f"copy{self._copies}.sbd", self._last.data))

    def _deliver(self, file: Sent) -> Path:
        self.tally.files += 1
        path = self.site.put(file.glider, file.name, file.data)
        self.sizes[str(path)] = len(file.data)
        return path

    def _is_known(self, path: Path) -> bool:
        if not self.site.state.exists() or not self.site.state.stat().st_size:
            return False
        try:
            with closing(Store.reading(self.site.state)) as store, store.guarded():
                file = store.file(str(path))
        except StateError:  # it is being made
            return False
        return file is not None and file.size == self.sizes[str(path)]

    def is_settled(self) -> bool:
        """Whether the last word is said on every file that came."""
        with closing(Store.reading(self.site.state)) as store:
            judged = set(Status) - {Status.WAITING}
            known = {file.path: file.size for file in store.files(*judged)}
        return self.sizes.items() <= known.items()

    def copy(self) -> None:
        """What a power cut would leave at this moment is whole."""
        if not self.site.state.exists() or not self.site.state.stat().st_size:
            return
        folder = self.site.config.with_name("copy")
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for path in self.site.state.parent.glob(self.site.state.name + "*"):
            shutil.copy(path, folder)
        found = damage(folder / self.site.state.name, 60.0)
        with closing(sqlite3.connect(folder / self.site.state.name)) as db:
            found = found or db.execute("PRAGMA integrity_check").fetchone()[0]
        self.tally.copies += 1
        if found != "ok":
            self.tally.broken.append(str(found))


def differences(chaos: Chaos, boxes: Mapping[str, Mailbox]) -> list[str]:
    """In what this differs from one undisturbed replay, and each channel's mails from messages told once."""
    site, tally = chaos.site, chaos.tally
    out = site.config.with_name("out")
    replay = command("run", "-c", site.config, "--replay", site.root, "--out", out, timeout=600.0)
    assert replay.returncode == 0, replay.stderr
    live, undisturbed = results(site.state), results(out / "replay.sqlite")
    tally.dives = sum(len(dives) for dives, _ in live.values())
    tally.incidents = sum(len(incidents) for _, incidents in live.values())
    found = [f"{g}: other results than a replay's" for g in undisturbed if live.get(g) != undisturbed[g]]
    found += [f"{g}: other segments" for g in undisturbed if _extent(site.state, g) != _extent(out, g)]
    found += [f"a copy of the state is broken: {text}" for text in tally.broken]
    for channel, box in boxes.items():
        found += _mails(chaos, channel, box)
    return found


def _extent(state: Path, glider: str) -> tuple[int, int]:
    with closing(Store.reading(state / "replay.sqlite" if state.is_dir() else state)) as store:
        return store.extent(glider)


def _mails(chaos: Chaos, channel: str, box: Mailbox) -> list[str]:
    sql = "SELECT alert, error, incident FROM outbox WHERE channel = ? ORDER BY id"
    with closing(sqlite3.connect(chaos.site.state)) as db:
        rows = {message_id(row[0], SENDER): row for row in db.execute(sql, (channel,))}
    times: dict[str, list[Mail]] = {}
    for mail in list(box.mails):
        times.setdefault(mail.id, []).append(mail)
    chaos.tally.alerts += len(rows)
    chaos.tally.refused += sum(bool(error) for _, error, _ in rows.values())
    chaos.tally.doubles += sum(len(m) - 1 for m in times.values())
    never = [alert for id_, (alert, error, _) in rows.items() if id_ not in times and not error]
    found = [f"{channel}: {alert} never came" for alert in never]
    found += [
        f"{channel}: nobody made the mail {m[0].subject}" for id_, m in times.items() if id_ not in rows
    ]
    found += _disorder(channel, rows, times)
    for same in times.values():
        for first, second in pairwise(same):
            if (first.subject, first.text) != (second.subject, second.text):
                found.append(f"{first.subject} came twice with different texts")
            if not any(_between(first, kill, second, chaos.tally.held) for kill in chaos.tally.at):
                found.append(f"{first.subject} came twice without a kill between its acceptance and its mark")
    return found


def _disorder(channel: str, rows: dict[str, tuple[str, str, str]], times: dict[str, list[Mail]]) -> list[str]:
    """Messages of one incident that came before an older one."""
    last: dict[str, float] = {}
    found = []
    for id_, (alert, _, incident) in rows.items():
        if incident and id_ in times:
            came = times[id_][0].accepted
            if came < last.get(incident, 0.0):
                found.append(f"{channel}: {alert} came before an older one of its incident")
            last[incident] = came
    return found


def _between(first: Mail, kill: float, second: Mail, held: list[tuple[float, float]]) -> bool:
    begun = first.accepted
    for start, end in held:  # one after another
        begun += max(0.0, min(end, kill) - max(start, first.accepted))
    return first.accepted - ON_ITS_WAY <= kill < second.accepted and kill - begun < AFTER_ACCEPTANCE
