"""What people read when a glider stays away, and when it calls again. Pure.

The same form as `messages.incident_text`: what and how bad, since when, where to look, what speaks
for trouble and against it, what to check.
"""

from __future__ import annotations

from dataclasses import dataclass

from gliderwatch.messages.formatting import INCIDENTS, clean, duration, flow, known, map_link, place, utc
from gliderwatch.messages.template import Page
from gliderwatch.model import Alert, Assessment, Incident, Kind, Severity

_EACH = (
    "This stands for all of them: each of the others is told by itself if it still stays away when one calls."
)


@dataclass(frozen=True, slots=True)
class DriftEllipse:
    """Where a glider is with 95 %: an ellipse about ``lat``, ``lon`` (degrees).

    ``major`` and ``minor`` are its semi-axes (m), ``bearing`` that of the major one (degrees from true
    north, 0 to 180).
    """

    lat: float
    lon: float
    major: float
    minor: float
    bearing: float


@dataclass(frozen=True, slots=True)
class Fleet:
    """The other gliders at sea: how many, how many of them ``late`` too, the last sign of life of any (s).

    ``names`` are theirs. ``shore`` is the thread of a message about one of them that was for all, because
    none called; empty where there is none, or it is over. ``back`` is when the first called after that (s).
    """

    others: int = 0
    late: int = 0
    last: float | None = None
    names: tuple[str, ...] = ()
    shore: str = ""
    back: float | None = None

    @property
    def is_silent(self) -> bool:
        """Whether no glider calls at all."""
        return self.others > 0 and self.late == self.others


@dataclass(frozen=True, slots=True)
class Absence:
    """A glider that stays away, as known at ``now`` (s).

    ``heard`` is its last sign of life and ``awaited`` the call that did not come (s); ``lat`` and ``lon``
    (degrees) where that was expected. ``last`` is the last dive that ended, ``incidents`` what was open.
    """

    glider: str
    now: float
    heard: float
    awaited: float
    lat: float | None
    lon: float | None
    area: DriftEllipse | None
    last: Assessment | None
    incidents: tuple[Incident, ...]
    fleet: Fleet


def overdue(absence: Absence, *, alert_id: str, thread: str, severity: Severity, first: bool) -> Alert:
    """The glider is overdue; not the ``first`` message of it: it still is."""
    a, silent = absence, duration(absence.now - absence.heard)
    lead = f"{_name(a.glider)} is overdue: it was expected {utc(a.awaited)} and has been silent for {silent}."
    if not first:
        lead = f"Still no sign of life. {lead}"
    trouble, harmless = _weighed(a)
    page = Page(
        (lead, *_remark(a.fleet)),
        (
            ("Silent since", utc(a.heard)),
            ("Expected", f"{utc(a.awaited)}, {place(a.lat, a.lon)}"),
            *_last(a.last),
            *_look(a),
        ),
        (("Speaks for trouble", trouble), ("Speaks against", harmless), ("Check", _checks(a))),
    )
    title = f"{'' if first else 'STILL '}OVERDUE {_name(a.glider)}: silent for {silent}, "
    title += f"expected {utc(a.awaited)}"
    if a.fleet.is_silent:
        title += f", as all {a.fleet.others + 1} gliders: shore side?"
    kind = Kind.OVERDUE if first else Kind.REMINDER
    return _alert(a.glider, a.now, kind, title, page, alert_id, thread, severity, severity)


def called(
    glider: str,
    heard: float,
    at: float,
    last: Assessment | None,
    *,
    alert_id: str,
    thread: str,
    to: Severity,
    shore: bool = False,
) -> Alert:
    """The glider gave a sign of life at ``at`` (s), the first since ``heard`` (s). ``shore``: that it stayed
    away was told together with the silence of all others."""
    silent = duration(at - heard)
    lead = f"{_name(glider)} calls again: {utc(at)}, after {silent} of silence. It is not overdue any more."
    page = Page(
        (lead, *((_EACH,) if shore else ())),
        (("Silent", f"{utc(heard)} to {utc(at)}"), *_last(last)),
    )
    title = f"ALL CLEAR {_name(glider)}: it calls again after {silent}"
    return _alert(glider, at, Kind.ALL_CLEAR, title, page, alert_id, thread, Severity.INFO, to)


