"""Losses that a lone glider cannot show, and healthy fleets, in kinds of sea, through the installed program.

    python benchmarks/fleet_faults.py [--seas mixed rotary ...] [--gliders 1 2 4 8] [--faults wing_loss:0.4
    compass:0.3 none] [--seeds 1] [--first 0] [--days 6.5] [--onset 4] [--json out.json]

A fleet flies within 50 km, each glider on one steady heading, and sends no roll. From the day `onset` on the
first one has the fault. Files are written, `gliderwatch run --replay` takes them, and what it says of fault
and sea is counted: told are messages of the kinds anomaly, false_alarm and neighbours about the first glider
within 48 h; false are those about others, or before the fault.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from itertools import product
from pathlib import Path

import numpy as np
from common import cost, machine

from gliderwatch.simulate.delivery import write_cache, write_mission
from gliderwatch.simulate.flight import Point, offset
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Scenario
from gliderwatch.simulate.seas import SEAS, sea_mission

DAY, HOUR = 86400.0, 3600.0
ACROSS = 25e3
"""m: gliders begin within so much of the middle, to the east and to the north."""
APART = 0.15
"""rad: by so much their headings differ, so that they stay together for a week."""
TIME = 48.0
"""Hours in which a fault is to be told."""
SAID = {"anomaly", "false_alarm", "neighbours"}


@dataclass(frozen=True)
class Job:
    """One fleet: kind of sea, gliders, fault and its size (`none`: healthy), chance, days, and when it
    begins."""

    sea: str
    gliders: int
    fault: str
    size: float
    seed: int
    days: float
    onset: float


@dataclass(frozen=True)
class Result:
    """What was said: hours from the onset of what was first told of the fault with its kind (None: nothing),
    and all else that was said."""

    job: Job
    told: float | None
    kind: str
    false: tuple[str, ...]


def fleet(job: Job) -> list[Scenario]:
    """The missions of a fleet."""
    base = sea_mission(job.sea, job.seed, days=job.days)
    sent = {name: every for name, every in base.cadence.items() if name != "m_roll"}
    base = replace(base, interval=3 * HOUR, cadence=sent)
    rng = np.random.default_rng([job.seed, 17])
    out, heading = [], rng.uniform(0, 2 * np.pi)
    for k in range(job.gliders):
        east, north = rng.uniform(-ACROSS, ACROSS, 2)
        angle = heading + rng.uniform(-APART, APART)
        place = _offset(base.place, east, north)
        far = _offset(place, 400e3 * np.sin(angle), 400e3 * np.cos(angle))
        faults = ()
        if k == 0 and job.fault != "none":
            faults = (Fault(FaultKind(job.fault), base.start + job.onset * DAY, job.size),)
        out.append(
            replace(
                base,
                glider=f"sea-{k}",
                member=k,
                place=place,
                waypoints=(far,),
                origin=base.place,
                faults=faults,
            )
        )
    return out


def _offset(place: Point, east: float, north: float) -> Point:
    lat, lon = offset(place, np.array(east), np.array(north))
    return Point(float(lat), float(lon))


def fly(folder: Path, scenario: Scenario) -> Path:
    """The folder with the files of a mission and its caches; it is simulated once."""
    fault = "-".join(f"{each.kind}-{each.size}" for each in scenario.faults) or "none"
    made = folder / f"{scenario.glider}-{fault}"
    if not made.exists():
        mission = simulate(scenario)
        write_mission(made / "gliders", made / "cache", mission)
        write_cache(made / "cache", mission)
    return made


def run(jobs: Sequence[Job]) -> Iterator[Result]:
    """Simulate fleets of one sea and seed, replay their files, and see what is said."""
    with tempfile.TemporaryDirectory(prefix="gliderwatch-benchmark-") as name:
        for k, job in enumerate(jobs):
            missions = fleet(job)
            made = [fly(Path(name), scenario) for scenario in missions]
            yield _replayed(Path(name) / f"job-{k}", job, missions, made)


def _replayed(folder: Path, job: Job, missions: Sequence[Scenario], made: Sequence[Path]) -> Result:
    gliders, caches, config = folder / "gliders", folder / "cache", folder / "gliderwatch.yml"
    for each in made:
        shutil.copytree(each / "gliders", gliders, copy_function=os.link, dirs_exist_ok=True)
        shutil.copytree(each / "cache", caches, dirs_exist_ok=True)
    config.write_text(
        f"dockserver: {{roots: [{gliders}], cache: [{caches}]}}\n"
        f"state: {{path: {folder / 'state.sqlite'}}}\n"
        f"gliders: {{{', '.join(f'{m.glider}: {{}}' for m in missions)}}}\n"
    )
    cost("run", "-c", config, "--replay", gliders, "--out", folder / "out")
    text = (folder / "out" / "alerts.jsonl").read_text(encoding="utf-8")
    begins = missions[0].start + job.onset * DAY
    told, kind, false = None, "", list[str]()
    for line in map(json.loads, text.splitlines()):
        if line["kind"] not in SAID:
            continue
        hours = (datetime.fromisoformat(line["time"]).timestamp() - begins) / HOUR
        if line["glider"] == "sea-0" and hours > 0 and job.fault != "none":
            if told is None:
                told, kind = hours, line["kind"]
        else:
            false.append(f"{hours:.0f} h {line['title']}")
    return Result(job, told, kind, tuple(false))


def table(results: Sequence[Result]) -> None:
    """Print how many faults were told in time, and what was false."""
    print("fault       gliders  fleets  told in 48 h  as neighbours  false  glider-months")
    for fault, n in dict.fromkeys((r.job.fault, r.job.gliders) for r in results):
        same = [r for r in results if (r.job.fault, r.job.gliders) == (fault, n)]
        told = sum(r.told is not None and r.told <= TIME for r in same)
        named, false = sum(r.kind == "neighbours" for r in same), sum(len(r.false) for r in same)
        months = sum(r.job.days * n / 30 for r in same)
        print(f"{fault:10}  {n:7d}  {len(same):6d}  {told:12d}  {named:13d}  {false:5d}  {months:13.1f}")


def main() -> None:
    """Run all fleets, print the table and what was false."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seas", nargs="+", choices=list(SEAS), default=list(SEAS))
    parser.add_argument("--gliders", type=int, nargs="+", default=[1, 2, 4, 8])
    parser.add_argument("--faults", nargs="+", default=["wing_loss:0.4", "compass:0.3", "none"])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--days", type=float, default=6.5)
    parser.add_argument("--onset", type=float, default=4.0)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    faults = [fault.partition(":") for fault in options.faults]
    kinds = list(product(faults, options.gliders))
    print(machine())
    results = list[Result]()
    for seed, sea in product(range(options.first, options.first + options.seeds), options.seas):
        jobs = [
            Job(sea, n, fault, float(size or 0), seed, options.days, options.onset)
            for (fault, _, size), n in kinds
        ]
        for result in run(jobs):
            results.append(result)
            print(f"{len(results)}: {result}", file=sys.stderr, flush=True)
            if options.json:
                options.json.write_text(json.dumps([asdict(each) for each in results]))
    table(results)


if __name__ == "__main__":
    main()
