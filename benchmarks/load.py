"""Many gliders at once: a backlog at start, newcomers meanwhile, then a day of surfacings, sped up.

python benchmarks/load.py [--gliders 200] [--segments 500] [--newcomers 5] [--surfacings 6] [--seconds 240]
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import subprocess
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from email.parser import BytesHeaderParser
from itertools import pairwise
from pathlib import Path
from typing import Any

from aiosmtpd.controller import Controller
from common import GLIDERWATCH, busy, configure, daemon, folder, machine, memory, tree
from rich.console import Console
from rich.table import Table

from gliderwatch.simulate.delivery import arrivals, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.store.state_file import Store

PORT = 18026
MISSIONS = 4
"""Missions that are simulated; their files under other names make the fleet."""
WORKERS = 2
"""Processes that decode, in the daemon and in the floor."""
SAMPLE = 2000
"""Files that the floor is measured on."""
LONGEST = 7200.0
FLOOR = """
import sys, time
import dbdreader
from gliderwatch.slocum.sensors import SENSORS
paths = sys.stdin.read().split("\\n")
dbdreader.DBD(paths[0], cacheDir=sys.argv[1])
begun = time.time()
for path in paths:
    file = dbdreader.DBD(path, cacheDir=sys.argv[1])
    file.get(*[name for name in SENSORS if name in file.parameterNames])
