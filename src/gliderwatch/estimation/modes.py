"""How a dive can be explained, and which explanation is the likeliest. Pure.

A multi-process model (Harrison and Stevens 1976): beside "as usual" a dive may show another speed,
another flow, a wrong current or a wrong ground velocity. Each opens the variance of one thing; the
innovations then say which of them is meant.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import exp, log, pi, sqrt

import numpy as np

from gliderwatch.estimation.dive_measurement import OWN, Linear
from gliderwatch.estimation.kinematic_speed import KinematicSpeed
from gliderwatch.model import Array
from gliderwatch.sea.gauss_markov import LASTING

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

    def by_cause(self) -> dict[Cause, Surprise]:
        """The surprise of each cause; of the usual one what is left of the chances."""
        told = {
            Cause.SPEED: self.speed,
            Cause.FLOW: self.flow,
            Cause.CURRENT: self.current,
            Cause.GROUND: self.ground,
        }
        return {Cause.USUAL: Surprise(1 - sum(each.chance for each in told.values()), 0.0), **told}


def opened(linear: Linear, cov: Array, cause: Cause, size: float) -> tuple[Linear, Array]:
    """The measurements and the covariance ((n, n)) of the state, if that is the cause."""
    more, wrong = np.zeros(len(cov)), np.zeros(len(linear.rows))
    if cause is Cause.SPEED:
        more[OWN] = size**2
    elif cause is Cause.FLOW:
        more[LASTING] = size**2
    elif cause is Cause.CURRENT:
        wrong[2:4] = size**2
    elif cause is Cause.GROUND:
        wrong[:2] = size**2
    return Linear(linear.rows, linear.innovation, linear.noise + np.diag(wrong)), cov + np.diag(more)


@dataclass(frozen=True, slots=True)
class Told:
    """What is known of W beside the measurements: as the glider ``tells`` it, at the predicted state ``x``
    ((n,))."""

    tells: KinematicSpeed
    x: Array


@dataclass(frozen=True, slots=True)
class Odds:
    """Probability of a cause, and W as the glider tells it, if that fits where this is the cause."""

    chance: float
    told: Told | None


def odds(
    expected: Linear,
    actual: Linear,
    cov: Array,
    own: float | None,
    surprises: Surprises,
    told: Told | None = None,
) -> dict[Cause, Odds]:
    """The odds of each cause.

    ``expected`` is linear about the own speed that was expected, ``actual`` about the one that ground
    velocity and current give, ``own`` (m/s): that is none where one of the two is wrong. Without a
    current only speed and flow can be in question.
    """
    possible = surprises.by_cause()
    if len(actual.rows) == 2:
        possible = {cause: each for cause, each in possible.items() if not cause.is_error}
    if own is not None and not 0 < own < FASTEST:
        del possible[Cause.SPEED]
    without = right = _log_densities(possible, expected, actual, cov)
    if told is not None:
        without = [each + log(told.tells.lies / FASTEST) + log(sqrt(2 * pi)) for each in without]
        expected, actual = (each.with_own(told.x, told.tells) for each in (expected, actual))
        with_it = _log_densities(possible, expected, actual, cov)
        right = [each + log(1 - told.tells.lies) for each in with_it]
    logs = [
        log(each.chance) + max(pair)
        for each, pair in zip(possible.values(), zip(without, right, strict=True), strict=True)
    ]
    most = max(logs)
    total = sum(exp(each - most) for each in logs)
    return {
        cause: Odds(exp(each - most) / total, told if right[i] > without[i] else None)
        for i, (cause, each) in enumerate(zip(possible, logs, strict=True))
    }


def _log_densities(
    possible: dict[Cause, Surprise], expected: Linear, actual: Linear, cov: Array
) -> list[float]:
    """Log density of the innovation, but for a constant, of each cause."""
    each = [
        opened(expected if cause.is_error else actual, cov, cause, surprise.size)
        for cause, surprise in possible.items()
    ]
    rows = np.array([linear.rows for linear, _ in each])
    noise = np.array([linear.noise for linear, _ in each])
    innovations = np.array([linear.innovation for linear, _ in each])
    s = rows @ np.array([cov for _, cov in each]) @ rows.transpose(0, 2, 1) + noise
    solved = np.linalg.solve(s, innovations[:, :, None])[:, :, 0]
    squares = [float(e @ x) for e, x in zip(innovations, solved, strict=True)]
    return [
        -0.5 * (square + float(size)) for square, size in zip(squares, np.linalg.slogdet(s)[1], strict=True)
    ]
