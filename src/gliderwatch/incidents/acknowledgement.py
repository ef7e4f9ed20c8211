"""Acknowledged incidents and muted gliders: of what nobody is reminded. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from gliderwatch.incidents.constants import WORSE_FLOW_ERROR, WORSE_SPEED
from gliderwatch.incidents.state_machine import departure, is_severe
from gliderwatch.model import Incident, Kind, Severity
from gliderwatch.params import Attention

# ----------------------------------------
# Of an acknowledged incident nobody is reminded, until it grows worse.

MARGINS = {Kind.ANOMALY: WORSE_SPEED, Kind.FALSE_ALARM: WORSE_FLOW_ERROR}
"""How much further out of the ordinary than when it was acknowledged counts as worse: m/s out of the normal
range, or flow error p_E."""


@dataclass(frozen=True, slots=True)
class Ack:
    """Who acknowledged an incident, when (``at``, s), with what ``note``, and how bad it was then.

    ``departure`` is that of its worst dive (`state_machine.departure`), ``severe`` whether that was severe.
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


def is_acknowledged(acks: Acks, ids: Iterable[str], severity: Severity) -> bool:
    """Whether somebody has acknowledged, at a severity or a higher one, what is not over under one of some
    ids.

    Of what is no incident of dives its severity alone says whether it has grown worse."""
    found = (ack for identity in ids if (ack := acks.get(identity)) is not None)
    return any(severity <= ack.severity for ack in found)


def acknowledge_thread(identity: str, severity: Severity, by: str, note: str, at: float) -> Ack:
    """The acknowledgement of what is no incident of dives, as bad as it is at a time (s)."""
    return Ack(identity, by, note, at, severity, 0.0, severe=False)


def acknowledge(incident: Incident, by: str, note: str, at: float) -> Ack:
    """The acknowledgement of an incident as it is at a time (s)."""
    worst = incident.worst
    return Ack(
        incident.id, by, note, at, incident.severity, departure(worst, incident.kind), is_severe(worst)
    )


# ----------------------------------------
# A glider that is muted in the configuration, by a command, or both.


def with_mute(configured: Attention, until: float | None) -> Attention:
    """The attention of a glider that a command mutes until a time (s; None: it does not): the later mute
    counts.

    >>> with_mute(Attention(muted_until=5.0), 9.0).muted_until
    9.0
    >>> with_mute(Attention(muted_until=9.0), 5.0).muted_until
    9.0
    """
    if until is None or (configured.muted_until is not None and configured.muted_until >= until):
        return configured
    return replace(configured, muted_until=until)
