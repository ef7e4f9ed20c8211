"""Files come in any order, the daemon is killed again and again: nothing is lost, nothing is told twice."""

from __future__ import annotations

import random
import shutil
import time
from collections.abc import Callable
from contextlib import closing
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import Any

import pytest

from acceptance.chaos import Chaos, Sent, differences, fleet
from acceptance.support import (
    GLIDERWATCH,
    TRACEBACK,
    Daemon,
    Mailbox,
    Site,
    command,
    mail_server,
    remora,
    results,
    until,
)
from gliderwatch.simulate.calls import CallRates, call_logs
from gliderwatch.simulate.delivery import FileForm, Names, arrivals
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import FixIn, Mission, Scenario
from gliderwatch.slocum.header import read_header
from gliderwatch.store.state_file import Status, Store

KILLS = 5
# Here the service is the installed program, from the start of Python on: one that is forked ready to run is
# killed at other moments of its start.


def simulated() -> list[Sent]:
    """A mission with an incident; every file under both of its names, and some first cut short."""
    mission = remora(3.0)
    files = []
    for number, (long, short) in enumerate(
        zip(arrivals(mission), arrivals(mission, FileForm(Names.SHORT)), strict=True)
    ):
        files.append(Sent("bruce", long.name, long.data))
        if number % 3 == 0:
            files.append(Sent("bruce", short.name, short.data[: len(short.data) // 2]))
        if number % 4 == 0:
            files.append(Sent("bruce", short.name, short.data))
    return files


def real(folder: Path) -> list[Sent]:
    """A real mission: its files under the names they have, and a third of them under their long names too."""
    files = []
    for number, path in enumerate(sorted(folder.glob("*.sbd"))):
        files.append(Sent("electa", path.name, path.read_bytes()))
        if number % 3 == 0:
            files.append(Sent("electa", f"{read_header(path).id.name}.sbd", path.read_bytes()))
    return files


def feed(site: Site, daemon: Daemon, files: list[Sent], seed: int) -> list[float]:
    """Let files come in shuffled order, with a kill and a new start at some of them; when it was killed."""
    chance = random.Random(seed)
    chance.shuffle(files)
    fatal = set(chance.sample(range(len(files)), KILLS))
    kills = []
    for number, file in enumerate(files):
        site.put(file.glider, file.name, file.data)
        time.sleep(chance.uniform(0.0, 0.1))
        if number in fatal:
            if chance.random() < 0.8:  # else it is killed while it starts
                daemon.ready()
            time.sleep(chance.uniform(0.0, 0.3))
            daemon.kill()
            kills.append(time.monotonic())
            daemon.start()
    return kills


def settled(site: Site, files: list[Sent]) -> bool:
    """Whether the ledger knows all files as they lie there now."""
    ledger = site.files()
    sizes = {file.name: (site.folder(file.glider) / file.name).stat().st_size for file in files}
    return all(name in ledger and ledger[name].size == size for name, size in sizes.items())


def check_mails(box: Mailbox, kills: list[float], site: Site) -> None:
    """Every message arrived; none twice, unless a kill fell between its acceptance and the note of it."""
    until(lambda: site.undelivered() == 0, "all delivered")
    twice = [id for id, n in box.times().items() if n > 1]
    assert len(twice) <= len(kills)
    for id in twice:
        times = [mail.accepted for mail in box.mails if mail.id == id]
        for first, second in pairwise(times):
            assert any(first <= kill < second and kill - first < 1.0 for kill in kills), (id, times, kills)


def check(site: Site, box: Mailbox, files: list[Sent], seed: int) -> None:
    """Feed and kill, then compare with one undisturbed replay of the same files."""
    with Daemon(site, [GLIDERWATCH]) as daemon:
        kills = feed(site, daemon, files, seed)
        until(lambda: settled(site, files), "all files judged")
        check_mails(box, kills, site)
        assert daemon.stop() == 0
    assert TRACEBACK not in daemon.text()
    assert len(kills) == KILLS
    out = site.config.with_name("out")
    replay = command("run", "-c", site.config, "--replay", site.root, "--out", out)
    assert replay.returncode == 0, replay.stderr
    expected = results(out / "replay.sqlite")
    assert sum(len(dives) for dives, _ in expected.values()) > 15
    assert results(site.state) == expected


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_simulated_mission_in_any_order_with_kills_ends_as_a_replay_does(tmp_path: Path, seed: int) -> None:
    site = Site(tmp_path)
    site.caches(remora(3.0))
    with mail_server() as box:
        site.configure("bruce", url=box.url, surfacing=["bruce"])
        check(site, box, simulated(), seed)
        assert any(" SLOW " in mail.subject for mail in box.mails)
    (incidents,) = (found for _, found in results(site.state).values())
    assert [str(incident.kind) for incident in incidents] == ["anomaly"]


@pytest.mark.real
@pytest.mark.slow
def test_a_real_mission_in_any_order_with_kills_ends_as_a_replay_does(
    shared_data: Path, tmp_path: Path
) -> None:
    site = Site(tmp_path)
    shutil.copytree(shared_data / "electa-2022" / "cache", site.cache, dirs_exist_ok=True)
    with mail_server() as box:
        site.configure("electa", url=box.url, surfacing=["electa"])
        check(site, box, real(shared_data / "electa-2022" / "from-glider"), 3)
    statuses = [file.status for file in site.files().values()]
    assert statuses.count(Status.WAITING) in (1, 2)  # no cache; once or twice, as its names come
    assert results(site.state)["electa"][1], "no incident: a test of little"


@pytest.mark.slow
def test_kills_at_commit_points_and_at_random_lose_nothing(tmp_path: Path) -> None:
    """`benchmarks/chaos.py` does the same with hundreds of kills, and all other faults beside them."""
    site, missions = Site(tmp_path), fleet(3.0)
    gliders = [mission.scenario.glider for mission in missions]
    site.caches(*missions)
    with mail_server() as box:
        site.configure(*gliders, url=box.url, surfacing=gliders)
        chaos = Chaos(site, missions, seed=5)
        with chaos.daemon:
            chaos.daemon.kill()
            chaos.kill(12)
            chaos.finish()
        assert differences(chaos, {"mail": box}) == []
    assert TRACEBACK not in chaos.daemon.text()
    assert chaos.tally.kills.total() == 12 and sum("commit" in where for where in chaos.tally.kills) > 2
    assert chaos.tally.dives > 40 and chaos.tally.copies > 8
    assert list(chaos.daemon.scratch.iterdir()) == []


Piece = tuple[Path, bytes]


def pieces(site: Site, mission: Mission, chance: random.Random) -> list[Piece]:
    """The files of a mission in any order, and among them its logs, each of which grows in three pieces."""
    folder, logs = site.folder("cora"), site.folder("cora").with_name("logs")
    logs.mkdir()
    grown: list[list[Piece]] = [[(folder / file.name, file.data)] for file in arrivals(mission)]
    for log in call_logs(mission, CallRates(garbled=0.005, typing=0.1, abort=0.6)):
        data = b"".join(line for _, line in log.lines)
        cuts = [0, *sorted(chance.sample(range(1, len(data)), 2)), len(data)]
        grown.append([(logs / log.name, data[a:b]) for a, b in pairwise(cuts)])
    out = []
    while grown:
        one = chance.choice(grown)
        out.append(one.pop(0))
        grown = [rest for rest in grown if rest]
    return out


def of_calls(state: Path) -> list[tuple[object, ...]]:
    """The calls in a state file, what rules of health found, and of which aborts people were notified."""
    with closing(Store.reading(state)) as store:
        told = [report.what for episode in store.notified("cora").aborts for report in episode.reports]
        calls = store.facts("cora").calls(0.0)
        return [calls, store.health.judged("cora"), sorted(told), store.facts("cora").expected(inf)]


@pytest.mark.slow
def test_logs_that_grow_and_a_kill_in_the_midst_of_them_end_as_a_replay_does(tmp_path: Path) -> None:
    """The files lack the fix at the surface, which the logs have: so their dives hang on both."""
    site, chance = Site(tmp_path), random.Random(3)
    start = float(int(time.time() - 86400))  # an abort of last week is history, not news
    mission = simulate(Scenario(seed=6, glider="cora", days=1.0, start=start, fix_in=FixIn.NEXT))
    site.caches(mission)
    given = pieces(site, mission, chance)
    cut = [k for k, (path, _) in enumerate(given) if any(path == other for other, _ in given[k + 1 :])]
    fatal = chance.sample(cut, 2)  # of these logs more is to come
    with mail_server() as box:
        site.configure("cora", url=box.url)
        with Daemon(site) as daemon:
            for number, (path, data) in enumerate(given):
                with path.open("ab") as file:
                    file.write(data)
                if number in fatal:
                    time.sleep(chance.uniform(0.0, 0.3))
                    daemon.kill()
                    daemon.start()
            sizes = {path.name: path.stat().st_size for path, _ in given}
            until(lambda: {n: f.size for n, f in site.files().items()} == sizes, "all files judged", 180.0)
            until(lambda: site.undelivered() == 0, "all delivered")
            assert daemon.stop() == 0
    assert TRACEBACK not in daemon.text()
    aborts = {mail.id for mail in box.mails if mail.subject == "cora ABORTED: leak"}
    assert len(aborts) == 1
    out = tmp_path / "out"
    replay = command("run", "-c", site.config, "--replay", site.root, "--out", out)
    assert replay.returncode == 0, replay.stderr
    assert sum(len(dives) for dives, _ in results(site.state).values()) > 5
    assert results(site.state) == results(out / "replay.sqlite")
    assert of_calls(site.state) == of_calls(out / "replay.sqlite")


class Cutting(Mailbox):
    """A mail server that does something at the moment it takes the first mail, before it says so."""

    moment: Callable[[], None] | None

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:  # noqa: N802 (aiosmtpd)
        """Take one mail, or cut the power."""
        answer = await Mailbox.handle_DATA(self, server, session, envelope)
        if self.moment is not None:
            self.moment()
            self.moment = None
        return answer


def test_only_a_kill_between_acceptance_and_its_note_sends_twice_under_one_id(tmp_path: Path) -> None:
    site = Site(tmp_path)
    mission = remora(0.5)
    site.caches(mission)
    box = Cutting()
    daemon = Daemon(site)
    box.moment = daemon.kill
    with mail_server(box):
        site.configure("bruce", url=box.url, surfacing=["bruce"])
        with daemon:
            for file in arrivals(mission):
                site.put("bruce", file.name, file.data)
            until(lambda: not daemon.alive(), "killed")
            assert site.undelivered() == 1
            daemon.start()
            until(lambda: site.undelivered() == 0, "delivered")
            daemon.kill()
            daemon.start()
            until(lambda: len(daemon.log("watching")) == 3, "watching")
            assert daemon.stop() == 0
    assert list(box.times().values()) == [2]
