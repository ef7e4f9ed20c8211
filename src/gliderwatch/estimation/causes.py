"""How a dive can be explained, and which explanation is the likeliest. Pure.

A multi-process model (Harrison and Stevens 1976): beside "as usual" a dive may show another speed,
another flow, a wrong current or a wrong ground velocity. Each opens the variance of one thing; the
innovations then say which of them is meant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from gliderwatch.estimation.flow import LASTING
from gliderwatch.estimation.measurement import OWN, Linear
from gliderwatch.estimation.reckoned import Reckoned
from gliderwatch.model import Array

FASTEST = 1.3
"""m/s: no glider flies faster through the water, and none backwards."""


class Cause(StrEnum):
    """How a dive is explained."""

    USUAL = "as usual"
    SPEED = "another speed"
    FLOW = "another flow"
    CURRENT = "wrong current"
    GROUND = "wrong ground velocity"

    @property
    def is_error(self) -> bool:
        """Whether it says that one of the measurements is wrong."""
        return self in (Cause.CURRENT, Cause.GROUND)


@dataclass(frozen=True, slots=True)
class Surprise:
    """``chance`` of it on a dive, and how large it usually is (m/s, a component)."""

    chance: float
    size: float


@dataclass(frozen=True, slots=True)
class Surprises:
    """The causes but for the usual one."""

    speed: Surprise = Surprise(0.02, 0.2)
    flow: Surprise = Surprise(0.03, 0.25)
    current: Surprise = Surprise(0.02, 0.4)
    ground: Surprise = Surprise(0.01, 0.3)

    def of(self, cause: Cause) -> Surprise:
        """The surprise of a cause; for the usual one what is left of the chances."""
        told = {
            Cause.SPEED: self.speed,
            Cause.FLOW: self.flow,
            Cause.CURRENT: self.current,
            Cause.GROUND: self.ground,
        }
        usual = Surprise(1 - sum(each.chance for each in told.values()), 0.0)
        return told.get(cause, usual)


def opened(linear: Linear, cov: Array, cause: Cause, size: float) -> tuple[Linear, Array]:
    """The measurements and the covariance ((n, n)) of the state, if that is the cause."""
    more, wrong = np.zeros(len(cov)), np.zeros(len(linear.rows))
    if cause is Cause.SPEED:
        more[OWN] = size**2
    elif cause is Cause.FLOW:
        more[LASTING] = size**2
    elif cause is Cause.CURRENT:
        wrong[2:] = size**2
    elif cause is Cause.GROUND:
        wrong[:2] = size**2
    return Linear(linear.rows, linear.innovation, linear.noise + np.diag(wrong)), cov + np.diag(more)


@dataclass(frozen=True, slots=True)
class Told:
    """What is known of W beside the measurements: as the glider ``tells`` it, at the predicted state ``x``
    ((n,))."""

    tells: Reckoned
    x: Array


def odds(
    expected: Linear,
    actual: Linear,
    cov: Array,
    own: float | None,
    surprises: Surprises,
    told: Told | None = None,
) -> dict[Cause, float]:
    """Probability of each cause.

    ``expected`` is linear about the own speed that was expected, ``actual`` about the one that ground
    velocity and current give, ``own`` (m/s): that is none where one of the two is wrong. Without a
    current only speed and flow can be in question.
    """
    logs = {}
    for cause in Cause:
        if cause.is_error and len(actual.rows) == 2:
            continue
        if cause is Cause.SPEED and own is not None and not 0 < own < FASTEST:
            continue
        surprise = surprises.of(cause)
        linear = expected if cause.is_error else actual
        likelihood = max(_log_densities(linear, cov, cause, surprise.size, told))
        logs[cause] = math.log(surprise.chance) + likelihood
    most = max(logs.values())
    total = sum(math.exp(each - most) for each in logs.values())
    return {cause: math.exp(each - most) / total for cause, each in logs.items()}


def is_believed(linear: Linear, cov: Array, cause: Cause, size: float, told: Told) -> bool:
    """Whether W as the glider tells it fits a dive that has that cause."""
    without, with_it = _log_densities(linear, cov, cause, size, told)
    return with_it > without


def _log_densities(
    linear: Linear, cov: Array, cause: Cause, size: float, told: Told | None
) -> tuple[float, float]:
    """Log density of the innovation, but for a constant, if that is the cause: what the glider tells of W
    being wrong, and being right (minus infinity: it tells nothing)."""
    linear, cov = opened(linear, cov, cause, size)
    plain = _log_density(linear, cov)
    if told is None:
        return plain, -math.inf
    wrong = plain + math.log(told.tells.lies / FASTEST) + math.log(math.sqrt(2 * math.pi))
    return wrong, _log_density(linear.with_own(told.x, told.tells), cov) + math.log(1 - told.tells.lies)


def _log_density(linear: Linear, cov: Array) -> float:
    s = linear.rows @ cov @ linear.rows.T + linear.noise
    square = float(linear.innovation @ np.linalg.solve(s, linear.innovation))
    return -0.5 * (square + float(np.linalg.slogdet(s)[1]))
