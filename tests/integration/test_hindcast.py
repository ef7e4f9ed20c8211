"""Missions that are over, judged again: by files as sent and full ones, with a report."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import fsspec
import netCDF4
import numpy as np
import pyarrow.parquet as pq
import pytest

from gliderwatch.archive import missions, report, summary
from gliderwatch.archive.difference import Found, delays
from gliderwatch.archive.hindcast import Hindcast
from gliderwatch.archive.missions import Mission
from gliderwatch.archive.onset import Onset
from gliderwatch.errors import GliderwatchError
from gliderwatch.simulate.delivery import write_full_rate, write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Scenario

DAY = 86400.0


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a mission of a day and a half with both kinds of files, slowed down on the first day."""
    folder = tmp_path_factory.mktemp("archive") / "sim-2024"
    scenario = Scenario(seed=3, days=1.4, interval=2 * 3600.0, full_rate=True)
    faults = (Fault(FaultKind.REMORA, scenario.start + 0.8 * DAY, 8.0, 0.0),)
    mission = simulate(replace(scenario, faults=faults))
    write_mission(folder / "sent", folder / "cache", mission)
    write_full_rate(folder / "recovered", mission)
    true = [(dive.t_dive, dive.t_surface, dive.speed) for dive in mission.truth]
    (folder / "truth.json").write_text(json.dumps(true))
    return folder


@pytest.fixture(scope="module")
def made(place: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Mission, Hindcast]:
    """Its report."""
    (mission,) = missions.find([str(place)])
    out = tmp_path_factory.mktemp("reports")
    return out / mission.name, mission, report.make_in(out, "joint", None, mission)


def test_both_kinds_of_files_are_judged_and_compared(made: tuple[Path, Mission, Hindcast]) -> None:
    _, mission, found = made
    assert (mission.name, mission.glider, mission.full, mission.online) == ("sim-2024", "sim", True, True)
    assert found.online is not None
    assert found.full is not None
    assert found.difference is not None
    assert found.difference.dives >= found.online.dives - 2 > 10
    assert found.difference.speed is not None
    assert found.difference.speed < 0.03
    assert found.delayed is not None
    assert found.near_real_time is not None
    assert found.delayed <= found.near_real_time


def test_the_report_is_a_page_a_paper_and_numbers(made: tuple[Path, Mission, Hindcast]) -> None:
    out, _, found = made
    page = (out / report.PAGE).read_text()
    assert "Speed" in page
    assert "Delayed mode, east" in page
    assert "http" not in page.replace("http-equiv", "").replace("http://www.w3.org/", "")
    assert (out / report.PAPER).read_bytes().startswith(b"%PDF")
    with netCDF4.Dataset(out / report.NUMBERS) as data:
        speed = data["speed"]
        assert found.full is not None
        assert len(speed["through_water"]) == found.full.dives
        assert speed["through_water"].units == "m/s"
        assert np.isfinite(data["delayed_mode_east"]["current"][:]).all()
        way = data["track"]
        assert len(way["surfacing_lat"]) > 10
        t, lat = way["delayed_time"][:], way["delayed_lat"][:]
        ends = np.interp(way["surfacing_time"][1:], t, lat)
        assert np.abs(ends - way["surfacing_lat"][1:]).max() * 111e3 < 50.0
        assert np.ma.median(data["error_of_the_track"]["of_the_dive"][:]) < 150.0


def test_the_speed_in_delayed_mode_is_the_true_one(place: Path, made: tuple[Path, Mission, Hindcast]) -> None:
    out, _, _ = made
    true = json.loads((place / "truth.json").read_text())
    with netCDF4.Dataset(out / report.NUMBERS) as data:
        t, speed = (data["delayed_mode_speed"][name][:] for name in ("delayed_time", "delayed"))
    dives = [min(true, key=lambda dive: abs((dive[0] + dive[1]) / 2 - at)) for at in t]
    off = np.abs(speed - [dive[2] for dive in dives])
    assert np.median(off[:7]) < 0.01
    assert np.median(off[9:]) < 0.03  # with the remora


def test_what_was_measured_around_each_flag_is_shown(
    place: Path, made: tuple[Path, Mission, Hindcast]
) -> None:
    out, _, found = made
    assert found.full is not None
    since = min(one.since for one in found.full.incidents)
    began = json.loads((place / "truth.json").read_text())[0][0] + 0.8 * DAY
    (one,) = {i.onset for i in found.full.incidents if i.since == since}
    assert one is not None
    assert abs(one.t - began) < 900.0
    with netCDF4.Dataset(out / report.NUMBERS) as data:
        around = {name: data[name] for name in data.groups if "_around_" in name}
        assert {name.partition("_")[0] for name in around} == {"roll", "pitch", "heading", "ballast", "depth"}
        for group in around.values():
            t = group["measured_time"][:]
            assert since - 86400.0 <= t.min() < since < t.max()
            assert len(t) > 1000


