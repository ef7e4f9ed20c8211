"""The process that draws: it loads matplotlib, can be slow, hang or die, and no alert waits for it."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from threading import Lock
from typing import TypeVar

from gliderwatch.processes import Workers

_Job = TypeVar("_Job")
_Made = TypeVar("_Made")


class DrawingProcess:
    """One process, begun when there is something to draw. For use by several threads.

    `state` is the state file, beside which matplotlib keeps what it knows of fonts; `niceness` by how much it
    yields to others; `warm` is called in the process before its first job.
    """

    def __init__(self, niceness: int, warm: Callable[[], None] | None = None) -> None:
        self._niceness, self._warm = niceness, warm
        self._pool: Workers | None = None
        self._lock = Lock()

    def begin(
        self, work: Callable[[_Job], _Made], job: _Job, limit: float, state: Path
    ) -> Future[_Made] | None:
        """Have the work done, in not more than `limit` s from when it is begun; None where that cannot be."""
        with self._lock:
            for _ in range(2):
                if self._pool is None:
                    cache = str(state.parent / "matplotlib")
                    self._pool = Workers(1, _prepare, (cache, self._niceness, self._warm))
                try:
                    made: Future[_Made] = self._pool.schedule(work, args=(job,), timeout=limit)
                    return made
                except RuntimeError:  # the pool gives up for good when a process dies that has nothing to do
                    self._end()
        return None

    def stop(self) -> None:
        """End the process at once."""
        with self._lock:
            self._end()

    def _end(self) -> None:
        if self._pool is not None:
            self._pool.end()
            self._pool = None


def _prepare(cache: str, niceness: int, warm: Callable[[], None] | None) -> None:
    """What the process does first: it yields to others."""
    with suppress(OSError):  # systemd's filter may refuse it
        os.nice(niceness)
    os.environ.setdefault("MPLCONFIGDIR", cache)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if warm is not None:
        warm()
