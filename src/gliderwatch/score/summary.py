"""All measures of a run together, as values, as JSON and as tables for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
from rich.table import Table

from gliderwatch.score import roc
from gliderwatch.score.measures import (
    FalseScore,
    FaultScore,
    Interval,
    false_scores,
    fault_scores,
)
from gliderwatch.score.record import Record
from gliderwatch.score.speeds import SpeedScore, speed_scores
from gliderwatch.score.surfacings import NextScore, next_scores

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
    roc: tuple[roc.Point, ...]


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
        tuple(roc.points(records)),
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
