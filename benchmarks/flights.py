"""Dives with verdicts of the joint estimator, for `joint.py`: made from files, and what is counted."""

from __future__ import annotations

import multiprocessing
import tempfile
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from gliderwatch.errors import GliderwatchError
from gliderwatch.estimation.dive_measurement import observe
from gliderwatch.estimation.modes import Cause
from gliderwatch.estimation.verdict import SpeedParams, SpeedState, Verdict, step
from gliderwatch.model import Current, Dive, Segment, readonly
from gliderwatch.score.graft import navigate
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.flight import Airframe, Point
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.ocean import Constituent, Ellipse, Front, Sea
from gliderwatch.simulate.scenario import DiveTruth, Fault, FaultKind, Scenario
from gliderwatch.slocum import folders
from gliderwatch.slocum.decode import decode

Made = TypeVar("Made")
DAY, HOUR, MONTH = 86400.0, 3600.0, 30 * 86400.0
USUAL = SpeedParams()
SEAS = {
    "calm": Sea(),
    "tidal": Sea(
        tides=(Ellipse(Constituent.M2, 0.25, 0.08, 0.6, 0.4), Ellipse(Constituent.K1, 0.10, -0.03, 1.2, 2.0)),
        sigma=0.05,
    ),
    "strong": Sea(residual=(0.25, 0.15), sigma=0.12),
    "front": Sea(front=Front(1.0)),
    "inertial": Sea(inertial=0.10),
}
WAYS = ("legs of 60 km", "triangle of 14 km", "zigzag of 6 km")


@dataclass(frozen=True)
class Flown:
    """Dives with their verdicts, the truth of each by its start (s), and when a fault began (s)."""

    name: str
    fault: str
    dives: list[Dive]
    verdicts: list[Verdict]
    truth: dict[float, DiveTruth]
    onset: float | None = None

    def pairs(self) -> Iterable[tuple[Dive, Verdict]]:
        return zip(self.dives, self.verdicts, strict=True)

    def healthy_months(self) -> float:
        end = self.onset if self.onset is not None else self.dives[-1].t_surface
        return (end - self.dives[0].t_dive) / MONTH


# --------------------------------------------------------------------------- from files to verdicts


def read(folder: Path, cache: Path) -> list[Segment]:
    """The segments below a folder in the order of time, the fullest copy of each, of what can be read."""
    found: dict[str, Segment] = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and folders.kind(path.name) is not None:
            try:
                segment = decode(path, [cache])
            except GliderwatchError:
                continue
            held = found.get(segment.id.name)
            if held is None or held.completeness < segment.completeness:
                found[segment.id.name] = segment
    return sorted(found.values(), key=lambda s: s.id)


def judged(dives: Iterable[Dive], params: SpeedParams = USUAL) -> list[Verdict]:
    state, out = SpeedState(), []
    for dive in dives:
        state, verdict = step(state, dive, params)
        out.append(verdict)
    return out


def fly(name: str, scenario: Scenario, params: SpeedParams = USUAL, roll: bool = True) -> Flown:
    """A simulated glider, its files, its dives and what is said of them; ``roll`` says whether it is sent."""
    mission = simulate(scenario)
    with tempfile.TemporaryDirectory(prefix="gliderwatch-benchmark-") as folder:
        write_mission(Path(folder) / "gliders", Path(folder) / "cache", mission)
        dives = navigate(read(Path(folder) / "gliders", Path(folder) / "cache"))
    if not roll:
        dives = [replace(d, features=replace(d.features, roll_mean=None, roll_std=None)) for d in dives]
    truth = {dive.t_dive: same for dive in dives if (same := of(dive, mission.truth)) is not None}
    fault = scenario.faults[0] if scenario.faults else None
    kind = f"{fault.kind} {fault.size:g}" if fault else ""
    return Flown(name, kind, dives, judged(dives, params), truth, fault.onset if fault else None)


def of(dive: Dive, truth: Sequence[DiveTruth]) -> DiveTruth | None:
    """The truth of a dive: clocks may be wrong, so more than half of the time of both is enough."""
    together = [min(dive.t_surface, t.t_surface) - max(dive.t_dive, t.t_dive) for t in truth]
    best = truth[int(np.argmax(together))]
    longer = max(dive.t_surface - dive.t_dive, best.t_surface - best.t_dive)
    return best if max(together) > longer / 2 else None


