"""When what is older than `state.keep_days` is removed: once a day, in steps, while no file is at hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import structlog

log = structlog.get_logger(__name__)

DAY, HOUR = 86400.0, 3600.0
STEADY = 60.0
"""Seconds by which the clock may run apart from the monotonic one between two runs."""


class Retention:
    """Removes what is old once a day, a step at a time, whenever nothing else is to be done.

    `steps` begins a run for a time before which all may go (s). The first is an hour after the start. A
    clock that has jumped since the last time may be wrong by years: then nothing is removed that time.
    """

    def __init__(self, steps: Callable[[float], Iterator[int]], now: float, monotonic: float) -> None:
        self._steps, self._offset = steps, now - monotonic
        self._due = monotonic + HOUR
        self._work: Iterator[int] | None = None
        self._removed = 0

    def pause(self, monotonic: float) -> float:
        """Seconds until there is something to do."""
        return max(0.0, self._due - monotonic)

    def turn(self, keep_days: float | None, now: float, monotonic: float) -> None:
        """Do one step, if one is due. Raises StateError; it is begun anew in an hour."""
        if monotonic < self._due:
            return
        if self._work is None:
            self._due = monotonic + DAY
            is_steady = abs(now - monotonic - self._offset) < STEADY
            self._offset = now - monotonic
            if keep_days is None or not is_steady:
                return
            self._work, self._removed = self._steps(now - keep_days * DAY), 0
        work, self._work, self._due = self._work, None, monotonic + HOUR
        for removed in work:
            self._removed += removed
            self._work, self._due = work, monotonic
            return
        self._due = monotonic + DAY
        log.info("what is older than state.keep_days is removed", rows=self._removed)
