"""What the currents of a fleet tell of one of its gliders, in kinds of sea, without files and vehicles.

    python benchmarks/fleet_currents.py flow [--seas slack ...] [--gliders 2 4 8] [--seeds 2] [--days 8]
    python benchmarks/fleet_currents.py faults [--gliders 4 8] [--faults loss:0.4 turn:0.3 none]
        [--any-course] [--first-only] [--json out.json]

Gliders start within 25 km of a middle and fly a steady heading each, all one way (`--any-course`: about the
middle, in any direction), 3 h a dive, in the seas of the score. A depth-averaged current is the mean of the
sea along the dive, less what the glider takes for its own way and is not: up to 9 % of its speed, up to 0.06
rad, and 6 mm/s at random. `fleet_faults.py`, which runs the installed program, has the last word;
this is much faster.

- flow: the error of the current of a dive (cm/s, a component, rms) as told by the others alone
  (`fleet.reference`), and as fused with its own dives before, beside the mean of the glider's own currents so
  far, and its last one; by the distance of the nearest; and NEES of both.
- faults: from the fourth day on the first glider has a fault. Told: `fleet_reference` has it within 48 h.
  False: that it has one of another glider, or before. With `--first-only` just the first glider is compared,
  and stops at what is told of it: a tenth of the time, and no false ones.
"""

from __future__ import annotations

import argparse
import json
import math
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the workers are the threads

import numpy as np
from common import machine

from gliderwatch.fleet.flow import DiveCurrent
from gliderwatch.fleet.reference import fleet_reference, standing
from gliderwatch.model import Array, Fix
from gliderwatch.navigation.geodesy import heading_vectors
from gliderwatch.simulate.flight import Point, offset
from gliderwatch.simulate.ocean import Ocean, make_ocean
from gliderwatch.simulate.seas import SEAS, sea_mission

HOUR, DAY = 3600.0, 86400.0
DIVE, UP, ACROSS, APART, NOISE = 3 * HOUR, 900.0, 25e3, 0.15, 0.006
STEPS, LEVELS = 12, 5
TIME = 48.0


@dataclass(frozen=True)
class Job:
    """A fleet: kind of sea, gliders, chance, days; fault of the first glider and its size (`none`: healthy),
    from a day on; whether all fly one way; whether the first glider alone is compared."""

    sea: str
    gliders: int
    seed: int
    days: float
    fault: str = "none"
    size: float = 0.0
    onset: float = 4.0
    one_way: bool = True
    first_only: bool = False


class Glider:
    """One glider under way."""

    def __init__(self, job: Job, k: int, heading: float, speed: float) -> None:
        self.job, self.k = job, k
        self.rng = np.random.default_rng([job.seed, k, 5])
        self.place = np.random.default_rng([job.seed, k, 6]).uniform(-ACROSS, ACROSS, 2)
        apart = self.rng.uniform(-APART, APART) if job.one_way else self.rng.uniform(0, math.tau)
        self.heading, self.speed = heading + apart, speed * (1 + 0.04 * self.rng.standard_normal())
        self.slip = self.rng.uniform(0.0, 0.09)
        self.turn = float(np.clip(self.rng.normal(0, 0.03), -0.06, 0.06))
        self.flows = dict[float, Array]()
        """What is true: the mean flow of each dive, by its end (s)."""

    def errors(self, t: float) -> tuple[float, float]:
        """The part of its speed that it has not, and by how much its compass is off (rad), at a time (s)."""
        ill = self.k == 0 and t >= self.job.onset * DAY
        loss = 1 - (1 - self.slip) * (1 - self.job.size) if ill and self.job.fault == "loss" else self.slip
        return loss, self.turn + (self.job.size if ill and self.job.fault == "turn" else 0.0)

    def dive(self, ocean: Ocean, t: float, origin: Point, depth: float, start: float) -> DiveCurrent:
        """Fly one dive from a time (s since the start) on."""
        before, took = self.place.copy(), DIVE * (1 + self.rng.uniform(-0.08, 0.08))
        loss, turn = self.errors(t)
        way = self.speed * (1 - loss) * heading_vectors(self.heading - turn)
        flow = np.zeros(2)
        for k in range(STEPS):
            here = (np.full(LEVELS, x) for x in (start + t + (k + 0.5) / STEPS * took, *self.place))
            u, v = ocean.current(*here, (np.arange(LEVELS) + 0.5) / LEVELS * depth)
            flow += np.array([u.mean(), v.mean()]) / STEPS
            self.place = self.place + (np.array([u.mean(), v.mean()]) + way) * took / STEPS
        found = flow + way - self.speed * heading_vectors(self.heading) + NOISE * self.rng.standard_normal(2)
        course = heading_vectors(self.heading)
        made = DiveCurrent(
            f"g{self.k}",
            _fix(start + t, before, origin),
            _fix(start + t + took, self.place, origin),
            float(found[0]),
            float(found[1]),
            course=(float(course[0]), float(course[1])),
            speed=self.speed,
        )
        self.flows[made.end.t] = flow
        if not self.job.one_way and np.hypot(*self.place) > ACROSS and self.place @ course > 0:
            self.heading = math.atan2(-self.place[0], -self.place[1]) + self.rng.uniform(-0.6, 0.6)
        return made


