"""What delayed mode gains over near real time on simulated seas, where the truth is known.

`python benchmarks/delayed.py [--seas rotary,mixed] [--seeds 2] [--days 20]`: gliders of the classes of
`simulate/seas.py`, through their files; error of a component of the instantaneous current at each half hour
under water (cm/s, from day 3), and the part inside of 95 %: as foreseen when the dive began, near real time
(once it had ended), delayed. Paper 002 has 6 to 7 near real time and below 6 delayed, against an ADCP some km
away.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from sea_runs import HEALTHY, Job, flight, scenario

from gliderwatch.archive.hindcast import mean_currents
from gliderwatch.model import Array
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.score.graft import navigate
from gliderwatch.sea.gauss_markov import FlowParams
from gliderwatch.sea.smoother import Currents, smooth
from gliderwatch.simulate.glider import sea_of
from gliderwatch.simulate.scenario import DiveTruth, Scenario
from gliderwatch.simulate.seas import SEAS

DAY = 86400.0
DEPTHS = 8
MODES = ("foreseen", "near_real_time", "delayed")


def truth(t: Array, dives: Sequence[DiveTruth], flown: Scenario) -> Array:
    """The true current (m/s, (n, 2)) at times (s), mean over the depths that the glider flies through."""
    places = np.array([dive.end for dive in dives])
    origin = flown.origin or flown.place
    east, north = to_plane(places[:, 0], places[:, 1], origin.lat, origin.lon).T
    times = np.array([dive.t_surface for dive in dives])
    x, y, sea = np.interp(t, times, east), np.interp(t, times, north), sea_of(flown)
    deepest = float(np.median([dive.deepest for dive in dives]))
    layers = [sea.current(t, x, y, depth) for depth in (np.arange(DEPTHS) + 0.5) / DEPTHS * deepest]
    return np.mean([np.stack(layer, -1) for layer in layers], axis=0)


def scored(found: Currents, real: Array, kept: Array) -> tuple[Array, Array]:
    """Errors (m/s) and whether they are inside of 95 %."""
    error = (found.total - real)[kept]
    return error.ravel(), (np.abs(error) < 1.96 * found.sigma[kept]).ravel()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seas", default=",".join(SEAS))
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first", type=int, default=500)
    parser.add_argument("--days", type=float, default=20.0)
    parser.add_argument("--kept", type=Path, default=Path("build/seas"))
    options = parser.parse_args()
    print(f"{'sea':<14}{'foreseen':>17}{'near real time':>17}{'delayed':>17}{'ratio':>7}")
    totals: dict[str, list[Array]] = {mode: [] for mode in MODES}
    for name in options.seas.split(","):
        rows: dict[str, list[tuple[Array, Array]]] = {mode: [] for mode in MODES}
        for seed in range(options.first, options.first + options.seeds):
            job = Job(name, seed, HEALTHY, options.days, options.kept)
            flown, made = scenario(job), flight(job)
            found = smooth(mean_currents(navigate(made.segments)), FlowParams())
            t = found.delayed.t
            kept = (t > flown.start + 3 * DAY) & (t < made.truth[-1].t_surface)
            real = truth(np.clip(t, flown.start, None), made.truth, flown)
            for mode in MODES:
                rows[mode].append(scored(getattr(found, mode), real, kept))
        rms = {}
        cells = []
        for mode, each in rows.items():
            error = np.concatenate([one for one, _ in each])
            inside = float(np.mean(np.concatenate([one for _, one in each])))
            totals[mode].append(error)
            rms[mode] = 100 * float(np.sqrt(np.mean(error**2)))
            cells.append(f"{rms[mode]:.1f} cm/s, {inside:4.0%}")
        ratio = rms["delayed"] / rms["near_real_time"]
        print(f"{name:<14}{cells[0]:>17}{cells[1]:>17}{cells[2]:>17}{ratio:>7.2f}", flush=True)
    all_rms = [100 * float(np.sqrt(np.mean(np.concatenate(each) ** 2))) for each in totals.values()]
    print(f"{'all':<14}" + "".join(f"{one:>6.1f} cm/s{'':>6}" for one in all_rms))
    print("paper 002: 6 to 7 cm/s near real time, below 6 delayed")


if __name__ == "__main__":
    main()
