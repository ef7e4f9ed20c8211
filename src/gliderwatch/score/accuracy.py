"""How well speed and next surfacing agree with the truth of simulated gliders. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.forecast.constants import CHI2_COVERED
from gliderwatch.model import Array, Assessment, NextSurfacing
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.score.measures import Interval, NextResult, Record, bootstrap

# ----------------------------------------
# How well the estimated speed agrees with the truth of simulated gliders.


@dataclass(frozen=True, slots=True)
class SpeedScore:
    """Errors of the speed of one estimator (rms, m/s).

    ``rms`` is against the truth, ``rms_believed`` against what the glider took for it; ``coverage`` is
    the part of dives whose 95 % interval holds the truth (None: no such interval).
    """

    estimator: str
    sea: str
    is_faulty: bool
    dives: int
    rms: Interval
    rms_believed: Interval
    coverage: float | None


def speed_scores(records: Iterable[Record]) -> list[SpeedScore]:
    """For each estimator and sea, of dives on which a glider has a fault, and of the others."""
    simulated = [r for r in records if not r.is_real]
    groups: dict[tuple[str, str, bool], list[Record]] = {}
    for r in {(r.estimator, r.glider): r for r in simulated}.values():  # sizes share the days before
        groups.setdefault((r.estimator, r.sea, False), []).append(r)
    for r in simulated:
        if r.onset is not None:
            groups.setdefault((r.estimator, r.sea, True), []).append(r)
    scores = (_speed_score(*group, gliders) for group, gliders in groups.items())
    return [score for score in scores if score.dives]


def _errors(record: Record, is_faulty: bool) -> Array:
    """Per judged dive: error against the truth, against what was believed (m/s), and sigma (NaN: none)."""
    onset = record.onset if record.onset is not None else math.inf
    rows = [
        (d.speed - d.true_speed, d.speed - d.believed_speed, math.nan if d.sigma is None else d.sigma)
        for d in record.dives
        if d.flag is not None
        and d.speed is not None
        and d.true_speed is not None
        and d.believed_speed is not None
        and (d.t_dive >= onset if is_faulty else d.t_surface <= onset)
    ]
    return np.array(rows).reshape(-1, 3)


def _speed_score(estimator: str, sea: str, is_faulty: bool, gliders: Sequence[Record]) -> SpeedScore:
    errors = {id(r): _errors(r, is_faulty) for r in gliders}
    every = np.concatenate(list(errors.values()))

    def rms(column: int) -> Interval:
        def of(some: Sequence[Record]) -> float:
            squares = np.concatenate([errors[id(r)][:, column] for r in some]) ** 2
            return float(np.sqrt(squares.mean())) if len(squares) else 0.0

        return bootstrap(gliders, of)

    has_sigma = np.isfinite(every[:, 2]) if len(every) else np.zeros(0, dtype=bool)
    inside = np.abs(every[has_sigma, 0]) <= 1.96 * every[has_sigma, 2]
    return SpeedScore(
        estimator,
        sea,
        is_faulty,
        len(every),
        rms(0),
        rms(1),
        float(inside.mean()) if has_sigma.any() else None,
    )


# ----------------------------------------
# How well the next surfacing was forecast: time, place and their 95 %.


@dataclass(frozen=True, slots=True)
class NextScore:
    """Forecasts of one estimator in one sea: mean errors of place (m) beside ``persistence``, and of time
    (s); parts of places and times within the bounds that hold 95 %."""

    estimator: str
    sea: str
    is_real: bool
    forecasts: int
    miss: Interval
    persistence: Interval
    late: float
    in_ellipse: float
    in_time: float


@dataclass(frozen=True, slots=True)
class _Fix:
    t: float
    lat: float
    lon: float


def results(
    forecasts: Iterable[NextSurfacing], dives: Sequence[Assessment], until: float = float("inf")
) -> tuple[NextResult, ...]:
    """The forecasts as first made (``forecasts``) after each surfacing, beside the fix after the next dive.

    ``dives`` are all of a glider in order of time. Left out is what files do not tell, and what came after
    ``until`` (s).
    """
    first: dict[float, NextSurfacing] = {}
    for e in forecasts:
        first.setdefault(e.after, e)
    fixes = [_fix(dive) for dive in dives]
    out = []
    for before, start, end, dive in zip(fixes, fixes[1:], fixes[2:], dives[2:], strict=False):
        expected = None if start is None else first.get(start.t)
        if before is None or start is None or end is None or expected is None or end.t > until:
            continue
        if expected.lat is not None and "unobserved_h" not in dive.evidence:
            out.append(_result(expected, before, start, end))
    return tuple(out)


def _fix(dive: Assessment) -> _Fix | None:
    """The fix that ended a dive, where it is known."""
    gap = dive.evidence.get("fix_gap_minutes")
    if gap is None or dive.lat is None or dive.lon is None:
        return None
    return _Fix(dive.t_surface + 60 * gap, dive.lat, dive.lon)


def _result(expected: NextSurfacing, before: _Fix, start: _Fix, end: _Fix) -> NextResult:
    assert expected.lat is not None and expected.lon is not None
    miss = to_plane(end.lat, end.lon, expected.lat, expected.lon)
    way = to_plane(end.lat, end.lon, start.lat, start.lon)
    again = to_plane(start.lat, start.lon, before.lat, before.lon)
    cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]])
    late = end.t - expected.t
    return NextResult(
        late=late,
        miss=float(np.hypot(*miss)),
        persistence=float(np.hypot(*(way - again))),
        in_ellipse=bool(miss @ np.linalg.solve(cov, miss) < CHI2_COVERED),
        in_time=abs(late) < 1.96 * expected.t_sigma,
        hours=(end.t - start.t) / 3600,
    )


def next_scores(records: Iterable[Record]) -> list[NextScore]:
    """For each estimator and sea, of healthy dives."""
    groups: dict[tuple[str, str, bool], list[Record]] = {}
    for r in {(r.estimator, r.glider): r for r in records}.values():  # sizes share the days before
        if r.next:
            groups.setdefault((r.estimator, r.sea, r.is_real), []).append(r)
    return [_score(*group, gliders) for group, gliders in groups.items()]


def _score(estimator: str, sea: str, is_real: bool, gliders: Sequence[Record]) -> NextScore:
    every = [each for r in gliders for each in r.next]

    def mean(name: str) -> Interval:
        return bootstrap(
            gliders, lambda some: float(np.mean([getattr(each, name) for r in some for each in r.next]))
        )

    return NextScore(
        estimator,
        sea,
        is_real,
        len(every),
        mean("miss"),
        mean("persistence"),
        float(np.mean([abs(each.late) for each in every])),
        float(np.mean([each.in_ellipse for each in every])),
        float(np.mean([each.in_time for each in every])),
    )