def withdrawn(
    glider: str, due: float, at: float, now: float, *, alert_id: str, thread: str, to: Severity
) -> Alert:
    """Files that came ``now`` show that the glider called at ``at``, before it was ``due`` (s)."""
    page = Page(
        (
            f"Correction for {_name(glider)}: it was up {utc(at)}, in time. "
            "Its files came late or not at all: not the glider was slow, but their way to here.",
        ),
        (("Told before", f"overdue since {utc(due)}"), ("Known now", f"at the surface {utc(at)}")),
        (("Check", ("dockserver, modem and network of that time",)),),
    )
    title = f"CORRECTION {_name(glider)}: it was up in time, {utc(at)}; its files came late"
    return _alert(glider, now, Kind.CORRECTION, title, page, alert_id, thread, Severity.INFO, to)


def _alert(
    glider: str,
    time: float,
    kind: Kind,
    title: str,
    page: Page,
    alert_id: str,
    thread: str,
    severity: Severity,
    audience: Severity,
) -> Alert:
    title = clean(title)
    return Alert(
        id=alert_id,
        glider=glider,
        time=time,
        kind=kind,
        severity=severity,
        audience=audience,
        incident=thread,
        title=title,
        body=page.text(),
        html=page.html(title),
    )


def _name(glider: str) -> str:
    return clean(glider, 40)


def _remark(fleet: Fleet) -> tuple[str, ...]:
    """The one thing an operator would say first where no glider calls."""
    if not fleet.is_silent:
        return ()
    others = "the other glider is" if fleet.others == 1 else f"all {fleet.others} other gliders are"
    since = "" if fleet.last is None else f", no file of any of them since {utc(fleet.last)}"
    names = f" ({', '.join(map(_name, fleet.names))})" if fleet.names else ""
    return (f"Look at dockserver and modem first: {others} late as well{since}{names}.", _EACH)


def _last(dive: Assessment | None) -> tuple[tuple[str, str], ...]:
    if dive is None:
        return ()
    return (("Last position", f"{place(dive.lat, dive.lon)}, surfaced {utc(dive.t_surface)}"),)


def _look(a: Absence) -> tuple[tuple[str, str], ...]:
    """Where to look: the middle of the area, its size and direction, the current that it rests upon."""
    if a.area is None:
        return (("Look at", "no position is known"),)
    area = a.area
    size = f"95 % within {area.major / 1000:.1f} x {area.minor / 1000:.1f} km (semi-axes), "
    size += f"longer towards {round(area.bearing) % 180:03d}° true"
    drift = "" if a.last is None else flow(*current(a.last))
    return (
        ("Look at", place(area.lat, area.lon)),
        ("Map", map_link(area.lat, area.lon)),
        ("Area", size),
        *((("Drift", f"last known current, {drift}"),) if drift else ()),
    )


def current(dive: Assessment) -> tuple[float | None, float | None]:
    """The last known current (east, north; m/s) of a dive: the estimated one, else the reference."""
    u, v = known(dive.flow_u), known(dive.flow_v)
    return (known(dive.reference_u), known(dive.reference_v)) if u is None or v is None else (u, v)


def _weighed(a: Absence) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What speaks for trouble of the glider, and what against."""
    names = [f"{INCIDENTS[i.kind]} open since {utc(i.since)}" for i in a.incidents]
    fleet, well = a.fleet, a.fleet.others - a.fleet.late
    calling = (f"{well} of {fleet.others} other gliders call as expected",) if well > 0 else ()
    late = (f"{fleet.late} of {fleet.others} other gliders are late as well",) if fleet.late else ()
    none = () if names else ("no incident was open before",)
    alone = () if fleet.others else ("no other glider at sea to tell glider and shore side apart",)
    return (*names, *calling) or ("nothing but the silence",), (*none, *late, *alone)


def _checks(a: Absence) -> tuple[str, ...]:
    return (
        "dockserver, modem and network: does a file of any glider come?",
        "the Iridium and Argos positions of the glider, if it has a beacon of its own",
        "the mission that runs: a longer interval, a no-comms or drift behaviour",
        "the last dives: leak, voltage, vacuum, aborts",
        *(("the ships and gliders near the area",) if a.area is not None else ()),
    )