print(begun, time.time())
"""
TEMPLATE = "glider-000"


@dataclass(frozen=True, slots=True)
class File:
    """A file of one glider that is to come."""

    glider: str
    name: str
    data: bytes


class Fleet:
    """Gliders that fly the same few missions; each file is made when it is asked for."""

    def __init__(self, gliders: int, segments: int, surfacings: int, newcomers: int) -> None:
        days = (segments + surfacings + 2) / 6.0
        scenarios = [Scenario(seed=seed, glider=TEMPLATE, days=days) for seed in range(MISSIONS)]
        self._missions = [simulate(scenario) for scenario in scenarios]
        self._files = [list(arrivals(mission)) for mission in self._missions]
        wanted = segments + surfacings
        if (shortest := min(map(len, self._files))) < wanted:
            sys.exit(f"only {shortest} segments were made of {wanted}")
        self.gliders = [f"glider-{number:03d}" for number in range(gliders)]
        self.newcomers = [f"glider-{number:03d}" for number in range(gliders, gliders + newcomers)]

    def caches(self, folder: Path) -> None:
        """Write the cache files of all."""
        for mission in self._missions:
            write_cache(folder, mission)

    def files(self, glider: str, begin: int, end: int) -> Iterator[File]:
        """Some files of a glider, counted in order of their sending."""
        for arrival in self._files[int(glider[-3:]) % MISSIONS][begin:end]:
            data = arrival.data.replace(TEMPLATE.encode(), glider.encode())
            yield File(glider, arrival.name.replace(TEMPLATE, glider), data)


@dataclass(slots=True)
class Mailbox:
    """When mails about each glider were accepted (s, monotonic)."""

    accepted: defaultdict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    async def handle_DATA(self, _server: Any, _session: Any, envelope: Any) -> str:  # noqa: N802 (aiosmtpd)
        subject = BytesHeaderParser().parsebytes(envelope.content)["Subject"] or ""
        glider = next((word.strip(":,") for word in subject.split() if word.startswith("glider-")), "")
        self.accepted[glider].append(time.monotonic())
        return "250 accepted"


class Log:
    """The log of the daemon, read as it grows: which files were taken, in what order and when."""

    def __init__(self, path: Path) -> None:
        self._path, self._read, self._rest = path, 0, b""
        self.taken: dict[str, float] = {}

    def look(self) -> int:
        """How many files have been taken by now."""
        if not self._path.exists():
            return 0
        with self._path.open("rb") as file:
            file.seek(self._read)
            new = file.read()
        self._read += len(new)
        *lines, self._rest = (self._rest + new).split(b"\n")
        now = time.monotonic()
        for line in lines:
            if b'"event": "file taken"' in line:
                self.taken[Path(json.loads(line)["path"]).name] = now
        return len(self.taken)

    def wait(self, files: int) -> None:
        """Wait until so many have been taken."""
        deadline = time.monotonic() + LONGEST
        while self.look() < files:
            if time.monotonic() > deadline:
                sys.exit(
                    f"only {len(self.taken)} of {files} files taken within {LONGEST:g} s: see {self._path}"
                )
            time.sleep(0.05)


@dataclass(frozen=True, slots=True)
class Tenth:
    """What a file of a tenth of the backlog took: seconds on the ``clock``, and of all processors."""

    clock: float
    cpu: float


@dataclass(slots=True)
class Figures:
    """What was measured."""

    files: int = 0
    size: float = 0.0
    floor: float = 0.0
    rate: float = 0.0
    cpu: float = 0.0
    tenths: list[Tenth] = field(default_factory=list)
    late: list[float] = field(default_factory=list)
    unordered: int = 0
    differing: list[str] = field(default_factory=list)
    peak: float = 0.0
    state: float = 0.0
    delivery: list[float] = field(default_factory=list)
    silent: int = 0
    day_seconds: float = 0.0


def put(root: Path, file: File) -> Path:
    """Write a file as a dockserver does; it has its name from the end on."""
    path = root / file.glider / "from-glider" / file.name
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.part")
    partial.write_bytes(file.data)
    return partial.rename(path)


def floor(paths: list[Path], cache: Path) -> float:
    """Files a second of dbdreader alone in as many processes, for the sensors that gliderwatch reads."""
    parts = [paths[i::WORKERS] for i in range(WORKERS)]
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", FLOOR, cache], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in parts
    ]
    for process, part in zip(processes, parts, strict=True):
        assert process.stdin is not None
        process.stdin.write("\n".join(map(str, part)))
        process.stdin.close()
    seconds = 0.0
    for process in processes:
        assert process.stdout is not None
        begun, ended = map(float, process.stdout.read().split())
        process.wait()
        seconds = max(seconds, ended - begun)
    return len(paths) / seconds


@contextmanager
def watched_memory(pid: int, figures: Figures) -> Iterator[None]:
    """Note the highest PSS (MB) of a process and its descendants."""
    end = threading.Event()

    def watch() -> None:
        while not end.wait(1.0):
            figures.peak = max(figures.peak, memory(tree(pid))[1])

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()


def backlog(where: Path, fleet: Fleet, log: Log, pid: int, figures: Figures) -> None:
    """Wait for the backlog; meanwhile a file of another glider comes every now and then. What a file of each
    tenth costs shows whether the last one costs what the first one did."""
    deadline = time.monotonic() + LONGEST
    while log.look() < 1 and time.monotonic() < deadline:
        time.sleep(0.02)
    begun, already = time.monotonic(), len(log.taken)
    spent = [(already, begun, busy(tree(pid)))]
    coming = [file for g in fleet.newcomers for file in fleet.files(g, 0, 4)]
    pause = max(0.2, min(5.0, figures.files / 100 / 1.3 / max(1, len(coming))))
    pending: dict[str, float] = {}
    due, total = begun + pause, figures.files
    while len(log.taken) < total + len(figures.late) + len(pending):
        if log.look() >= spent[-1][0] + (total - already) / 10:
            spent.append((len(log.taken), time.monotonic(), busy(tree(pid))))
        for name in [name for name in pending if name in log.taken]:
            figures.late.append(log.taken[name] - pending.pop(name))
        if coming and not pending and time.monotonic() >= due and len(log.taken) < total:
            file = coming.pop(0)
            put(where / "gliders", file)
            pending[file.name], due = time.monotonic(), time.monotonic() + pause
        if time.monotonic() > deadline:
            sys.exit(f"only {len(log.taken)} files taken within {LONGEST:g} s")
        time.sleep(0.02)
    if len(log.taken) > spent[-1][0]:
        spent.append((len(log.taken), time.monotonic(), busy(tree(pid))))
    figures.rate = (len(log.taken) - already) / (time.monotonic() - begun)
    figures.tenths = [
        Tenth((t1 - t0) / (b - a), (c1 - c0) / (b - a)) for (a, t0, c0), (b, t1, c1) in pairwise(spent)
    ]
    figures.cpu = (spent[-1][2] - spent[0][2]) / (spent[-1][0] - spent[0][0])


def unordered(fleet: Fleet, log: Log, segments: int) -> int:
    """Files that were taken after a later one of their glider."""
    turn = {name: n for n, name in enumerate(log.taken)}
    count = 0
    for glider in fleet.gliders:
        order = [turn[file.name] for file in fleet.files(glider, 0, segments)]
        count += sum(b < a for a, b in pairwise(order))
    return count


def differing(where: Path, config: Path, gliders: Iterable[str]) -> list[str]:
    """Gliders whose assessments are not those of a replay of their files."""
    live = Store.reading(where / "state" / "state.sqlite")
    out = []
    for glider in gliders:
        target = where / f"replay-{glider}"
        subprocess.run(
            [GLIDERWATCH, "run", "-c", config, "--replay", where / "gliders" / glider, "--out", target],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        replayed = Store.reading(target / "replay.sqlite")
        made = live.assessments(glider)
        out += [glider] if not made or made != replayed.assessments(glider) else []
        replayed.close()
    live.close()
    return out


def delivered(where: Path) -> None:
    """Wait until no message waits any more."""
    deadline = time.monotonic() + LONGEST
    while time.monotonic() < deadline:
        store = Store.reading(where / "state" / "state.sqlite")
        waiting = store.undelivered()
        store.close()
        if not waiting:
            return
        time.sleep(0.5)
    sys.exit(f"messages not delivered within {LONGEST:g} s")


def day(
    where: Path,
    fleet: Fleet,
    box: Mailbox,
    log: Log,
    begin: int,
    count: int,
    seconds: float,
    figures: Figures,
) -> None:
    """All gliders surface so many times, spread over some seconds; from each file's name to its mail."""
    rng, plan = random.Random(1), []
    for glider in fleet.gliders:
        phase = rng.random()
        for n, file in enumerate(fleet.files(glider, begin, begin + count)):
            plan.append(((n + phase) * seconds / count, file))
    plan.sort(key=lambda item: item[0])
    arrived: defaultdict[str, list[float]] = defaultdict(list)
    delivered(where)  # what was made of the backlog is not of this day
    already, begun = log.look(), time.monotonic()
    for at, file in plan:
        time.sleep(max(0.0, begun + at - time.monotonic()))
        put(where / "gliders", file)
        arrived[file.glider].append(time.monotonic())
    log.wait(already + len(plan))
    delivered(where)
    figures.day_seconds = seconds
    for glider, times in arrived.items():
        for t, following in zip(times, [*times[1:], float("inf")], strict=True):
            mails = [m - t for m in box.accepted[glider] if t <= m < following]
            if mails:
                figures.delivery.append(mails[0])
            else:
                figures.silent += 1


