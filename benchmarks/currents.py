"""Forecasts of the current one dive ahead, on real missions and in simulated seas.

python benchmarks/currents.py [--missions ../shared/data] [--gliders 3] [--days 20]

Dives come from files, as in `joint.py`; currents that the joint estimator calls wrong are left out. Errors
are those of a component, of all dives after the first.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from common import machine
from flights import HOUR, judged, of, read

from gliderwatch.estimation.dive_measurement import observe
from gliderwatch.forecast.constants import CHI2_COVERED
from gliderwatch.model import Array, Dive, Fix
from gliderwatch.papers import two_stage
from gliderwatch.papers.two_stage import TwoStageParams
from gliderwatch.score.graft import navigate
from gliderwatch.sea.flow_forecast import Currents, learn, predict
from gliderwatch.sea.tides import Constituent
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.seas import SEAS, sea_mission
from gliderwatch.store import codec

M2_K1 = (Constituent.M2, Constituent.K1)
NAMES = ("persistence", "two-stage", "two-stage 119 h", "foreseen")


@dataclass(frozen=True)
class Seen:
    """The fixes of a dive, its believed current (m/s) with error, and the true one where it is known."""

    start: Fix
    end: Fix
    current: Array
    sigma: float
    truth: Array | None


@dataclass(frozen=True)
class Row:
    """One dive: error (m/s, (2,)) of each forecast; of that of the model of the sea its source and its error
    squared in standard errors; of the displacement over the dive the error of persistence and of the forecast
    (m, as over 3 h) and that squared in standard errors."""

    errors: dict[str, Array]
    source: str
    nis: float
    metres: tuple[float, float]
    spread: float


def seen(dives: Sequence[Dive], truth: dict[float, Array] | None = None) -> list[Seen]:
    out = []
    for dive, verdict in zip(dives, judged(dives), strict=True):
        if dive.current is None or dive.track is None or verdict.info is None or verdict.info.cause.is_error:
            continue
        each = observe(dive)
        assert each.current is not None
        known = truth.get(dive.t_dive) if truth is not None else None
        if truth is None or known is not None:
            out.append(Seen(dive.start, dive.end, each.current, each.current_sigma, known))
    return out


def simulated(sea: str, seed: int, days: float) -> list[Seen]:
    mission = simulate(sea_mission(sea, seed, days=days))
    with tempfile.TemporaryDirectory(prefix="gliderwatch-benchmark-") as folder:
        write_mission(Path(folder) / "gliders", Path(folder) / "cache", mission)
        dives = navigate(read(Path(folder) / "gliders", Path(folder) / "cache"))
    truth = {d.t_dive: np.array(same.current) for d in dives if (same := of(d, mission.truth)) is not None}
    return seen(dives, truth)


class TwoStage:
    """The two-stage filter as a forecast."""

    def __init__(self, params: TwoStageParams) -> None:
        self.params, self.state = params, None

    def __call__(self, each: Seen) -> Array | None:
        told = (
            two_stage.forecast(self.state, each.start.t, each.end.t, self.params)
            if self.state is not None
            else None
        )
        step = (each.start.t, each.end.t, each.current)
        self.state = (
            two_stage.learn(self.state, *step, 0.02, self.params)
            if self.state is not None
            else two_stage.init(*step, self.params)
        )
        return told


def rows(dives: Sequence[Seen]) -> tuple[list[Row], float]:
    """What was foretold of each dive, and how long it took to learn a dive (s)."""
    others: dict[str, Callable[[Seen], Array | None]] = {
        "two-stage": TwoStage(TwoStageParams(constituents=M2_K1)),
        "two-stage 119 h": TwoStage(TwoStageParams(cutoff=1 / (119.4 * HOUR), constituents=M2_K1)),
    }
    state, out, cost, last = Currents(), [], 0.0, None
    for each in dives:
        told = {name: forecast(each) for name, forecast in others.items()} | {"persistence": last}
        begun = time.process_time()
        found = predict(state, each.start, each.end)
        state = learn(state, each.start, each.end, each.current, each.sigma)
        cost += time.process_time() - begun
        if found is not None:
            out.append(row(each, told | {"foreseen": found.flow}, found.source, found.flow, found.cov))
        last = each.current
    return out, cost / max(len(dives), 1)


def row(each: Seen, told: dict[str, Array | None], source: str, flow: Array, cov: Array) -> Row:
    lasts = each.end.t - each.start.t
    miss = {name: each.current - mean for name, mean in told.items() if mean is not None}
    e = miss["foreseen"]
    nis = float(e @ np.linalg.solve(cov + each.sigma**2 * np.eye(2), e))
    # where the truth is not known the reported current stands for it, with its error
    water = each.truth if each.truth is not None else each.current
    noise = 0.0 if each.truth is not None else each.sigma
    off = (flow - water) * lasts
    last = told["persistence"]
    assert last is not None
    spread = float(off @ np.linalg.solve((cov + noise**2 * np.eye(2)) * lasts**2, off))
    scale = 3 * HOUR / lasts
    metres = (float(np.hypot(*(last - water))) * 3 * HOUR, float(np.hypot(*off)) * scale)
    return Row(miss, source, nis, metres, spread)


def line(name: str, found: Sequence[Row], cost: float) -> str:
    def rms(forecast: str) -> float:
        return 100 * float(np.sqrt(np.mean([r.errors[forecast] ** 2 for r in found])))

    on = np.mean(["tides" in r.source for r in found])
    inside = np.mean([r.nis < CHI2_COVERED for r in found])
    spread = np.mean([r.spread < CHI2_COVERED for r in found])
    metres = np.mean([r.metres for r in found], axis=0)
    errors = " ".join(f"{rms(forecast):6.2f}" for forecast in NAMES)
    return (
        f"{name:22s} {len(found):5d} {errors} {on:5.0%} {inside:7.0%} "
        f"{metres[0]:6.0f} {metres[1]:6.0f} {spread:6.0%} {1e3 * cost:5.2f}"
    )


def better(found: Sequence[Row]) -> str:
    """By how many standard errors each forecast's squared errors are below those of persistence."""
    out = []
    for name in NAMES[1:]:
        gain = [np.sum(r.errors["persistence"] ** 2 - r.errors[name] ** 2) for r in found]
        out.append(f"{name} {np.mean(gain) / np.std(gain) * np.sqrt(len(gain)):+.1f}")
    return "better than persistence by standard errors: " + ", ".join(out)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--missions", type=Path, default=Path(__file__).parents[2] / "shared" / "data")
    parser.add_argument("--gliders", type=int, default=3, help="in each sea")
    parser.add_argument("--days", type=float, default=20)
    arguments = parser.parse_args()
    print(machine())
    print(
        "rms error of the current one dive ahead (cm/s, a component); on how many dives tides are seen; how\n"
        "many are in the 95 % ellipse of what was foreseen; error of the displacement in 3 h (m) of\n"
        "persistence and foreseen, against the true current where it is known, and how many are in its 95 %\n"
        "ellipse; time to foresee and learn a dive (ms)\n"
        f"{'':22s} dives   last   2-st  2-119 forese.  on  inside   last forese. inside    ms"
    )
    every: list[Row] = []
    if arguments.missions.is_dir():
        for mission in sorted(p for p in arguments.missions.iterdir() if (p / "from-glider").is_dir()):
            found, cost = rows(seen(navigate(read(mission / "from-glider", mission / "cache"))))
            every += found
            print(line(mission.name, found, cost))
        print(line("all real missions", every, 0.0))
        print(better(every))
    every, wrong = [], []
    for name in SEAS:
        some: list[Row] = []
        for seed in range(1, arguments.gliders + 1):
            dives = simulated(name, seed, arguments.days)
            wrong += [each.current - each.truth for each in dives if each.truth is not None]
            found, cost = rows(dives)
            some += found
        every += some
        print(line(name, some, cost))
    print(line("all simulated seas", every, 0.0))
    print(better(every))
    print(f"a simulated glider's own currents are {100 * np.sqrt(np.mean(np.square(wrong))):.2f} cm/s off")
    state = Currents()
    for each in dives:
        state = learn(state, each.start, each.end, each.current, each.sigma)
    print(f"a state is {len(codec.encode(state))} bytes in a checkpoint")


if __name__ == "__main__":
    main()
