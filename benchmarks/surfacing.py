"""The next surfacing: what was forecast as the files came, beside what happened and beside persistence.

python benchmarks/surfacing.py [--missions ../shared/data] [--gliders 4]

Segments come one by one, in order. A forecast is made when a dive is first told with the fix that ends it,
from nothing but the files until then (so mostly from the first published current of that dive), and scored
against the next dive as it is known in the end. Not scored: forecasts that could only be made after that
dive, and dives with a hole in the data in which the glider may have been up.

Persistence a: the velocity over ground of the last dive, for as long as the last interval. Persistence b: the
estimated speed, the mean heading vector and the current of the last dive, for as long.
"""

from __future__ import annotations

import argparse
import multiprocessing
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from common import machine
from flights import read, various

from gliderwatch.forecast.constants import CHI2_COVERED
from gliderwatch.forecast.surfacing import Surfacings, ground, is_unseen
from gliderwatch.model import Dive, NextSurfacing, Segment, Unusable
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.simulate.scenario_files import find, load_scenario

PARAMS = GliderParams()
SHOWN = ("calm", "tidal", "deep", "front")


@dataclass(frozen=True)
class Forecast:
    """What was said when a ``dive`` was first told, with files until ``at`` (s): by what was ``known`` of
    surfacings, and the ``speed`` (m/s) estimated."""

    dive: Dive
    expected: NextSurfacing
    known: Surfacings
    speed: float
    at: float


def forecasts(segments: Sequence[Segment]) -> tuple[list[Forecast], list[Dive]]:
    """What was said when each dive was first told, and the dives as they are known in the end."""
    navigation, state, speed = Navigation(), GliderState(), 0.0
    made, final = list[Forecast](), dict[float, Dive]()
    for segment in segments:
        navigation, dives = extend(navigation, segment)
        final |= {dive.t_dive: dive for dive in dives if dive.end is not None}
        before, outcome = state.last, process(state, segment, PARAMS)
        state = outcome.state
        if state.assessment is not None and state.assessment.speed is not None:
            speed = state.assessment.speed
        is_new = state.last is not None and (before is None or state.last.t_dive != before.t_dive)
        if is_new and outcome.expected is not None:
            known = state.memory.surfacings
            made.append(Forecast(state.last, outcome.expected, known, speed, segment.last_t))
    return made, [final[t] for t in sorted(final)]


# --------------------------------------------------------------------------- scores


def scores(segments: Sequence[Segment]) -> np.ndarray:
    """One row a forecast: errors of place (km) of ours, of persistence a and of b; of time (min) of ours and
    of persistence; whether the place was in the 95 % ellipse and the time in the 95 % interval."""
    made, dives = forecasts(segments)
    following = {dive.t_dive: then for dive, then in pairwise(dives)}
    rows = []
    for forecast in made:
        then = following.get(forecast.dive.t_dive)
        if then is None or then.end is None:
            continue
        is_stale = then.unusable is Unusable.STALE_FIX
        if forecast.at < then.t_surface and not is_unseen(then) and not is_stale:
            rows.append(row(forecast, then))
    return np.array(rows, dtype=np.float64).reshape(-1, 7)


def row(forecast: Forecast, then: Dive) -> tuple[float, ...]:
    expected, dive, known = forecast.expected, forecast.dive, forecast.known
    assert then.end is not None and dive.end is not None
    off = to_plane(then.end.lat, then.end.lon, expected.lat, expected.lon)
    cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]])
    late = then.end.t - expected.t
    interval = known.intervals[-1] if known.intervals else expected.t - expected.after
    way = to_plane(then.end.lat, then.end.lon, dive.end.lat, dive.end.lon)
    over_ground = ground(dive)
    drawn = np.zeros(2) if over_ground is None else over_ground
    flown = forecast.speed * np.array(known.heading or (0.0, 0.0)) + np.array(known.current or (0.0, 0.0))
    return (
        float(np.hypot(*off)) / 1e3,
        float(np.hypot(*(drawn * interval - way))) / 1e3,
        float(np.hypot(*(flown * interval - way))) / 1e3,
        abs(late) / 60,
        abs(then.end.t - dive.end.t - interval) / 60,
        bool(off @ np.linalg.solve(cov, off) < CHI2_COVERED),
        bool(abs(late) < 1.96 * expected.t_sigma),
    )


def show(name: str, rows: np.ndarray) -> None:
    mean, middle = rows.mean(axis=0), np.median(rows, axis=0)
    places = " ".join(f"{mean[k]:6.2f} {middle[k]:5.2f}" for k in range(3))
    times = " ".join(f"{mean[k]:5.1f} {middle[k]:5.1f}" for k in (3, 4))
    print(f"{name:14s} {len(rows):5d} {places}   {times}   {100 * mean[5]:6.1f} {100 * mean[6]:6.1f}")


# --------------------------------------------------------------------------- missions


def sail(scenario: Scenario) -> np.ndarray:
    with tempfile.TemporaryDirectory(prefix="gliderwatch-benchmark-") as folder:
        write_mission(Path(folder) / "gliders", Path(folder) / "cache", simulate(scenario))
        return scores(read(Path(folder) / "gliders", Path(folder) / "cache"))


def fleet(gliders: int) -> list[tuple[str, Scenario]]:
    """Gliders of 12 days in four seas, on short and long ways, with airframes of their own."""
    coastal = [(name.split(",")[0], scenario) for name, scenario in various(gliders)]
    ocean = load_scenario(find("deep"))
    deep = [
        ("deep", replace(ocean, seed=s.seed, days=12, place=s.place, waypoints=s.waypoints, pitch=s.pitch))
        for sea, s in coastal
        if sea == "calm"
    ]
    return [(sea, scenario) for sea, scenario in coastal + deep if sea in SHOWN]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--missions", type=Path, default=Path("../shared/data"))
    parser.add_argument("--gliders", type=int, default=4, help="of each sea and way")
    asked = parser.parse_args()
    print(machine())
    print(
        "                      place: error (km), mean and median     time: error (min)       inside 95 % of"
    )
    print(
        "                   n     ours         a            b            ours     the last     place   time"
    )
    jobs = fleet(asked.gliders)
    context = multiprocessing.get_context("spawn")  # a fork would share the decoder's folder
    with ProcessPoolExecutor(2, mp_context=context) as pool:
        found = list(pool.map(sail, [scenario for _, scenario in jobs]))
    for sea in SHOWN:
        show(sea, np.concatenate([rows for (name, _), rows in zip(jobs, found, strict=True) if name == sea]))
    missions = sorted(p for p in asked.missions.iterdir() if (p / "from-glider").is_dir())
    real = [scores(read(mission / "from-glider", mission / "cache")) for mission in missions]
    for mission, rows in zip(missions, real, strict=True):
        show(mission.name, rows)
    if real:
        show("all of these", np.concatenate(real))


if __name__ == "__main__":
    main()
