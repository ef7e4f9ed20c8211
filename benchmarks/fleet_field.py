"""The experiment of paper 003: a fleet maps the temperature of a box of the sea, and decides where to look.

    python benchmarks/fleet_field.py [--gliders 1 5 10 15 20] [--hours 1 2 3] [--days 7] [--seeds 1]
        [--methods pooled consensus literal] [--rates 180 360] [--workers 2] [--figure field.png]
        [--json field.json]

Gliders fly at 0.6 m/s and a pitch of 26 degrees, up and down through a box of 60 x 60 km and 100 m, and come
up after a time that is uniform about `hours`, 15 min more or less. The sea is
`gliderwatch.simulate.stand_in`. At each surfacing a glider hands over its samples, and flies on where the
gradient of the mean variance leads (003 eqs. 8 to 12); at the walls it turns back. Three ways to put together
what the gliders know:

- pooled: the samples go to one field, as `gliderwatch.fleet` does it;
- consensus: each glider and the relay have a field of their own, with the same filter; at each contact they
  take Metropolis averages of (D, g) (003 eqs. 5 to 7);
- literal: the same with the filter as 003 has it.

Told is the relative error of the relay's field (rms error over rms of the field) on a grid of 30 x 30 x 30, a
seventh of it, and NEES (mean of squared error over variance: 1 is honest, more is overconfident).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from statistics import mean

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the workers are the threads

import numpy as np
from common import machine

from gliderwatch.fleet import scalar_field
from gliderwatch.fleet.advice import gradient
from gliderwatch.fleet.constants import INFORMATION_RATE
from gliderwatch.fleet.scalar_field import (
    BIN,
    Batch,
    Checkpoint,
    FieldParams,
    Information,
    at,
    elapse,
    inverse,
    prior,
    rows,
    run,
    sample_variance,
    update,
)
from gliderwatch.model import Array
from gliderwatch.papers.consensus import agree, metropolis
from gliderwatch.simulate import stand_in

METHODS = ("pooled", "consensus", "literal")
HOUR, DAY = 3600.0, 86400.0
SPEED, PITCH, STEP, JITTER, NOISE = 0.6, math.radians(26.0), 30.0, 900.0, 0.03
ACROSS = SPEED * math.cos(PITCH) / stand_in.SIDE
DOWN = SPEED * math.sin(PITCH) / stand_in.DEPTH
PAIR = metropolis(~np.eye(2, dtype=bool))
SETTLED = 24.0


@dataclass(frozen=True)
class Cell:
    """One experiment: a fleet, how often it comes up (h), for how many days, who puts it together, chance,
    and what samples count (`INFORMATION_RATE`)."""

    gliders: int
    hours: float
    days: int
    method: str
    seed: int
    rate: float = INFORMATION_RATE


@dataclass(frozen=True)
class Result:
    """What came of it: relative errors and NEES at ``t`` (h)."""

    cell: Cell
    t: tuple[float, ...]
    error: tuple[float, ...]
    nees: tuple[float, ...]

    @property
    def settled(self) -> tuple[float, float]:
        """Means of error and NEES from the first day on."""
        late = [k for k, t in enumerate(self.t) if t >= SETTLED]
        return mean(self.error[k] for k in late), mean(self.nees[k] for k in late)


class Glider:
    """One glider under way: where it was last up, when, and its heading."""

    def __init__(self, name: str, rng: np.random.Generator) -> None:
        self.name, self.rng = name, rng
        self.place, self.t, self.heading = rng.uniform(0, 1, 2), 0.0, rng.uniform(0, math.tau)

    def fly(self, until: float) -> Batch:
        """The samples to a time (s), one in `STEP`; then it is up there."""
        t = np.append(np.arange(self.t + STEP, until, STEP), until)
        way = ACROSS * (t - self.t)[:, None] * np.array([np.sin(self.heading), np.cos(self.heading)])
        place = _reflected(np.column_stack([self.place + way, DOWN * (t - self.t)]))
        value = stand_in.temperature(place, t) + NOISE * self.rng.standard_normal(len(t))
        self.place, self.t = place[-1, :2], until
        return Batch(f"{self.name}-{until:.0f}", self.name, t, place, value, np.full(len(t), STEP))


class Pooled:
    """All samples in one field."""

    def __init__(self, params: FieldParams) -> None:
        self.params, self.batches, self.kept = params, list[Batch](), list[Checkpoint]()

    def meet(self, batch: Batch) -> Information:
        """Take what a glider hands over; what is known after it."""
        first = math.floor(batch.t[0] / BIN)
        self.kept = [kept for kept in self.kept if kept.bin < first]
        self.batches = [b for b in self.batches if b.t[-1] > batch.t[-1] - 12 * HOUR] + [batch]
        self.kept += run(self.kept[-1] if self.kept else None, self.batches, self.params)
        return self.kept[-1].known

    def at(self, t: float) -> Information:
        """What is known at a time (s)."""
        return at(self.kept[-1], t, self.params)


class Nodes:
    """A field a glider and one of the relay, which meet at surfacings."""

    def __init__(self, params: FieldParams) -> None:
        self.params, self.known = params, dict[str, tuple[float, Information]]()

    def _of(self, node: str, t: float) -> Information:
        before, known = self.known.get(node, (0.0, prior(self.params)))
        return elapse(known, t - before, self.params)

    def meet(self, batch: Batch) -> Information:
        """Put a glider's samples into its field, let it and the relay agree; what the glider knows then."""
        t = float(batch.t[-1])
        phi, variance = rows(batch.place, self.params), sample_variance(batch.stand, self.params)
        own = update(self._of(batch.glider, t), phi, batch.value - self.params.mean, variance)
        relay = self._of("relay", t)
        d, g = agree((own.d, relay.d), (own.g, relay.g), PAIR)
        self.known[batch.glider] = t, Information(d[0], g[0])
        self.known["relay"] = t, Information(d[1], g[1])
        return self.known[batch.glider][1]

    def at(self, t: float) -> Information:
        """What the relay knows at a time (s)."""
        return self._of("relay", t)


