"""A state file of five years: how long the daemon takes to start with it, and `status` to answer.

python benchmarks/five_years.py [--gliders 200] [--assessments 300000] [--removal]

Every dive has its rows of ledger, segments, assessments, signs of life and expectations, encoded as the
store does. The newest 64 segments of a glider and their checkpoints are of true size; of the older ones the
records, which nothing reads at a start, are as good as empty.
"""

from __future__ import annotations

import argparse
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from common import GLIDERWATCH, configure, cost, folder, machine, memory, tree
from rich.console import Console
from rich.table import Table

from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState
from gliderwatch.service import transaction
from gliderwatch.service.routing import NOBODY
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Scenario
from gliderwatch.slocum.decode import decode
from gliderwatch.store import codec
from gliderwatch.store.segments import RECENT, SPARSE
from gliderwatch.store.state_file import File, Status, Store

YEARS, YEAR = 5.0, 365.25 * 86400.0
DEATH = 300.0
GLIDER, T_DIVE, T_SURFACE = "sentinel", 1111111111.125, 1111121111.125


@dataclass(frozen=True, slots=True)
class Pattern:
    """Records of one dive, in which glider and times are filled in."""

    assessment: str
    incident: str
    expected: str
    completeness: str
    segment: bytes
    checkpoint: bytes


def pattern(where: Path) -> Pattern:
    """From a mission of three days on which a remora took hold."""
    fault = Fault(FaultKind.REMORA, Scenario().start + 1.5 * 86400, 8.0)
    mission = simulate(Scenario(seed=4, glider="bruce", days=3.0, faults=(fault,)))
    paths = write_mission(where / "gliders", where / "cache", mission)
    with_state = where / "pattern.sqlite"
    store = Store.open(with_state)
    for path in paths:
        segment = decode(path, [where / "cache"])
        file = File(str(path), 1, 1, Status.WAITING, "bruce", segment.id.name)
        params = GliderParams(speed_min=0.2, speed_max=0.4)
        transaction.process_file(store, file, segment, params, NOBODY, segment.last_t)
    dive, expected = store.assessments("bruce")[-2], store.forecasts("bruce")[-1]
    incidents = store.incidents("bruce")
    store.close()
    with sqlite3.connect(with_state) as db:
        sql = "SELECT completeness, segment, checkpoint FROM segments ORDER BY opened_at DESC LIMIT 1"
        row = db.execute(sql).fetchone()
    dive = replace(dive, glider=GLIDER, t_dive=T_DIVE, t_surface=T_SURFACE)
    expected = replace(expected, after=T_DIVE, t=T_SURFACE)
    incident = replace(
        incidents[0], id=GLIDER, glider=GLIDER, since=T_DIVE, opened_at=T_DIVE, cleared_at=T_SURFACE
    )
    texts = (codec.plain_encode(value) for value in (dive, incident, expected))
    return Pattern(*texts, *row)


def filled(text: str, glider: str, t: float, end: float) -> str:
    """A record of one glider and dive."""
    text = text.replace(GLIDER, glider)
    return text.replace(f"{T_DIVE:.3f}", f"{t:.3f}").replace(f"{T_SURFACE:.3f}", f"{end:.3f}")


def fill(path: Path, gliders: list[str], dives: int, of: Pattern) -> None:
    """Write the state file."""
    Store.open(path).close()
    db = sqlite3.connect(path, isolation_level=None)
    db.execute("PRAGMA synchronous = OFF")
    db.execute("PRAGMA journal_mode = OFF")  # each page once; the daemon makes it WAL again
    now = time.time()
    for glider in gliders:
        db.execute("BEGIN")
        for table, places, rows in (
            ("assessments", 6, assessments(glider, dives, of, now)),
            ("segments", 7, segments(glider, dives, of, now)),
            ("files", 9, files(glider, dives, now)),
            ("heard", 5, heard(glider, dives, now)),
            ("expected", 5, expectations(glider, dives, of, now)),
            ("incidents", 5, incidents(glider, dives, of, now)),
        ):
            db.executemany(f"INSERT INTO {table} VALUES ({','.join('?' * places)})", rows)
        db.execute("COMMIT")
    db.close()


def times(dives: int, now: float) -> Iterator[tuple[int, float, float]]:
    """Number, begin and end of each dive; the last has just ended."""
    step = YEARS * YEAR / dives
    for k in range(dives):
        t = round(now - YEARS * YEAR + k * step, 3)
        yield k, t, round(t + 0.9 * step, 3)


def assessments(glider: str, dives: int, of: Pattern, now: float) -> Iterator[tuple[object, ...]]:
    for _, t, end in times(dives, now):
        yield glider, t, end, 1, 0, filled(of.assessment, glider, t, end)


