"""The clock as an input: who is overdue now, and when to look again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from gliderwatch.model import Alert
from gliderwatch.run import intake
from gliderwatch.run.intake import Speaking
from gliderwatch.store.sqlite import Store

TICK = 60.0
"""Seconds between two ticks at the most."""
JUMP = 10.0
"""Seconds by which the clock may run apart from the monotonic one between two ticks."""
HOLD = 60.0
"""Seconds for which nobody is called overdue after the clock has jumped: it may jump back."""


class Ticking:
    """Ticks of one daemon; remembers how the clock runs."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._offset: float | None = None
        self._trusted_from = float("-inf")

    def tick(
        self,
        gliders: Sequence[str],
        speaking: Speaking,
        is_busy: Callable[[str], bool],
        now: float,
        monotonic: float,
    ) -> tuple[tuple[Alert, ...], float]:
        """Messages about those `gliders` that are overdue at `now` (s), and seconds until the next tick.

        A glider of which files are at hand (`is_busy`) is left for the next one.
        """
        if self._offset is not None and abs(now - monotonic - self._offset) > JUMP:
            self._trusted_from = monotonic + HOLD
        self._offset = now - monotonic
        hold, pause = self._trusted_from - monotonic, TICK
        alerts: list[Alert] = []
        for glider in gliders:
            if is_busy(glider) or hold > 0:
                continue
            alerts += intake.tick(self._store, glider, speaking, _others(gliders, glider, speaking), now)
            at = intake.next_tick(self._store, glider, speaking, now)
            if at is not None and at > now:
                pause = min(pause, at - now)
        return tuple(alerts), min(pause, hold) if hold > 0 else pause


def _others(gliders: Iterable[str], glider: str, speaking: Speaking) -> list[str]:
    return [other for other in gliders if other != glider and not speaking.attention(other).recovered]
