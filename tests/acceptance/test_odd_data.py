"""Files that say something odd of a glider that is well: a replay says so, and assesses every dive."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acceptance.support import command, healthy, lines
from clocks import files_with_clock_set
from gliderwatch.model import Array
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.dinkum import Sensor, SensorList
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.telemetry import CADENCE, SCIENCE_CADENCE, SegmentData

HOUR = 3600.0


@dataclass(frozen=True)
class Replayed:
    """What a replay printed, its assessments and the titles of its messages."""

    shown: str
    dives: list[dict[str, Any]]
    titles: list[str]

    @property
    def flags(self) -> set[int | None]:
        return {dive["flag"] for dive in self.dives}

    @property
    def notes(self) -> str:
        return "\n".join(note for dive in self.dives for note in dive["notes"])


def replayed(folder: Path, *arguments: object) -> Replayed:
    out = folder / "out"
    done = command("run", "--replay", folder, "--out", out, *arguments, COLUMNS="200")
    assert done.returncode == 0, done.stdout + done.stderr
    found = lines(out / "assessments.jsonl"), [alert["title"] for alert in lines(out / "alerts.jsonl")]
    return Replayed(done.stdout + done.stderr, *found)


def written(folder: Path, mission: Mission) -> Path:
    """The mission as a dockserver has it."""
    write_mission(folder / "gliders", folder / "cache", mission)
    return folder


def changed(mission: Mission, change: Callable[[str, Array], Array]) -> Mission:
    """The mission with other values of its sensors, by their names."""

    def of(segment: SegmentData) -> SegmentData:
        columns = zip(segment.sensors.columns, segment.values.T, strict=True)
        return replace(segment, values=np.array([change(s.name, v) for s, v in columns]).T)

    return replace(mission, segments=tuple(map(of, mission.segments)))


def renamed(mission: Mission, old: str, new: Sensor) -> Mission:
    """The mission with another name and unit of one sensor."""

    def of(segment: SegmentData) -> SegmentData:
        sensors = tuple(new if s.name == old else s for s in segment.sensors.sensors)
        sent = (segment.sensors.sent - {old}) | ({new.name} if old in segment.sensors.sent else set())
        return replace(segment, sensors=SensorList(sensors, frozenset(sent)))

    return replace(mission, segments=tuple(map(of, mission.segments)))


# --------------------------------------------------------------------------- longitude


def test_a_simulated_glider_crosses_the_antimeridian(tmp_path: Path) -> None:
    scenario = tmp_path / "fiji.yml"
    places = {"place": {"lat": -17.5, "lon": 179.94}, "waypoints": [{"lat": -17.4, "lon": -179.5}]}
    scenario.write_text(json.dumps({"seed": 3, "days": 0.8} | places), encoding="utf-8")
    sea = tmp_path / "sea"
    assert command("simulate", sea, "--scenario", scenario).returncode == 0
    found = replayed(sea)
    east = [dive["lon"] for dive in found.dives]
    assert min(east) < -179.9 and max(east) > 179.9, "both sides of it"
    assert (found.flags, found.titles, found.notes) == ({0}, [], "")
    assert len(found.dives) == len(list(sea.rglob("*.sbd"))) - 1


def eastward(name: str, values: Array) -> Array:
    """Longitudes of 0 to 360 degrees, as degrees and minutes."""
    if not name.endswith("_lon"):
        return values
    degrees = np.trunc(values / 100) + np.fmod(values, 100) / 60
    degrees = np.where(degrees < 0, degrees + 360, degrees)
    return np.floor(degrees) * 100 + np.fmod(degrees, 1) * 60


def test_longitudes_of_180_to_360_degrees_are_those_of_the_west(tmp_path: Path) -> None:
    mission = healthy(0.8)
    found = replayed(written(tmp_path, changed(mission, eastward)))
    assert len(found.dives) == len(mission.truth) and found.flags == {0} and found.titles == []
    assert {round(dive["lon"]) for dive in found.dives} == {-84}
    assert "beyond 180 degrees brought back to -180 to 180" in found.notes


# --------------------------------------------------------------------------- names of transfers


def test_what_a_transfer_left_behind_is_never_data(tmp_path: Path) -> None:
    mission = healthy(0.3)
    folder = written(tmp_path, mission) / "gliders" / "angus" / "from-glider"
    name, *_ = sorted(path.name for path in folder.iterdir())
    for left in (f".{name}", f".{name}.Xa3f9", f"{name}.filepart", f"{name}.tmp", f"{name}~", "92.tmp.sbd"):
        (folder / left).write_bytes((folder / name).read_bytes()[:300])
    (folder / "~00920001.sbd").write_bytes(b"")
    assert f"files: {len(mission.segments)} taken\n" in replayed(tmp_path).shown


# --------------------------------------------------------------------------- depth


def deepest(found: Replayed) -> list[float]:
    return [dive["evidence"]["depth_max"] for dive in found.dives]


@pytest.mark.parametrize("offset", [3.5, 6.0])
def test_a_pressure_that_was_not_zeroed_makes_no_dives_of_drift(tmp_path: Path, offset: float) -> None:
    mission = healthy(0.8)
    found = replayed(written(tmp_path, changed(mission, lambda n, v: v + offset * (n == "m_depth"))))
    assert len(found.dives) == len(mission.truth) and found.flags == {0} and found.titles == []
    assert f"depth is {offset:.1f} m at the surface: taken off" in found.notes


def test_pressure_stands_in_for_a_depth_that_is_not_sent(tmp_path: Path) -> None:
    mission = healthy(0.8)
    as_pressure = changed(mission, lambda name, v: v * 1025 * 9.80665 / 1e5 if name == "m_depth" else v)
    as_pressure = renamed(as_pressure, "m_depth", Sensor("m_pressure", "bar", 4))
    usual = replayed(written(tmp_path / "usual", mission))
    found = replayed(written(tmp_path / "pressure", as_pressure))
    assert found.flags == {0} and len(found.dives) == len(mission.truth)
    assert deepest(found) == pytest.approx(deepest(usual), rel=0.02)


def test_the_pressure_of_the_science_file_stands_in_after_it(tmp_path: Path) -> None:
    mission = simulate(
        Scenario(
            seed=11,
            glider="angus",
            days=0.8,
            cadence={name: t for name, t in CADENCE.items() if name != "m_depth"},
            science=SCIENCE_CADENCE,
        )
    )
    found = replayed(written(tmp_path, mission))
    assert found.flags == {0} and len(found.dives) == len(mission.truth)
    assert deepest(found) == pytest.approx([60.0] * len(found.dives), abs=5.0)


# --------------------------------------------------------------------------- encoding


@pytest.mark.parametrize("version", [4, 6])
def test_another_encoding_is_named_with_the_software_it_belongs_to(tmp_path: Path, version: int) -> None:
    folder = written(tmp_path, healthy(0.3)) / "gliders" / "angus" / "from-glider"
    path, *_ = sorted(folder.iterdir())
    path.write_bytes(path.read_bytes().replace(b"encoding_ver:    5", b"encoding_ver:    %d" % version))
    shown = " ".join(replayed(tmp_path).shown.split())
    assert f"encoding version {version}" in shown and "software" in shown


# --------------------------------------------------------------------------- clock


@pytest.mark.parametrize("hours", [-5, -2, 5])
def test_a_clock_that_is_set_by_hours_is_named_and_costs_no_flag(tmp_path: Path, hours: int) -> None:
    flown = simulate(Scenario(seed=11, glider="angus", days=1.3, communications=(300.0, 600.0)))
    mission = files_with_clock_set(flown, len(flown.segments) // 2, hours * HOUR)
    found = replayed(written(tmp_path, mission))
    assert len(found.dives) == len(mission.truth) and found.flags == {0}
    said = rf"clock was {'set forward by ' if hours > 0 else ''}{abs(hours)}(\.\d)? h"
    assert re.search(said, found.notes), found.notes
    assert hours > 0 or found.titles == [f"angus CLOCK fell back by {-hours} h"] * (hours < -3)
