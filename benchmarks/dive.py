"""What one dive costs: processor time of assessing it, and of all that a file leads to, beside a floor.

python benchmarks/dive.py [--data ../shared/data] [--seas rotary mixed] [--days 15] [--files 500 1000 2000]

Missions are decoded first, which is not counted. `assess` is `pipeline.process` alone; `in all` is that and
all the rest in one transaction: ledger, rules of health, silences and messages, the state file in memory. A
replay keeps few checkpoints, a daemon one after each file.
The floor is a fixed piece of work, some Python and some small arrays, done before and after in the same
run: ratios can be compared between machines, and between hours of a busy one. With `--files` a simulated
mission of so many files, and what the last hundred of them cost.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
from common import folder, machine, one_core
from month_sbd import write
from sea_runs import Flight, Job, fed, flight

from gliderwatch.model import Segment
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.score.measures import HEALTHY
from gliderwatch.service.replay import Request, replay
from gliderwatch.store.database import MEMORY
from gliderwatch.store.state_file import Store

LAST = 100
"""Files at the end of a long mission that are counted apart."""
KEPT = Path(__file__).resolve().parents[1] / "build" / "seas"


@dataclass(frozen=True)
class Cost:
    """Processor time (s) of a dive: ``assess`` alone, ``dive`` in all; of one of the ``last`` files, of any
    file in a ``replay`` and in a ``daemon``; and of the ``floor``."""

    assess: float
    dive: float
    last: float
    replay: float
    daemon: float
    floor: float


def floor() -> float:
    """Processor time (s) of a fixed piece of work: about a millisecond."""
    small, total = np.eye(4) + 0.1, 0.0
    begun = time.process_time()
    for k in range(100):
        total += float(np.linalg.inv(small)[0, 0]) + sum(i * 0.5 for i in range(k))
    return time.process_time() - begun


def cost(flown: Flight, runs: int) -> tuple[int, Cost]:
    """How many dives a mission has, and the median cost of one."""
    found = [_cost(flown) for _ in range(runs)]
    dives = found[0][0]
    return dives, Cost(*(median(getattr(c, name) for _, c in found) for name in Cost.__dataclass_fields__))


def _cost(flown: Flight) -> tuple[int, Cost]:
    before, dives, state = _floors(), set[float](), GliderState()
    begun = time.process_time()
    for segment in flown.segments:
        outcome = process(state, segment, GliderParams())
        state = outcome.state
        dives |= {a.t_dive for a in outcome.assessments}
    assess = time.process_time() - begun
    store = Store.open(MEMORY, durable=False)  # as a replay has it: few checkpoints
    split = max(len(flown.segments) - LAST, 0)
    begun = time.process_time()
    _take(store, flown, slice(None, split))
    middle = time.process_time()
    _take(store, flown, slice(split, None))
    ended = time.process_time()
    store.close()
    n, files = max(len(dives), 1), len(flown.segments)
    last = (ended - middle) / (files - split)
    store = Store.open(MEMORY)  # as a daemon has it: the state after each file
    kept = time.process_time()
    _take(store, flown, slice(None))
    daemon = (time.process_time() - kept) / files
    store.close()
    whole, floors = ended - begun, median([*before, *_floors()])
    return len(dives), Cost(assess / n, whole / n, last, whole / files, daemon, floors)


def _take(store: Store, flown: Flight, which: slice) -> None:
    some = Flight(flown.segments[which], flown.on_shore[which], ())
    if some.segments:
        list(fed(store, some, GliderParams()))


def _floors() -> list[float]:
    return [floor() for _ in range(30)]


def real(where: Path) -> Iterator[tuple[str, Flight]]:
    """The real missions of a folder, each as if its files had come as they ended."""
    for mission in sorted(path for path in where.iterdir() if (path / "cache").is_dir()):
        yield mission.name, _decoded(mission)


def _decoded(mission: Path) -> Flight:
    """The segments of a folder with its caches, as a replay keeps them."""
    store = replay(Request((mission,), (mission / "cache",))).store
    segments = [store.segments.get(each) for glider in store.gliders() for each in store.segments.of(glider)]
    store.close()
    return Flight(tuple(segments), tuple(_sent(s) for s in segments), ())


def _sent(segment: Segment) -> float:
    return max(segment.last_t, segment.id.opened_at) + 300.0


def long(files: Sequence[int]) -> Iterator[tuple[str, Flight]]:
    """Simulated missions of so many files."""
    for n in files:
        with folder() as where:
            write(where, n)
            yield f"{n} files", _decoded(where)


def missions(arguments: argparse.Namespace) -> Iterator[tuple[str, Flight]]:
    """All that is asked for."""
    if arguments.data.is_dir():
        yield from real(arguments.data)
    for sea in arguments.seas:
        yield sea, flight(Job(sea, 0, HEALTHY, arguments.days, KEPT))
    yield from long(arguments.files)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--seas", nargs="*", default=["rotary", "mixed"])
    parser.add_argument("--days", type=float, default=15.0)
    parser.add_argument("--files", nargs="*", type=int, default=[])
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    one_core()
    print(machine())
    for name, flown in missions(arguments):
        dives, c = cost(flown, arguments.runs)
        print(
            f"{name}: {len(flown.segments)} files, {dives} dives; a dive: assess {1000 * c.assess:.1f} ms "
            f"({c.assess / c.floor:.1f} floors), in all {1000 * c.dive:.1f} ms ({c.dive / c.floor:.1f}); "
            f"a file: replayed {1000 * c.replay:.1f} ms ({c.replay / c.floor:.1f}), by a daemon "
            f"{1000 * c.daemon:.1f} ms ({c.daemon / c.floor:.1f}), "
            f"one of the last {LAST} {1000 * c.last:.1f} ms ({c.last / c.floor:.1f}); "
            f"floor {1000 * c.floor:.2f} ms",
            flush=True,
        )


if __name__ == "__main__":
    main()
