"""Faults put onto healthy missions, real and simulated, through the whole pipeline.

python benchmarks/detection.py [--missions ../shared/data] [--moments 20]

For each mission: what is flagged after its first 12 hours as it is; then a part of the speed is lost to drag,
or the current is made wrong by 0.3 m/s, from random moments on, and the flags after that are counted. What
is said of a dive is what is known of it in the end. The last column says what an assessment costs (ms).
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
from common import machine
from flights import SEAS, read, various

from gliderwatch.model import Assessment, Flag, Kind, Segment, Unusable
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.score.graft import Graft, GraftKind, grafted, navigate, own_speeds
from gliderwatch.simulate.dockserver import write_mission
from gliderwatch.simulate.glider import simulate

HOUR, DAY = 3600.0, 86400.0
PARAMS = GliderParams()
FAULTS = {
    "lost 50 %": (Graft(GraftKind.SLOWED, 0.5), 2),
    "lost 30 %": (Graft(GraftKind.SLOWED, 0.3), 4),
    "DAC + 0.3": (Graft(GraftKind.DAC_WRONG, 0.3), 1),
    "DAC - 0.3": (Graft(GraftKind.DAC_WRONG, -0.3), 1),
}
"""Each fault, and within how many surfacings it should be told."""


@dataclass
class Told:
    """All that a run of segments says: assessments by start of dive (s), anomalies that were opened (s)."""

    dives: dict[float, Assessment] = field(default_factory=dict)
    anomalies: set[float] = field(default_factory=set)

    def after(self, t: float) -> list[Assessment]:
        """The dives that surfaced after a time (s) and are known to have ended, in order."""
        dives = [self.dives[at] for at in sorted(self.dives)]
        return [a for a in dives if a.t_surface > t and a.unusable is not Unusable.NOT_SURFACED]


@dataclass(frozen=True)
class Row:
    """One mission: flags after 12 h with reasons, faults found of tried, healthy gliders blamed, cost (s)."""

    name: str
    flags: Counter[int | None]
    anomalies: int
    reasons: list[str]
    found: dict[str, list[int]]
    wolves: int
    cost: float


def fold(states: list[GliderState], told: Told, segments: Iterable[Segment]) -> None:
    """Run segments from the last of some states on; each state after is appended."""
    for segment in segments:
        outcome = process(states[-1], segment, PARAMS)
        states.append(outcome.state)
        told.dives = {t: a for t, a in told.dives.items() if t < outcome.since}
        told.dives |= {a.t_dive: a for a in outcome.assessments}
        told.anomalies = {t for t in told.anomalies if t <= outcome.since}
        told.anomalies |= {i.opened_at for i in outcome.incidents if i.kind is Kind.ANOMALY}


def examined(name: str, segments: Sequence[Segment], moments: int) -> Row:
    """A mission as it is, and with each of the faults from random moments on."""
    states, healthy = [GliderState()], Told()
    begun = time.perf_counter()
    fold(states, healthy, segments)
    cost = (time.perf_counter() - begun) / max(len(healthy.dives), 1)
    dives = navigate(segments)
    late = dives[0].t_dive + 12 * HOUR
    ends = [d.t_surface for d in dives]
    usual = median(own_speeds(dives).values())
    rng = np.random.default_rng(1)
    onsets = np.sort(rng.uniform(late, max(ends[-3], late + 1), moments))
    found: dict[str, list[int]] = {each: [0, 0] for each in FAULTS}
    wolves = 0
    for onset in onsets.tolist():
        for each, (graft, within) in FAULTS.items():
            count, wolf = _tried(segments, states, healthy, graft, onset, usual, within)
            found[each][0] += count[0]
            found[each][1] += count[1]
            wolves += wolf
    told = healthy.after(late)
    return Row(
        name,
        Counter(a.flag for a in told),
        sum(t > late for t in healthy.anomalies),
        [f"flag {a.flag} at {(a.t_dive - ends[0]) / HOUR:.0f} h: {a.reason}" for a in told if a.flag],
        found,
        wolves,
        cost,
    )


def _tried(
    segments: Sequence[Segment],
    states: Sequence[GliderState],
    healthy: Told,
    graft: Graft,
    onset: float,
    usual: float,
    within: int,
) -> tuple[tuple[int, int], int]:
    """Successes and trials, and whether a healthy glider with a wrong current got flag 1."""
    changed = grafted(segments, graft, onset, usual)
    # a segment that was opened before the onset may hold a part of it
    first = max(bisect_left([s.id.opened_at for s in segments], onset) - 1, 0)
    told = Told(dict(healthy.dives), set())
    begun = [states[first]]
    fold(begun, told, changed[first:])
    if graft.kind is GraftKind.SLOWED:
        flags = [a.flag for a in told.after(onset)[:within]]
        return (int(Flag.ANOMALY in flags), 1), 0
    # a current that is changed to the left of the way is wrong on all dives that began after the onset
    wrong = [a for a in told.after(onset) if a.t_dive > onset and a.reference_u is not None][:8]
    seen = [a for a in wrong if a.flag is not None]
    return (sum(a.flag == 2 for a in seen), len(seen)), int(any(a.flag == 1 for a in wrong))


def simulated(gliders: int) -> Iterator[tuple[str, list[Segment]]]:
    """Healthy gliders in all seas and on all ways."""
    for name, scenario in various(gliders):
        with TemporaryDirectory(prefix="gliderwatch-benchmark-") as folder:
            write_mission(Path(folder) / "gliders", Path(folder) / "cache", simulate(scenario))
            yield name, read(Path(folder) / "gliders", Path(folder) / "cache")


def _simulated(job: tuple[int, int, int]) -> list[Row]:
    part, gliders, moments = job
    mine = [each for i, each in enumerate(simulated(gliders)) if i % 2 == part]
    return [examined(name, segments, moments) for name, segments in mine]


def _real(job: tuple[Path, int]) -> Row:
    mission, moments = job
    return examined(mission.name, read(mission / "from-glider", mission / "cache"), moments)


def shown(name: str, rows: Sequence[Row]) -> str:
    """One line of the table."""
    flags: Counter[int | None] = sum((r.flags for r in rows), Counter())
    cells = [f"{name:14s} {flags.total():5d} {flags[1]:4d} {flags[2]:4d} {flags[None]:4d}"]
    cells.append(f"{sum(r.anomalies for r in rows):5d}")
    for each in FAULTS:
        count, total = (sum(r.found[each][i] for r in rows) for i in (0, 1))
        cells.append(f"{count:4d}/{total:<4d} {100 * count / max(total, 1):4.0f}%")
    return " ".join(
        [
            *cells,
            f"{sum(r.wolves for r in rows):5d}",
            f"{1e3 * max((r.cost for r in rows), default=0.0):6.1f}",
        ]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--missions", type=Path, default=Path(__file__).parents[2] / "shared" / "data")
    parser.add_argument("--moments", type=int, default=20)
    parser.add_argument("--gliders", type=int, default=1, help="simulated, in each sea and on each way")
    arguments = parser.parse_args()
    print(machine())
    found = arguments.missions.iterdir() if arguments.missions.is_dir() else []
    missions = sorted(p for p in found if (p / "from-glider").is_dir())
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=2, mp_context=context) as pool:
        real = pool.map(_real, [(mission, arguments.moments) for mission in missions])
        made = pool.map(_simulated, [(part, arguments.gliders, arguments.moments) for part in (0, 1)])
        print(f"{'after 12 h':14s} dives   f1   f2 none alerts  " + "  ".join(FAULTS) + "  f1!  ms/dive")
        rows = list(real)
        for row in rows:
            print(shown(row.name, [row]))
            for reason in row.reasons:
                print(f"    {reason}")
        print(shown("all real", rows))
        everything = [row for part in made for row in part]
        for sea in SEAS if everything else ():
            print(shown(sea, [r for r in everything if r.name.startswith(sea)]))
        if everything:
            print(shown("all simulated", everything))


if __name__ == "__main__":
    main()
