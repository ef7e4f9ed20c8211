"""A glider that calls, or does not, as the clock goes on: for tests of the rules of silence."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from alert_support import HEALTHY
from gliderwatch.incidents.notices import Fleet
from gliderwatch.incidents.overdue import Sign, Silence, next_tick, tick
from gliderwatch.messages.notice_text import render
from gliderwatch.model import Alert, Assessment, Incident, NextSurfacing

HOUR = 3600.0
DAY = 24 * HOUR
T0 = 1_700_000_000.0
INTERVAL = 3 * HOUR
CALL = 900.0
"""From the surfacing to the end of the call."""
MARGIN = INTERVAL + 2400.0


def expected(after: float = T0, **changes: object) -> NextSurfacing:
    """The surfacing after one at `after`: 3 h later, 5 km to the east."""
    made = NextSurfacing(after, after + INTERVAL, 600.0, 30.0, -80.0, 1e6, 0.0, 4e6, "as before")
    return replace(made, **changes)  # type: ignore[arg-type]


@dataclass
class Sea:
    """`rules.overdue.Known` of a glider that surfaced at some times; its files come as told."""

    surfacings: list[float] = field(default_factory=list)
    files: list[Sign] = field(default_factory=list)
    open: tuple[Incident, ...] = ()
    glider: str = "electa"
    dived: bool = True

    def call(self, t: float, at: float | None = None, *, read: bool = True) -> Sea:
        """A surfacing at `t`, whose files come at once or at a time, readable or not."""
        end = t + CALL
        if read:
            self.surfacings = sorted({*self.surfacings, t})
        self.files.append(Sign(t - INTERVAL + CALL, end if read else None, end if at is None else at))
        return self

    def incidents(self) -> tuple[Incident, ...]:
        return self.open

    def last_surfacing(self, until: float) -> Assessment | None:
        t = max((t for t in self.surfacings if t <= until), default=None)
        return (
            None if t is None else replace(HEALTHY, t_surface=t, t_dive=t - 2.5 * HOUR, lat=30.0, lon=-80.05)
        )

    def expected(self, until: float) -> NextSurfacing | None:
        t = max((t for t in self.surfacings if t <= until), default=None)
        return None if t is None else expected(t)

    def first_surfacing(self, after: float) -> float | None:
        return min((t for t in self.surfacings if t > after), default=None)

    def has_dived(self, since: float) -> bool:
        return self.dived

    def signs(self, since: float) -> tuple[Sign, ...]:
        return tuple(s for s in self.files if s.opened_at >= since)


class Clock:
    """All that is said of a glider's silence while time goes by."""

    def __init__(self, sea: Sea, hours: float | None = None) -> None:
        self.sea, self.hours = sea, hours
        self.silences: tuple[Silence, ...] = ()
        self.alerts: list[Alert] = []

    def at(self, now: float, fleet: Fleet = Fleet()) -> list[str]:  # noqa: B008
        """The kinds of the messages of one tick."""
        self.silences, new = tick(self.silences, self.sea, fleet, self.hours, now)
        self.alerts += map(render, new)
        return [str(a.kind) for a in new]

    def exactly(self, until: float, now: float) -> None:
        """Tick whenever something is due, as a replay does."""
        at = next_tick(self.silences, self.sea, self.hours, now)
        while at is not None and at <= until:
            self.at(at)
            at = next_tick(self.silences, self.sea, self.hours, at)
