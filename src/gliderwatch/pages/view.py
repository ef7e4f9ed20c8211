"""What a page shows of a glider, as a value, and what follows from it: how bad it is, where it is. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from gliderwatch.fleet.advice import Advice
from gliderwatch.forecast.constants import GPS_ERROR
from gliderwatch.health.battery import End
from gliderwatch.health.readings import Readings
from gliderwatch.incidents.acknowledgement import Acks
from gliderwatch.incidents.constants import GONE
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.incidents.overdue import ExpectedCall, current
from gliderwatch.incidents.whereabouts import whereabouts
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.layers.section import Section
from gliderwatch.messages.formatting import INCIDENTS, clean, duration, speed, utc
from gliderwatch.model import Alert, Assessment, Call, Fix, Incident, Kind, NextSurfacing, Severity
from gliderwatch.pages.matters import Matter, matters
from gliderwatch.params import Attention


@dataclass(frozen=True, slots=True)
class GliderView:
    """One glider as known at ``now`` (s): its last ``dives`` that ended and ``incidents``, in order of time,
    who took them on (``acks``), the next surfacing ``expected``, the call ``awaited``, its ``calls`` and the
    text of the ``log`` of the last one, the newest ``alerts`` first, and what people were ``notified`` of;
    ``waypoint`` (degrees) where it is bound; ``readings`` of its health, when its ``battery`` ends, the
    ``section`` of a property along its way with the ``layers`` found and advised after each profile, and by
    field where it should look next since its last surfacing (``advice``)."""

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
    notified: NotificationState = NotificationState()
    waypoint: tuple[float, float] | None = None
    readings: Readings = field(default_factory=dict)
    section: Section | None = None
    layers: tuple[LayerAdvice, ...] = ()
    battery: End | None = None
    advice: tuple[tuple[str, Advice], ...] = ()

    @property
    def latest(self) -> Assessment | None:
        """Its last dive that ended."""
        return self.dives[-1] if self.dives else None

    @property
    def open(self) -> tuple[Incident, ...]:
        """The incidents of dives that are not over, the worst first."""
        found = (i for i in self.incidents if i.cleared_at is None)
        return tuple(sorted(found, key=lambda i: (-i.severity, i.since)))

    @property
    def matters(self) -> tuple[Matter, ...]:
        """What needs, or needed, somebody by now, in order of time."""
        found = (m for m in matters(self.incidents, self.notified, self.acks) if m.since <= self.now)
        return tuple(replace(m, over=None) if m.over is not None and m.over > self.now else m for m in found)

    @property
    def open_matters(self) -> tuple[Matter, ...]:
        """What goes on, the worst first."""
        found = (m for m in self.matters if m.over is None)
        return tuple(sorted(found, key=lambda m: (-m.severity, m.since)))

    @property
    def last_sign(self) -> float | None:
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
        return self.last_sign is not None and self.now - self.last_sign >= GONE

    @property
    def is_overdue(self) -> bool:
        """Whether the call awaited has not come in time."""
        call = self.awaited
        return call is not None and not self.attention.recovered and not self.is_over and self.now >= call.due

    @property
    def is_adrift(self) -> bool:
        """Whether it has aborted and not gone on: it lies at the surface."""
        return any(m.kind is Kind.ABORT and m.over is None for m in self.matters)

    def whereabouts(self, ahead: float = 0.0) -> DriftEllipse | None:
        """Where it is with 95 %, so many seconds from now; one that is adrift drifts from its last fix. None
        where nothing is known, of a glider out of the water, and of one not heard for a month."""
        if self.is_over or self.attention.recovered:
            return None
        fix, expected = self.fix, self.expected
        place = (fix.lat, fix.lon) if fix is not None else None
        due = self.awaited.due if self.awaited is not None else None
        if fix is not None and self.is_adrift:
            error = GPS_ERROR**2
            expected = NextSurfacing(fix.t, fix.t, 0.0, fix.lat, fix.lon, error, 0.0, error, "its last fix")
            due = fix.t
        return whereabouts(expected, place, self.flow, due, self.now + ahead)


@dataclass(frozen=True, slots=True)
class Verdict:
    """How a glider is: the ``rank`` (the least is the worst), a ``word`` and its ``colour`` (bad, warn, ok,
    quiet), a ``sentence``, since when (s), and the id of the ``matter`` that it is about."""

    rank: int
    colour: str
    word: str
    sentence: str
    since: float | None = None
    matter: str = ""


def verdict(view: GliderView) -> Verdict:
    """The worst of what is so of a glider, in words."""
    return min(_verdicts(view), key=lambda v: v.rank)


def _verdicts(view: GliderView) -> Iterator[Verdict]:
    if view.attention.recovered:
        yield Verdict(-1, "quiet", "RECOVERED", "It is out of the water.")
    elif view.is_over and view.last_sign is not None:
        yield Verdict(
            -1, "quiet", "OVER", "Nothing was heard for a month: its deployment seems over.", view.last_sign
        )
    for episode in view.notified.aborts:
        if episode.cleared is None:
            cause = next((clean(t.cause, 40) for t in episode.reports if t.cause), "")
            sentence = f"It fell out of its mission{f': {cause}' if cause else ''}."
            yield Verdict(0, "bad", "ABORTED", sentence, episode.reports[0].t, episode.id)
    if view.is_overdue and (call := view.awaited) is not None:
        sentence = f"Expected {utc(call.t)}, silent for {duration(view.now - call.last_sign)}."
        yield Verdict(1, "bad", "OVERDUE", sentence, call.last_sign)
    for incident in view.open:
        yield _of_incident(incident)
    for matter in view.open_matters:
        if (found := _of_matter(matter)) is not None:
            yield found
    yield _of_last_dive(view)


def _of_matter(matter: Matter) -> Verdict | None:
    """What goes on beside the flight; None of what is looked at by itself."""
    since, id_ = matter.since, matter.id
    match matter.kind:
        case Kind.HEALTH:
            bad = matter.severity is Severity.CRITICAL
            sentence = f"{matter.sentence[:1].upper()}{matter.sentence[1:]}."
            return Verdict(
                1 if bad else 4, "bad" if bad else "warn", matter.word.upper(), sentence, since, id_
            )
        case Kind.CALL:
            return Verdict(5, "warn", "NO FILES", "It calls, and sends no file.", since, id_)
        case Kind.NEIGHBOURS:
            return Verdict(4, "warn", "NEIGHBOURS", f"{matter.sentence.capitalize()}.", since, id_)
        case Kind.UNKNOWN:
            return Verdict(6, "warn", "NOT JUDGED", "Files come, but no dive can be judged.", since, id_)
    return None


def _of_incident(incident: Incident) -> Verdict:
    last = incident.last
    if incident.kind is Kind.ANOMALY:
        is_fast = last.speed is not None and last.speed > last.speed_max
        normal = f"{last.speed_min:.2f}-{last.speed_max:.2f} m/s"
        sentence = f"{speed(last.speed)} through the water, normal is {normal}; {incident.dives} dives."
        return Verdict(2, "bad", "FAST" if is_fast else "SLOW", sentence, incident.since, incident.id)
    words = INCIDENTS.get(incident.kind, str(incident.kind))
    sentence = f"{words.capitalize()}; {incident.dives} dives."
    return Verdict(3, "warn", "DISAGREES", sentence, incident.since, incident.id)


def _of_last_dive(view: GliderView) -> Verdict:
    last, call = view.latest, view.awaited
    if call is not None and view.now > call.t:
        late = f"Expected {utc(call.t)}: {duration(view.now - call.t)} late, not overdue yet."
        return Verdict(7, "warn", "LATE", late, call.t)
    if last is None:
        return Verdict(10, "quiet", "NO DIVE YET", "No dive has been judged yet.")
    if last.flag is None:
        return Verdict(9, "quiet", "NO FLAG", f"The last dive has no flag: {clean(last.reason, 90)}.")
    if last.flag != 0:
        return Verdict(8, "warn", "WATCH", f"The last dive is out of the ordinary: {clean(last.reason, 90)}.")
    normal = f"{last.speed_min:.2f}-{last.speed_max:.2f} m/s"
    return Verdict(11, "ok", "NORMAL", f"{speed(last.speed)} through the water, normal is {normal}.")


def worst_first(views: tuple[GliderView, ...]) -> tuple[tuple[GliderView, Verdict], ...]:
    """Gliders with their verdicts; those that are over last, gliders of one rank by name."""
    found = [(view, verdict(view)) for view in views]
    return tuple(sorted(found, key=lambda p: (p[1].rank if p[1].rank >= 0 else 99, p[0].name)))
