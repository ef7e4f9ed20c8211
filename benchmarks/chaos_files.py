"""Thousands of hostile files and a folder of 100,000, while good files come: prints what became of them.

    python benchmarks/chaos_files.py [HOSTILE [CROWD [SEED]]]

Damaged, cut, grown, empty, huge, misnamed and foreign files, links, FIFOs, sockets and folders with the names
of files, names with line ends and terminal escapes, and files that hang or crash the decoder or take all of
its memory. Ends with 1 unless the daemon lives, has named every entry, and made of the good files what a
replay makes of them.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from common import machine

from acceptance.angus import FILES, angus
from acceptance.hostile import fill, peak, program, shown, workers
from acceptance.support import Daemon, Site, command, remora, results
from gliderwatch.simulate.delivery import Arrival, arrivals
from gliderwatch.store.state_file import Status

_PATIENCE = 1800.0
_TOO_MUCH = 500.0
"""MB that the daemon itself may take."""


def main(hostile: int = 2500, crowd: int = 100_000, seed: int = 1) -> int:
    """Run it; the exit code."""
    print(machine())
    with tempfile.TemporaryDirectory(prefix="gliderwatch-chaos-") as name:
        site, bruce = angus(Path(name)), remora(3.0)
        site.caches(bruce)
        site.configure("angus", "bruce", "crowd", rescan_seconds=5)
        names = fill(site.folder("angus"), [file.data for file in FILES], hostile, seed)
        folder = site.folder("crowd")
        for number in range(crowd):
            (folder / f"crowd-2024-121-0-{number}.sbd").touch()
        names += [f"crowd-2024-121-0-{number}.sbd" for number in range(crowd)]
        with Daemon(site, (sys.executable, "-c", program())) as daemon:
            good = _Good(site, list(arrivals(bruce)))
            most, took = _watch(site, daemon, names, good)
            lives, largest, taken = daemon.alive(), peak(daemon.pid), good.taken()
            code = daemon.stop()
        alone = Path(name) / "alone"
        command("run", "-c", site.config, "--replay", site.folder("bruce"), "--out", alone)
        same = results(site.state)["bruce"] == results(alone / "replay.sqlite")["bruce"]
        ledger = site.files()
    unnamed = [name for name in map(shown, names) if name not in ledger]
    print(f"{hostile} hostile entries and a folder of {crowd} empty files, {took:.0f} s")
    print(f"not named: {len(unnamed)} {unnamed[:5]}")
    print("  " + ", ".join(f"{n} {s}" for s, n in Counter(f.status for f in ledger.values()).most_common()))
    for reason, n in Counter(_short(f.reason) for f in ledger.values()).most_common(25):
        print(f"  {n:6d}  {reason}")
    print(f"good files: {len(good.files)}, of them {taken} taken, the slowest after {good.slowest:.1f} s")
    print(f"as in a replay: {same}; daemon alive: {lives}, ended with {code}")
    print(f"memory at most (MB): daemon {largest:.0f}, workers together {most:.0f}")
    return 0 if lives and same and not unnamed and not code and largest < _TOO_MUCH else 1


class _Good:
    """Good files that come one after another, each once the one before was taken."""

    def __init__(self, site: Site, files: list[Arrival]) -> None:
        self.site, self.files, self.slowest = site, files, 0.0
        self._next, self._since = 0, 0.0

    def taken(self) -> int:
        """How many are taken."""
        return self.site.statuses(*(file.name for file in self.files)).count(Status.TAKEN)

    def go_on(self, statuses: dict[str, Status]) -> bool:
        """Let the next one come, if it is time; whether all are taken."""
        last = self.files[self._next - 1].name if self._next else None
        if last is not None and statuses.get(last) != Status.TAKEN:
            return False
        if last is not None:
            self.slowest = max(self.slowest, time.monotonic() - self._since)
        if self._next == len(self.files):
            return True
        self.site.put("bruce", self.files[self._next].name, self.files[self._next].data)
        self._next, self._since = self._next + 1, time.monotonic()
        return False


def _watch(site: Site, daemon: Daemon, names: list[str], good: _Good) -> tuple[float, float]:
    """Wait until all is named and taken; the most memory of the workers (MB), and how long it took (s)."""
    begun, most, done, missing = time.monotonic(), 0.0, False, set(map(shown, names))
    while (missing or not done) and daemon.alive() and time.monotonic() < begun + _PATIENCE:
        time.sleep(0.5)
        most = max(most, workers(daemon.pid))
        ledger = site.files()
        missing -= ledger.keys()
        done = done or good.go_on({name: file.status for name, file in ledger.items()})
    return most, time.monotonic() - begun


def _short(reason: str) -> str:
    words = reason.partition("(")[0].partition(":")[0]
    return " ".join(word for word in words.split() if not any(c.isdigit() for c in word))[:90] or "-"


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
