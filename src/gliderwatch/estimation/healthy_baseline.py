"""What is usual for a glider beside its speed: numbers that speak for or against a fault. Pure.

Each number of a dive is held against the same number of healthy dives of this deployment at a like setting of
the thruster: the first ones, and the latest. A pilot changes pitch and ballast, and with them how fast the
glider dives and climbs: such an answer is held against dives at the same pitch and ballast only, of the
first ones if they will do, because growth that slows a glider over weeks is not to be taken for usual.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import compress
from math import isfinite
from statistics import median
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gliderwatch.estimation.constants import (
    ASYMMETRY_RANGE,
    BALLAST_RANGE,
    BASELINE_FIRST,
    BASELINE_LEAST,
    BASELINE_MOST,
    BASELINE_RECENT,
    BRIEF,
    DEPTH_RANGE,
    DURATION_LEAST,
    DURATION_RANGE,
    LIKE,
    MAD_TO_SIGMA,
    RANGE_WIDTH,
    RATE_RANGE,
    ROLL_RANGE,
    SHORTEST,
    VACUUM_RANGE,
    YOS_RANGE,
)
from gliderwatch.model import Array, DiveFeatures, readonly
from gliderwatch.navigation.features import evidence


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of a dive, and what half of its range is at least: ``least`` in its unit and ``part`` of the
    usual value. It depends on the numbers ``given``; empty: it is the pilot's choice, or nobody's."""

    name: str
    least: float = 0.0
    part: float = 0.0
    given: tuple[str, ...] = ()


TRIM = ("pitch_dive", "pitch_climb", "ballast_dive", "ballast_climb")
QUANTITIES = (
    Quantity("roll_mean", least=ROLL_RANGE),
    Quantity("pitch_dive", least=ROLL_RANGE),
    Quantity("pitch_climb", least=ROLL_RANGE),
    Quantity("pitch_asymmetry", least=ASYMMETRY_RANGE),
    Quantity("depth_rate_dive", part=RATE_RANGE, given=TRIM),
    Quantity("depth_rate_climb", part=RATE_RANGE, given=TRIM),
    Quantity("rate_ratio", part=RATE_RANGE, given=TRIM),
    Quantity("ballast_dive", least=BALLAST_RANGE, part=RATE_RANGE),
    Quantity("ballast_climb", least=BALLAST_RANGE, part=RATE_RANGE),
    Quantity("yos_per_hour", part=YOS_RANGE, given=(*TRIM, "depth_max")),
    Quantity("duration_h", least=DURATION_LEAST, part=DURATION_RANGE),
    Quantity("vacuum", least=VACUUM_RANGE),
)
"""Names and units: `docs/nomenclature.md`."""
_DEPTH = Quantity("depth_max", least=DEPTH_RANGE, part=RATE_RANGE)
_BY_NAME = {q.name: q for q in (*QUANTITIES, _DEPTH)}
_GIVEN = tuple(dict.fromkeys(q.given for q in QUANTITIES))
_COLUMN = {name: i for i, name in enumerate((*_BY_NAME, "thruster"))}


@dataclass(frozen=True, slots=True, eq=False)
class Baseline:
    """Healthy dives of one deployment, oldest first. It equals none but itself, so that what follows from it
    can be kept: a dive comes again when its current is corrected.

    ``dives`` ((k, n), k at most `BASELINE_MOST`) has a column for each of `QUANTITIES`, for the depth reached
    and for the thruster; ``measured`` (the same shape) is 1 where a dive has the number, else 0.
    """

    dives: Array = field(default_factory=lambda: readonly(np.empty((0, len(_COLUMN)))))
    measured: Array = field(default_factory=lambda: readonly(np.empty((0, len(_COLUMN)))))


@dataclass(frozen=True, slots=True)
class Usual:
    """The ``value`` of a number on one dive, what is ``usual``, and the range from ``low`` to ``high``."""

    value: float
    low: float
    usual: float
    high: float


@lru_cache(maxsize=64)
def learn(baseline: Baseline, features: DiveFeatures) -> Baseline:
    """The baseline with one more dive. Only for dives that are healthy, and not while an incident is open.

    A new deployment begins with ``Baseline()``.
    """
    if features.duration < SHORTEST:
        return baseline
    row = _row(features)
    dives = np.concatenate([_dives(baseline), row[None]])
    alike = np.flatnonzero(_same_setting(dives, row))
    if len(alike) > BASELINE_FIRST + BASELINE_RECENT:
        dives = np.delete(dives, alike[BASELINE_FIRST], axis=0)
    dives = dives[-BASELINE_MOST:]
    measured = np.isfinite(dives)
    return Baseline(readonly(np.where(measured, dives, 0.0)), readonly(measured))


