"""Logs of calls: how soon a line in one that grows is a mail, and what 1,000 damaged ones and a huge one do.

    python benchmarks/logs.py lines [--gliders 30]
    python benchmarks/logs.py damaged [--logs 1000] [--data ../shared/data/logs]

`lines`: gliders call, and in the log of one after another a line says that it aborts; seconds from that line
to the mail that a local server has accepted. `damaged`: lines lost, doubled, moved and overwritten, the end
cut, of public logs and simulated ones; beside them one of 1 GB, and two just below what is read of a log. The
installed command replays them; counted are those that the ledger names, and the memory at the most.
"""

from __future__ import annotations

import argparse
import random
import resource
import statistics
import subprocess
import time
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

from aiosmtpd.controller import Controller
from common import GLIDERWATCH, configure, daemon, folder, machine, wait_taken
from latency import PORT, Mailbox

from gliderwatch.simulate.calls import CallRates, call_logs
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.slocum.calls import LARGEST
from gliderwatch.store.state_file import Status, Store

ABORTS = b"62.87 28 behavior ?_-1: abort_the_mission(1): (24)MS_ABORT_LEAK\r\n"
GLIDERS = 50
HUGE = 1_000_000_000
NAMED_AFTER = b"unit_1033"


def begin(root: Path, glider: str) -> Path:
    """The log of a call that has just begun; nothing of it is an alarm."""
    now = datetime.now(UTC)
    path = root / glider / "logs" / f"{glider}_{now:%Y%m%dT%H%M%S}_network_net_0.log"
    path.write_bytes(
        b"Connection Event: Carrier Detect found.\r\n"
        + f"MissionName:ew33.mi MissionNum:{glider}-2025-022-0-33 (0103.0033)\r\n".encode()
        + f"Vehicle Name: {glider}\r\nCurr Time: {now:%a %b %d %H:%M:%S %Y} MT:  263958\r\n".encode()
        + b"ABORT HISTORY: total since reset: 0\r\n"
    )
    return path


def lines(gliders: int) -> None:
    """Print how long pilots wait for the mail of a line."""
    names, box, seconds = [f"g{k:03d}" for k in range(gliders)], Mailbox(), list[float]()
    server = Controller(box, hostname="127.0.0.1", port=PORT)
    server.start()
    try:
        with folder() as where:
            url = f"mailto://127.0.0.1:{PORT}?from=gliderwatch@a.org&to=pilot@b.org"
            config = configure(where, names, channels={"mail": {"url": url}})
            for name in names:
                (where / "gliders" / name / "from-glider").mkdir(parents=True)
                (where / "gliders" / name / "logs").mkdir()
            with daemon(config):
                wait_taken(config, 0)
                logs = [begin(where / "gliders", name) for name in names]
                wait_taken(config, gliders)
                for log in logs:
                    with log.open("ab") as file:
                        file.write(ABORTS)
                    begun = time.monotonic()
                    seconds.append(box.wait() - begun)
    finally:
        server.stop()
    median, late = statistics.median(seconds), statistics.quantiles(seconds, n=20)[-1]
    print(machine())
    print(
        f"{len(seconds)} lines to mails: median {1000 * median:.0f} ms, 95 % {1000 * late:.0f} ms, "
        f"most {1000 * max(seconds):.0f} ms"
    )


def whole_logs(data: Path) -> list[bytes]:
    """Public logs, where they are at hand, and simulated ones with an abort."""
    public = [path.read_bytes() for path in sorted(data.glob("*.log"))]
    mission = simulate(Scenario(seed=7, glider=NAMED_AFTER.decode(), days=1.0))
    rates = CallRates(dropped=0.1, no_file=0.1, garbled=0.01, abort=0.6, typing=0.3)
    return public + [b"".join(line for _, line in log.lines) for log in call_logs(mission, rates)]


def mutated(whole: bytes, rng: random.Random) -> bytes:
    """A log that is damaged as lines and disks do it."""
    parts = whole.splitlines(keepends=True)
    for _ in range(rng.randrange(1, 12)):
        k, other = rng.randrange(len(parts)), rng.randrange(len(parts))
        what = rng.randrange(5)
        if what == 0 and len(parts) > 1:
            del parts[k]
        elif what == 1:
            parts.insert(other, parts[k])
        elif what == 2:
            parts[k], parts[other] = parts[other], parts[k]
        elif what == 3:
            line = bytearray(parts[k])
            for _ in range(rng.randrange(1, 9)):
                line[rng.randrange(len(line))] = rng.randrange(256)
            parts[k] = bytes(line)
        else:
            parts[k] = parts[k].rstrip(b"\r\n") + rng.choice((b"", b"\r", b"\n", b"\0"))
    data = b"".join(parts)
    return data[: rng.randrange(1, 2 * len(data))]


def write_damaged(where: Path, n: int, data: Path) -> None:
    """Damaged logs of some gliders, one that is huge, and two as large as is read."""
    rng, wholes = random.Random(20250126), whole_logs(data)
    for k in range(n):
        glider = f"unit_{k % GLIDERS:04d}"
        log = mutated(rng.choice(wholes), rng).replace(NAMED_AFTER, glider.encode())
        (where / f"{glider}_20250126T{k // 60 % 24:02d}{k % 60:02d}55_network_net_0.log").write_bytes(log)
    block = wholes[0] * (1 + LARGEST // len(wholes[0]))
    for name, content, times in (
        ("huge", block, HUGE // len(block) + 1),
        ("lines", block[:LARGEST], 1),
        ("one_line", b"\xff" * LARGEST, 1),
    ):
        with (where / f"{name}_20250126T072155.log").open("wb") as file:
            for _ in range(times):
                file.write(content)


def damaged(n: int, data: Path) -> None:
    """Print what becomes of damaged logs."""
    with folder() as where:
        logs = where / "logs"
        logs.mkdir()
        write_damaged(logs, n, data)
        size = sum(path.stat().st_size for path in logs.iterdir())
        begun = time.monotonic()
        done = subprocess.run(
            [GLIDERWATCH, "run", "--replay", logs, "--out", where / "out"],
            capture_output=True,
            text=True,
            check=False,
        )
        seconds = time.monotonic() - begun
        store = Store.reading(where / "out" / "replay.sqlite")
        ledger = {Path(file.path).name: file for file in store.files(*Status)}
        store.close()
        there = {path.name for path in logs.iterdir()}
    counts = Counter(str(file.status) for file in ledger.values())
    mute = [name for name, file in ledger.items() if file.status != Status.TAKEN and not file.reason]
    print(f"{len(there)} logs, {size / 1e9:.1f} GB: exit {done.returncode}, {dict(counts)}, {seconds:.0f} s")
    print(f"not in the ledger: {len(there - ledger.keys())}; not taken and without a reason: {len(mute)}")
    print(f"the huge one: {ledger['huge_20250126T072155.log'].reason}")
    print(f"memory at the most: {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:.0f} MB")
    print(f"its last line of errors: {(done.stderr.strip().splitlines() or [''])[-1]}")


def main() -> None:
    shape = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=shape)
    parser.add_argument("what", choices=("lines", "damaged"))
    parser.add_argument("--gliders", type=int, default=30)
    parser.add_argument("--logs", type=int, default=1000)
    parser.add_argument("--data", type=Path, default=Path("../shared/data/logs"))
    given = parser.parse_args()
    if given.what == "lines":
        lines(given.gliders)
    else:
        damaged(given.logs, given.data)


if __name__ == "__main__":
    main()
