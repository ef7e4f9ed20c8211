"""Real missions with some of their sensors left out: what is still judged, and what is told of lost speed.

python benchmarks/sensors.py [--missions ../shared/data] [--moments 6] [--workers 2] [--json out.json]
                             [--tides rotary diurnal] [--seeds 3]

For each mission and each set of sensors left out (`gliderwatch.score.sensors`): the part of dives that
ended that is judged, and the messages about a healthy glider, of which all are false. Then half (x 0.5) or
three tenths (x 0.7) of the speed are lost to drag from evenly spaced moments on; counted is what is told by
an anomaly that opens within 2 and 4 surfacings, and in the end. With `--tides` each mission is flown in
the tides of these kinds of sea (`gliderwatch.score.tides`), once for each seed.
"""

from __future__ import annotations

import argparse
import multiprocessing
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import msgspec
import numpy as np
from common import machine
from flights import read

from gliderwatch.model import Assessment, Kind, Segment, Unusable
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.score.graft import Graft, GraftKind, grafted, navigate, own_speeds
from gliderwatch.score.sensors import LEFT_OUT, is_sent, left_out
from gliderwatch.score.tides import TIDAL, in_tide

HOUR = 3600.0
PARAMS = GliderParams()
DRAGS = {"x 0.5": (Graft(GraftKind.SLOWED, 0.5), 2), "x 0.7": (Graft(GraftKind.SLOWED, 0.3), 4)}
"""Speed that is left, and within how many surfacings the loss is to be told."""
SETTLED = 12.0
"""Hours from the start after which faults begin."""


@dataclass
class Told:
    """What is known of dives, by their start (s), and what was opened: kind and surfacing (s)."""

    dives: dict[float, Assessment] = field(default_factory=dict)
    opened: set[tuple[str, float]] = field(default_factory=set)

    def ended(self) -> list[Assessment]:
        """The dives that have ended, in order."""
        return [a for t, a in sorted(self.dives.items()) if a.unusable is not Unusable.NOT_SURFACED]


@dataclass(frozen=True)
class Drag:
    """Of ``moments`` at which a drag begins: told ``in_time`` and told at all; median surfacings."""

    moments: int
    in_time: int
    told: int
    surfacings: float


@dataclass(frozen=True)
class Job:
    """A mission to run without some sensors, in the tide of a ``sea`` (empty: none) of a seed."""

    mission: Path
    without: str
    moments: int
    sea: str = ""
    seed: int = 0


@dataclass(frozen=True)
class Row:
    """A mission without some sensors: dives that ended, the judged ones, incidents opened of each kind, flags
    1 and 2 among the dives; and of each drag."""

    mission: str
    without: str
    dives: int
    judged: int
    opened: dict[str, int]
    flags: dict[int, int]
    drags: dict[str, Drag]


def fold(states: list[GliderState], told: Told, segments: Iterable[Segment]) -> None:
    """Run segments from the last of some states on; each state after is appended. What opened once counts,
    even if it is taken back with the next file: it was told."""
    for segment in segments:
        outcome = process(states[-1], segment, PARAMS)
        states.append(outcome.state)
        told.dives = {t: a for t, a in told.dives.items() if t < outcome.since}
        told.dives |= {a.t_dive: a for a in outcome.assessments}
        told.opened |= {(str(i.kind), i.opened_at) for i in outcome.incidents}


def examined(mission: str, segments: Sequence[Segment], without: str, moments: int) -> Row:
    """A mission without some sensors, as it is, and with drag from some moments on."""
    gone = LEFT_OUT[without]
    states, as_it_is = [GliderState()], Told()
    fold(states, as_it_is, left_out(segments, gone))
    dives = navigate(segments)
    usual = median(own_speeds(dives).values())
    first, last = dives[0].t_dive + SETTLED * HOUR, dives[-5].t_surface
    onsets = np.linspace(first, max(last, first), moments).tolist()
    ended = as_it_is.ended()
    return Row(
        mission,
        without,
        len(ended),
        sum(a.flag is not None for a in ended),
        dict(Counter(kind for kind, _ in as_it_is.opened)),
        dict(Counter(int(a.flag) for a in ended if a.flag)),
        {
            name: _dragged(segments, states, as_it_is, gone, graft, within, onsets, usual)
            for name, (graft, within) in DRAGS.items()
        },
    )