@lru_cache(maxsize=64)
def compare(baseline: Baseline, features: DiveFeatures) -> Mapping[str, Usual]:
    """The numbers of a dive of which enough healthy dives tell what is usual, by name."""
    if features.duration < BRIEF:
        return MappingProxyType({})
    row = _row(features)
    dives = _dives(baseline)
    dives = dives[_same_setting(dives, row)]
    columns = dives.T.tolist()
    same = {given: _same_trim(dives, row, given).tolist() for given in _GIVEN}
    out = {}
    for quantity, value, column in zip(QUANTITIES, row.tolist(), columns, strict=False):
        if isfinite(value):
            measured = [isfinite(each) for each in column]
            alike = list(compress(same[quantity.given], measured))
            usual = _usual(list(compress(column, measured)), alike, quantity)
            if usual is not None:
                out[quantity.name] = Usual(value, *usual)
    return MappingProxyType(out)


def evidence_of(baseline: Baseline, features: DiveFeatures) -> dict[str, float]:
    """What a dive adds to its evidence: `derived` numbers, and what is usual.

    ``_low``, ``_usual`` and ``_high`` are put after each name that `compare` knows; ``surfacing_delay_h``
    is how much later than usual the dive ended (h).
    """
    out = derived(features)
    for name, usual in compare(baseline, features).items():
        out |= {f"{name}_low": usual.low, f"{name}_usual": usual.usual, f"{name}_high": usual.high}
        if name == "duration_h":
            out["surfacing_delay_h"] = usual.value - usual.usual
    return out


def derived(features: DiveFeatures) -> dict[str, float]:
    """Numbers made of others.

    ``pitch_asymmetry`` (rad) is by how much the climb is steeper than the dive, ``rate_ratio`` how fast the
    glider climbs as a part of how fast it dives, ``yos_per_hour`` how often it turned to climb (1/h).

    >>> derived(DiveFeatures(duration=10800.0, depth_rate_dive=0.2, depth_rate_climb=-0.1, yos=6))
    {'rate_ratio': 0.5, 'yos_per_hour': 2.0}
    """
    out = {}
    down, up = features.pitch_dive, features.pitch_climb
    if down is not None and up is not None:
        out["pitch_asymmetry"] = abs(up) - abs(down)
    down, up = features.depth_rate_dive, features.depth_rate_climb
    if down and up:
        out["rate_ratio"] = abs(up / down)
    if features.yos and features.duration:
        out["yos_per_hour"] = features.yos / (features.duration / 3600)
    return out


def _dives(baseline: Baseline) -> Array:
    """The dives with NaN where one has not the number."""
    return np.where(baseline.measured > 0, baseline.dives, np.nan)


def _row(features: DiveFeatures) -> Array:
    """The numbers of a dive in the order of columns, NaN where unknown; no word of a thruster: it was off.

    They are compared as they are published, because what is usual is published beside them.
    """
    numbers = {"thruster": 0.0, **evidence(features), **derived(features)}
    return np.array([numbers.get(name, np.nan) for name in _COLUMN], dtype=np.float64)


def _same_setting(dives: Array, row: Array) -> NDArray[np.bool_]:
    """Which dives were flown with the thruster like this one: buoyancy alone is like nothing else."""
    at = _COLUMN["thruster"]
    return np.asarray((np.abs(dives[:, at] - row[at]) < LIKE) & ((dives[:, at] > 0) == (row[at] > 0)))


def _usual(values: list[float], alike: list[bool], quantity: Quantity) -> tuple[float, float, float] | None:
    """Low, usual and high value of a number among the dives that have it, None where they are too few.

    ``alike``: whether each was at the same trim.
    """
    windows = [values[:BASELINE_FIRST], values[-BASELINE_RECENT:]]
    if quantity.given:
        first = list(compress(values[:BASELINE_FIRST], alike))
        # the first dives alone, so that what grows slowly is not usual in the end
        windows = [first if len(first) >= BASELINE_LEAST else list(compress(values, alike))]
    if len(windows[-1]) < BASELINE_LEAST:
        return None
    if len(values) <= min(BASELINE_FIRST, BASELINE_RECENT):
        del windows[1:]  # the first are the latest too
    ranges = [_range(window, quantity) for window in windows]
    return min(low for low, _, _ in ranges), ranges[-1][1], max(high for _, _, high in ranges)


def _same_trim(dives: Array, row: Array, given: tuple[str, ...]) -> NDArray[np.bool_]:
    """Whether each dive had the same of what a number depends on, as far as both tell."""
    columns = [_COLUMN[name] for name in given]
    here, quantities = row[columns], [_BY_NAME[name] for name in given]
    most = [max(q.least, q.part * abs(v)) for q, v in zip(quantities, here.tolist(), strict=True)]
    return np.asarray(~(np.abs(dives[:, columns] - here) > most).any(axis=1))


def _range(values: list[float], quantity: Quantity) -> tuple[float, float, float]:
    usual = median(values)  # of a dozen values: numpy's is for thousands
    spread = RANGE_WIDTH * MAD_TO_SIGMA * median([abs(value - usual) for value in values])
    half = max(spread, quantity.least, quantity.part * abs(usual))
    return usual - half, usual, usual + half
