"""The two-stage filter of paper 002: a low pass for the residual, a Kalman filter for the tide. Pure.

First the currents of the dives go through a Butterworth low pass; what it lets pass is the residual. What it
takes away is given to a Kalman filter whose state are the cosine and sine amplitudes of each tide, which
wander at random; the mean over a dive is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gliderwatch.model import Array, readonly
from gliderwatch.sea.tides import HOUR, Constituent, smoothing


@dataclass(frozen=True, slots=True)
class TwoStageParams:
    """``cutoff`` (1/s) of the low pass; ``constituents``; ``q`` (m2/s3) that a second adds to the variance of
    an amplitude, and ``prior`` (m2/s2), that before any dive. A power gain below 0.01 at 12 h, as 002 asks
    for, needs a cutoff of 1/119.4 h, which lags by 19 h (1 / (2 pi f_c))."""

    cutoff: float = 1 / (40 * HOUR)
    constituents: tuple[Constituent, ...] = (Constituent.M2,)
    q: float = 1e-5 / HOUR
    prior: float = 0.25


@dataclass(frozen=True, slots=True)
class TwoStage:
    """What is known after a dive: ``t`` (s) its middle, its ``current`` and ``residual`` (m/s, (2,));
    ``mean`` (m/s, (2 C, 2)) of the amplitudes, cos and sin of each tide, and ``cov`` (m2/s2, (2 C, 2 C))."""

    t: float
    current: Array
    residual: Array
    mean: Array
    cov: Array


def low_pass_step(before: Array, x0: Array, x1: Array, dt: float, cutoff: float) -> Array:
    """First-order Butterworth (Tustin, K = tan(pi f_c dt)) one step of ``dt`` s on, from x0 to x1.

    ``cutoff`` f_c in 1/s. The rule holds for steps well below 1/(2 f_c); after 1/(4 f_c) or more, where
    K is 1, nothing is left of what was before.
    """
    k = math.tan(min(math.pi * cutoff * dt, math.pi / 4))
    return np.asarray(((1 - k) * before + k * (x0 + x1)) / (1 + k))


def low_pass(t: Array, x: Array, cutoff: float) -> Array:
    """What passes of values ``x`` ((m,) or (m, ...)) at increasing times ``t`` (s); it begins with x[0]."""
    out = np.array(x, dtype=np.float64)
    for k in range(1, len(t)):
        out[k] = low_pass_step(out[k - 1], x[k - 1], x[k], float(t[k] - t[k - 1]), cutoff)
    return out


def low_pass_both_ways(t: Array, x: Array, cutoff: float) -> Array:
    """The same forward, and what comes of it backward: without a lag, for missions that are over."""
    forward = low_pass(t, x, cutoff)
    return np.asarray(low_pass(-t[::-1], forward[::-1], cutoff)[::-1])


def mean_tide(start: float, end: float, constituents: tuple[Constituent, ...]) -> Array:
    """The row (2 C,) that makes of cosine and sine amplitudes the mean tide between two times (s)."""
    row: list[float] = []
    for each in constituents:
        left, angle = smoothing(each.omega, end - start), each.omega * (start + end) / 2
        row += [left * math.cos(angle), left * math.sin(angle)]
    return np.array(row)


def init(start: float, end: float, current: Array, params: TwoStageParams) -> TwoStage:
    """What is known after the first dive: all of it is residual."""
    n = 2 * len(params.constituents)
    first = readonly(current)
    return TwoStage(
        (start + end) / 2, first, first, readonly(np.zeros((n, 2))), readonly(params.prior * np.eye(n))
    )


def learn_tide(mean: Array, cov: Array, row: Array, tide: Array, sigma: float) -> tuple[Array, Array, Array]:
    """Amplitudes, their covariance and the innovation, by the mean ``tide`` (m/s, (2,)) of one dive."""
    seen = cov @ row
    gain = seen / (row @ seen + sigma**2)
    error = tide - row @ mean
    return mean + np.outer(gain, error), cov - np.outer(gain, seen), error


def learn(
    state: TwoStage, start: float, end: float, current: Array, sigma: float, params: TwoStageParams
) -> TwoStage:
    """What is known after a dive between two times (s), whose ``current`` (m/s) has error ``sigma``."""
    t = (start + end) / 2
    residual = low_pass_step(state.residual, state.current, current, t - state.t, params.cutoff)
    cov = state.cov + params.q * (t - state.t) * np.eye(len(state.cov))
    row = mean_tide(start, end, params.constituents)
    mean, cov, _ = learn_tide(state.mean, cov, row, current - residual, sigma)
    return TwoStage(t, readonly(current), readonly(residual), readonly(mean), readonly(cov))


def forecast(state: TwoStage, start: float, end: float, params: TwoStageParams) -> Array:
    """Mean flow (m/s, (2,)) between two times (s): the residual stays, the tide goes on."""
    row = mean_tide(start, end, params.constituents)
    return np.asarray(state.residual + row @ state.mean)