def _fix(t: float, place: Array, origin: Point) -> Fix:
    lat, lon = offset(origin, place[0], place[1])
    return Fix(t, float(lat), float(lon))


def currents_of(job: Job) -> tuple[float, list[DiveCurrent], dict[float, Array]]:
    """When a fleet begins (s), the currents that it measures, in the order of its surfacings, and the true
    flows of its first glider by the ends of its dives."""
    base = sea_mission(job.sea, job.seed, days=job.days)
    chance, rng = np.random.default_rng([job.seed, 17]), np.random.default_rng([job.seed, 3])
    end = base.start + (job.days + 1) * DAY
    ocean = make_ocean(base.sea, base.start - DAY, end, rng, lat=base.place.lat)
    heading, speed = chance.uniform(0, math.tau), chance.uniform(0.22, 0.38)
    out, truth = list[DiveCurrent](), dict[float, Array]()
    for k in range(job.gliders):
        glider = Glider(job, k, heading, speed)
        t = glider.rng.uniform(0, DIVE)
        while t < job.days * DAY - DIVE:
            out.append(glider.dive(ocean, t, base.place, base.depths[1], base.start))
            t = out[-1].end.t - base.start + UP
        truth = truth or glider.flows
    return base.start, sorted(out, key=lambda each: each.end.t), truth


# --------------------------------------------------------------------------- flow


def flow_errors(job: Job) -> list[tuple[float, ...]]:
    """Of each dive of the first glider from the third day on: distance of the nearest (m), squared errors a
    component of the others, of these fused with its own, of the mean so far, of the last; squared error over
    variance of the first two."""
    start, currents, truth = currents_of(job)
    own = [each for each in currents if each.glider == "g0"]
    out = []
    for k, dive in enumerate(own):
        if dive.end.t < start + 3 * DAY or k == 0:
            continue
        found = fleet_reference([c for c in currents if c.end.t <= dive.end.t], "g0")
        if found is None:
            continue
        past = np.array([[c.u, c.v] for c in own[:k]])
        flows = (found.others.flow, found.fused[0], past.mean(axis=0), past[-1])
        off = [truth[dive.end.t] - each for each in flows]
        covs = (found.others.cov, found.fused[1])
        nees = (float(e @ np.linalg.solve(cov, e)) / 2 for e, cov in zip(off, covs, strict=False))
        out.append((found.others.nearest, *(float(each @ each) / 2 for each in off), *nees))
    return out


def flow_table(jobs: list[Job], workers: int) -> Iterator[str]:
    """Lines of the table of errors."""
    with ProcessPoolExecutor(workers) as pool:
        results = list(zip(jobs, pool.map(flow_errors, jobs), strict=True))
    yield "                     dives  others  fused  own mean  own last  NEES  fused   (cm/s a component)"

    def line(name: str, rows: Array) -> str:
        a, b, c, d = 100 * np.sqrt(rows[:, 1:5].mean(axis=0))
        nees = rows[:, 5:].mean(axis=0)
        by = f"{a:6.1f}  {b:5.1f}  {c:8.1f}  {d:8.1f}"
        return f"{name:20} {len(rows):6d}  {by}  {nees[0]:4.1f}  {nees[1]:5.1f}"

    for n in dict.fromkeys(job.gliders for job in jobs):
        yield line(
            f"{n} gliders", np.array([row for job, found in results for row in found if job.gliders == n])
        )
    every = np.array([row for _, found in results for row in found])
    for low, high in ((0, 10e3), (10e3, 20e3), (20e3, 60e3)):
        part = every[(every[:, 0] >= low) & (every[:, 0] < high)]
        if len(part):
            yield line(f"nearest {low / 1e3:.0f} to {high / 1e3:.0f} km", part)
    for sea in dict.fromkeys(job.sea for job in jobs):
        yield line(sea, np.array([row for job, found in results for row in found if job.sea == sea]))


