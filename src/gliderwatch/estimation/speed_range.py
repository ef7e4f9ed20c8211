"""The normal speed of a glider, learnt from its first healthy dives. Pure.

What is normal depends on how hard the glider is driven: speeds are compared with those of dives at a like
setting of the thruster (none: buoyancy alone). At a setting that was never flown the normal speed is what
the dives at weaker ones make expected: the square of a speed goes with the thrust and with the volume pumped.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import median

import numpy as np
from numpy.typing import NDArray

from gliderwatch.estimation.constants import (
    ABOVE,
    FASTEST,
    LEAST_THRUST,
    MAD_TO_SIGMA,
    MOST_PUMPED,
    NARROWEST,
    NEAR,
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
    """Healthy dives: speeds through the water (m/s) and settings of the thruster, (k,), and volumes pumped
    diving and climbing (m3, (k, 2), 0: not known)."""

    speeds: Array = field(default_factory=lambda: readonly([]))
    settings: Array = field(default_factory=lambda: readonly([]))
    volumes: Array = field(default_factory=lambda: readonly(np.empty((0, 2))))


@dataclass(frozen=True, slots=True)
class Drive:
    """What drives a glider on a dive: the ``setting`` of its thruster (0: never on, 1: always and fully; not
    known: 0) and the ``volumes`` pumped diving and climbing (m3; not known: 0)."""

    setting: float
    volumes: tuple[float, float] = (0.0, 0.0)


def drive(features: DiveFeatures) -> Drive:
    """What drove a glider on a dive."""
    return Drive(features.thruster or 0.0, (features.ballast_dive or 0.0, features.ballast_climb or 0.0))


def learn(
    normal: Normal, speed: float, at: Drive, duration: float, params: RangeParams, before: int = 0
) -> Normal:
    """The healthy dives with one more, of a ``duration`` (s) driven so, after all that came ``before``."""
    is_trial = duration < params.shortest and before < params.trials
    similar = int(_alike(normal, at).sum())
    every = max(round(params.spacing / max(duration, 1.0)), 1)
    if is_trial or similar >= params.most or (similar >= params.least and before % every):
        return normal
    return _with(normal, slice(None), (speed,), at)


def renewed(normal: Normal, speeds: tuple[float, ...], at: Drive) -> Normal:
    """The healthy dives where those driven so are now these alone: the glider is flown in a new way."""
    return _with(normal, ~_alike(normal, at), speeds, at)


def _with(normal: Normal, kept: NDArray[np.bool_] | slice, speeds: tuple[float, ...], at: Drive) -> Normal:
    """Those of the dives that are ``kept``, and more at some speeds, all driven so."""
    return Normal(
        readonly([*normal.speeds[kept], *speeds]),
        readonly([*normal.settings[kept], *([at.setting] * len(speeds))]),
        readonly([*normal.volumes[kept], *([at.volumes] * len(speeds))]),
    )


def speed_range(normal: Normal, at: Drive, params: RangeParams) -> SpeedRange | None:
    """The normal range of a dive that is driven so; None as long as too few dives tell.

    >>> dives = Normal(readonly([0.25, 0.24, 0.26]), readonly([0.0] * 3), readonly([(0.0, 0.0)] * 3))
    >>> found = speed_range(dives, Drive(0.0), RangeParams())
    >>> round(found.low, 4), found.usual, round(found.high, 4)
    (0.1907, 0.25, 0.3375)
    """
    alike = _alike(normal, at)
    if alike.sum() >= params.least:
        return _range(normal.speeds[alike], params)
    weaker = normal.settings < at.setting
    if weaker.sum() < params.least:
        return None
    strongest = weaker & (normal.settings >= np.sort(normal.settings[weaker])[-params.least])
    found = _range(_driven(normal, strongest, at), params)
    return SpeedRange(found.low, found.usual, FASTEST, found.dives)


def _driven(normal: Normal, which: NDArray[np.bool_], at: Drive) -> Array:
    """Speeds (m/s) that some dives would have had driven so, with the thruster set higher."""
    volumes = normal.volumes[which]
    both = np.array(at.volumes) * volumes > 0  # known, and of one sign
    times = np.divide(at.volumes, volumes, out=np.zeros_like(volumes), where=both)
    known = both.sum(axis=1)
    pumped = np.where(known > 0, np.minimum(times.sum(axis=1) / np.maximum(known, 1), MOST_PUMPED), 1.0)
    more = LEAST_THRUST * (at.setting - normal.settings[which])
    return np.sqrt(pumped * normal.speeds[which] ** 2 + more)


def _alike(normal: Normal, at: Drive) -> NDArray[np.bool_]:
    is_near = np.abs(normal.settings - at.setting) < NEAR
    return np.asarray(is_near & ((normal.settings > 0) == (at.setting > 0)))


def _range(speeds: Array, params: RangeParams) -> SpeedRange:
    usual = median(speeds.tolist())
    spread = params.width * MAD_TO_SIGMA * median(np.abs(speeds - usual).tolist())
    below = min(max(spread, params.narrowest * usual), params.widest * usual)
    above = max(spread, params.above * usual)
    return SpeedRange(usual - below, usual, usual + above, len(speeds))
