"""What a message says that reaches somebody because nobody has acknowledged it. Pure."""

from __future__ import annotations

from dataclasses import replace

from gliderwatch.alerts.page import with_lead
from gliderwatch.alerts.words import clean, duration
from gliderwatch.model import Alert, Kind


def escalated(alert: Alert, waited: float) -> Alert:
    """The message, for who is told it after so long (s) without an acknowledgement."""
    muted = tuple(f"{alert.glider}/{kind}/" for kind in (Kind.OVERDUE, Kind.UNKNOWN, Kind.ABORT, Kind.CALL))
    is_muted = alert.incident.startswith(muted)  # there is no incident to acknowledge
    command = f"mute {alert.glider} --hours 6" if is_muted else f"ack {alert.incident.rstrip('+')}"
    lead = f"Nobody has acknowledged this for {duration(waited)}: that is why you are told. "
    lead += f"If you take it on: gliderwatch {clean(command)}"
    return replace(
        alert,
        title=clean(f"NOT ACKNOWLEDGED {alert.title}"),
        body=f"{lead}\n\n{alert.body}",
        html=with_lead(alert.html, lead),
    )
