"""Many missions on Dask: one worker on one core, two on two, two of a scheduler, one killed on the way.

`python benchmarks/cluster.py [--missions 200] [--days 1.5] [--kept build/cluster]`: simulated missions as
files sent, healthy and faulty, judged by `gliderwatch hindcast` as installed. One worker gets one core
(`taskset`), as it decodes in a process of its own that would use a second one. Printed of each run: time on
the clock, of all processors, and of the busiest worker; missions a minute; how many times as fast as one
worker, by the clock and by processors (time of all with one worker, through that of the busiest of two and of
the command that hands out); the load of the machine; and whether all reports are equal to the byte
(`report.pdf` and the state of the replay, which hold the time of their making, apart). `--kept` keeps the
missions, which are made once.
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
from dataclasses import dataclass, replace
from pathlib import Path

from common import GLIDERWATCH, busy, folder, machine, tree

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


@dataclass(frozen=True, slots=True)
class Run:
    """What a run took (s): on the ``clock``, of all ``processors``, of the ``busiest`` worker, and of the
    process that ``hands`` out."""

    clock: float
    processors: float
    busiest: float
    hands: float


def spent(root: int) -> float:
    """Time of processor (s) of a process and all below it; 0 where it is gone."""
    try:
        return busy(tree(root))
    except (FileNotFoundError, ProcessLookupError):
        return 0.0


def run(
    places: list[Path], out: Path, options: list[object], beside: list[int], kill: bool, cores: str
) -> Run:
    """Judge all missions on some cores; ``beside`` are processes of workers that are there already, of which
    one is killed when a third is done."""
    shutil.rmtree(out, ignore_errors=True)
    command = ["taskset", "-c", cores, GLIDERWATCH, "hindcast", *places, "--out", out, *map(str, options)]
    print(f"  load {os.getloadavg()[0]:.1f} at the start", flush=True)
    before, begun = {pid: spent(pid) for pid in beside}, time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    workers, whole = dict[int, float](), 0.0
    while process.poll() is None:
        time.sleep(0.2)
        for pid in [*beside, *(pid for pid in tree(process.pid)[1:] if parent(pid) == process.pid)]:
            workers[pid] = max(workers.get(pid, 0.0), spent(pid) - before.get(pid, 0.0))
        whole = max(whole, spent(process.pid))
        if kill and ready(out) >= len(places) / 3:
            print(f"  {kill_one(beside[-1])} when {ready(out)} were done", flush=True)
            kill = False
    _, words = process.communicate()
    clock = time.monotonic() - begun
    if process.returncode:
        sys.exit(f"gliderwatch hindcast ended with {process.returncode}: {words}")
    of_others = sum(workers.get(pid, 0.0) for pid in beside)
    hands = max(whole + of_others - sum(workers.values()), 0.0)
    return Run(clock, whole + of_others, max(workers.values()), hands)


def parent(pid: int) -> int:
    """The parent of a process; 0 where it is gone."""
    try:
        return int(Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[1])
    except (FileNotFoundError, ProcessLookupError):
        return 0


def reports(out: Path) -> dict[str, str]:
    """The hash of each file of the reports."""
    found = [path for path in sorted(out.rglob("*")) if path.is_file() and path.name not in TIMED]
    return {
        str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in found
        if not path.name.startswith("replay.sqlite")
    }


def show(name: str, n: int, made: Run, one: Run | None) -> None:
    """Print what a run took, and how many times as fast as ``one`` worker it was."""
    print(
        f"{name:<44}{made.clock:7.0f} s, {made.processors:6.0f} s of processors, busiest worker "
        f"{made.busiest:.0f} s, {60 * n / made.clock:.1f}/min"
    )
    if one is not None:
        by_processors = one.processors / (made.busiest + made.hands)
        print(f"  {one.clock / made.clock:.2f} times as fast by the clock, {by_processors:.2f} by processors")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--missions", type=int, default=200)
    parser.add_argument("--days", type=float, default=1.5)
    parser.add_argument("--kept", type=Path, default=Path("build/cluster"))
    options = parser.parse_args()
    print(machine(), flush=True)
    places, n = missions(options.kept.resolve(), options.missions, options.days), options.missions
    outs = [options.kept.resolve() / name for name in ("one", "two", "scheduler")]
    one = None
    for workers, out, cores in ((1, outs[0], "0"), (2, outs[1], "0,1")):
        made = run(places, out, ["--workers", workers], [], False, cores)
        show(f"{workers} worker{'s' if workers > 1 else ''} on {workers} core", n, made, one)
        one = one or made
    with cluster(2) as (address, processes):
        made = run(places, outs[2], ["--cluster", address], processes, True, "0,1")
        show("--cluster, 2 workers, one killed on the way", n, made, one)
    found = [reports(out) for out in outs]
    unlike = {name for name in found[0] for other in found[1:] if other.get(name) != found[0][name]}
    same = not unlike and len({len(each) for each in found}) == 1
    print(f"{len(found[0])} files of each run: " + ("all equal" if same else f"{sorted(unlike)[:9]} differ"))
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
