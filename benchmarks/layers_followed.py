"""A simulated glider flies what the installed program advises, through the files: is the layer covered?

`python benchmarks/layers_followed.py [--days 2] [--only NAME ...] [--method composite|filter]`: for each
water a glider of `gliderwatch.simulate` dives for 4 h at a time. At each surfacing its sbd and tbd files are
put on a dockserver that the installed daemon watches; the mission arguments that the daemon writes are read
as a glider reads them, and the next dive flies them. The depths of the layer are those where the true
gradient is above a quarter of its peak. Coverage is the part of that gradient that any cast of a dive went
through (and the mean of what each cast went through), travel the part of the way that as many casts over all
depths would have gone: means over the dives from the second on, for the first has no advice.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from common import configure, daemon, folder
from numpy.typing import NDArray

from gliderwatch.simulate.delivery import FileForm, deliver, encoded, from_glider
from gliderwatch.simulate.glider import voyage
from gliderwatch.simulate.ocean import Layer, Water
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.telemetry import SCIENCE_CADENCE, SegmentData
from gliderwatch.simulate.vehicle import Yo

Array = NDArray[np.float64]
DAY, HOURS = 86400.0, 4.0
TOP, DEEP = 5.0, 200.0
START = Scenario().start
EVERYWHERE = 1e9
"""m: the wavelength of a layer that is as deep in one place as in another."""


def drifting(depth: float, a_day: float) -> Layer:
    """A boundary at `depth` (m) that sinks (below 0: rises) by so many m a day, a part of a slow wave."""
    period = 2 * np.pi * _SLOW / abs(a_day) * DAY
    phase = -2 * np.pi * START / period + (np.pi if a_day < 0 else 0.0)
    return Layer(depth, amplitude=_SLOW, period=period, wavelength=EVERYWHERE, phase=phase)


_SLOW = 30.0
"""m: the amplitude of that wave, so much that its begin is straight."""
TIDE = {"amplitude": 4.0, "period": 12.42 * 3600.0, "wavelength": 30e3}
WATERS = {
    "sinks by 10 m a day": Water(layers=(drifting(60.0, 10.0),)),
    "rises by 10 m a day": Water(layers=(drifting(90.0, -10.0),)),
    "two, with a tide": Water(
        layers=(Layer(40.0, temperature=-3.0, **TIDE), Layer(110.0, temperature=-4.0, **TIDE))
    ),
    "one, a tide of 15 m": Water(layers=(Layer(80.0, amplitude=15.0, wavelength=30e3),)),
    "none": Water(layers=()),
}


def casts_of(segment: SegmentData) -> list[tuple[float, float]]:
    """Ways down and up in a science file, from depth to depth (m), by its pressures."""
    names = [sensor.name for sensor in segment.sensors.columns]
    depth = segment.values[1:, names.index("sci_water_pressure")] * 10.0 / 1.006
    depth = depth[segment.updated[1:, names.index("sci_water_pressure")]]
    ends, sign = [float(depth[0])], 0
    for z in depth.tolist():
        if sign * (z - ends[-1]) > 0:
            ends[-1] = z
        elif abs(z - ends[-1]) > 5.0:
            sign = 1 if z > ends[-1] else -1
            ends.append(z)
    return list(pairwise(ends))


def covered(water: Water, t: float, casts: Sequence[tuple[float, float]]) -> float:
    """The part of the gradient of the layers (above a quarter of its peak) that the casts went through."""
    z = np.arange(0.25, DEEP + 20.0, 0.5)
    temperature, _ = water.properties(np.full(len(z), t), np.zeros(len(z)), np.zeros(len(z)), z)
    gradient = np.abs(np.gradient(temperature, z))
    if not gradient.max() > 0:
        return 1.0
    gradient[gradient < gradient.max() / 4] = 0.0
    seen = np.zeros(len(z), dtype=bool)
    for a, b in casts:
        seen |= (z >= min(a, b)) & (z <= max(a, b))
    return float(gradient[seen].sum() / gradient.sum())


def yos_in(outputs: Path) -> tuple[Yo, ...]:
    """What a glider makes of the mission arguments: first all depths, then the band, if there is one."""
    found = []
    for name in ("full", "band"):
        path = outputs / f"sim-yo-{name}.ma"
        if path.exists():
            told = dict(re.findall(r"b_arg: (\w+)\(\w+\)\s+(-?\d+)", path.read_text(encoding="ascii")))
            n = int(told["num_half_cycles_to_do"])
            found.append(
                Yo(float(told["c_target_depth"]), float(told["d_target_depth"]), None if n < 0 else n)
            )
    return tuple(found)


def put(root: Path, mission: Mission, since: int) -> None:
    """Put the files of a mission from the number `since` on where a dockserver would."""
    for kind in (mission.segments, mission.science):
        for segment in kind[since:]:
            data, extension = encoded(segment, FileForm(factored=False))
            deliver(from_glider(root, mission) / f"{segment.header.full_name}.{extension}", data)


def follow(place: Path, water: Water, method: str, days: float) -> tuple[Array, list[str]]:
    """Coverage, mean coverage of a cast, and travel of each dive from the second on (n, 3), and the first
    line of each advice."""
    outputs = place / "advice"
    settings = {"max_depth": DEEP, "min_depth": TOP, "altitude": 5, "method": method, "outputs": str(outputs)}
    config = configure(place, [])
    document = json.loads(config.read_text()) | {"gliders": {"sim": {"layers": settings}}}
    config.write_text(json.dumps(document), encoding="utf-8")
    scenario = Scenario(
        days=days, depths=(TOP, DEEP), interval=HOURS * 3600, water=water, science=SCIENCE_CADENCE
    )
    rows, words = list[tuple[float, float, float]](), list[str]()
    with daemon(config):
        going, n = voyage(scenario), 0
        mission = next(going)
        while True:
            put(place / "gliders", mission, n)
            segment, n = mission.science[-1], len(mission.segments)
            casts = casts_of(segment)
            dive = mission.truth[-1]
            t, whole = (dive.t_dive + dive.t_surface) / 2, len(casts) * (DEEP - TOP)
            each = float(np.mean([covered(water, t, [cast]) for cast in casts]))
            rows.append((covered(water, t, casts), each, sum(abs(b - a) for a, b in casts) / whole))
            wait(config, len(mission.truth))
            words.append((outputs / "sim-yo-full.ma").read_text().splitlines()[2])
            mission = going.send(yos_in(outputs))
            if len(mission.truth) == len(words):  # the whole of it: the last file is of the surface
                return np.array(rows[1:]), words


def wait(config: Path, advices: int) -> None:
    """Wait until so many advices are written."""
    deadline = time.monotonic() + 120.0
    while config.with_name("daemon.log").read_bytes().count(b'"event": "advice written"') < advices:
        if time.monotonic() > deadline:
            sys.exit(f"no advice within 120 s: see {config.with_name('daemon.log')}")
        time.sleep(0.05)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--days", type=float, default=2.0)
    parser.add_argument("--only", nargs="*", choices=WATERS, default=list(WATERS))
    parser.add_argument("--method", choices=("composite", "filter"), default="composite")
    given = parser.parse_args()
    print(
        f"{'water':<22}{'dives':>6}{'coverage':>10}{'least':>7}{'a cast':>8}{'travel':>8}  advice at the end"
    )
    for name in given.only:
        with folder() as place:
            rows, words = follow(place, WATERS[name], given.method, given.days)
        coverage, each, travel = rows.mean(axis=0)
        print(
            f"{name:<22}{len(rows):>6}{coverage:>10.3f}{rows[:, 0].min():>7.2f}{each:>8.2f}{travel:>8.2f}"
            f"  {words[-1].removeprefix('# ')}",
            flush=True,
        )


if __name__ == "__main__":
    main()
