"""When somebody has taken an incident on: it is brought to mind no more, until it grows worse. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gliderwatch.model import Incident, Kind, Severity
from gliderwatch.rules.constants import WORSE_FLOW_ERROR, WORSE_SPEED
from gliderwatch.rules.incident import departure, is_severe

MARGINS = {Kind.ANOMALY: WORSE_SPEED, Kind.FALSE_ALARM: WORSE_FLOW_ERROR}
"""How much further out of the ordinary than when it was acknowledged counts as worse: m/s out of the normal
range, or flow error p_E."""


@dataclass(frozen=True, slots=True)
class Ack:
    """Who took an incident on, when (``at``, s), with what ``note``, and how bad it was then.

    ``departure`` is that of its worst dive (`rules.incident.departure`), ``severe`` whether that was severe.
    """

    incident: str
    by: str
    note: str
    at: float
    severity: Severity
    departure: float
    severe: bool

    def holds(self, incident: Incident) -> bool:
        """Whether the incident has not grown worse since."""
        return (
            incident.severity <= self.severity
            and is_severe(incident.worst) <= self.severe
            and departure(incident.worst, incident.kind) - self.departure <= MARGINS.get(incident.kind, 0.0)
        )


Acks = Mapping[str, Ack]
"""Acknowledgements by the id of their incident."""


def acknowledge(incident: Incident, by: str, note: str, at: float) -> Ack:
    """The acknowledgement of an incident as it is at a time (s)."""
    worst = incident.worst
    return Ack(
        incident.id, by, note, at, incident.severity, departure(worst, incident.kind), is_severe(worst)
    )
