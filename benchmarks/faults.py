"""The faults that a chaos run injects: each begins, lasts for some seconds and ends."""

from __future__ import annotations

import os
import signal
import sqlite3
from collections.abc import Callable
from contextlib import closing, suppress
from functools import partial
from pathlib import Path

from common import tree
from storm import DECODE_SECONDS, Kind, Lane, SparedError, Storm

from acceptance.chaos import flood
from gliderwatch.store.maintenance import asides

_PAGE = 4096
_DAY = 86400.0
_SALVO = 10
_DAMAGE = 0.35
"""The part of the time after which the state is damaged no more: what is made anew hides what was lost."""


class Faults:
    """All that is done to the daemon, its folders and its clock."""

    def __init__(self, storm: Storm) -> None:
        self.storm, self.site, self.between = storm, storm.site, storm.chance.uniform

    # ------------------------------------------------------------------- the daemon

    def kills(self) -> Lane:
        """Salvos of kills, and pauses in which files are taken and messages sent."""
        chance = self.storm.chance
        while True:
            for _ in range(_SALVO):
                self.storm.strike()
                if chance.random() < 0.5:
                    self.storm.kill_at_commit(chance.choice(["before", "after"]), chance.randint(1, 8))
                    for _ in range(20):
                        yield 0.5
                        if not self.storm.is_fatal():
                            break
                yield self.between(0.0, 4.0) if chance.random() < 0.8 else self.between(0.0, 0.6)
                if self.storm.is_calm():
                    if self.storm.is_fatal():
                        self.storm.strike()
                    return
            if self.storm.terminate(down=self.between(0.0, 4.0)):
                self.storm.done["SIGTERM, started again"] += 1
            yield self.between(15.0, 45.0)

    def signals(self) -> list[Kind]:
        """What is done to a daemon that runs."""
        return [
            ("SIGHUP", self._reload),
            ("SIGHUP with a broken configuration, mended", self._broken),
            ("SIGSTOP, SIGCONT", self._stop),
            ("decoder worker killed", partial(self._worker, signal.SIGKILL)),
            ("decoder worker stopped, let go on", partial(self._worker, signal.SIGSTOP)),
            ("queue of inotify overflowed", self._overflow),
            ("thread of the observer dead", self._observer),
            ("slow share, 0.3 s an opening", self._slow),
        ]

    def _ready(self) -> Lane:
        while not self.storm.is_ready():
            yield 0.2

    def _reload(self) -> Lane:
        yield from self._ready()
        self.storm.signal(signal.SIGHUP)

    def _broken(self) -> Lane:
        yield from self._ready()
        right = self.site.config.read_text(encoding="utf-8")
        with self.storm.excused():
            self.site.config.write_text(right.replace('"dockserver"', '"dockserv"'), encoding="utf-8")
            try:
                self.storm.signal(signal.SIGHUP)
                yield self.between(1.0, 4.0)
            finally:
                self.site.config.write_text(right, encoding="utf-8")
        yield from self._ready()
        self.storm.signal(signal.SIGHUP)

    def _stop(self) -> Lane:
        yield from self._ready()
        with self.storm.held(), self.storm.stopped():
            yield self.between(2.0, 10.0)

    def _worker(self, number: int) -> Lane:
        """One that decodes or waits: three files come just before."""
        yield from self._ready()
        for _ in range(3):
            self.storm.put_if_there()
        yield self.between(0.0, 0.05)
        workers = [pid for pid in tree(self.storm.daemon.pid)[1:] if _is_worker(pid)]
        if not workers:
            raise SparedError
        pid = self.storm.chance.choice(workers)
        with suppress(ProcessLookupError):
            os.kill(pid, number)
        try:
            yield self.between(1.0, 0.6 * DECODE_SECONDS)
        finally:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)

    def _overflow(self) -> Lane:
        yield from self._ready()
        with self.storm.held(), self.storm.stopped():
            if not self.storm.is_away:
                flood(self.site.folder(self.storm.gliders[0]))
                for _ in range(3):
                    self.storm.put_if_there()
            yield 0.5

    def _observer(self) -> Lane:
        yield from self._switch("CHAOS_OBSERVER", "die", 12.0)

    def _slow(self) -> Lane:
        yield from self._switch("CHAOS_SLOW", "slow", self.between(4.0, 12.0))

    def _switch(self, name: str, value: str, seconds: float) -> Lane:
        path = self.storm.switches[name]
        path.write_text(value, encoding="utf-8")
        try:
            yield seconds
        finally:
            path.unlink(missing_ok=True)

    def clocks(self) -> list[Kind]:
        """Jumps of the clock of the host, there and back."""
        jumps = {"2 days on": 2 * _DAY, "400 days back": -400 * _DAY, "30 days on": 30 * _DAY}
        return [(f"clock {name}, and right again", partial(self._jump, s)) for name, s in jumps.items()]

    def _jump(self, seconds: float) -> Lane:
        yield from self._switch("CHAOS_CLOCK", str(seconds), self.between(2.0, 12.0))

    # ------------------------------------------------------------------- the state

    def states(self) -> list[Kind]:
        """What is done to the state file and its disk."""
        full = "disk full" if self.storm.disk.is_real else "disk full (played by a limit on files)"
        often = [(full, self._full), ("state read-only", self._readonly)]
        return [
            *often,
            *often,
            ("state damaged: a page", partial(self._damaged, _page)),
            ("state damaged: a record", partial(self._damaged, _record)),
        ]

    def _full(self) -> Lane:
        disk = self.storm.disk
        with self.storm.excused(), self.storm.held():
            disk.fill(self.storm.daemon)
            try:
                yield self.between(3.0, 10.0)
            finally:
                disk.free(self.storm.daemon)

    def _readonly(self) -> Lane:
        with self.storm.excused(), self.storm.held():
            yield from self._switch("CHAOS_STATE", "readonly", self.between(3.0, 10.0))

    def _damaged(self, harm: Callable[[Path], None]) -> Lane:
        """While the daemon is down; what was set aside before and is told is deleted."""
        if self.storm.part() > _DAMAGE:
            raise SparedError
        yield from self._ready()
        with self.storm.excused():
            self.storm.strike("to damage its state")
            with suppress(sqlite3.Error), closing(sqlite3.connect(self.site.state)) as db:
                db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
                told = {row[0] for row in db.execute("SELECT id FROM alerts WHERE id LIKE 'state/%'")}
            for aside in asides(self.site.state):
                if f"state/{aside.name}" in told:
                    for path in aside.parent.glob(f"{aside.name}*"):
                        path.unlink()
            self.storm.is_harmed = True
            harm(self.site.state)
            yield 5.0

    def copies(self) -> list[Kind]:
        """Power cuts: the state of one moment is copied, opened and checked."""
        return [("power cut: copy of the state checked", self._copy)]

    def _copy(self) -> Lane:
        self.storm.is_harmed = self.storm.is_harmed and not self.storm.is_ready()
        if self.storm.is_harmed or not self.storm.daemon.alive():
            raise SparedError
        with self.storm.stopped():
            self.storm.copy()
        yield 0.0


def _page(state: Path) -> None:
    """Another content for a page in which a segment begins: messages and what was said can be saved."""
    with closing(sqlite3.connect(state)) as db:
        record = db.execute("SELECT segment FROM segments ORDER BY random() LIMIT 1").fetchone()
    if record is not None:
        page = state.read_bytes().index(record[0][:64]) // _PAGE
        with state.open("r+b") as file:
            file.seek(page * _PAGE)
            file.write(b"\xa5" * _PAGE)


def _record(state: Path) -> None:
    """Checkpoints that no check of SQLite finds fault with: they are found at work."""
    with closing(sqlite3.connect(state)) as db:
        db.execute("UPDATE segments SET checkpoint = x'00112233' WHERE checkpoint IS NOT NULL")
        db.commit()


def _is_worker(pid: int) -> bool:
    with suppress(OSError):
        return b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False
