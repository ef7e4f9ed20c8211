"""Healthy and faulty gliders in every kind of sea (`gliderwatch.simulate.seas`), through the whole program.

python benchmarks/seas.py --quick [--workers 2] [--seas mixed rotary] [--json out.json]

For each kind of sea and each seed a healthy glider of 30 days, and faults that begin on day 6 and are
followed for 15 days. Missions are simulated once, written as files, read again and kept in `build/seas`; so
a run after a change of the estimator assesses them anew and does nothing else. Results are kept as well,
each as it comes: a run that was stopped goes on where it was, as long as the program is the same.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from statistics import mean, median

from common import machine
from sea_runs import AS_IT_IS, FAULTS, SETTLED, Job, Manner, Message, Result, as_json, result

from gliderwatch.model import Kind
from gliderwatch.score.measures import HEALTHY, DiveResult
from gliderwatch.simulate.seas import SEAS

MONTH, DAY, HOUR = 30 * 24.0, 86400.0, 3600.0
THREE_HOURS = (2.5, 4.0)
"""Hours from surfacing to surfacing of a dive of some three."""
TIME = 15 * 24.0
"""Hours in which a fault is to be told."""
_INCIDENTS = (Kind.ANOMALY, Kind.FALSE_ALARM)


@dataclass(frozen=True)
class Healthy:
    """What is said of healthy gliders in one kind of sea.

    Messages are per glider-month: ``unknown`` those that nothing could be judged, ``all_kinds`` all.
    ``judged`` is the part of dives with a flag; ``rms`` (m/s) and ``inside`` (part in the 95 % interval) are
    of speeds from day 3; ``miss`` (km) and ``covered`` of the places, ``late_covered`` of the times in the
    ``forecasts`` of dives of three hours. ``cost`` (ms) is of a dive.
    """

    sea: str
    months: float
    anomalies: float
    false_alarms: float
    unknown: float
    all_kinds: float
    judged: float
    rms: float
    inside: float
    forecasts: int
    miss: float
    covered: float
    late_covered: float
    cost: float


@dataclass(frozen=True)
class Faulty:
    """What is said of a fault in one kind of sea.

    ``told`` is the part told as what it is within 15 days, by an incident that opens, ``otherwise`` the part
    told as something else (as well); ``delay`` (h) is the median, infinite where most are not told. An
    incident that was open before by mistake, and hides the fault, does not count. Of the messages in two days
    and in fifteen the mean and the most.
    """

    sea: str
    fault: str
    gliders: int
    told: float
    otherwise: float
    delay: float
    two_days: float
    two_days_most: int
    fifteen_days: float
    fifteen_days_most: int


# --------------------------------------------------------------------------- measures


def healthy(sea: str, results: Sequence[Result]) -> Healthy:
    """The measures of the healthy gliders of a sea."""
    months = sum(r.hours for r in results) / MONTH
    kinds = Counter(m.kind for r in results for m in r.messages)
    dives = [d for r in results for d in r.dives]
    late = [d for r in results for d in r.dives if d.t_dive >= r.start + SETTLED * DAY]
    errors = [(d.speed - d.true_speed, d.sigma) for d in _compared(late)]
    known = [abs(e) <= 1.96 * s for e, s in errors if s is not None]
    coming = [n for r in results for n in r.next if THREE_HOURS[0] <= n.hours <= THREE_HOURS[1]]
    costs = [r.cost for r in results if r.cost]
    return Healthy(
        sea,
        months,
        kinds[Kind.ANOMALY] / months,
        kinds[Kind.FALSE_ALARM] / months,
        kinds["unknown"] / months,
        kinds.total() / months,
        _mean(d.flag is not None for d in dives),
        math.sqrt(_mean(e * e for e, _ in errors)),
        _mean(known),
        len(coming),
        _mean(n.miss / 1e3 for n in coming),
        _mean(n.in_ellipse for n in coming),
        _mean(n.in_time for n in coming),
        1e3 * max(costs, default=math.nan),
    )


def _compared(dives: Iterable[DiveResult]) -> Iterator[DiveResult]:
    return (d for d in dives if d.flag is not None and d.speed is not None and d.true_speed is not None)


def faulty(sea: str, fault: str, results: Sequence[Result]) -> Faulty:
    """The measures of one fault in a sea."""
    delays = [_delay(r) for r in results]
    two, fifteen = ([_count(r, hours) for r in results] for hours in (48.0, TIME))
    return Faulty(
        sea,
        fault,
        len(results),
        _mean(math.isfinite(d) for d in delays),
        _mean(
            any(m.kind in _INCIDENTS and m.kind != AS_IT_IS[fault] for m in _after(r, TIME)) for r in results
        ),
        median(delays) if delays else math.nan,
        _mean(two),
        max(two, default=0),
        _mean(fifteen),
        max(fifteen, default=0),
    )


def _after(result: Result, hours: float) -> list[Message]:
    """The messages since the fault began."""
    assert result.onset is not None
    return [m for m in result.messages if result.onset <= m.hours <= result.onset + hours]


def _count(result: Result, hours: float) -> int:
    return len(_after(result, hours))


def _delay(result: Result) -> float:
    """Hours from the begin of the fault until it was told as what it is; infinite: never."""
    assert result.onset is not None
    right = (m.told - result.onset for m in _after(result, TIME) if m.kind == AS_IT_IS[result.fault])
    return next(right, math.inf)


def _mean(values: Iterable[float]) -> float:
    every = [float(v) for v in values]
    return mean(every) if every else math.nan


# --------------------------------------------------------------------------- tables


def tables(results: Sequence[Result]) -> tuple[list[Healthy], list[Faulty]]:
    """The measures of all seas, and of all together (`all`)."""
    seas = [s for s in SEAS if any(r.sea == s for r in results)]
    well, ill = [], []
    for sea in (*seas, "all"):
        mine = [r for r in results if sea in (r.sea, "all")]
        if sound := [r for r in mine if r.fault == HEALTHY]:
            well.append(healthy(sea, sound))
        ill += [
            faulty(sea, fault, found) for fault in FAULTS if (found := [r for r in mine if r.fault == fault])
        ]
    return well, ill


def shown(well: Sequence[Healthy], ill: Sequence[Faulty]) -> Iterator[str]:
    """The tables as lines."""
    yield "healthy, messages a glider-month; speed and forecasts (dives of 3 h) from day 3"
    yield f"{'sea':13s} months anomal flag2 unknwn    all judged  rms cm/s in95   n3h miss km  cover time ms"
    for h in well:
        yield (
            f"{h.sea:13s} {h.months:6.1f} {h.anomalies:6.2f} {h.false_alarms:5.2f} {h.unknown:6.2f} "
            f"{h.all_kinds:6.2f} {_part(h.judged)} {100 * h.rms:9.2f} {_part(h.inside)} {h.forecasts:5d} "
            f"{h.miss:7.2f}  {_part(h.covered)} {_part(h.late_covered)} {h.cost:7.1f}"
        )
    yield ""
    yield "fault on day 6: told as what it is within 15 days, median delay; told as something else; messages"
    yield f"{'sea':13s} {'fault':10s}  n  told  delay h other  48 h mean most  15 d mean most"
    for f in ill:
        yield (
            f"{f.sea:13s} {f.fault:10s} {f.gliders:2d} {_part(f.told)} {f.delay:8.1f} {_part(f.otherwise)} "
            f"{f.two_days:9.1f} {f.two_days_most:4d} {f.fifteen_days:10.1f} {f.fifteen_days_most:4d}"
        )


def _part(value: float) -> str:
    return f"{100 * value:4.0f}%" if math.isfinite(value) else "    -"


def told(results: Iterable[Result]) -> Iterator[str]:
    """Every message of healthy gliders, and of those with a fault that was not told as what it is."""
    for r in results:
        is_missed = r.fault != HEALTHY and not math.isfinite(_delay(r))
        for m in r.messages if r.fault == HEALTHY or is_missed else ():
            yield f"    {r.sea} {r.seed} {r.fault}: {m.hours:.0f} h, {m.kind}: {m.title}"
        if is_missed and not r.messages:
            yield f"    {r.sea} {r.seed} {r.fault}: nothing was told"


# --------------------------------------------------------------------------- the command


def jobs(arguments: argparse.Namespace) -> list[Job]:
    """All gliders of a run: of the quick one a fault befalls one seed, in turn."""
    seeds, first = arguments.seeds or (2 if arguments.quick else 6), arguments.first
    seas = arguments.seas or list(SEAS)
    found = [
        Job(sea, first + seed, fault, arguments.days, arguments.kept)
        for seed in range(seeds)  # seeds outside: a part of a run has all seas in it
        for i, sea in enumerate(seas)
        for j, fault in enumerate((HEALTHY, *FAULTS))
        if fault == HEALTHY or not arguments.quick or (i + j - 1) % seeds == seed
    ]
    wanted = arguments.only
    return [job for job in found if wanted is None or job.fault in wanted]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="2 seeds a sea, each fault in one of them")
    parser.add_argument("--seas", nargs="*", choices=list(SEAS), help="these kinds of sea alone")
    parser.add_argument("--only", nargs="*", choices=[HEALTHY, *FAULTS], help="these faults alone")
    parser.add_argument("--seeds", type=int, help="gliders a sea (6; quick: 2)")
    parser.add_argument("--first", type=int, default=0, help="first seed: others than were calibrated with")
    parser.add_argument("--days", type=float, default=30.0, help="of healthy gliders")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--direct", action="store_true", help="write no checkpoints: half of the time")
    parser.add_argument("--bare", action="store_true", help="incidents alone, no messages: a quarter of it")
    parser.add_argument("--told", action="store_true", help="every message that should not be")
    parser.add_argument("--json", type=Path, help="all measures and all that was told")
    parser.add_argument("--kept", type=Path, default=Path(__file__).parents[1] / "build" / "seas")
    arguments = parser.parse_args()
    begun, context = time.monotonic(), multiprocessing.get_context("spawn")
    print(machine())
    results = list[Result]()
    with ProcessPoolExecutor(max_workers=arguments.workers, mp_context=context) as pool:
        try:
            manner = Manner.BARE if arguments.bare else Manner.DIRECT if arguments.direct else Manner.WHOLE
            for found in pool.map(partial(result, manner=manner), jobs(arguments)):
                results.append(found)
                print(f"\r{len(results)} gliders", end="", file=sys.stderr, flush=True)
        except KeyboardInterrupt:  # what is done is worth its table
            pool.shutdown(wait=False, cancel_futures=True)
    print(file=sys.stderr)
    well, ill = tables(results)
    lines = chain(shown(well, ill), told(results) if arguments.told else ())
    print("\n".join(lines))
    dives, seconds = sum(len(r.dives) for r in results), time.monotonic() - begun
    cpu = sum(r.cpu * len(r.dives) for r in results)
    print(f"{len(results)} gliders, {dives} dives: {seconds:.0f} s, {1e3 * cpu / dives:.1f} ms a dive in all")
    if arguments.json:
        summary = {"healthy": [asdict(h) for h in well], "faults": [asdict(f) for f in ill]}
        arguments.json.write_bytes(as_json(results, summary))


if __name__ == "__main__":
    main()