def report(figures: Figures, arguments: argparse.Namespace) -> None:
    """Print it."""
    f = figures
    print(machine())
    table = Table("what", "measured", "wanted")
    size = f"{arguments.gliders} gliders x {arguments.segments} segments, {f.files} files, {f.size:.0f} MB"
    table.add_row("backlog", size, "")
    table.add_row("dbdreader alone, 2 processes", f"{f.floor:.0f} files/s", "")
    table.add_row("gliderwatch", f"{f.rate:.0f} files/s, {1000 / f.rate:.1f} ms a file", "")
    table.add_row("processor time of all", f"{1000 * f.cpu:.1f} ms a file", "")
    rates = ", ".join(f"{1 / t.clock:.3g}" for t in f.tenths)
    costs = ", ".join(f"{1000 * t.cpu:.3g}" for t in f.tenths)
    table.add_row("files/s in each tenth", rates, "alike")
    table.add_row("processor time in each tenth", f"{costs} ms a file", "alike")
    table.add_row("ratio of the rates", f"{f.rate / f.floor:.3f}", ">= 0.5")
    table.add_row("most memory (PSS)", f"{f.peak:.0f} MB", "< 500 MB")
    table.add_row("state file", f"{f.state:.0f} MB, {1000 * f.state / f.files:.1f} kB a file", "")
    table.add_row("taken out of order", str(f.unordered), "0")
    table.add_row("gliders unlike their replay", ", ".join(f.differing) or "none of 2", "none")
    late = f"{len(f.late)} files, median {statistics.median(f.late):.2f} s, most {max(f.late):.2f} s"
    table.add_row("newcomers meanwhile", late if f.late else "none came", "< 5 s")
    if len(f.delivery) > 1:
        p = statistics.quantiles(f.delivery, n=100)
        times = f"median {p[49]:.3f}, p99 {p[98]:.3f}, most {max(f.delivery):.3f} s"
        many = f"{len(f.delivery)} mails of {len(f.delivery) + f.silent} files in {f.day_seconds:g} s"
        table.add_row("a day: file to mail", f"{many}; {times}", "p99 < 2 s")
    Console(width=130).print(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--gliders", type=int, default=200)
    parser.add_argument("--segments", type=int, default=500)
    parser.add_argument("--newcomers", type=int, default=5)
    parser.add_argument("--surfacings", type=int, default=6, help="of each glider in the day; 0: no day")
    parser.add_argument("--seconds", type=float, default=240.0, help="in which the day goes by")
    arguments = parser.parse_args()
    figures, box = Figures(), Mailbox()
    server = Controller(box, hostname="127.0.0.1", port=PORT)
    server.start()
    fleet = Fleet(arguments.gliders, arguments.segments, arguments.surfacings, arguments.newcomers)
    names = [*fleet.gliders, *fleet.newcomers]
    try:
        with folder() as where:
            recipients = {"pilot": {"channels": ["mail"], "surfacing": names}}
            url = f"mailto://127.0.0.1:{PORT}?from=gliderwatch@a.org&to=pilot@b.org"
            # copies of four gliders would all be neighbours in one place: `fleet_cost.py` measures that
            usual = {"normal_speed": {"min": 0.2, "max": 0.4}, "neighbours": False}
            config = configure(
                where, names, channels={"mail": {"url": url}}, recipients=recipients, defaults=usual
            )
            fleet.caches(where / "cache")
            paths = [
                put(where / "gliders", file)
                for glider in fleet.gliders
                for file in fleet.files(glider, 0, arguments.segments)
            ]
            for name in fleet.newcomers:
                (where / "gliders" / name / "from-glider").mkdir(parents=True)
            figures.files, figures.size = len(paths), sum(p.stat().st_size for p in paths) / 1e6
            figures.floor = floor(random.Random(2).sample(paths, min(SAMPLE, len(paths))), where / "cache")
            log = Log(config.with_name("daemon.log"))
            with daemon(config) as pid, watched_memory(pid, figures):
                backlog(where, fleet, log, pid, figures)
                figures.unordered = unordered(fleet, log, arguments.segments)
                figures.differing = differing(where, config, fleet.gliders[:2])
                figures.state = sum(p.stat().st_size for p in (where / "state").iterdir()) / 1e6
                if arguments.surfacings:
                    begin, count = arguments.segments, arguments.surfacings
                    day(where, fleet, box, log, begin, count, arguments.seconds, figures)
    finally:
        server.stop()
    report(figures, arguments)


if __name__ == "__main__":
    main()
