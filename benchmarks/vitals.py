"""What the daemons of a storm take of the machine."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from common import memory
from storm import Lane, Storm

from acceptance.hostile import peak

_GROWTH, _MOST = 60.0, 400.0
"""MB by which the last daemon may grow, and that a daemon may have resident at the most."""


_FILES = 3
"""Files that the last daemon may have open more: a connection or two that are opened when first needed."""


class Vitals:
    """Memory (PSS, MB) and open files of the daemon at the ``start``, of the last one while it is ``young``
    and at the ``end``; and the most memory (RSS, MB) that any had."""

    def __init__(self, storm: Storm) -> None:
        self.storm = storm
        self.pss: dict[str, float] = {}
        self.open_files: dict[str, list[str]] = {}
        self.most = 0.0

    def lane(self) -> Lane:
        """Measures a daemon that has just begun, and the last one."""
        yield from self._young("start")
        while not self.storm.is_calm():
            self._look()
            yield 0.5
        yield from self._young("young")
        while True:
            self._look()
            yield 0.5

    def measure(self, when: str) -> None:
        """Note what the daemon takes now."""
        self._look()
        self.pss[when] = memory([self.storm.daemon.pid])[1]
        self.open_files[when] = [_target(fd) for fd in Path(f"/proc/{self.storm.daemon.pid}/fd").iterdir()]

    def growth(self) -> list[str]:
        """What the last daemon has more than it began with."""
        pss, files, found = self.pss, self.open_files, []
        if "young" not in pss:
            return [
                "the last daemon was not measured when it began: the machine is too busy for so few minutes"
            ]
        if len(files["end"]) > len(files["young"]) + _FILES:
            more = Counter(files["end"]) - Counter(files["young"])
            found.append(f"open files that were not before: {dict(more)}")
        if pss["end"] - pss["young"] > _GROWTH or self.most > _MOST:
            found.append(f"memory: {pss['young']:.0f} MB grew to {pss['end']:.0f}, {self.most:.0f} at most")
        return found

    def _young(self, when: str) -> Lane:
        daemon = self.storm.daemon
        while when not in self.pss:
            while not self.storm.is_ready():
                yield 0.2
            pid = daemon.pid
            yield 2.0
            if daemon.alive() and daemon.pid == pid:
                self.measure(when)

    def _look(self) -> None:
        self.most = max(self.most, peak(self.storm.daemon.pid))


def _target(fd: Path) -> str:
    """What is open, without its number: a path, or a kind."""
    try:
        return str(fd.readlink()).partition(":[")[0]
    except OSError:  # closed meanwhile
        return ""
