"""The measurements of a dive as linear functions of the joint state. Pure.

The state ends with the own speed W, slip and side; before them is the flow. See `joint` for the equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.estimation.flow import FlowParams, mean_flow
from gliderwatch.estimation.observation import Observation
from gliderwatch.estimation.reckoned import Reckoned
from gliderwatch.model import Array

OWN, SLIP, SIDE = -3, -2, -1
"""Places in the state of W (m/s), and of slip and side (parts of W)."""


@dataclass(frozen=True, slots=True)
class Linear:
    """Measurements of one dive, linear in the n numbers of the state.

    ``rows`` ((m, n)), ``innovation`` ((m,)) at the predicted state, ``noise`` ((m, m)); the ground
    velocity comes first (2), then the current (2) if there is one.
    """

    rows: Array
    innovation: Array
    noise: Array

    def first(self, m: int) -> Linear:
        """The first ``m`` of the measurements."""
        return Linear(self.rows[:m], self.innovation[:m], self.noise[:m, :m])

    def with_own(self, x: Array, told: Reckoned) -> Linear:
        """These and W as ``told``, at the state ``x`` ((n,))."""
        row = np.zeros((1, len(x)))
        row[0, OWN] = 1.0
        m = len(self.rows)
        noise = np.zeros((m + 1, m + 1))
        noise[:m, :m], noise[m, m] = self.noise, told.sigma**2
        innovation = np.append(self.innovation, told.speed - x[OWN])
        return Linear(np.concatenate([self.rows, row]), innovation, noise)


@dataclass(frozen=True, slots=True)
class Guess:
    """About what the measurements are linear: ``own`` speed W (m/s), the ``slip`` that is known of beside
    that of the state (part of W), and the standard error ``slip_sigma`` of that on this dive."""

    own: float
    slip: float
    slip_sigma: float


def measure(seen: Observation, x: Array, guess: Guess, doubt: float, flow: FlowParams) -> Linear:
    """The measurements of a dive at the predicted state ``x`` ((n,)).

    ``doubt`` is a factor on the variances of the measurements. The error of slip on this dive is one of
    ground velocity and current alike.
    """
    h, own = seen.heading, guess.own
    aside = np.array([-h[1], h[0]])
    rows = np.zeros((4, flow.size + 3))
    rows[:2, : flow.size] = rows[2:, : flow.size] = mean_flow(seen.start, seen.end, flow)
    rows[2:, OWN] = -(guess.slip + x[SLIP]) * h - x[SIDE] * aside
    rows[:2, OWN] = h + rows[2:, OWN]
    rows[:2, SLIP] = rows[2:, SLIP] = -own * h
    rows[:2, SIDE] = rows[2:, SIDE] = -own * aside
    noise = np.zeros((4, 4))
    noise[:2, :2] = seen.ground_cov + own**2 * seen.heading_cov
    noise[2:, 2:] = seen.current_sigma**2 * np.eye(2)
    along = np.tile(own * guess.slip_sigma * h, 2)
    # the products of W with slip and side are in two columns each: take them out once
    once = np.tile(own * (x[SLIP] * h + x[SIDE] * aside), 2)
    measured = np.concatenate([seen.ground, seen.current if seen.current is not None else np.zeros(2)])
    linear = Linear(rows, measured - rows @ x - once, doubt * noise + np.outer(along, along))
    return linear if seen.current is not None else linear.first(2)


def drag_slip(speed: float, usual: float | None) -> tuple[float, float]:
    """The slip that drag adds on a glider slower than usual (m/s): mean and standard error, parts of W.

    More drag at the same pitch needs more lift, so a larger angle of attack. With the flight model of
    Merckelbach et al. (2019) slip rises by 1.5 (1 - speed / usual)^2 where drag alone slows a Slocum,
    and not at all where it lacks buoyancy. Which of the two it is, is not known here.

    >>> drag_slip(0.25, 0.25), drag_slip(0.1, None)
    ((0.0, 0.0), (0.0, 0.0))
    """
    if usual is None or usual <= 0:
        return 0.0, 0.0
    lost = min(max(1 - speed / usual, 0.0), 1.0)
    return 0.9 * lost**2, 0.45 * lost**2
