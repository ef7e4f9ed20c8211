"""What the benchmarks share: files to read, the command as installed, the floor, and what it ran on."""

from __future__ import annotations

import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

GLIDERWATCH = Path(sys.executable).with_name("gliderwatch")
FLOOR = """
import sys, time
from pathlib import Path
import dbdreader
from gliderwatch.slocum.sensors import SENSORS
begun, n = time.process_time(), 0
for path in sorted(Path(sys.argv[1]).rglob("*.?bd")):
    file = dbdreader.DBD(str(path), cacheDir=sys.argv[2])
    n += len(file.get(*[name for name in SENSORS if name in file.parameterNames]))
print(time.process_time() - begun)
"""


@dataclass(frozen=True, slots=True)
class Cost:
    """What a command cost: time on the clock, and of all processors (s)."""

    wall: float
    cpu: float


@contextmanager
def folder() -> Iterator[Path]:
    """A folder for the time of a benchmark."""
    with tempfile.TemporaryDirectory(prefix="gliderwatch-benchmark-") as name:
        yield Path(name)


def one_core() -> None:
    """Use the first processor alone, and let all that is started from here do so."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def cost(*arguments: object) -> Cost:
    """Run the installed command to its end; its output is thrown away."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([GLIDERWATCH, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)
    after, ended = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Cost(ended - begun, cpu)


def floor(files: Path, cache: Path) -> float:
    """Processor time (s) of dbdreader alone, without imports, for the sensors that gliderwatch reads."""
    result = subprocess.run(
        [sys.executable, "-c", FLOOR, files, cache], check=True, capture_output=True, text=True
    )
    return float(result.stdout)


def configure(folder: Path, gliders: list[str], **more: object) -> Path:
    """A configuration (JSON is YAML) for the folders `gliders` and `cache` below a folder."""
    (folder / "gliders").mkdir(exist_ok=True)
    (folder / "cache").mkdir(exist_ok=True)
    document = {
        "channels": {"mail": {"url": "mailto://127.0.0.1:9?from=a@b.org&to=c@d.org"}},  # loads Apprise
        "recipients": {"pilot": {"channels": ["mail"]}},
        "dockserver": {"roots": [str(folder / "gliders")], "cache": [str(folder / "cache")]},
        "state": {"path": str(folder / "state" / "state.sqlite")},
        "defaults": {"normal_speed": {"min": 0.2, "max": 0.4}},
        "gliders": dict.fromkeys(gliders),
    }
    path = folder / "gliderwatch.yml"
    path.write_text(json.dumps(document | more), encoding="utf-8")
    return path


@contextmanager
def daemon(config: Path) -> Iterator[int]:
    """The daemon while it runs: its process id. Its log is beside the configuration."""
    with config.with_name("daemon.log").open("wb") as log:
        process = subprocess.Popen([GLIDERWATCH, "run", "-c", config], stdout=log, stderr=log)
    try:
        yield process.pid
    finally:
        process.terminate()
        process.wait()


def wait_taken(config: Path, files: int, patience: float = 600.0) -> None:
    """Wait until the daemon has taken so many files."""
    deadline = time.monotonic() + patience
    while taken(config) < files:
        if time.monotonic() > deadline:
            sys.exit(f"not taken within {patience:g} s: see {config.with_name('daemon.log')}")
        time.sleep(0.1)


def taken(config: Path) -> int:
    """How many files the daemon has taken."""
    return config.with_name("daemon.log").read_bytes().count(b'"event": "file taken"')


def tree(pid: int) -> list[int]:
    """A process and all its descendants."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        below = [int(child) for task in tasks for child in (task / "children").read_text().split()]
    except FileNotFoundError:
        return []
    return [pid, *(each for child in below for each in tree(child))]


def memory(pids: list[int]) -> tuple[float, float]:
    """RSS and PSS (MB) of processes; PSS counts what several share once."""
    rss = pss = 0
    for pid in pids:
        try:
            lines = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()[1:]
        except OSError:  # it has just ended
            continue
        sizes = {name: int(rest.split()[0]) for name, _, rest in (line.partition(":") for line in lines)}
        rss, pss = rss + sizes["Rss"], pss + sizes["Pss"]
    return rss / 1024, pss / 1024


def busy(pids: list[int]) -> float:
    """Time of processor (s) that processes have had, what they waited for included."""
    total = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        total += sum(map(int, fields[11:15]))
    return total / os.sysconf("SC_CLK_TCK")


def machine() -> str:
    """What this runs on."""
    info = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    model = next((line.partition(":")[2].strip() for line in info.splitlines() if "model name" in line), "?")
    load = os.getloadavg()[0]
    python = platform.python_version()
    return f"{os.cpu_count()} x {model}, Linux {platform.release()}, Python {python}, load {load:.1f}"
