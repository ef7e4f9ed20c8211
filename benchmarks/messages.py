"""How many messages one fault makes, and whether they contradict each other: random gliders, seas and faults.

python benchmarks/messages.py [--missions 40] [--first 0] [--workers 2]

Each glider flies for 22 days in a kind of sea drawn at random, with a fault drawn at random from a day
between the second and the sixth on. Counted are the messages of its first 48 hours (at most 4 are wanted) and
of 15 days (10), reminders included, and those that contradict an earlier one (`tests/wavering.py`).
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from common import machine

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from wavering import TROUBLE, count, drawn, told, wavers


@dataclass(frozen=True)
class Row:
    """Of one glider: its sea and fault, messages in 48 hours and 15 days, whether the fault was told at all,
    contradictions, and what was told of it when it was healthy."""

    seed: int
    fault: str
    two_days: int
    fifteen_days: int
    is_told: bool
    wavers: tuple[str, ...]
    before: tuple[str, ...]
    titles: tuple[str, ...]


def work(seed: int) -> Row:
    """One glider."""
    scenario = drawn(seed, days=22.0, first=2.0, last=6.0)
    fault, messages = scenario.faults[0], told(scenario)
    return Row(
        seed,
        f"{fault.kind} {fault.size:.2f}, every {scenario.interval / 3600:.1f} h",
        count(messages, 48.0),
        count(messages, 15 * 24.0),
        any(each.alert.kind in TROUBLE and each.hours >= 0 for each in messages),
        tuple(wavers(messages)),
        tuple(each.alert.title for each in messages if each.hours < 0),
        tuple(f"{each.hours:.0f} h, {each.alert.kind}: {each.alert.title}" for each in messages),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--missions", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--told", action="store_true", help="every message of those beyond what is wanted")
    arguments = parser.parse_args()
    print(machine())
    seeds = range(arguments.first, arguments.first + arguments.missions)
    rows, context = [], multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=arguments.workers, mp_context=context) as pool:
        for row in pool.map(work, seeds):
            rows.append(row)
            if row.two_days > 4 or row.fifteen_days > 10 or row.wavers or row.before:
                print(f"{row.seed}: {row.fault}: {row.two_days} in 48 h, {row.fifteen_days} in 15 days")
                for line in (*row.wavers, *(f"healthy: {title}" for title in row.before)):
                    print(f"    {line}")
                for line in row.titles if arguments.told else ():
                    print(f"        {line}")
            print(f"\r{len(rows)} gliders", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    for name, found in (("48 h", [r.two_days for r in rows]), ("15 days", [r.fifteen_days for r in rows])):
        print(f"messages in {name}: " + ", ".join(f"{n}: {k}" for n, k in sorted(Counter(found).items())))
    print(
        f"{len(rows)} faults, told {sum(r.is_told for r in rows)}, more than 4 in 48 h "
        f"{sum(r.two_days > 4 for r in rows)}, "
        f"more than 10 in 15 days {sum(r.fifteen_days > 10 for r in rows)}, "
        f"contradictions {sum(len(r.wavers) for r in rows)} on {sum(bool(r.wavers) for r in rows)}, "
        f"messages before the fault {sum(len(r.before) for r in rows)}"
    )


if __name__ == "__main__":
    main()
