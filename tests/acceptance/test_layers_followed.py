"""A glider at sea that flies what the mission arguments advise: from its science file to its next dive."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.layers.advice import Layered, LayerParams, after
from gliderwatch.layers.band import Band, Method, Mode, Tracking
from gliderwatch.simulate.dinkum import Header, Sensor, SensorList, encode
from gliderwatch.slocum.decode import decode_science
from gliderwatch.slocum.mission_arguments import write_yo

HOUR, DAY = 3600.0, 86400.0
START = 1.7e9
DEEP = 200.0
"""m: the glider flies from 5 m to here where nothing else is advised."""
SENSORS = SensorList(
    tuple(
        Sensor(name, unit, 8 if unit == "timestamp" else 4)
        for name, unit in (
            ("sci_m_present_time", "timestamp"),
            ("sci_water_pressure", "bar"),
            ("sci_water_temp", "degc"),
        )
    ),
    frozenset({"sci_m_present_time", "sci_water_pressure", "sci_water_temp"}),
)
Water = Callable[[float, np.ndarray], np.ndarray]
"""Temperature at a time (s since the start) and depths (m)."""


def moving(t: float, z: np.ndarray) -> np.ndarray:
    """A thermocline from 60 to 80 m that goes down by 10 m a day, with an internal tide of 3 m."""
    top = 60.0 + 10.0 * t / DAY + 3.0 * np.sin(2 * np.pi * t / (12.42 * HOUR))
    return np.interp(z, [top, top + 20.0], [18.0, 10.0])


def two(t: float, z: np.ndarray) -> np.ndarray:
    """Two layers, from 40 to 50 m and from 100 to 115 m."""
    return np.interp(z, [40.0, 50.0, 100.0, 115.0], [18.0, 15.0, 15.0, 11.0])


def none(t: float, z: np.ndarray) -> np.ndarray:
    """Water without a layer: 0.002 degrees colder each m."""
    return 15.0 - 0.002 * z


def layer_of(water: Water, t: float) -> np.ndarray:
    """Depths (m) where the gradient is above a quarter of its peak."""
    z = np.arange(0.0, DEEP, 0.5)
    gradient = np.abs(np.diff(water(t, z))) / 0.5
    return z[:-1][gradient > 0.25 * gradient.max()] + 0.25


def dive(bands: list[tuple[Band, int]], t: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and depths (m) every 10 s of a glider at 0.2 m/s that does so many half cycles in each band,
    without end in the last, and comes up at the end."""
    turns, so_far, limit = [0.0], 0.0, (seconds - DEEP / 0.2) * 0.2
    for band, half_cycles in bands:
        done = 0
        while so_far < limit and done != half_cycles:
            goal = band.bottom if done % 2 == 0 else band.top
            so_far += abs(goal - turns[-1])
            turns.append(goal)
            done += 1
    turns.append(0.0)
    at = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turns))) / 0.2])
    times = np.arange(0.0, at[-1], 10.0)
    return t + times, np.interp(times, at, turns)


def science_file(folder: Path, n: int, t: np.ndarray, z: np.ndarray, water: Water, noise: np.ndarray) -> Path:
    """The tbd file of a segment."""
    warm = np.array([float(water(at, np.array([depth]))[0]) for at, depth in zip(t, z, strict=True)]) + noise
    rows = np.column_stack([START + t, z * 0.101, warm])
    rows = np.vstack([rows[:1], rows])  # the state before, as gliders write it
    name = f"unit_1-2023-318-0-{n}"
    header = Header(f"0{n:07d}", name, "tbd", "layers.mi", START + float(t[0]))
    path = folder / f"{name}.tbd"
    path.write_bytes(encode(header, SENSORS, rows, np.ones(rows.shape, dtype=bool), factored=False))
    return path


def read_yo(path: Path) -> tuple[Band, int]:
    """What a glider makes of a file of mission arguments."""
    said = dict(re.findall(r"b_arg: (\w+)\(\w+\)\s+(-?\d+)", path.read_text(encoding="ascii")))
    band = Band(float(said["c_target_depth"]), float(said["d_target_depth"]))
    return band, int(said["num_half_cycles_to_do"])


@dataclass
class Voyage:
    """Of each segment: coverage of the layer, by any cast; its way, and that of yos over all depths (m)."""

    coverage: list[float]
    way: list[float]
    full_way: list[float]
    advice: list[Layered]


def voyage(folder: Path, water: Water, method: Method, segments: int = 12) -> Voyage:
    params = LayerParams("temperature", DEEP, 5.0, 10.0, method, 2)
    chance = np.random.default_rng(4)
    out, tracking, bands = Voyage([], [], [], []), Tracking(), [(Band(5.0, DEEP), -1)]
    for n in range(segments):
        begin = n * 4 * HOUR
        t, z = dive(bands, begin, 4 * HOUR)
        # Yos of the same number of half cycles, but over all depths, as the comparison of methods counts.
        ups = np.flatnonzero(np.diff(np.sign(np.diff(z)))) + 1
        turns = np.concatenate([[0.0], z[ups], [0.0]])
        out.way.append(float(np.abs(np.diff(turns)).sum()))
        out.full_way.append((len(turns) - 1) * (DEEP - 5.0))
        layer = layer_of(water, begin)
        out.coverage.append(float(np.mean((layer >= z.min()) & (layer <= z.max()))))
        path = science_file(folder, n, t, z, water, chance.normal(0.0, 0.01, len(t)))
        found = after(tracking, decode_science(path, []), params)
        assert found is not None
        tracking = found.tracking
        out.advice.append(found)
        files = {p.stem[-4:]: read_yo(p) for p in write_yo("unit_1", found.advice, folder / "out")}
        bands = [files["full"]] if "band" not in files else [files["full"], files["band"]]
    return out


@pytest.mark.parametrize("water", [moving, two])
def test_a_glider_that_follows_the_advice_keeps_on_the_layer(tmp_path: Path, water: Water) -> None:
    found = voyage(tmp_path, water, Method.COMPOSITE)
    assert np.mean(found.coverage) >= 0.95
    assert sum(found.way) / sum(found.full_way) < 0.8
    assert [x.advice.mode for x in found.advice[:3]] == [Mode.TRACK] * 3
    assert len(found.advice[5].advice.layers) == (2 if water is two else 1)


def test_in_the_band_alone_it_keeps_on_it_too(tmp_path: Path) -> None:
    """What the band casts saw, without the two full ones."""
    found = voyage(tmp_path, moving, Method.COMPOSITE)
    for n, one in enumerate(found.advice[:-1]):
        layer, band = layer_of(moving, (n + 1) * 4 * HOUR), one.advice.band
        assert band is not None
        assert np.mean((layer >= band.top) & (layer <= band.bottom)) > 0.9


def test_where_there_is_no_layer_it_says_so(tmp_path: Path) -> None:
    found = voyage(tmp_path, none, Method.COMPOSITE, segments=3)
    for one in found.advice:
        assert (one.advice.band, one.advice.mode, one.advice.why) == (None, Mode.COMPLETE, "no layer")
    assert not (tmp_path / "out" / "unit_1-yo-band.ma").exists()
    assert "complete: no layer" in (tmp_path / "out" / "unit_1-yo-full.ma").read_text()


def test_the_filter_of_the_paper_keeps_on_it_too(tmp_path: Path) -> None:
    found = voyage(tmp_path, moving, Method.FILTER)
    assert np.mean(found.coverage) >= 0.95
