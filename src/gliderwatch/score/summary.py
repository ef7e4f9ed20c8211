"""All measures of a run together, as values, as JSON and as tables for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
from rich.table import Table

from gliderwatch.incidents.state_machine import RuleStates, advance
from gliderwatch.model import Assessment, Flag, Kind
from gliderwatch.params import RuleParams
from gliderwatch.score.accuracy import NextScore, SpeedScore, next_scores, speed_scores
from gliderwatch.score.measures import (
    EXPECTED,
    MONTH,
    DiveResult,
    FalseScore,
    FaultScore,
    Interval,
    OpenedIncident,
    Record,
    detection,
    false_openings,
    false_scores,
    fault_scores,
    healthy_time,
)

# ----------------------------------------
# What other bounds of the normal speed would have reported, from recorded speeds. Pure.
#
# The estimate does not depend on the bounds, so that it need not be made again: the flags are given again to
# the speeds as known in the end, and put through the same rules.

LOWER = (0.2, 0.3, 0.4, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)
"""Lower bounds as parts of the usual speed; the upper one lies as far above it as the lower one below."""


@dataclass(frozen=True, slots=True)
class Point:
    """At a lower bound: the part of gliders with a loss of speed that was reported, and false messages of
    flag 1 a glider-month."""

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
                false = sum(false_openings(r, Flag.ANOMALY) for r in alone) * MONTH / time
                found.append(Point(estimator, lower, share, false))
    return found


def judged(record: Record, lower: float, rules: RuleParams) -> Record:
    """The record as it would be with another normal range: ``lower`` and 2 - ``lower`` of the usual speed."""
    low, high = lower * record.usual, (2 - lower) * record.usual
    states, openings = RuleStates(), list[OpenedIncident]()
    seen: set[str] = set()
    for dive in record.dives:
        states, incidents = advance(states, _assessment(dive, low, high), rules)
        for incident in incidents:
            if incident.id not in seen:
                seen.add(incident.id)
                flag = Flag.ANOMALY if incident.kind == Kind.ANOMALY else Flag.FALSE_ALARM
                openings.append(OpenedIncident(int(flag), incident.opened_at, incident.opened_at))
    return replace(record, low=low, high=high, openings=tuple(openings))


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


# ----------------------------------------
# All measures of a run together, as values, as JSON and as tables for a terminal.

_SEAS_IN_A_TABLE = 5
"""Columns of seas that fit beside each other."""


@dataclass(frozen=True, slots=True)
class Summary:
    """What `score.json` holds. ``seconds`` is what the replays took, all cores together."""

    version: str
    gliders: int
    seconds: float
    faults: tuple[FaultScore, ...]
    false: tuple[FalseScore, ...]
    speeds: tuple[SpeedScore, ...]
    next: tuple[NextScore, ...]
    roc: tuple[Point, ...]


def summarise(records: Sequence[Record], version: str) -> Summary:
    """All measures of some records."""
    order = sorted(records, key=lambda r: r.is_real)
    return Summary(
        version,
        len(records),
        round(sum(r.seconds for r in records), 1),
        tuple(sorted(fault_scores(order), key=lambda s: (s.is_real, s.estimator, s.sea, s.fault, s.size))),
        tuple(sorted(false_scores(order), key=lambda s: (s.is_real, s.estimator, s.sea == "", s.sea))),
        tuple(sorted(speed_scores(order), key=lambda s: (s.estimator, s.is_faulty, s.sea))),
        tuple(sorted(next_scores(order), key=lambda s: (s.is_real, s.estimator, s.sea))),
        tuple(points(records)),
    )


def write(path: Path, summary: Summary) -> None:
    """Write `score.json`; what is infinite (never) is null there."""
    path.write_bytes(msgspec.json.format(msgspec.json.encode(summary), indent=2) + b"\n")


def tables(summary: Summary) -> Iterator[Table]:
    """Tables of faults, in all and by sea, of false messages, of speeds and of next surfacings."""
    overall = [s for s in summary.faults if s.sea == ""]
    for is_real in (False, True):
        for estimator in dict.fromkeys(s.estimator for s in overall if s.is_real == is_real):
            where = "real missions" if is_real else "simulated gliders"
            some = [s for s in overall if (s.estimator, s.is_real) == (estimator, is_real)]
            yield _faults(some, f"{estimator}: faults of {where}")
            each = [s for s in summary.faults if (s.estimator, s.is_real) == (estimator, is_real) and s.sea]
            yield from _by_sea(each, f"{estimator}: detected of {where}, and the median hours")
    for estimator in dict.fromkeys(s.estimator for s in summary.false):
        title = f"{estimator}: false messages a glider-month (95 %), false dives"
        yield _false([s for s in summary.false if s.estimator == estimator], title)
    for estimator in dict.fromkeys(s.estimator for s in summary.speeds):
        title = f"{estimator}: speed against the truth (95 %)"
        yield _speeds([s for s in summary.speeds if s.estimator == estimator], title)
    for estimator in dict.fromkeys(s.estimator for s in summary.next):
        title = f"{estimator}: the next surfacing of healthy gliders (95 %)"
        yield _next([s for s in summary.next if s.estimator == estimator], title)


def _table(title: str, left: Iterable[str], right: Iterable[str]) -> Table:
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    for name in left:
        table.add_column(name, no_wrap=True)
    for name in right:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _faults(scores: Iterable[FaultScore], title: str) -> Table:
    names = ("size", "n", "detected (95 %)", "chance", "surf.", "hours", "flag 1", "flag 2")
    table = _table(title, ("fault",), names)
    for s in scores:
        table.add_row(
            s.fault,
            f"{s.size:g}",
            str(s.gliders),
            "none is due" if s.detected is None else _shares(s.detected),
            "" if s.detected is None else f"{100 * s.chance:.0f}%",
            "" if s.expected is None else f"{_count(s.surfacings_median)}, {_count(s.surfacings_90)}",
            "" if s.expected is None else f"{_count(s.hours_median)}, {_count(s.hours_90)}",
            f"{100 * s.flag_1:.0f}%" + ("*" if s.expected == 1 else ""),
            f"{100 * s.flag_2:.0f}%" + ("*" if s.expected == 2 else ""),
        )
    return table


def _by_sea(scores: Sequence[FaultScore], title: str) -> Iterator[Table]:
    """A column a sea, some of them in each table."""
    seas = list(dict.fromkeys(s.sea for s in scores))
    for first in range(0, len(seas), _SEAS_IN_A_TABLE):
        some = seas[first : first + _SEAS_IN_A_TABLE]
        table = _table(title, ("fault",), ("size", *some))
        for fault, size in dict.fromkeys((s.fault, s.size) for s in scores):
            cells = {s.sea: s for s in scores if (s.fault, s.size) == (fault, size)}
            shown = (_detected(cells[sea]) if sea in cells else "" for sea in some)
            table.add_row(fault, f"{size:g}", *shown)
        yield table


def _detected(score: FaultScore) -> str:
    if score.detected is None:
        return "-"
    hours = f" {score.hours_median:.0f} h" if math.isfinite(score.hours_median) else ""
    return f"{100 * score.detected.value:.0f}%{hours}"


def _false(scores: Iterable[FalseScore], title: str) -> Table:
    names = ("n", "months", "flag 1 a month", "flag 2 a month", "dives 1", "dives 2")
    table = _table(title, ("sea",), names)
    for s in scores:
        sea = s.sea or ("all real" if s.is_real else "all simulated")
        table.add_row(
            sea,
            str(s.gliders),
            f"{s.months:.1f}",
            _rates(s.flag_1),
            _rates(s.flag_2),
            f"{100 * s.dives_1:.1f}%",
            f"{100 * s.dives_2:.1f}%",
        )
    return table


def _speeds(scores: Iterable[SpeedScore], title: str) -> Table:
    table = _table(title, ("sea", "glider"), ("dives", "rms, cm/s", "to believed", "in 95 %"))
    for s in scores:
        table.add_row(
            s.sea,
            "faulty" if s.is_faulty else "healthy",
            str(s.dives),
            f"{100 * s.rms.value:.1f} ({100 * s.rms.low:.1f}-{100 * s.rms.high:.1f})",
            f"{100 * s.rms_believed.value:.1f}",
            "" if s.coverage is None else f"{100 * s.coverage:.0f}%",
        )
    return table


def _next(scores: Iterable[NextScore], title: str) -> Table:
    names = ("n", "off by, km", "same way again", "off by, min", "ellipse", "time")
    table = _table(title, ("sea",), names)
    for s in scores:
        table.add_row(
            s.sea,
            str(s.forecasts),
            *(f"{i.value / 1e3:.2f} ({i.low / 1e3:.2f}-{i.high / 1e3:.2f})" for i in (s.miss, s.persistence)),
            f"{s.late / 60:.0f}",
            f"{100 * s.in_ellipse:.0f}%",
            f"{100 * s.in_time:.0f}%",
        )
    return table


def _shares(interval: Interval) -> str:
    return f"{100 * interval.value:.0f}% ({100 * interval.low:.0f}-{100 * interval.high:.0f})"


def _rates(interval: Interval) -> str:
    return f"{interval.value:.2f} ({interval.low:.2f}-{interval.high:.2f})"


def _count(value: float) -> str:
    return f"{value:.0f}" if math.isfinite(value) else "-"