def experiment(cell: Cell) -> Result:
    """Fly one experiment."""
    scalar_field.INFORMATION_RATE = cell.rate  # this process is of the benchmark alone
    params = FieldParams("literal") if cell.method == "literal" else FieldParams()
    field = Pooled(params) if cell.method == "pooled" else Nodes(params)
    rng = np.random.default_rng([cell.seed, cell.gliders])
    fleet = [Glider(f"g{k}", np.random.default_rng([cell.seed, k])) for k in range(cell.gliders)]
    due = rng.uniform(0.3, 1.0, cell.gliders) * cell.hours * HOUR
    scored = list[tuple[float, float, float]]()
    for t in np.arange(6.0, cell.days * 24 + 1, 6.0) * HOUR:
        while due.min() < t:
            k = int(due.argmin())
            known = field.meet(fleet[k].fly(float(due[k])))
            east, north = gradient(inverse(known.d), fleet[k].place, params)
            fleet[k].heading = math.atan2(east, north)
            due[k] += cell.hours * HOUR + rng.uniform(-JITTER, JITTER)
        scored.append((float(t) / HOUR, *score(field.at(float(t)), float(t), params)))
    times, errors, nees = zip(*scored, strict=True)
    return Result(cell, times, errors, nees)


def score(known: Information, t: float, params: FieldParams) -> tuple[float, float]:
    """Relative error and NEES of a field at a time (s)."""
    axis = np.linspace(0, 1, 30)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)[::7]
    truth = stand_in.temperature(grid, t)
    mean_, cov = known.coefficients()
    phi = rows(grid, params)
    off = phi @ mean_ + params.mean - truth
    variance = np.einsum("ni,ni->n", phi @ cov, phi)
    return float(np.sqrt(np.mean(off**2) / np.mean(truth**2))), float(np.mean(off**2 / variance))