def test_what_is_done_is_not_done_again(made: tuple[Path, Mission, Hindcast], monkeypatch) -> None:
    out, mission, found = made

    def never(*_: object) -> None:
        raise AssertionError("judged again")

    monkeypatch.setattr(report.hindcast, "replays", never)
    assert report.make_in(out.parent, "joint", None, mission) == found
    with pytest.raises(AssertionError, match="judged again"):
        report.make_in(out.parent, "adaptive", None, mission)


def test_the_papers_law_shows_its_error_and_its_basis(place: Path, tmp_path: Path) -> None:
    (mission,) = missions.find([str(place / "sent")])
    found = report.make_in(tmp_path, "adaptive:franklin", None, mission)
    assert mission.full is False
    assert found.estimator == "adaptive:franklin"
    with netCDF4.Dataset(tmp_path / mission.name / report.NUMBERS) as data:
        assert len(data["track"]["basis_function_lat"]) >= 1
        clle, speed, dives = data["clle"], data["speed_along_the_track"], data["speed"]
        assert len(clle["east_time"]) == len(data["track"]["learnt_lat"]) > 2 * len(dives["through_water"])
        assert np.hypot(clle["east"][:], clle["north"][:]).max() < 500.0
        # Between surfacings too; at the end of each dive it is what was assessed, but for the moment.
        ends = np.interp(dives["through_water_time"][:], speed["learnt_time"][:], speed["learnt"][:])
        assert np.abs(ends - dives["through_water"][:]).max() < 1e-3


def test_an_archive_may_lie_in_an_object_store(place: Path) -> None:
    store = fsspec.filesystem("memory")
    store.put(f"{place}/sent/", "/archive/sim/", recursive=True)
    store.put(f"{place}/cache/", "/archive/sim/cache/", recursive=True)
    (mission,) = missions.find(["memory://archive/sim"])
    assert (mission.glider, mission.online, mission.full) == ("sim", True, False)
    with missions.local(mission.place) as folder:
        assert len(list(folder.rglob("*.sbd"))) == len(list((place / "sent").rglob("*.sbd")))


def test_folders_that_hold_no_mission_are_named(tmp_path: Path) -> None:
    with pytest.raises(GliderwatchError, match="holds no flight data"):
        missions.find([str(tmp_path)])
    with pytest.raises(GliderwatchError, match="is not a folder"):
        missions.find([str(tmp_path / "none")])
    with pytest.raises(GliderwatchError, match="there is no estimator"):
        report.make_in(tmp_path, "best", None, Mission("x", str(tmp_path), "sim", False, True))


def test_delays_are_of_the_same_incident() -> None:
    full = [
        Found("anomaly", 0.0, 3600.0, 9e4, onset=Onset(600.0, 500.0, 700.0, ())),
        Found("anomaly", 20 * DAY, 20.1 * DAY, None),
        Found("false_alarm", 0, 1, 2),
    ]
    online = [Found("anomaly", 3600.0, 10800.0, None, on_shore=11400.0)]
    first, second, third = delays(full, online)
    assert (first.sent, first.later, first.after) == (online[0], 2.0, 3.0)
    # What was open for weeks tells nothing of what begins now: no "480 hours earlier".
    assert (second.sent, second.later, second.already) == (None, None, 3600.0)
    assert (third.sent, third.after, third.already) == (None, None, None)


def test_of_two_incidents_each_has_its_own_delay() -> None:
    full = [Found("anomaly", 0.0, 3600.0, DAY), Found("anomaly", 1.2 * DAY, 1.3 * DAY, None)]
    online = [Found("anomaly", 0.3 * DAY, 0.4 * DAY, DAY), Found("anomaly", 1.3 * DAY, 1.5 * DAY, None)]
    assert [one.sent for one in delays(full, online)] == online


def test_the_summary_is_a_table_and_a_page(made: tuple[Path, Mission, Hindcast], tmp_path: Path) -> None:
    summary.write(tmp_path, [made[2]])
    table = pq.read_table(tmp_path / summary.TABLE).to_pylist()
    assert [row["files"] for row in table] == ["as sent", "full"]
    assert table[0]["dives"] == table[0]["judged"] + made[2].online.flags.get("none", 0)
    assert [row["with_step"] for row in table] == [None, len(made[2].full.incidents)]
    assert all(0.0 < row["seen_after"] < 12.0 for row in table)
    assert table[1]["depth"] > 20.0
    page = (tmp_path / summary.PAGE).read_text()
    assert "sim-2024/report.html" in page
    assert "By files as sent, 1 mission, 0.0" in page