def segments(glider: str, dives: int, of: Pattern, now: float) -> Iterator[tuple[object, ...]]:
    empty = codec.encode(GliderState())
    for k, t, _ in times(dives, now):
        is_recent, is_milestone = k >= dives - RECENT, k % SPARSE == 0
        checkpoint = of.checkpoint if is_recent else empty if is_milestone else None
        record = of.segment if is_recent else b""
        yield glider, t, f"{glider}-{k}", of.completeness, record, checkpoint, is_milestone


def files(glider: str, dives: int, now: float) -> Iterator[tuple[object, ...]]:
    for k, _, end in times(dives, now):
        name = f"{glider}-{k}"
        path = f"/var/opt/gmc/default/gliders/{glider}/from-glider/{name}.sbd"
        yield path, 11000, k, "taken", glider, name, "", "", end


def heard(glider: str, dives: int, now: float) -> Iterator[tuple[object, ...]]:
    for k, t, end in times(dives, now):
        yield glider, f"{glider}-{k}", t, end, end + 60.0


def expectations(glider: str, dives: int, of: Pattern, now: float) -> Iterator[tuple[object, ...]]:
    for k, t, end in times(dives, now):
        yield glider, f"{glider}-{k}", t, end, filled(of.expected, glider, end, 2 * end - t)


def incidents(glider: str, dives: int, of: Pattern, now: float) -> Iterator[tuple[object, ...]]:
    for k, t, end in times(dives, now):
        if k % 1000 == 0:
            text = filled(of.incident, glider, t, end).replace(f'"{glider}"', f'"{glider}/{k}"', 1)
            yield f"{glider}/{k}", glider, t, end, text


@dataclass(frozen=True, slots=True)
class Start:
    """What a start cost: seconds to READY, PSS (MB) a moment later, seconds of `status` meanwhile."""

    seconds: float
    memory: float
    status: float


def start(config: Path) -> Start:
    """Start the daemon, ask for the status, and end it."""
    log = config.with_name("daemon.log")
    with log.open("wb") as file:
        begun = time.monotonic()
        process = subprocess.Popen([GLIDERWATCH, "run", "-c", config], stdout=file, stderr=file)
    try:
        while b'"event": "watching"' not in log.read_bytes():
            if process.poll() is not None or time.monotonic() > begun + DEATH:
                sys.exit(f"it does not start: {log.read_text()}")
            time.sleep(0.01)
        seconds = time.monotonic() - begun
        asked = cost("status", "-c", config).wall
        time.sleep(12.0)  # it has looked at all gliders by then, and given signs of life
        return Start(seconds, memory(tree(process.pid))[1], asked)
    finally:
        process.terminate()
        process.wait()


def removal(state: Path, days: float) -> tuple[float, float, int]:
    """Remove what is older than so many days: seconds in all, of the longest step, and rows."""
    store, rows, longest, begun = Store.open(state), 0, 0.0, time.monotonic()
    steps = store.remove(time.time() - days * 86400.0)
    while True:
        before = time.monotonic()
        step = next(steps, None)
        if step is None:
            break
        rows, longest = rows + step, max(longest, time.monotonic() - before)
    store.close()
    return time.monotonic() - begun, longest, rows


def size(state: Path) -> float:
    """MB of the state file."""
    return state.stat().st_size / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--gliders", type=int, default=200)
    parser.add_argument("--assessments", type=int, default=300_000)
    parser.add_argument("--removal", action="store_true", help="afterwards remove all but the last year")
    arguments = parser.parse_args()
    names = [f"glider-{number:03d}" for number in range(arguments.gliders)]
    table = Table("what", "measured", "wanted")
    with folder() as where:
        config = configure(where, names)
        empty = start(config)
        state = where / "state" / "state.sqlite"
        for path in state.parent.iterdir():
            path.unlink()
        fill(state, names, arguments.assessments // arguments.gliders, pattern(where))
        many = f"{arguments.gliders} gliders, {arguments.assessments} assessments"
        table.add_row("state file", f"{many}, {size(state):.0f} MB", "")
        starts = [start(config) for _ in range(3)]
        table.add_row("start to READY, empty state", f"{empty.seconds:.2f} s", "")
        table.add_row("start to READY", ", ".join(f"{s.seconds:.2f}" for s in starts) + " s", "< 3 s")
        table.add_row("status, empty state", f"{empty.status:.2f} s", "")
        table.add_row("status", ", ".join(f"{s.status:.2f}" for s in starts) + " s", "")
        pss = max(s.memory for s in starts)
        table.add_row("memory (PSS), empty state", f"{empty.memory:.0f} MB", "")
        table.add_row("memory (PSS)", f"{pss:.0f} MB", "")
        if arguments.removal:
            seconds, longest, rows = removal(state, 365.0)
            table.add_row("all but the last year removed", f"{rows} rows, {seconds:.1f} s", "")
            table.add_row("longest step of it", f"{longest:.2f} s", "")
            table.add_row("state file", f"{size(state):.0f} MB", "")
    print(machine())
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