def _dragged(
    segments: Sequence[Segment],
    states: Sequence[GliderState],
    healthy: Told,
    gone: Sequence[str],
    graft: Graft,
    within: int,
    onsets: Sequence[float],
    usual: float,
) -> Drag:
    ends = [dive.t_surface for dive in navigate(segments)]
    counts = []
    for onset in onsets:
        changed = left_out(grafted(segments, graft, onset, usual), gone)
        # a segment that was opened before the onset may hold a part of it
        first = max(bisect_left([s.id.opened_at for s in segments], onset) - 1, 0)
        told = Told(dict(healthy.dives))
        fold([states[first]], told, changed[first:])
        opened = [at for kind, at in told.opened if kind == Kind.ANOMALY and at > onset]
        later = [t for t in ends if t > onset]
        counts.append(next((i + 1 for i, t in enumerate(later) if t >= min(opened)), 0) if opened else 0)
    return Drag(
        len(counts),
        sum(0 < n <= within for n in counts),
        sum(n > 0 for n in counts),
        median([n or np.inf for n in counts]),
    )


def work(job: Job) -> Row | None:
    """One mission without some sensors; None where it never had them."""
    segments = read(job.mission / "from-glider", job.mission / "cache")
    if not is_sent(segments, LEFT_OUT[job.without]):
        return None
    if not job.sea:
        return examined(job.mission.name, segments, job.without, job.moments)
    name = f"{job.mission.name} {job.sea} {job.seed}"
    return examined(name, in_tide(segments, job.sea, job.seed), job.without, job.moments)


def shown(row: Row) -> str:
    """One line of the table."""
    drags = [f"{d.in_time:2d} {d.told:2d} of {d.moments:2d} {d.surfacings:4.0f}" for d in row.drags.values()]
    opened = ", ".join(f"{n} {kind}" for kind, n in sorted(row.opened.items())) or "-"
    return (
        f"{row.mission:28s} {row.without:15s} {row.dives:4d} {100 * row.judged / max(row.dives, 1):4.0f}% "
        f"{row.flags.get(1, 0):3d} {row.flags.get(2, 0):3d}  " + "  ".join(drags) + f"  {opened}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--missions", type=Path, default=Path(__file__).parents[2] / "shared" / "data")
    parser.add_argument("--moments", type=int, default=6)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="*", help="these missions alone")
    parser.add_argument("--without", nargs="*", choices=list(LEFT_OUT), help="these sets of sensors alone")
    parser.add_argument("--tides", nargs="*", choices=TIDAL, default=[], help="in these kinds of sea")
    parser.add_argument("--seeds", type=int, default=1, help="tides of each kind")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    print(machine())
    missions = sorted(p for p in arguments.missions.iterdir() if (p / "from-glider").is_dir())
    jobs = [
        Job(mission, without, arguments.moments, sea, seed)
        for mission in missions
        if arguments.only is None or mission.name in arguments.only
        for without in arguments.without or LEFT_OUT
        for sea in arguments.tides or [""]
        for seed in range(arguments.seeds if sea else 1)
    ]
    print("drags: told within 2 (x 0.5), 4 (x 0.7) surfacings, told at all, of moments, median surfacings")
    print(
        f"{'mission':28s} {'left out':15s}  n   judged f1  f2  "
        + "  ".join(f"{name:16s}" for name in DRAGS)
        + " incidents of the healthy glider"
    )
    rows = []
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=arguments.workers, mp_context=context) as pool:
        for row in pool.map(work, jobs):
            if row is not None:
                rows.append(row)
                print(shown(row), flush=True)
    if arguments.json:
        arguments.json.write_bytes(msgspec.json.format(msgspec.json.encode(rows), indent=1))


if __name__ == "__main__":
    main()
