"""What other bounds of the normal speed would have told, from recorded speeds. Pure.

The estimate does not depend on the bounds, so that it need not be made anew: the flags are given again to
the speeds as known in the end, and put through the same rules.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from gliderwatch.model import Assessment, Flag, Kind
from gliderwatch.params import RuleParams
from gliderwatch.rules.incident import Watches, judge
from gliderwatch.score.measures import EXPECTED, MONTH, detection, false_told, healthy_time
from gliderwatch.score.record import DiveResult, Record, Told

LOWER = (0.2, 0.3, 0.4, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)
"""Lower bounds as parts of the usual speed; the upper one lies as far above it as the lower one below."""


@dataclass(frozen=True, slots=True)
class Point:
    """At a lower bound: the part of gliders with a loss of speed that was told, and false messages of flag 1
    a glider-month."""

    estimator: str
    lower: float
    detected: float
    false: float


def points(records: Sequence[Record], rules: RuleParams | None = None) -> list[Point]:
    """The curve of each estimator over the simulated gliders."""
    rules, found = rules or RuleParams(), []
    for estimator in dict.fromkeys(r.estimator for r in records):
        some = [r for r in records if r.estimator == estimator and not r.is_real]
        for lower in LOWER:
            again = [judged(r, lower, rules) for r in some]
            slow = [r for r in again if EXPECTED.get(r.fault) == Flag.ANOMALY]
            alone = list({r.glider: r for r in again}.values())
            time = sum(map(healthy_time, alone))
            if slow and time > 0:
                share = sum(detection(r) is not None for r in slow) / len(slow)
                false = sum(false_told(r, Flag.ANOMALY) for r in alone) * MONTH / time
                found.append(Point(estimator, lower, share, false))
    return found


def judged(record: Record, lower: float, rules: RuleParams) -> Record:
    """The record as it would be with another normal range: ``lower`` and 2 - ``lower`` of the usual speed."""
    low, high = lower * record.usual, (2 - lower) * record.usual
    watches, told = Watches(), list[Told]()
    seen: set[str] = set()
    for dive in record.dives:
        watches, incidents = judge(watches, _assessment(dive, low, high), rules)
        for incident in incidents:
            if incident.id not in seen:
                seen.add(incident.id)
                flag = Flag.ANOMALY if incident.kind == Kind.ANOMALY else Flag.FALSE_ALARM
                told.append(Told(int(flag), incident.opened_at, incident.opened_at))
    return replace(record, low=low, high=high, told=tuple(told))


def _assessment(dive: DiveResult, low: float, high: float) -> Assessment:
    flag = dive.flag
    if flag is not None and flag != Flag.FALSE_ALARM and dive.speed is not None:
        flag = Flag.NORMAL if low <= dive.speed <= high else Flag.ANOMALY
    return Assessment(
        glider="",
        segment="",
        t_dive=dive.t_dive,
        t_surface=dive.t_surface,
        lat=None,
        lon=None,
        flag=flag,
        reason="",
        speed=dive.speed,
        speed_min=low,
        speed_max=high,
        flow_u=None,
        flow_v=None,
        reference_u=None,
        reference_v=None,
        reference_final=False,
        p_e=None,
        gamma_f=0.0,
        clle_max=None,
        excitation=None,
        n_samples=0,
        evidence={},
        notes=(),
        parameters="",
    )
