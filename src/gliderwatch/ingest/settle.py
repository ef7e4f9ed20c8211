"""Which files are complete: a file still growing must not be taken. Pure: time is an argument."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from pathlib import Path

from gliderwatch.ingest import names


@dataclass(slots=True)
class _Entry:
    size: int
    mtime_ns: int
    due: float


class Settling:
    """Holds files back until they are complete, and lets each state of a file pass once.

    A long name is complete at once, and a log is read as it grows; an 8.3 name when size and mtime have
    been still for `settle_seconds`. What mtime says is never compared with a clock, for it is the glider's.
    `now` is in seconds of any clock that does not jump (monotonic).
    """

    def __init__(self, settle_seconds: float) -> None:
        self.settle_seconds = settle_seconds
        self._waiting: dict[Path, _Entry] = {}
        self._passed: dict[Path, tuple[int, int]] = {}

    def observe(self, path: Path, size: int, mtime_ns: int, now: float) -> None:
        """Takes note of a file as a scan or an event shows it; a change of state begins the wait anew."""
        state = (size, mtime_ns)
        entry = self._waiting.get(path)
        if self._passed.get(path) == state or (entry and (entry.size, entry.mtime_ns) == state):
            return
        self._passed.pop(path, None)
        at_once = names.is_long(path.name) or names.is_log(path.name)
        wait = 0.0 if at_once else self.settle_seconds
        self._waiting[path] = _Entry(size, mtime_ns, now + wait)

    def ready(self, now: float) -> list[Path]:
        """The files that are complete now, those that waited longest first; each state of a file once."""
        due = sorted((path for path, entry in self._waiting.items() if entry.due <= now), key=self._order)
        for path in due:
            entry = self._waiting.pop(path)
            self._passed[path] = (entry.size, entry.mtime_ns)
        return due

    def passed(self, path: Path) -> tuple[int, int] | None:
        """Size and mtime (ns) with which a file passed last."""
        return self._passed.get(path)

    def forget(self, path: Path) -> None:
        """Knows nothing of a file any more: it is gone, or is to be let pass once more."""
        self._waiting.pop(path, None)
        self._passed.pop(path, None)

    def only(self, there: Container[Path]) -> None:
        """Forgets the files that passed and are not `there` any more; one that comes back passes again."""
        self._passed = {path: state for path, state in self._passed.items() if path in there}

    def next_deadline(self, now: float) -> float | None:
        """Seconds from `now` until the next file may be complete; None when none waits."""
        due = min((entry.due for entry in self._waiting.values()), default=None)
        return None if due is None else max(due - now, 0.0)

    def _order(self, path: Path) -> tuple[float, Path]:
        return self._waiting[path].due, path
