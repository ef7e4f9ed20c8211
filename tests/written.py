"""Messages as they are made of notices: for tests of texts and of what becomes of messages."""

from __future__ import annotations

from gliderwatch.incidents.notices import (
    Cleared,
    Content,
    Corrected,
    Notice,
    Opened,
    StillOpen,
    Surfaced,
)
from gliderwatch.messages.notice_text import render
from gliderwatch.model import Alert, Assessment, Incident, Kind, NextSurfacing, Severity


def _written(
    dive: Assessment, kind: Kind, severity: Severity, content: Content, alert_id: str, audience: Severity
) -> Alert:
    about = content.before if isinstance(content, Corrected) else getattr(content, "incident", None)
    thread = "" if about is None else about.id
    return render(Notice(alert_id, thread, dive.glider, dive.t_surface, kind, severity, audience, content))


def opened(incident: Incident, dive: Assessment, *, alert_id: str, audience: Severity) -> Alert:
    """The first message of an incident."""
    return _written(dive, incident.kind, incident.severity, Opened(incident, dive), alert_id, audience)


def reminder(
    incident: Incident, dive: Assessment, hours: float, *, alert_id: str, audience: Severity
) -> Alert:
    """The incident is open for so long."""
    content = StillOpen(incident, dive, hours)
    return _written(dive, Kind.REMINDER, incident.severity, content, alert_id, audience)


def all_clear(incident: Incident, dive: Assessment, *, alert_id: str, audience: Severity) -> Alert:
    """The incident is over."""
    return _written(dive, Kind.ALL_CLEAR, Severity.INFO, Cleared(incident, dive), alert_id, audience)


def correction(
    before: Incident,
    now: Incident | None,
    dive: Assessment,
    why: str,
    *,
    alert_id: str,
    audience: Severity,
) -> Alert:
    """What was reported has changed."""
    severity = Severity.INFO if now is None else now.severity
    return _written(dive, Kind.CORRECTION, severity, Corrected(before, now, dive, why), alert_id, audience)


def surfacing(
    dive: Assessment, previous: float | None, *, alert_id: str, expected: NextSurfacing | None = None
) -> Alert:
    """The notice of a surfacing."""
    content = Surfaced(dive, previous, expected)
    return _written(dive, Kind.SURFACING, Severity.INFO, content, alert_id, Severity.INFO)
