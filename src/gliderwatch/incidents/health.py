"""Findings of the rules of health in a row become incidents, by the table of all incidents. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from gliderwatch.health.rule import Finding
from gliderwatch.health.rules import Judged
from gliderwatch.incidents.constants import HEALTH_CLEAR_AFTER
from gliderwatch.incidents.state_machine import TRANSITIONS, Event, Phase
from gliderwatch.model import Severity


@dataclass(frozen=True, slots=True)
class HealthIncident:
    """What a rule of health found in segments and calls in a row.

    ``since`` (s) is when it began by the first finding, ``opened_at`` the end of the segment or call that
    showed it, ``cleared_at`` of the one that cleared it (None: open). ``severity`` is the worst so far.
    """

    id: str
    glider: str
    rule: str
    severity: Severity
    since: float
    opened_at: float
    cleared_at: float | None
    worst: Finding
    last: Finding


def health_incidents(glider: str, rows: Iterable[tuple[float, Judged]]) -> tuple[HealthIncident, ...]:
    """The incidents of a glider by what the rules found in its segments and calls, in order of time (s)."""
    done: list[HealthIncident] = []
    open_: dict[str, HealthIncident] = {}
    normal: dict[str, int] = {}
    for t, judged in rows:
        for rule, finding in judged.items():
            before = open_.get(rule)
            phase = Phase.OK if before is None else Phase.OPEN
            normal[rule] = 0 if finding is not None else normal.get(rule, 0) + 1
            after = TRANSITIONS[phase, _event(phase, finding, normal[rule])]
            if finding is not None:
                open_[rule] = _opened(glider, t, finding) if before is None else _worse(before, finding)
            elif before is not None and after is Phase.OK:
                done.append(replace(open_.pop(rule), cleared_at=t))
    return tuple(sorted((*done, *open_.values()), key=lambda i: (i.opened_at, i.id)))


def _event(phase: Phase, finding: Finding | None, normal: int) -> Event:
    """What a segment or call means for a rule: each rule has two readings in a row in it already."""
    if finding is not None:
        return Event.CONFIRMED if phase is Phase.OK else Event.FLAGGED
    return Event.CLEARED if phase is Phase.OPEN and normal >= HEALTH_CLEAR_AFTER else Event.NORMAL


def _opened(glider: str, t: float, finding: Finding) -> HealthIncident:
    identity = f"{glider}/health/{finding.rule}/{finding.t:.0f}"
    return HealthIncident(
        identity, glider, finding.rule, finding.severity, finding.t, t, None, finding, finding
    )


def _worse(before: HealthIncident, finding: Finding) -> HealthIncident:
    worst = finding if finding.severity > before.severity else before.worst
    return replace(before, severity=worst.severity, worst=worst, last=finding)