def various(gliders: int, fault: FaultKind | None = None, size: float = 0.0) -> list[tuple[str, Scenario]]:
    """Gliders of 12 days in all seas and on all ways, airframes of their own; a fault after 6 days."""
    k, out = 14 / 111, []
    ways = {
        WAYS[0]: Scenario().waypoints,
        WAYS[1]: (Point(27.5 + 0.87 * k, -84 - 0.56 * k), Point(27.5, -84 - 1.13 * k), Point(27.5, -84)),
        WAYS[2]: tuple(Point(27.5 + 0.35 * k * (i % 2), -84 - 0.4 * k * (i + 1)) for i in range(12)),
    }
    for sea, water in SEAS.items():
        for way, waypoints in ways.items():
            for seed in range(1, gliders + 1):
                rng = np.random.default_rng(1000 + seed)
                drag, lift = np.clip(rng.standard_normal(2), -1.5, 1.5)
                airframe = Airframe(
                    parasite_drag=0.15 * np.exp(0.2 * drag), lift_slope=7.5 * np.exp(0.1 * lift)
                )
                pitch = float(rng.uniform(0.42, 0.52))
                plain = Scenario(
                    seed=seed, days=12, sea=water, waypoints=waypoints, airframe=airframe, pitch=pitch
                )
                onset = plain.start + (6 + 0.07 * seed) * DAY
                faults = (Fault(fault, onset, size),) if fault else ()
                out.append((f"{sea}, {way}", replace(plain, faults=faults)))
    return out


def all_of(work: Callable[..., Made], jobs: Sequence[tuple[object, ...]]) -> list[Made]:
    context = multiprocessing.get_context("spawn")  # a fork would share the decoder's folder
    with ProcessPoolExecutor(mp_context=context) as pool:
        return list(pool.map(work, *zip(*jobs, strict=True), chunksize=4))


# --------------------------------------------------------------------------- what is counted


def incidents(flown: Flown, flag: int) -> list[float]:
    """Surfacings (s) at which two dives in a row, or one that is very slow, would open an incident."""
    out: list[float] = []
    row = normal = 0
    is_open = False
    for dive, verdict in flown.pairs():
        if verdict.flag is None or (flag == 1 and verdict.flag == 2):
            continue
        if verdict.flag != flag:
            row, normal = (row if is_open else 0), normal + 1
            is_open = is_open and normal < 2
            row = row if is_open else 0
            continue
        row, normal = row + 1, 0
        severe = flag == 1 and verdict.info and verdict.info.estimate.speed < verdict.normal.low / 2
        if not is_open and row >= (1 if severe else 2):
            is_open = True
            out.append(dive.t_surface)
    return out


def delay(flown: Flown, flag: int) -> tuple[float, float]:
    """Surfacings and hours from the onset to the first dive with a flag; infinite where there is none."""
    assert flown.onset is not None
    after = [(d, v) for d, v in flown.pairs() if d.t_surface > flown.onset]
    for count, (dive, verdict) in enumerate(after, start=1):
        if verdict.flag == flag:
            return count, (dive.t_surface - flown.onset) / HOUR
    return np.inf, np.inf


def errors(flights: Iterable[Flown]) -> np.ndarray:
    """Of each dive with a good current: error of V (m/s), and in standard errors; NEES of F; NIS."""
    out = []
    for flown in flights:
        for dive, verdict in flown.pairs():
            info, truth = verdict.info, flown.truth.get(dive.t_dive)
            if info is None or truth is None or info.across is None or info.cause.is_error:
                continue
            found = info.estimate
            miss = found.flow - np.array(truth.current)
            nees = float(miss @ np.linalg.solve(found.flow_cov, miss)) / 2
            nis = info.nis / info.dof if info.cause is Cause.USUAL else np.nan
            out.append((found.speed - truth.speed, (found.speed - truth.speed) / found.sigma, nees, nis))
    return np.array(out)


# --------------------------------------------------------------------------- real missions


def slowed(dive: Dive, part: float) -> Dive:
    """A dive on which part of the speed is lost to drag: the way is shorter, the current stays right."""
    if dive.track is None:
        return dive
    seen = observe(dive)
    own = seen.own_speed()
    speed = own[0] if own and 0 < own[0] < 1.3 else dive.features.onboard_speed or 0.3
    steps = dive.track.heading * np.diff(dive.track.t)[:, None]
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    names = ("depth_rate_dive", "depth_rate_climb", "onboard_speed")
    told = {name: getattr(dive.features, name) for name in names}
    slower = {name: (1 - part) * value for name, value in told.items() if value is not None}
    return replace(
        dive,
        track=replace(dive.track, x=readonly(dive.track.x - part * speed * way)),
        features=replace(dive.features, **slower),
    )


def off(dive: Dive, angle: float, size: float = 0.3) -> Dive:
    """A dive whose current is wrong by ``size`` (m/s) in a direction (rad)."""
    if dive.current is None:
        return dive
    u, v = dive.current.u + size * np.cos(angle), dive.current.v + size * np.sin(angle)
    return replace(dive, current=Current(float(u), float(v), dive.current.final))


def from_(dives: Sequence[Dive], k: int, change: Callable[[Dive], Dive]) -> list[Verdict]:
    """The verdicts from the k-th dive on, all of these changed."""
    return judged([*dives[:k], *map(change, dives[k:])])[k:]
