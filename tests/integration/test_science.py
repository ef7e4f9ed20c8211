"""The pressure of the science file stands in for a depth that the flight file of its segment leaves out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dinkum
from gliderwatch.slocum.decode import decode
from gliderwatch.slocum.sensors import depth_of

NO_DEPTH = tuple(sensor for sensor in dinkum.SENSORS if sensor[0] != "m_depth")
SCIENCE = (("sci_m_present_time", 8, "timestamp"), ("sci_water_pressure", 4, "bar"))
NAME = "unit_7-2024-250-1-3"
OTHER = "0abc12f0"


def flight(sensors: tuple[tuple[str, int, str], ...] = NO_DEPTH) -> bytes:
    rows = [{k: v for k, v in row.items() if k in {s[0] for s in sensors}} for row in dinkum.rows()]
    return dinkum.header(NAME, n_held=len(sensors)) + dinkum.cycles(rows, sensors)


def science(name: str = NAME, n: int = 40, sensors: tuple[tuple[str, int, str], ...] = SCIENCE) -> bytes:
    rows = [
        {sensors[0][0]: dinkum.OPENED_AT + 90.0 * i, sensors[1][0]: 0.25 * min(i, n - i)} for i in range(n)
    ]
    head = dinkum.header(name, crc=OTHER, n_held=2, filename_extension="tbd")
    return head + dinkum.cycles(rows, sensors)


def with_own(station: Path, sensor: str, unit: str, first: float) -> bytes:
    """A science file that measures one sensor more, whose value grows by 1 a cycle from the first; its cache
    file is put beside the station's."""
    wanted = (*SCIENCE, (sensor, 4, unit))
    rows = [
        {SCIENCE[0][0]: dinkum.OPENED_AT + 90.0 * i, SCIENCE[1][0]: 1.0, sensor: first + i} for i in range(20)
    ]
    (station.parent / f"{OTHER}.cac").write_bytes(dinkum.sensor_list(wanted, OTHER))
    head = dinkum.header(NAME, crc=OTHER, n_held=3, filename_extension="tbd")
    return head + dinkum.cycles(rows, wanted)


@pytest.fixture
def station(tmp_path: Path) -> Path:
    """A folder with a flight file without depth, and the cache files of it and of its science file."""
    (tmp_path / f"{dinkum.CRC}.cac").write_bytes(dinkum.sensor_list(NO_DEPTH))
    (tmp_path / f"{OTHER}.cac").write_bytes(dinkum.sensor_list(SCIENCE, OTHER))
    (tmp_path / f"{NAME}.sbd").write_bytes(flight())
    return tmp_path / f"{NAME}.sbd"


@pytest.mark.parametrize(("suffix", "packed"), [("tbd", False), ("TBD", False), ("tcd", True), ("TCD", True)])
def test_the_pressure_of_the_science_file_beside_it_gives_the_depth(
    station: Path, suffix: str, packed: bool
) -> None:
    without = decode(station, [station.parent])
    assert "depth" not in without.quantities
    content = science()
    station.with_suffix(f".{suffix}").write_bytes(dinkum.compress(content) if packed else content)
    whole = decode(station, [station.parent])
    t = dinkum.OPENED_AT + 90.0 * np.arange(1, 40)  # the first cycle is of the segment before
    assert whole.get("depth").t.tolist() == t.tolist()
    bar = np.array([0.25 * min(i, 40 - i) for i in range(1, 40)])
    assert whole.get("depth").v == pytest.approx(depth_of(bar), abs=1e-4)
    assert np.array_equal(whole.get("heading").v, without.get("heading").v)
    assert whole.completeness > without.completeness


def test_of_a_science_file_that_grows_the_longer_one_holds_more(station: Path) -> None:
    found = []
    for n in (10, 30, 40):
        station.with_suffix(".tbd").write_bytes(science(n=n))
        found.append(decode(station, [station.parent]).completeness)
    assert found == sorted(found)
    assert len(set(found)) == 3


@pytest.mark.parametrize(
    "content",
    [
        science("unit_7-2024-250-1-4"),
        science()[:200],
        b"",
        flight(),
    ],
    ids=["of another segment", "cut", "empty", "a flight file"],
)
def test_what_is_no_science_file_of_the_segment_changes_nothing(station: Path, content: bytes) -> None:
    without = decode(station, [station.parent])
    station.with_suffix(".tbd").write_bytes(content)
    found = decode(station, [station.parent])
    assert found.completeness == without.completeness
    assert "depth" not in found.quantities


def test_a_science_file_without_pressure_changes_nothing(station: Path) -> None:
    without = decode(station, [station.parent])
    held = (SCIENCE[0], ("sci_water_temp", 4, "degc"))
    (station.parent / f"{OTHER}.cac").write_bytes(dinkum.sensor_list(held, OTHER))
    station.with_suffix(".tbd").write_bytes(science())
    assert decode(station, [station.parent]).completeness == without.completeness


def test_a_science_file_without_its_cache_changes_nothing(station: Path) -> None:
    without = decode(station, [station.parent])
    station.with_suffix(".tbd").write_bytes(science())
    (station.parent / f"{OTHER}.cac").unlink()
    assert decode(station, [station.parent]).completeness == without.completeness


def test_a_depth_that_is_there_is_kept(station: Path) -> None:
    (station.parent / f"{dinkum.CRC}.cac").write_bytes(dinkum.sensor_list())
    station.write_bytes(flight(dinkum.SENSORS))
    own = decode(station, [station.parent])
    station.with_suffix(".tbd").write_bytes(science())
    assert decode(station, [station.parent]).completeness == own.completeness
    assert own.get("depth").v.max() > 20


def test_what_the_science_file_measures_is_read_where_a_field_is_made_of_it(station: Path) -> None:
    content = with_own(station, "sci_water_temp", "degc", 9.0)
    before = decode(station, [station.parent], science=())
    station.with_suffix(".tbd").write_bytes(content)
    plain, whole = decode(station, [station.parent]), decode(station, [station.parent], science=())
    assert "temperature" not in plain.quantities
    assert whole.get("temperature").v == pytest.approx(9.0 + np.arange(1, 20), abs=1e-4)
    assert whole.get("science_pressure").v == pytest.approx(1e5)
    assert whole.completeness > before.completeness  # so that it takes the place of what came without it


def test_a_sensor_of_the_science_computer_is_read_by_its_name(station: Path) -> None:
    content = with_own(station, "sci_flbbcd_chlor_units", "ug/l", 0.5)
    station.with_suffix(".tbd").write_bytes(content)
    plain = decode(station, [station.parent], science=())
    whole = decode(station, [station.parent], science=("sci_flbbcd_chlor_units", "sci_not_sent"))
    assert set(whole.quantities) - set(plain.quantities) == {"sci_flbbcd_chlor_units"}
    assert whole.get("sci_flbbcd_chlor_units").v == pytest.approx(0.5 + np.arange(1, 20))