# --------------------------------------------------------------------------- faults


@dataclass(frozen=True)
class Result:
    """Hours after the onset at which the fault was told (None: it was not), what else was, and the
    glider-months looked at."""

    job: Job
    told: float | None
    false: tuple[str, ...]
    months: float


def told(job: Job) -> Result:
    """What comparisons at each surfacing of a fleet find."""
    start, currents, _ = currents_of(job)
    ill = start + job.onset * DAY if job.fault != "none" else math.inf
    when, false = None, dict[str, str]()
    for k, dive in enumerate(currents):
        if dive.end.t < start + 2 * DAY or dive.end.t > ill + TIME * HOUR:
            continue
        if job.first_only and (dive.glider != "g0" or dive.end.t < ill or when is not None):
            continue
        stands = standing(currents[: k + 1], dive.glider)
        found = None if stands is None else stands.fault
        if found is None:
            continue
        name, hours = f"{found.glider or 'all'}/{found.fault}", (dive.end.t - start) / HOUR
        if name == f"g0/{job.fault}" and dive.end.t > ill:
            when = (dive.end.t - ill) / HOUR if when is None else when
        else:
            false.setdefault(name, f"{hours:.0f} h {name} {found.size:.2f} ({found.ratio:.0f})")
    return Result(job, when, tuple(false.values()), job.gliders * (job.days - 2) / 30)


def fault_table(jobs: list[Job], workers: int) -> tuple[list[Result], list[str]]:
    """The results, and lines of their table."""
    with ProcessPoolExecutor(workers) as pool:
        results = list[Result]()
        for result in pool.map(told, jobs):
            results.append(result)
            print(f"{len(results)} of {len(jobs)}: {result}", flush=True)
    lines = ["fault   gliders  fleets  told in 48 h  median h  false  glider-months"]
    for fault, n in dict.fromkeys((job.fault, job.gliders) for job in jobs):
        same = [r for r in results if (r.job.fault, r.job.gliders) == (fault, n)]
        hours = [r.told for r in same if r.told is not None]
        median = f"{np.median(hours):8.0f}" if hours else "       -"
        false, months = sum(len(r.false) for r in same), sum(r.months for r in same)
        rest = "      -              -" if same[0].job.first_only else f"{false:5d}  {months:13.1f}"
        lines.append(f"{fault:6}  {n:7d}  {len(same):6d}  {len(hours):12d}  {median}  {rest}")
    return results, lines


def main() -> None:
    """Run, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["flow", "faults"])
    parser.add_argument("--seas", nargs="+", choices=list(SEAS), default=list(SEAS))
    parser.add_argument("--gliders", type=int, nargs="+", default=[2, 4, 8])
    parser.add_argument("--faults", nargs="+", default=["loss:0.4", "turn:0.3", "none"])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--days", type=float, default=8.0)
    parser.add_argument("--any-course", action="store_true")
    parser.add_argument("--first-only", action="store_true")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    print(machine())
    seeds, one_way = range(options.first, options.first + options.seeds), not options.any_course
    grid = list(product(options.gliders, options.seas, seeds))
    if options.what == "flow":
        for line in flow_table(
            [Job(sea, n, s, options.days, one_way=one_way) for n, sea, s in grid], options.workers
        ):
            print(line)
        return
    jobs = []
    for fault in options.faults:
        name, _, size = fault.partition(":")
        size_, only = float(size or 0), options.first_only
        jobs += [Job(sea, n, s, options.days, name, size_, 4.0, one_way, only) for n, sea, s in grid]
    results, lines = fault_table(jobs, options.workers)
    print("\n".join(lines))
    if options.json:
        options.json.write_text(json.dumps([asdict(result) for result in results]))


if __name__ == "__main__":
    main()