def _reflected(place: Array) -> Array:
    """Coordinates brought back into the box, as by mirrors at its walls."""
    return np.asarray(1 - np.abs(place % 2.0 - 1.0))


def table(results: Sequence[Result]) -> Iterator[str]:
    """Lines of a table, a mean over seeds each."""
    yield "method     gliders  hours  rate  error 24 h   at the end   24 h on    NEES 24 h on"

    def of(r: Result) -> tuple[str, int, float, float]:
        return r.cell.method, r.cell.gliders, r.cell.hours, r.cell.rate

    for method, gliders, hours, rate in dict.fromkeys(map(of, results)):
        same = [r for r in results if of(r) == (method, gliders, hours, rate)]
        day = mean(r.error[r.t.index(SETTLED)] for r in same)
        end, (late, nees) = mean(r.error[-1] for r in same), np.mean([r.settled for r in same], axis=0)
        of_cell = f"{method:9}  {gliders:7d}  {hours:5.1f}  {rate:4.0f}"
        yield f"{of_cell}  {day:10.3f}  {end:11.3f}  {late:8.3f}  {nees:13.2f}"


def draw(results: Sequence[Result], path: Path) -> None:
    """The figure like 003 Fig. 5b: rms error over time, a column a method, a row for how often they come up,
    a line a fleet."""
    import matplotlib.pyplot as plt  # noqa: PLC0415 (only where a figure is wanted)

    methods = list(dict.fromkeys(r.cell.method for r in results))
    rows = sorted({r.cell.hours for r in results})
    size = (3.4 * len(methods), 2.4 * len(rows) + 0.6)
    figure, axes = plt.subplots(
        len(rows), len(methods), figsize=size, sharex=True, sharey=True, squeeze=False
    )
    for (row, hours), (column, method) in product(enumerate(rows), enumerate(methods)):
        axis = axes[row][column]
        for r in results:
            if (r.cell.method, r.cell.hours, r.cell.seed) == (method, hours, results[0].cell.seed):
                axis.plot(np.array(r.t) / 24, r.error, label=f"{r.cell.gliders}")
        axis.axhline(0.1, color="0.6", lw=0.8, ls=":")
        axis.set(ylim=(0, 0.6), title=f"{method}, every {hours:g} h")
        axis.set_xlabel("days" if row == len(rows) - 1 else "")
        axis.set_ylabel("relative error" if column == 0 else "")
    axes[0][-1].legend(fontsize=7, title="gliders", title_fontsize=7)
    figure.tight_layout()
    plt.rcParams["svg.hashsalt"] = "gliderwatch"  # the same figure is the same file
    figure.savefig(path, dpi=110, metadata={"Date": None} if path.suffix == ".svg" else None)


def main() -> None:
    """Fly all cells, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gliders", type=int, nargs="+", default=[1, 5, 10, 15, 20])
    parser.add_argument("--hours", type=float, nargs="+", default=[1.0, 2.0, 3.0])
    parser.add_argument("--days", type=int, default=7)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--rates", type=float, nargs="+", default=[INFORMATION_RATE])
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    cells = [
        Cell(n, hours, options.days, method, seed, rate)
        for method, hours, n, seed, rate in product(
            options.methods, options.hours, options.gliders, range(options.seeds), options.rates
        )
    ]
    print(machine())
    results = list[Result]()
    with ProcessPoolExecutor(options.workers) as pool:
        for result in pool.map(experiment, cells):
            results.append(result)
            print(f"{len(results)} of {len(cells)}: {result.cell}", file=sys.stderr)
    print("\n".join(table(results)))
    if options.json:
        options.json.write_text(json.dumps([asdict(result) for result in results]))
    if options.figure:
        draw(results, options.figure)


if __name__ == "__main__":
    main()
