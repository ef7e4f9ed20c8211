"""Many missions on Dask: one worker, two, two of a scheduler of which one is killed on the way.

`python benchmarks/cluster.py [--missions 200] [--days 1.5] [--kept build/cluster]`: simulated missions as
files sent, healthy and faulty, judged by `gliderwatch hindcast` as installed. Printed: time on the clock and
of all processors of each run, missions a minute, how many times as fast as with one worker, the load of the
machine as each began, and whether all reports are equal to the byte (`report.pdf` and the state of the
replay, which hold the time of their making, apart). `--kept` keeps the missions, which are made once.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from common import GLIDERWATCH, Cost, busy, folder, machine, tree

from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind
from gliderwatch.simulate.scenario_files import find, load_scenario

DASK = GLIDERWATCH.with_name("dask")
SEAS = ("calm", "tidal", "rough_data", "gulf_stream")
FAULTS = (None, FaultKind.REMORA, None, FaultKind.NET)
TIMED = ("report.pdf", "replay.sqlite")
"""Files that hold when they were made."""


def missions(kept: Path, n: int, days: float) -> list[Path]:
    """The folders of so many missions; made once."""
    out = []
    for i in range(n):
        place = kept / f"{days:g}-days" / f"mission-{i:03d}"
        out.append(place)
        if (place / "whole").exists():
            continue
        base, kind = load_scenario(find(SEAS[i % len(SEAS)])), FAULTS[i // len(SEAS) % len(FAULTS)]
        size = {FaultKind.REMORA: 6.0, FaultKind.NET: 0.8}
        fault = () if kind is None else (Fault(kind, base.start + days / 2 * 86400, size[kind]),)
        scenario = replace(
            base,
            seed=1000 + i,
            glider=f"glider-{i:03d}",
            days=days,
            faults=fault,
            full_rate=False,
            science={},
        )
        write_mission(place / "sent", place / "cache", simulate(scenario))
        (place / "whole").touch()
    return out


def ready(out: Path) -> int:
    """How many reports are there."""
    return len(list(out.glob("*/done-*")))


@contextmanager
def cluster(workers: int) -> Iterator[tuple[str, list[int]]]:
    """A scheduler and its workers: its address, and the process of each worker."""
    environment = {**os.environ, "DASK_DISTRIBUTED__WORKER__DAEMON": "False"}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    with folder() as place:
        file = place / "scheduler.json"
        at = ["--scheduler-file", file]
        begun = [subprocess.Popen([DASK, "scheduler", "--port", "0", "--no-dashboard", *at], **quiet)]
        begun += [
            subprocess.Popen([DASK, "worker", "--nthreads", "1", "--no-dashboard", *at], cwd=place, **quiet)
            for _ in range(workers)
        ]
        try:
            while not file.exists() or not file.read_text().strip():
                time.sleep(0.1)
            address = file.read_text().partition('"address": "')[2].partition('"')[0]
            yield address, [process.pid for process in begun]
        finally:
            for process in reversed(begun):
                process.terminate()
            for process in begun:
                process.wait()


def kill_one(nanny: int) -> str:
    """Kill what works for a worker; its nanny starts another."""
    for pid in tree(nanny)[1:]:
        if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes():
            os.kill(pid, signal.SIGKILL)
            return f"process {pid} of a worker killed"
    return "no worker to kill"


def run(places: list[Path], out: Path, options: list[object], beside: list[int], kill: bool) -> Cost:
    """Judge all missions; ``beside`` are processes of workers that are there already, of which one is killed
    when a third is done."""
    shutil.rmtree(out, ignore_errors=True)
    command = [GLIDERWATCH, "hindcast", *places, "--out", out, *map(str, options)]
    print(f"  load {os.getloadavg()[0]:.1f} at the start", flush=True)
    before, begun = sum(busy(tree(pid)) for pid in beside), time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while kill and process.poll() is None:
        time.sleep(0.2)
        if ready(out) >= len(places) / 3:
            print(f"  {kill_one(beside[-1])} when {ready(out)} were done", flush=True)
            kill = False
    _, words = process.communicate()
    wall = time.monotonic() - begun
    if process.returncode:
        sys.exit(f"gliderwatch hindcast ended with {process.returncode}: {words}")
    spent = os.times()
    after = sum(busy(tree(pid)) for pid in beside)
    return Cost(wall, spent.children_user + spent.children_system + after - before)


def reports(out: Path) -> dict[str, str]:
    """The hash of each file of the reports."""
    found = [path for path in sorted(out.rglob("*")) if path.is_file() and path.name not in TIMED]
    return {
        str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in found
        if not path.name.startswith("replay.sqlite")
    }


def show(name: str, n: int, cost: Cost, one: Cost | None) -> None:
    faster = "" if one is None else f", {one.wall / cost.wall:.2f} times as fast"
    print(
        f"{name:<44}{cost.wall:7.0f} s, {cost.cpu:6.0f} s of processors, {60 * n / cost.wall:.1f}/min{faster}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--missions", type=int, default=200)
    parser.add_argument("--days", type=float, default=1.5)
    parser.add_argument("--kept", type=Path, default=Path("build/cluster"))
    options = parser.parse_args()
    print(machine(), flush=True)
    places, n = missions(options.kept.resolve(), options.missions, options.days), options.missions
    outs = [options.kept.resolve() / name for name in ("one", "two", "scheduler")]
    spent, one = 0.0, None
    for workers, out in ((1, outs[0]), (2, outs[1])):
        cost = run(places, out, ["--workers", workers], [], False)
        cost, spent = Cost(cost.wall, cost.cpu - spent), cost.cpu
        show(f"{workers} worker{'s' if workers > 1 else ''}", n, cost, one)
        one = one or cost
    with cluster(2) as (address, processes):
        cost = run(places, outs[2], ["--cluster", address], processes, True)
        show("--cluster, 2 workers, one killed on the way", n, Cost(cost.wall, cost.cpu - spent), one)
    made = [reports(out) for out in outs]
    unlike = {name for name in made[0] for other in made[1:] if other.get(name) != made[0][name]}
    same = not unlike and len({len(each) for each in made}) == 1
    print(f"{len(made[0])} files of each run: " + ("all equal" if same else f"{sorted(unlike)[:9]} differ"))
    again = run_again(places, outs[2])
    print(f"once more, all done already: {again:.1f} s")


def run_again(places: list[Path], out: Path) -> float:
    """How long a run takes that finds everything done (s)."""
    begun = time.monotonic()
    subprocess.run(
        [GLIDERWATCH, "hindcast", *places, "--out", out, "--workers", "1"], check=True, capture_output=True
    )
    return time.monotonic() - begun


if __name__ == "__main__":
    main()
