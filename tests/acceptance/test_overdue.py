"""A glider that stays away: the service tells it when it is due, once, and that it calls again."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from acceptance.support import Daemon, Mailbox, Site, command, mail_server, until
from gliderwatch.service.replay import Request, replay
from gliderwatch.simulate.delivery import Arrival, arrivals, write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.slocum.decode import decode

HOUR, DAY = 3600.0, 86400.0
GLIDER = "cora"


@dataclass(frozen=True)
class Flight:
    """A mission near the present: what was expected before its last two dives, and when it is back after."""

    mission: Mission
    files: list[Arrival]
    expected: float
    back: float


def fly(folder: Path, end: float) -> Flight:
    """A mission of half a day whose last, short file is opened at the surface at about a time (s)."""
    start = end - 0.5 * DAY
    for _ in range(2):  # the sea moves with time: the second flight starts so that it ends when it is to
        mission = simulate(
            Scenario(seed=5, glider=GLIDER, days=0.5, start=start, communications=(60.0, 60.0))
        )
        paths = write_mission(folder / f"{start:.0f}", folder / "cache", mission)
        store = replay(Request((folder / f"{start:.0f}",), (folder / "cache",))).store
        back = decode(paths[-1], [folder / "cache"]).id.opened_at
        start += end - back
    opened = decode(paths[-3], [folder / "cache"]).id.opened_at
    expected = store.facts(GLIDER).expected(opened)
    assert expected is not None
    return Flight(mission, list(arrivals(mission)), expected.t, back)


def configure(site: Site, box: Mailbox | None = None, **settings: Any) -> None:
    """The configuration with settings of the glider."""
    site.configure(GLIDER, url=box.url if box is not None else None)
    document = json.loads(site.config.read_text(encoding="utf-8"))
    document["gliders"][GLIDER] = settings
    site.config.write_text(json.dumps(document), encoding="utf-8")


def put(site: Site, *files: Arrival) -> None:
    for file in files:
        site.put(GLIDER, file.name, file.data)


def taken(site: Site, n: int) -> None:
    until(lambda: site.state.exists() and site.status()["files"].get("taken", 0) == n, f"{n} files taken")


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path / "site")


def test_it_is_told_when_due_once_and_clears_itself(site: Site, tmp_path: Path) -> None:
    flight = fly(tmp_path, time.time() + 12.0)
    site.caches(flight.mission)
    due = min(time.time() + 8.0, flight.back - 1.0)
    with mail_server() as box:
        configure(site, box, overdue_hours=(due - flight.expected) / HOUR)
        put(site, *flight.files[:-3])
        with Daemon(site) as daemon:
            taken(site, len(flight.files) - 3)
            before = site.status()["gliders"][GLIDER]
            until(lambda: box.mails, "a message")
            assert time.time() >= due
            daemon.kill()
            daemon.start().ready()
            told = box.mails[0]
            assert told.subject.startswith(f"{GLIDER} OVERDUE ")
            assert "Search here: " in told.text and "openstreetmap" in told.text
            until(lambda: site.status()["gliders"][GLIDER]["overdue"], "status tells it")
            assert f"{GLIDER}: OVERDUE since" in command("status", "-c", site.config).stdout
            until(lambda: time.time() > flight.back + 1.0, "its next surfacing but one")
            put(site, flight.files[-1])
            until(lambda: len(box.times()) > 1, "the all-clear")
            assert box.mails[-1].subject.strip().startswith(f"{GLIDER} ALL CLEAR: calls again")
            put(site, flight.files[-2])
            until(lambda: len(box.times()) > 2, "the correction")
            assert box.mails[-1].subject.strip().startswith(f"{GLIDER} CORRECTION: was up in time")
            after = site.status()["gliders"][GLIDER]
    assert before["expected"]["t"] < before["overdue_at"]
    assert not after["overdue"] and after["heard"] > before["overdue_at"]
    assert len(box.times()) == 3


@pytest.mark.slow
def test_files_that_come_at_once_are_told_once_whatever_their_order(site: Site, tmp_path: Path) -> None:
    """The newest comes first: alone it would tell of a call that was late, with the next of one in time."""
    flight = fly(tmp_path, time.time() + 12.0)
    site.caches(flight.mission)
    due = min(time.time() + 8.0, flight.back - 1.0)
    with mail_server() as box:
        configure(site, box, overdue_hours=(due - flight.expected) / HOUR)
        put(site, *flight.files[:-3])
        with Daemon(site) as daemon:
            taken(site, len(flight.files) - 3)
            until(lambda: box.mails, "a message")
            until(lambda: time.time() > flight.back + 1.0, "its next surfacing but one")
            for n, file in enumerate((flight.files[-1], flight.files[-2])):
                put(site, file)
                taken(site, len(flight.files) - 2 + n)
            until(lambda: len(box.times()) > 1, "what became of it")
            assert daemon.stop() == 0
    told = [mail.subject.strip() for mail in box.mails]
    assert len(told) == 2 and told[1].startswith(f"{GLIDER} CORRECTION: was up in time"), told


@pytest.mark.slow
def test_an_archive_a_mute_and_a_recovery_are_quiet(site: Site, tmp_path: Path) -> None:
    """What would be told without them is told in the end."""
    flight = fly(tmp_path, time.time() - 1.0)
    site.caches(flight.mission)
    old = simulate(Scenario(seed=6, glider="dora", days=0.5, start=time.time() - 40 * DAY))
    site.caches(old)
    for file in arrivals(old):
        site.put("dora", file.name, file.data)
    put(site, *flight.files[:-3])
    hours, n = (time.time() - flight.expected) / HOUR - 0.1, len(flight.files) - 3 + len(list(arrivals(old)))
    tomorrow = time.strftime("%Y-%m-%d", time.gmtime(time.time() + 2 * DAY))
    with mail_server() as box, Daemon(site_with(site, box, hours, recovered=True)) as daemon:
        taken(site, n)
        assert f"{GLIDER}: recovered" in command("status", "-c", site.config).stdout
        site_with(site, box, hours, muted_until=tomorrow)
        reload(daemon, 1)
        status = command("status", "-c", site.config).stdout
        assert f"{GLIDER}: muted until {tomorrow} 00:00 UTC" in status
        assert "dora: last heard" in status and "deployment seems over" in status
        assert max(map(len, status.splitlines())) <= 80
        time.sleep(4.0)  # the first tick comes two seconds after the start
        assert box.mails == []
        site_with(site, box, hours)
        reload(daemon, 2)
        until(lambda: box.mails, "what was quiet")
        assert [" ".join(mail.subject.split()[:2]) for mail in box.mails] == [f"{GLIDER} OVERDUE"]


def site_with(site: Site, box: Mailbox, hours: float, **settings: Any) -> Site:
    configure(site, box, overdue_hours=hours, **settings)
    document = json.loads(site.config.read_text(encoding="utf-8"))
    document["gliders"]["dora"] = None
    site.config.write_text(json.dumps(document), encoding="utf-8")
    return site


def reload(daemon: Daemon, times: int) -> None:
    daemon.reload()
    until(lambda: len(daemon.log("configuration read again")) == times, "read again")
