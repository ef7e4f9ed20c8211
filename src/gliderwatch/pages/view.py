"""What a page shows of a glider, as a value, and what follows from it: how bad it is, where it is. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from gliderwatch.incidents.acknowledgement import Acks
from gliderwatch.incidents.constants import GONE
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.incidents.overdue import ExpectedCall, current
from gliderwatch.incidents.whereabouts import whereabouts
from gliderwatch.messages.formatting import INCIDENTS, clean, duration, speed, utc
from gliderwatch.model import Alert, Assessment, Call, Fix, Incident, Kind, NextSurfacing
from gliderwatch.params import Attention


@dataclass(frozen=True, slots=True)
class GliderView:
    """One glider as known at ``now`` (s): its last ``dives`` that ended and ``incidents``, in order of time,
    who took them on (``acks``), the next surfacing ``expected``, the call ``awaited``, its ``calls`` and the
    text of the ``log`` of the last one, the newest ``alerts`` first, and what people were ``said``;
    ``waypoint`` (degrees) where it is bound."""

    name: str
    now: float
    dives: tuple[Assessment, ...] = ()
    incidents: tuple[Incident, ...] = ()
    acks: Acks = field(default_factory=dict)
    attention: Attention = Attention()
    expected: NextSurfacing | None = None
    awaited: ExpectedCall | None = None
    calls: tuple[Call, ...] = ()
    log: str = ""
    alerts: tuple[Alert, ...] = ()
    said: NotificationState = NotificationState()
    waypoint: tuple[float, float] | None = None

    @property
    def latest(self) -> Assessment | None:
        """Its last dive that ended."""
        return self.dives[-1] if self.dives else None

    @property
    def open(self) -> tuple[Incident, ...]:
        """The incidents that are not over, the worst first."""
        found = (i for i in self.incidents if i.cleared_at is None)
        return tuple(sorted(found, key=lambda i: (-i.severity, i.since)))

    @property
    def heard(self) -> float | None:
        """Its last sign of life (s)."""
        times = [call.last_t for call in self.calls if call.last_t <= self.now]
        times += [self.awaited.last_sign] if self.awaited is not None else []
        times += [self.latest.t_surface] if self.latest is not None else []
        return max(times, default=None)

    @property
    def fix(self) -> Fix | None:
        """Its last position: of a call, or of the end of a dive."""
        known = [call.fix for call in self.calls if call.fix is not None]
        known += [
            Fix(d.t_surface, d.lat, d.lon) for d in self.dives if d.lat is not None and d.lon is not None
        ]
        return max(known, key=lambda fix: fix.t, default=None)

    @property
    def flow(self) -> tuple[float, float] | None:
        """The last known current (east, north; m/s)."""
        return None if self.latest is None else current(self.latest)

    @property
    def is_over(self) -> bool:
        """Whether nothing was heard for so long that the deployment counts as over."""
        return self.heard is not None and self.now - self.heard >= GONE

    @property
    def is_overdue(self) -> bool:
        """Whether the call awaited has not come in time."""
        call = self.awaited
        return call is not None and not self.attention.recovered and not self.is_over and self.now >= call.due

    def whereabouts(self, ahead: float = 0.0) -> DriftEllipse | None:
        """Where it is with 95 %, so many seconds from now."""
        fix = self.fix
        place = (fix.lat, fix.lon) if fix is not None else None
        due = self.awaited.due if self.awaited is not None else None
        return whereabouts(self.expected, place, self.flow, due, self.now + ahead)


@dataclass(frozen=True, slots=True)
class Verdict:
    """How a glider is: the ``rank`` (the least is the worst), a ``word`` and its ``colour`` (bad, warn, ok,
    quiet), a ``sentence``, and since when (s)."""

    rank: int
    colour: str
    word: str
    sentence: str
    since: float | None = None


def verdict(view: GliderView) -> Verdict:
    """The worst of what is so of a glider, in words."""
    return min(_verdicts(view), key=lambda v: v.rank)


def _verdicts(view: GliderView) -> Iterator[Verdict]:
    if view.attention.recovered:
        yield Verdict(-1, "quiet", "RECOVERED", "It is out of the water.")
    elif view.is_over and view.heard is not None:
        yield Verdict(
            -1, "quiet", "OVER", "Nothing was heard for a month: its deployment seems over.", view.heard
        )
    for episode in view.said.aborts:
        if episode.cleared is None:
            cause = next((clean(t.cause, 40) for t in episode.reports if t.cause), "")
            sentence = f"It fell out of its mission{f': {cause}' if cause else ''}."
            yield Verdict(0, "bad", "ABORTED", sentence, episode.reports[0].t)
    if view.is_overdue and (call := view.awaited) is not None:
        sentence = f"Expected {utc(call.t)}, silent for {duration(view.now - call.last_sign)}."
        yield Verdict(1, "bad", "OVERDUE", sentence, call.last_sign)
    for incident in view.open:
        yield _of_incident(incident)
    if view.said.empty is not None and not view.said.empty.is_over:
        yield Verdict(4, "warn", "NO FILES", "It calls, and sends no file.", view.said.empty.since)
    if view.said.unknown is not None and not view.said.unknown.is_over:
        yield Verdict(
            5, "warn", "NOT JUDGED", "Files come, but no dive can be judged.", view.said.unknown.since
        )
    yield _of_last_dive(view)


def _of_incident(incident: Incident) -> Verdict:
    last = incident.last
    if incident.kind is Kind.ANOMALY:
        is_fast = last.speed is not None and last.speed > last.speed_max
        normal = f"{last.speed_min:.2f}-{last.speed_max:.2f} m/s"
        sentence = f"{speed(last.speed)} through the water, normal is {normal}; {incident.dives} dives."
        return Verdict(2, "bad", "FAST" if is_fast else "SLOW", sentence, incident.since)
    words = INCIDENTS.get(incident.kind, str(incident.kind))
    return Verdict(3, "warn", "DISAGREES", f"{words.capitalize()}; {incident.dives} dives.", incident.since)


def _of_last_dive(view: GliderView) -> Verdict:
    last, call = view.latest, view.awaited
    if call is not None and view.now > call.t:
        late = f"Expected {utc(call.t)}: {duration(view.now - call.t)} late, not overdue yet."
        return Verdict(6, "warn", "LATE", late, call.t)
    if last is None:
        return Verdict(9, "quiet", "NO DIVE YET", "No dive has been judged yet.")
    if last.flag is None:
        return Verdict(8, "quiet", "NO FLAG", f"The last dive has no flag: {clean(last.reason, 90)}.")
    if last.flag != 0:
        return Verdict(7, "warn", "WATCH", f"The last dive is out of the ordinary: {clean(last.reason, 90)}.")
    normal = f"{last.speed_min:.2f}-{last.speed_max:.2f} m/s"
    return Verdict(10, "ok", "NORMAL", f"{speed(last.speed)} through the water, normal is {normal}.")


def worst_first(views: tuple[GliderView, ...]) -> tuple[tuple[GliderView, Verdict], ...]:
    """Gliders with their verdicts; those that are over last, gliders of one rank by name."""
    found = [(view, verdict(view)) for view in views]
    return tuple(sorted(found, key=lambda p: (p[1].rank if p[1].rank >= 0 else 99, p[0].name)))
