"""How well the estimated speed agrees with the truth of simulated gliders. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.model import Array
from gliderwatch.score.measures import Interval, bootstrap
from gliderwatch.score.record import Record


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

    known = np.isfinite(every[:, 2]) if len(every) else np.zeros(0, dtype=bool)
    inside = np.abs(every[known, 0]) <= 1.96 * every[known, 2]
    return SpeedScore(
        estimator,
        sea,
        is_faulty,
        len(every),
        rms(0),
        rms(1),
        float(inside.mean()) if known.any() else None,
    )
