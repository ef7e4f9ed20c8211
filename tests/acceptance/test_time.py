"""Clocks that are wrong, jump, or change between summer and winter: the results are the same."""

from __future__ import annotations

import os
import time
from contextlib import closing
from pathlib import Path

import pytest

from acceptance.angus import FILES, put, taken
from acceptance.chaos import hooked
from acceptance.support import TRACEBACK, Daemon, Mailbox, Site, command, lines, mail_server, results, until
from gliderwatch.delivery.dispatcher import HEARTBEAT
from gliderwatch.simulate.delivery import arrivals
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Mission, Rates, Scenario
from gliderwatch.store.state_file import Status, Store

DAY = 86400.0
LEAP = 1709121600.0 + 43200.0  # 2024-02-28T12:00Z
WINTER = 1729944000.0  # 2024-10-26T12:00Z: in Berlin an hour comes twice on the next night
YEAR_1970 = 10 * DAY
BERLIN = "CET-1CEST,M3.5.0,M10.5.0/3"


def mission(start: float, days: float = 2.0, skew: float = 0.0) -> Mission:
    """One with a remora from its first half on, by a glider whose clock is `skew` (s) ahead."""
    fault = Fault(FaultKind.REMORA, start + 0.4 * days * DAY, 8.0)
    rates = Rates(clock_skew=skew)
    return simulate(Scenario(seed=4, glider="bruce", days=days, start=start, faults=(fault,), rates=rates))


def site_of(folder: Path, flown: Mission) -> Site:
    """A dockserver with all files of a mission."""
    site = Site(folder)
    site.caches(flown)
    site.configure("bruce")
    put(site, *arrivals(flown), glider="bruce")
    return site


def replayed(site: Site, name: str, **env: str) -> tuple[list[dict[str, object]], list[dict[str, object]]]:
    """Assessments and alerts of a replay."""
    out = site.config.with_name(name)
    done = command("run", "-c", site.config, "--replay", site.root, "--out", out, **env)
    assert done.returncode == 0, done.stderr
    return lines(out / "assessments.jsonl"), lines(out / "alerts.jsonl")


@pytest.mark.parametrize(
    "start",
    [
        pytest.param(WINTER, id="end of summer time"),
        pytest.param(LEAP, id="leap day", marks=pytest.mark.slow),
    ],
)
def test_the_time_zone_of_the_host_does_not_matter(tmp_path: Path, start: float) -> None:
    site = site_of(tmp_path, mission(start))
    plain = replayed(site, "utc", TZ="UTC")
    assert replayed(site, "berlin", TZ=BERLIN) == plain
    assert replayed(site, "far", TZ="XXX+11:30") == plain
    dives, alerts = plain
    assert len(dives) > 8 and any(alert["kind"] == "anomaly" for alert in alerts)
    flown = [when for dive in dives for when in (dive["t_dive"], dive["t_surface"])]
    assert flown == sorted(flown)


@pytest.mark.slow
def test_files_of_1970_are_named_and_files_dated_in_the_future_are_taken(tmp_path: Path) -> None:
    """The clock of a glider that was not set: no order can be made of its files, the others go on."""
    flown, lost = mission(LEAP), list(arrivals(mission(YEAR_1970, 0.5)))
    site = Site(tmp_path)
    site.caches(flown)
    with mail_server() as box:
        site.configure("bruce", url=box.url)
        with Daemon(site, TZ=BERLIN) as daemon:
            put(site, *lost, glider="bruce")
            paths = put(site, *arrivals(flown), glider="bruce")
            for path, when in zip(paths, (0.0, 4e9, time.time() + 10 * 365 * DAY), strict=False):
                os.utime(path, (when, when))
            taken(site, *arrivals(flown))
            wanted = [Status.QUARANTINED] * len(lost)
            until(lambda: site.statuses(*(file.name for file in lost)) == wanted, "quarantined")
            until(lambda: any(" SLOW " in mail.subject for mail in box.mails), "told")
            assert daemon.stop() == 0
    assert {site.files()[file.name].reason for file in lost} == {
        "opened in the year 1970: the glider's clock was wrong"
    }
    live = results(site.state)
    replayed(site, "out", TZ="UTC")
    assert live == results(tmp_path / "out" / "replay.sqlite")
    assert TRACEBACK not in daemon.text()


@pytest.mark.slow
def test_a_glider_clock_48_minutes_off_changes_times_only(tmp_path: Path) -> None:
    """The clock and all that it stamps are 48 min ahead: speeds and flags are those of a right one."""
    right, _ = replayed(site_of(tmp_path / "right", mission(LEAP)), "out")
    wrong, _ = replayed(site_of(tmp_path / "wrong", mission(LEAP, skew=2880.0)), "out")
    assert [d["flag"] for d in wrong] == [d["flag"] for d in right]
    speeds = [[d["speed"] for d in dives if d["speed"] is not None] for dives in (wrong, right)]
    assert speeds[0] == pytest.approx(speeds[1], abs=1e-3) and len(speeds[0]) > 8
    assert wrong[0]["t_dive"] != right[0]["t_dive"]


@pytest.mark.slow
def test_a_clock_that_jumps_both_ways_changes_nothing(site: Site) -> None:
    clock = site.config.with_name("clock")
    jumps = [2 * DAY, -400 * DAY, 30 * DAY, 0.0]
    with mail_server() as box:
        site.configure("angus", url=box.url, surfacing=["angus"])
        with Daemon(site, **hooked(CHAOS_CLOCK=clock)) as daemon:
            for number, file in enumerate(FILES):
                put(site, file)
                taken(site, file)
                clock.write_text(str(jumps[number % len(jumps)]), encoding="utf-8")
            until(lambda: site.undelivered() == 0, "all delivered")
            assert daemon.stop() == 0
    with closing(Store.reading(site.state)) as store:
        assert len(box.mails) == len(store.alerts()) == len(box.times()) > 3
    assert not any("OVERDUE" in mail.subject.upper() for mail in box.mails)
    replayed(site, "out")
    assert results(site.state) == results(site.config.with_name("out") / "replay.sqlite")


@pytest.mark.slow
def test_a_message_put_off_before_the_clock_is_set_back_is_not_put_off_for_a_year(site: Site) -> None:
    clock = site.config.with_name("clock")
    clock.write_text(str(365 * DAY), encoding="utf-8")
    with mail_server(Mailbox(refusing=True)) as box:
        site.configure("angus", url=box.url, surfacing=["angus"])
        with Daemon(site, **hooked(CHAOS_CLOCK=clock)) as daemon:
            put(site, FILES[0])
            until(lambda: daemon.log("alert not delivered"), "put off")
            box.refusing = False
            clock.write_text("0", encoding="utf-8")
            until(lambda: box.mails, "delivered", 6 * HEARTBEAT)
            assert daemon.stop() == 0
