"""The speed that a glider tells without fix, heading or current: from depth rate, or its own mean. Pure.

On board the speed W is the depth rate over tan(pitch). Shore has both, thinned, and often the mean of W as
well (`m_avg_speed`). Neither is W: the ratio to it is learnt on healthy dives. On real missions depth rate
over tan(pitch) was 1.16 to 1.20 W and kept to 5 % of that; the glider's own mean was 0.97 to 1.04 W, but
lags for hours after each start of a mission, so that it is taken only where there is no other.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tan
from statistics import median

from gliderwatch.estimation.constants import (
    BRIEF,
    FLATTEST_PITCH,
    MAD_TO_SIGMA,
    ONBOARD_LEAST,
    ONBOARD_LIES,
    RATIOS_FEW,
    RATIOS_KEPT,
    SHORTEST,
    VERTICAL_LEAST,
    VERTICAL_LIES,
    VERTICAL_RATIO,
    VERTICAL_SPREAD,
)
from gliderwatch.model import DiveFeatures


@dataclass(frozen=True, slots=True)
class Source:
    """One way to the speed: the ratio of W to it while none is learnt, with its standard error (None: not to
    be used before), the least standard error, how often it ``lies``: has nothing to do with the speed, and
    the ``shortest`` dive (s) of which it tells."""

    first: tuple[float, float] | None
    least: float
    lies: float
    shortest: float


VERTICAL = Source((VERTICAL_RATIO, VERTICAL_SPREAD), VERTICAL_LEAST, VERTICAL_LIES, BRIEF)
ONBOARD = Source(None, ONBOARD_LEAST, ONBOARD_LIES, SHORTEST)


@dataclass(frozen=True, slots=True)
class Ratios:
    """Ratios of W to the speed by each source, on the last healthy dives."""

    vertical: tuple[float, ...] = ()
    onboard: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class KinematicSpeed:
    """W (m/s) by depth rate and pitch or by the glider's own mean, with its standard error and the chance
    that it ``lies``; ``is_prompt``: no lag."""

    speed: float
    sigma: float
    lies: float
    is_prompt: bool


def vertical(features: DiveFeatures) -> float | None:
    """Mean of depth rate over tan(pitch) of dives and climbs (m/s), weighed by the time that each takes.

    >>> round(vertical(DiveFeatures(10800.0, depth_rate_dive=0.1, pitch_dive=-0.4,
    ...                             depth_rate_climb=-0.1, pitch_climb=0.4)), 4)
    0.2365
    """
    slowness = []
    for rate, pitch in (
        (features.depth_rate_dive, features.pitch_dive),
        (features.depth_rate_climb, features.pitch_climb),
    ):
        if rate is None or pitch is None or abs(pitch) < FLATTEST_PITCH or rate == 0:
            return None
        slowness.append(tan(abs(pitch)) / abs(rate))
    return 2 / sum(slowness)


def learn(ratios: Ratios, features: DiveFeatures, own: float) -> Ratios:
    """The ratios with those of one more healthy dive, of which W is known (m/s)."""
    if features.duration < SHORTEST:
        return ratios
    return Ratios(
        _with(ratios.vertical, vertical(features), own),
        _with(ratios.onboard, features.onboard_speed, own),
    )


def kinematic_speed(ratios: Ratios, features: DiveFeatures) -> KinematicSpeed | None:
    """W as a dive tells it; None where it does not."""
    for source, value, earlier in (
        (VERTICAL, vertical(features), ratios.vertical),
        (ONBOARD, features.onboard_speed, ratios.onboard),
    ):
        if features.duration < source.shortest:
            continue
        found = _ratio(source, earlier)
        if value is not None and value > 0 and found is not None:
            ratio, sigma = found
            return KinematicSpeed(ratio * value, sigma * ratio * value, source.lies, source is VERTICAL)
    return None


def _with(ratios: tuple[float, ...], value: float | None, own: float) -> tuple[float, ...]:
    return ratios if value is None or not value > 0 else (*ratios, own / value)[-RATIOS_KEPT:]


def _ratio(source: Source, ratios: tuple[float, ...]) -> tuple[float, float] | None:
    """The ratio of W to a speed, and its standard error as a part of it."""
    if len(ratios) < RATIOS_FEW:
        return source.first
    ratio = median(ratios)
    spread = MAD_TO_SIGMA * median(abs(each / ratio - 1) for each in ratios)
    return ratio, max(spread, source.least)
