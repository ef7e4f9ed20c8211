"""Flags in a row become an incident; normal dives in a row clear it. Pure.

For each kind of incident a glider is in one phase. A dive says one of three things of a kind: it is
`flagged`, it is `normal`, or nothing. A dive without a flag says nothing; one with flag 2 says nothing of
an anomaly, because its speed is not to be believed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from math import inf

from gliderwatch.estimation.constants import COMPASS_OFF
from gliderwatch.incidents.constants import LINGERS, SEVERE, SURELY, WELL
from gliderwatch.model import Assessment, Flag, Incident, Kind
from gliderwatch.params import AnomalyRule, FalseAlarmRule, RuleParams


class Phase(StrEnum):
    """Where a glider is with one kind of incident."""

    OK = "ok"
    PENDING = "pending"
    OPEN = "open"


class Event(StrEnum):
    """What a dive means for one kind of incident."""

    FLAGGED = "flagged"
    CONFIRMED = "confirmed"
    NORMAL = "normal"
    CLEARED = "cleared"


TRANSITIONS = {
    (Phase.OK, Event.FLAGGED): Phase.PENDING,
    (Phase.OK, Event.CONFIRMED): Phase.OPEN,
    (Phase.OK, Event.NORMAL): Phase.OK,
    (Phase.PENDING, Event.FLAGGED): Phase.PENDING,
    (Phase.PENDING, Event.CONFIRMED): Phase.OPEN,
    (Phase.PENDING, Event.NORMAL): Phase.OK,
    (Phase.OPEN, Event.FLAGGED): Phase.OPEN,
    (Phase.OPEN, Event.NORMAL): Phase.OPEN,
    (Phase.OPEN, Event.CLEARED): Phase.OK,
}


@dataclass(frozen=True, slots=True)
class RuleState:
    """State of one kind of incident of one glider.

    ``flagged`` counts flagged dives in a row, ``normal`` the normal ones since, ``first`` is the first
    flagged dive, ``incident`` the open one.
    """

    phase: Phase = Phase.OK
    flagged: int = 0
    normal: int = 0
    first: Assessment | None = None
    worst: Assessment | None = None
    incident: Incident | None = None


@dataclass(frozen=True, slots=True)
class RuleStates:
    """State of the rules of one glider after a dive."""

    anomaly: RuleState = RuleState()
    false_alarm: RuleState = RuleState()

    def open(self) -> tuple[Incident, ...]:
        """The incidents that are open."""
        return tuple(w.incident for w in (self.anomaly, self.false_alarm) if w.incident is not None)


def end_all(state: RuleStates, t: float) -> tuple[Incident, ...]:
    """The incidents that were open, cleared at a time (s) because the deployment is over."""
    return tuple(replace(incident, cleared_at=t) for incident in state.open())


def advance(
    state: RuleStates, dive: Assessment, rules: RuleParams
) -> tuple[RuleStates, tuple[Incident, ...]]:
    """The state after one more dive, and the incidents that it opened, carried on or cleared."""
    if dive.flag is None:
        return state, ()
    is_open = state.anomaly.incident is not None
    anomaly, first = _watch(state.anomaly, dive, Kind.ANOMALY, _says_of_anomaly(dive, is_open), rules.anomaly)
    before = state.false_alarm
    if anomaly.incident is not None:
        # one fault is one incident: a slow glider explains what was taken for a wrong measurement
        over = () if before.incident is None else (replace(before.incident, cleared_at=dive.t_surface),)
        return RuleStates(anomaly, RuleState()), first + over
    disagrees = _says_of_disagreement(dive, before.incident)
    false_alarm, second = _watch(before, dive, Kind.FALSE_ALARM, disagrees, rules.false_alarm)
    return RuleStates(anomaly, false_alarm), first + second


def _says_of_anomaly(dive: Assessment, is_open: bool) -> bool | None:
    """Whether a dive is flagged (None: it says neither). An open anomaly is cleared by dives near the usual
    speed: one just inside the bound, or by less than its standard error, is not well again."""
    if dive.flag == Flag.FALSE_ALARM:
        return None
    usual, speed = dive.usual_speed, dive.speed
    if is_open and dive.flag == Flag.NORMAL and usual is not None and speed is not None:
        inside = max(WELL * (usual - dive.speed_min), dive.speed_sigma or 0.0)
        return None if speed < min(dive.speed_min + inside, usual) else False
    return dive.flag == Flag.ANOMALY


def _says_of_disagreement(dive: Assessment, opened: Incident | None) -> bool | None:
    """Whether a dive is flagged (None: it says neither). What was ``opened`` is over when what is across the
    heading, or what the compass is off, is no longer half of what it was: a misfit at the bound is not mended
    by being just below."""
    if dive.flag != Flag.NORMAL or opened is None:
        return dive.flag == Flag.FALSE_ALARM
    for misfit, error, least in (("across_misfit", "across_sigma", 0.0), ("side", "side_sigma", COMPASS_OFF)):
        was, now = (abs(each.evidence.get(misfit, 0.0)) for each in (opened.last, dive))
        if was > least and now > max(LINGERS * was, SURELY * dive.evidence.get(error, inf)):
            return None
    return False


def is_severe(dive: Assessment) -> bool:
    """Whether a speed is below two thirds of the lower bound of the normal range, and surely below that."""
    if dive.speed is None:
        return False
    sigma = dive.speed_sigma or 0.0
    return dive.speed < SEVERE * dive.speed_min and dive.speed + SURELY * sigma < dive.speed_min


def departure(dive: Assessment, kind: Kind) -> float:
    """How far a dive is out of the ordinary, to find the worst one: m/s out of range, or p_E."""
    if kind == Kind.FALSE_ALARM:
        return dive.p_e or 0.0
    return max(dive.speed_min - dive.speed, dive.speed - dive.speed_max) if dive.speed is not None else 0.0


def _watch(
    watch: RuleState, dive: Assessment, kind: Kind, flagged: bool | None, rule: AnomalyRule | FalseAlarmRule
) -> tuple[RuleState, tuple[Incident, ...]]:
    if flagged is None:
        return watch, ()
    count, normal = (watch.flagged + 1, 0) if flagged else (watch.flagged, watch.normal + 1)
    event = _event(watch, dive, count, normal, flagged, rule)
    phase = TRANSITIONS[watch.phase, event]
    first, worst = watch.first, watch.worst
    if flagged:
        first = first or dive
        worst = dive if worst is None or departure(dive, kind) > departure(worst, kind) else worst
    if phase == Phase.OK and watch.incident is None:
        return RuleState(), ()
    if phase == Phase.PENDING:
        return RuleState(phase, count, normal, first, worst), ()
    assert first is not None and worst is not None
    if event == Event.CONFIRMED:
        incident = Incident(
            id=f"{dive.glider}/{kind}/{first.t_dive:.0f}",
            glider=dive.glider,
            kind=kind,
            severity=rule.severity,
            since=first.t_dive,
            opened_at=dive.t_surface,
            cleared_at=None,
            dives=count,
            worst=worst,
            last=dive,
        )
    else:
        assert watch.incident is not None
        incident = replace(
            watch.incident, dives=count, worst=worst, last=dive if flagged else watch.incident.last
        )
    if phase == Phase.OK:
        return RuleState(), (replace(incident, cleared_at=dive.t_surface),)
    return RuleState(phase, count, normal, first, worst, incident), (incident,)


def _event(
    watch: RuleState,
    dive: Assessment,
    count: int,
    normal: int,
    flagged: bool,
    rule: AnomalyRule | FalseAlarmRule,
) -> Event:
    if not flagged:
        return Event.CLEARED if watch.phase == Phase.OPEN and normal >= rule.clear_after else Event.NORMAL
    needed = rule.open_after
    if isinstance(rule, AnomalyRule) and is_severe(dive):
        needed = min(needed, rule.open_after_severe)
    return Event.CONFIRMED if watch.phase != Phase.OPEN and count >= needed else Event.FLAGGED
