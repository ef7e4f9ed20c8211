"""Evidence over several dives: steps in speed that the glider does not know of, and slow drifts. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache, lru_cache

import numpy as np

from gliderwatch.estimation.constants import (
    CALIBRATED_ALARMS,
    CALIBRATED_FALL,
    CALIBRATED_RATIO,
    LONGEST_INNOVATION,
    OLDER_EVERY,
    OLDER_KEPT,
    STEP_SIZE,
    WINDOW,
)
from gliderwatch.estimation.dive_measurement import SIDE, SLIP
from gliderwatch.model import Array, readonly, replace

# ----------------------------------------
# Evidence over several dives. Pure.
#
# Two tests. `Bank` is the generalised likelihood ratio of Willsky and Jones (1976): after each dive it asks
# of every recent dive whether a step in the state of a Kalman filter, begun just before that dive, explains
# the innovations since. `cusum` is Page's (1954): it adds up small departures of one number in one
# direction. Both are set by how often they may cry wolf.


@dataclass(frozen=True, slots=True, eq=False)
class Bank:
    """Hypotheses of a step, one for each recent dive and one for some of the older ones, oldest first.

    ``shift`` ((k, n, q)): by how much the state differs from what the filter makes of it, for each of the q
    numbers that describe a step; ``info`` ((k, q, q)) and ``score`` ((k, q)): information about these
    numbers in the innovations since, and the gradient of the log likelihood in them; ``begun`` (s, (k,)) when
    each step would have been.
    """

    shift: Array = field(default_factory=lambda: readonly(np.empty((0, 0, 0))))
    info: Array = field(default_factory=lambda: readonly(np.empty((0, 0, 0))))
    score: Array = field(default_factory=lambda: readonly(np.empty((0, 0))))
    begun: Array = field(default_factory=lambda: readonly([]))


@dataclass(frozen=True, slots=True)
class Update:
    """One update of a Kalman filter with n states and m measurements.

    ``rows`` ((m, n)), ``gain`` ((n, m)), and ``weight`` ((m, m)), the inverse covariance of the
    ``innovation`` ((m,)).
    """

    rows: Array
    gain: Array
    weight: Array
    innovation: Array


@dataclass(frozen=True, slots=True)
class Step:
    """The likeliest step.

    ``ratio`` is twice the log likelihood ratio: where there was no step, of chi-square with one degree of
    freedom at each dive. ``which`` number and ``sigma`` of the step; ``shifts``, ``info`` and ``score``: the
    hypothesis, as in the `Bank`; ``begun`` (s) when it would have been.
    """

    ratio: float
    which: int
    sigma: float
    shifts: Array
    info: Array
    score: Array
    begun: float

    @property
    def sizes(self) -> Array:
        """The numbers that describe the step, (q,): slip and side first."""
        return np.asarray(np.linalg.solve(self.info, self.score))

    @property
    def size(self) -> float:
        """Size of the step."""
        return float(self.sizes[self.which])

    @property
    def shift(self) -> Array:
        """By how much the state is off by all of it, (n,)."""
        return np.asarray(self.shifts @ self.sizes)

    @property
    def cov(self) -> Array:
        """Covariance of `shift`, (n, n)."""
        shifted = self.shifts @ np.linalg.solve(self.info, self.shifts.T)
        return np.asarray((shifted + shifted.T) / 2)


def advance(
    bank: Bank,
    shape: Array,
    precision: Array,
    kept: Array,
    update: Update,
    begun: float,
    dives: int = 1,
) -> Bank:
    """The bank after one more dive, ``begun`` at a time (s), the one after ``dives`` before it.

    ``shape`` ((n, q)) is what a step does to the state, ``precision`` ((q, q)) what is known of its size
    before, ``kept`` ((n, n)) the transition to the dive.
    """
    n, q = shape.shape
    held = _held(len(bank.score), dives)
    shift = np.concatenate([kept @ bank.shift.reshape(-1, n, q)[held], shape[None]])
    info = np.concatenate([bank.info.reshape(-1, q, q)[held], precision[None]])
    score = np.concatenate([bank.score.reshape(-1, q)[held], np.zeros((1, q))])
    seen = update.rows @ shift
    weighted = np.swapaxes(seen, 1, 2) @ update.weight
    return Bank(
        readonly(shift - update.gain @ seen),
        readonly(info + weighted @ seen),
        readonly(score + weighted @ update.innovation),
        readonly([*bank.begun[held], begun]),
    )


def _held(n: int, dives: int) -> list[int]:
    """Places of the ``n`` hypotheses that are held beside a new one.

    All of the last `WINDOW`. Of the older ones one in `OLDER_EVERY` dives: on a long leg a step that the
    glider does not know of cannot be seen before it turns, days later.

    >>> _held(3, 7), len(_held(24, 7)), len(_held(24, 12))
    ([0, 1, 2], 23, 24)
    """
    older = max(n - WINDOW, 0)
    stays = n < WINDOW or dives % OLDER_EVERY == 0
    held = [*range(older), *range(older if stays else older + 1, n)]
    return held[max(len(held) - (WINDOW - 1 + OLDER_KEPT), 0) :]


def likeliest(bank: Bank, which: int, sign: int = 0) -> Step | None:
    """The likeliest step in number ``which``: of any ``sign`` (0), or of one. None while there are no dives.

    The other numbers take what values they like within the precision given to `advance`.
    """
    if not len(bank.score):
        return None
    sizes, variances = (each[:, which] for each in _sizes(bank))
    ratio = np.where(sizes * sign >= 0, sizes**2 / variances, 0.0)
    k = int(ratio.argmax())
    return Step(
        ratio=float(ratio[k]),
        which=which,
        sigma=float(variances[k]) ** 0.5,
        shifts=bank.shift[k],
        info=bank.info[k],
        score=bank.score[k],
        begun=float(bank.begun[k]),
    )


@lru_cache(maxsize=2)  # asked for a loss and for a turn
def _sizes(bank: Bank) -> tuple[Array, Array]:
    """The likeliest value of each number under each hypothesis, and its variance: (k, q) each."""
    cov = np.asarray(np.linalg.inv(bank.info), dtype=np.float64)
    return (cov @ bank.score[:, :, None])[:, :, 0], cov.diagonal(axis1=1, axis2=2)


def ratio_bound(alarms_per_month: float) -> float:
    """The ratio of `Step` that a healthy glider reaches so often in a month. Raises ValueError below 0.

    By measurement, not by theory: the flow is not quite what the filter takes it for, which makes
    large ratios more frequent than chi-square has them.

    >>> ratio_bound(0.5), round(ratio_bound(0.05), 1)
    (10.0, 19.2)
    """
    if not alarms_per_month > 0:
        raise ValueError(f"alarms a month must be above 0, not {alarms_per_month}")
    alarms = min(alarms_per_month, CALIBRATED_ALARMS)
    return CALIBRATED_RATIO + CALIBRATED_FALL * math.log(CALIBRATED_ALARMS / alarms)


def cusum(before: float, departure: float, slack: float) -> float:
    """Page's sum after one more number: ``departure`` in standard deviations, of which ``slack`` is normal.

    >>> cusum(1.0, 2.0, 0.5)
    2.5
    """
    return max(0.0, before + departure - slack)


@cache
def cusum_bound(slack: float, dives_between_alarms: float) -> float:
    """The sum that a healthy glider reaches once in so many dives, departures being white and normal.

    Siegmund's (1985) approximation of the mean run length, (exp(2 k b) - 2 k b - 1) / (2 k^2) with b the
    bound plus 1.166, solved by bisection. Raises ValueError when slack or dives are not positive.

    >>> round(cusum_bound(0.5, 336.0), 2)  # exact: 4
    3.99
    """
    if not (slack > 0 and dives_between_alarms > 0):
        raise ValueError(f"slack and dives must be above 0, not {slack} and {dives_between_alarms}")
    low, high = 0.0, 20.0 / slack
    for _ in range(50):
        bound = (low + high) / 2
        x = 2 * slack * (bound + 1.166)
        low, high = (
            (low, bound) if (math.expm1(x) - x) / (2 * slack**2) >= dives_between_alarms else (bound, high)
        )
    return high


# ----------------------------------------
# Losses that the glider does not know of: steps in slip (a lost or bent wing) and side (a compass).


def steps(
    bank: Bank, matrix: Array, update: Update, jump: Array, front: float, begun: float, dives: int
) -> tuple[Step | None, Step | None, Bank]:
    """The likeliest loss (a step up in slip) and turn (one in side), and the bank with one more dive.

    ``matrix`` ((n, n)) is the transition to the dive, ``begun`` at a time (s) after ``dives`` before, and
    ``update`` that of the filter. The flow may have changed together with the step, by ``front`` (m/s, a
    component), which does ``jump`` ((n, 2)) to the state. No dive alone may prove a step.
    """
    shape = np.zeros((len(matrix), 4))
    shape[[SLIP, SIDE], [0, 1]] = 1.0
    shape[:, 2:] = jump
    sizes = np.array([STEP_SIZE, STEP_SIZE, front, front])
    square = float(update.innovation @ update.weight @ update.innovation)
    believed = update.innovation * min(1.0, LONGEST_INNOVATION / math.sqrt(max(square, 1e-12)))
    update = replace(update, innovation=believed)
    bank = advance(bank, shape, np.diag(sizes**-2), matrix, update, begun, dives)
    return likeliest(bank, 0, sign=1), likeliest(bank, 1), bank


def proven(loss: Step | None, turn: Step | None, alarms_per_month: float) -> Step | None:
    """The step that is too likely for chance, if there is one."""
    bound = ratio_bound(alarms_per_month)
    return next((step for step in (loss, turn) if step is not None and step.ratio > bound), None)
