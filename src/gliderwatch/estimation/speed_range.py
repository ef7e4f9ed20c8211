"""The normal speed of a glider, learnt from its first healthy dives. Pure.

What is normal depends on how hard the glider is driven: speeds are compared with those of dives at a like
setting of the thruster (none: buoyancy alone). A setting that was never flown is held against the
weaker ones, because a thruster makes no glider slower.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import median

import numpy as np
from numpy.typing import NDArray

from gliderwatch.estimation.constants import (
    ABOVE,
    FASTEST,
    LIKE,
    MAD_TO_SIGMA,
    NARROWEST,
    RANGE_LEAST,
    RANGE_MOST,
    RANGE_WIDTH,
    SHORTEST,
    TRIALS,
    USUAL_DIVE,
    WIDEST,
)
from gliderwatch.model import Array, DiveFeatures, readonly


@dataclass(frozen=True, slots=True)
class RangeParams:
    """How a range is made of healthy speeds.

    ``least`` and ``most`` are how many dives at a setting are needed and used. The half width of the range
    is ``width`` robust standard deviations; downwards at least ``narrowest`` and at most ``widest`` of the
    median, so that a loss of 30 % is always outside, upwards at least ``above`` of it. ``shortest`` (s)
    is how long a dive must be to count among the first ``trials`` of a deployment: on the short ones after
    launch pilots try out the ballast. Of dives shorter than ``spacing`` (s) fewer are used, so that ``most``
    reach over three days: water that is a little denser or lighter stays for a day.
    """

    least: int = RANGE_LEAST
    most: int = RANGE_MOST
    width: float = RANGE_WIDTH
    narrowest: float = NARROWEST
    widest: float = WIDEST
    above: float = ABOVE
    shortest: float = SHORTEST
    trials: int = TRIALS
    spacing: float = USUAL_DIVE


@dataclass(frozen=True, slots=True)
class SpeedRange:
    """Lowest, usual and highest normal speed through the water (m/s), and the number of ``dives`` they were
    learnt from (0: configured)."""

    low: float
    usual: float
    high: float
    dives: int


@dataclass(frozen=True, slots=True)
class Normal:
    """Healthy dives: speeds through the water (m/s) and settings of the thruster, (k,)."""

    speeds: Array = field(default_factory=lambda: readonly([]))
    settings: Array = field(default_factory=lambda: readonly([]))


def setting(features: DiveFeatures) -> float:
    """How much the thruster was on during a dive (0: never, 1: always and fully); not known: 0."""
    return features.thruster or 0.0


def learn(
    normal: Normal, speed: float, at: float, duration: float, params: RangeParams, before: int = 0
) -> Normal:
    """The healthy dives with one more, of a ``duration`` (s) at a setting, after all that came ``before``."""
    is_trial = duration < params.shortest and before < params.trials
    similar = int(_alike(normal, at).sum())
    every = max(round(params.spacing / max(duration, 1.0)), 1)
    if is_trial or similar >= params.most or (similar >= params.least and before % every):
        return normal
    return Normal(readonly([*normal.speeds, speed]), readonly([*normal.settings, at]))


def renewed(normal: Normal, speeds: tuple[float, ...], at: float) -> Normal:
    """The healthy dives where those at a setting are now these alone: the glider is flown in a new way."""
    kept = ~_alike(normal, at)
    return Normal(
        readonly([*normal.speeds[kept], *speeds]), readonly([*normal.settings[kept], *([at] * len(speeds))])
    )


def speed_range(normal: Normal, at: float, params: RangeParams) -> SpeedRange | None:
    """The normal range at a setting; None as long as too few dives tell.

    >>> dives = Normal(readonly([0.25, 0.24, 0.26]), readonly([0.0, 0.0, 0.0]))
    >>> found = speed_range(dives, 0.0, RangeParams())
    >>> round(found.low, 4), found.usual, round(found.high, 4)
    (0.1907, 0.25, 0.3375)
    """
    alike = _alike(normal, at)
    if alike.sum() >= params.least:
        return _range(normal.speeds[alike], params)
    weaker = normal.settings < at
    if weaker.sum() < params.least:
        return None
    strongest = np.sort(normal.settings[weaker])[-params.least]
    found = _range(normal.speeds[weaker & (normal.settings >= strongest)], params)
    return SpeedRange(found.low, found.usual, FASTEST, found.dives)


def _alike(normal: Normal, at: float) -> NDArray[np.bool_]:
    return np.asarray((np.abs(normal.settings - at) < LIKE) & ((normal.settings > 0) == (at > 0)))


def _range(speeds: Array, params: RangeParams) -> SpeedRange:
    usual = median(speeds.tolist())
    spread = params.width * MAD_TO_SIGMA * median(np.abs(speeds - usual).tolist())
    below = min(max(spread, params.narrowest * usual), params.widest * usual)
    above = max(spread, params.above * usual)
    return SpeedRange(usual - below, usual, usual + above, len(speeds))
