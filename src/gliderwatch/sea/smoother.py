"""The currents of a mission that is over, by all that came before and after: delayed mode (002). Pure.

The filter runs forward over all dives by the one model of the sea (`gauss_markov`); then a Rauch-Tung-
Striebel pass goes back, so that each moment is known by the whole mission, not by its past alone. Between two
ends of a dive lie knots, at which the current is wanted: the state there is the parts of the flow and the
displacement (m) by the water since the dive began, which at its end is the length of the dive times the
depth-averaged current.

    x_k|N = x_k|k + C_k (x_k+1|N - x_k+1|k),   C_k = P_k|k F_k' P_k+1|k^-1
    P_k|N = P_k|k + C_k (P_k+1|N - P_k+1|k) C_k'

Near real time is the same to the end of the dive and no further: what is known once the glider has come up.
What was foreseen is the forward pass alone: what was known when the dive began.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from gliderwatch.model import Array, readonly
from gliderwatch.sea.constants import KNOT, SEA_SCALES, START_SIGMA, TIDE_SCALES
from gliderwatch.sea.gauss_markov import FIXED, FlowParams, intensities, passage, prior

_ROUNDING = 1e-12
"""Part of a variance that is added before it is inverted: what rounding may take from it."""


@dataclass(frozen=True, slots=True)
class MeanCurrent:
    """The ``current`` (m/s, (2,): east, north) of a dive from ``start`` to ``end`` (s), with standard error
    ``sigma`` in a component, at a latitude ``lat`` (degrees)."""

    start: float
    end: float
    current: Array
    sigma: float
    lat: float


@dataclass(frozen=True, slots=True)
class Currents:
    """Currents at times ``t`` (s, (n,)), all (m/s, (n, 2)): the ``tide``, the ``residual``, which is all that
    is no tide, and ``sigma`` (n, 2) of their sum."""

    t: Array
    tide: Array
    residual: Array
    sigma: Array

    @property
    def total(self) -> Array:
        """The instantaneous current (m/s, (n, 2))."""
        return readonly(self.tide + self.residual)


@dataclass(frozen=True, slots=True)
class Delayed:
    """What a mission that is over shows of its currents: in ``delayed`` mode, and at the same moments in
    ``near_real_time`` and as ``foreseen``; ``scale`` and ``tides`` are the factors on the noise of what is no
    tide and on the prior sizes of the tides that fit it best."""

    delayed: Currents
    near_real_time: Currents
    foreseen: Currents
    scale: float
    tides: float


class _Step(NamedTuple):
    """From one knot to the next: ``matrix``, state predicted and after what was measured there."""

    t: float
    matrix: Array
    predicted: Array
    predicted_cov: Array
    mean: Array
    cov: Array
    ends: bool


def smooth(dives: Sequence[MeanCurrent], params: FlowParams, knot: float = KNOT) -> Delayed:
    """The currents during the dives of a mission, in order of time, every `knot` seconds or more often.

    Raises ValueError where there is no dive, or two overlap.
    """
    if not dives:
        raise ValueError("there is no dive with a current: nothing can be smoothed")
    if any(b.start < a.end - 1.0 for a, b in pairwise(dives)):
        raise ValueError("dives overlap: give those of one glider, each once, in order of time")
    scale, tides = _fitted(dives, params)
    params = _with_tides(params, tides)
    steps, _ = _forward(dives, params, scale, knot)
    until_end = [state for part in _by_dive(steps) for state in _backward(part)]
    before = [(one.predicted, one.predicted_cov) for one in steps]
    delayed, near_real_time, foreseen = (
        _currents(steps, states, params) for states in (_backward(steps), until_end, before)
    )
    return Delayed(delayed, near_real_time, foreseen, scale, tides)


def _fitted(dives: Sequence[MeanCurrent], params: FlowParams) -> tuple[float, float]:
    """The likeliest of `SEA_SCALES` and of `TIDE_SCALES`: each in turn, the first once more at the end."""

    @cache
    def fit(scale: float, tides: float) -> float:
        return _forward(dives, _with_tides(params, tides), scale, math.inf)[1]

    scale = max(SEA_SCALES, key=lambda one: fit(one, TIDE_SCALES[-1]))
    tides = max(TIDE_SCALES, key=lambda one: fit(scale, one))
    return max(SEA_SCALES, key=lambda one: fit(one, tides)), tides


def _with_tides(params: FlowParams, factor: float) -> FlowParams:
    return replace(params, tides=tuple(replace(each, size=factor * each.size) for each in params.tides))


def _forward(
    dives: Sequence[MeanCurrent], params: FlowParams, scale: float, knot: float
) -> tuple[list[_Step], float]:
    """The filter over all dives, and the logarithm of its likelihood."""
    n, place = params.size, params.mean
    mean, cov = np.zeros(n), np.diag(prior(params))
    steps, fit, before = list[_Step](), 0.0, dives[0].start
    for dive in dives:
        # The way to the dive; there the displacement begins with nothing.
        matrix, noise = _move(max(dive.start - before, 0.0), dive.lat, mean, scale, params)
        matrix[place] = 0.0
        noise[place] = noise[:, place] = 0.0
        noise[place, place] = START_SIGMA**2 * np.eye(2)
        mean, cov = matrix @ mean, matrix @ cov @ matrix.T + noise
        steps.append(_Step(dive.start, matrix, mean, cov, mean, cov, False))
        lasts = dive.end - dive.start
        parts = 1 if knot == math.inf else max(math.ceil(lasts / knot), 1)
        for i in range(parts):
            matrix, noise = _move(lasts / parts, dive.lat, mean, scale, params)
            predicted, predicted_cov = matrix @ mean, matrix @ cov @ matrix.T + noise
            mean, cov = predicted, predicted_cov
            if i == parts - 1:
                mean, cov, gained = _measured(mean, cov, dive, place)
                fit += gained
            t = dive.start + lasts * (i + 1) / parts
            steps.append(_Step(t, matrix, predicted, predicted_cov, mean, cov, i == parts - 1))
        before = dive.end
    return steps, fit


def _move(dt: float, lat: float, mean: Array, scale: float, params: FlowParams) -> tuple[Array, Array]:
    """Matrix and noise of `dt` seconds, the displacement (m) going on in place of the mean flow."""
    place = params.mean
    if dt <= 0.0:
        return np.eye(params.size), np.zeros((params.size, params.size))
    one = passage(0.0, dt, lat, intensities(mean, scale, params), params)
    matrix, noise = np.array(one.matrix), np.array(one.noise)
    matrix[place] *= dt
    matrix[place, place] = np.eye(2)
    noise[place] *= dt
    noise[:, place] *= dt
    return matrix, noise


def _measured(mean: Array, cov: Array, dive: MeanCurrent, place: slice) -> tuple[Array, Array, float]:
    """State after the depth-averaged current, and the logarithm of its density."""
    lasts = dive.end - dive.start
    error = dive.current * lasts - mean[place]
    spread = cov[place, place] + (dive.sigma * lasts) ** 2 * np.eye(2)
    factor = cho_factor(spread)
    gain = cho_solve(factor, cov[place]).T
    after = cov - gain @ cov[place]
    logarithm = -0.5 * float(error @ cho_solve(factor, error)) - float(np.log(np.diag(factor[0])).sum())
    # In currents, not in metres, so that fits of other knots can be compared.
    return mean + gain @ error, (after + after.T) / 2, logarithm + 2 * math.log(lasts)


def _by_dive(steps: Sequence[_Step]) -> list[list[_Step]]:
    """The steps of each dive by itself."""
    ends = [i + 1 for i, one in enumerate(steps) if one.ends]
    return [list(steps[i:j]) for i, j in zip([0, *ends[:-1]], ends, strict=True)]


def _backward(steps: Sequence[_Step]) -> list[tuple[Array, Array]]:
    """Mean and covariance at each step by all that was measured in them."""
    mean, cov = steps[-1].mean, steps[-1].cov
    out = [(mean, cov)]
    for one, after in zip(reversed(steps[:-1]), reversed(steps[1:]), strict=True):
        # In units of each number's own error: metres and m/s differ by so much that digits would be lost.
        own = np.sqrt(np.diag(after.predicted_cov))
        spread = after.predicted_cov / np.outer(own, own) + _ROUNDING * np.eye(len(own))
        back = cho_solve(cho_factor(spread), (after.matrix @ one.cov) / own[:, None]).T / own
        mean = one.mean + back @ (mean - after.predicted)
        cov = one.cov + back @ (cov - after.predicted_cov) @ back.T
        out.append((mean, (cov + cov.T) / 2))
    return out[::-1]


def _currents(steps: Sequence[_Step], states: Sequence[tuple[Array, Array]], params: FlowParams) -> Currents:
    flow = slice(0, 2 * params.parts)
    add = np.tile(np.eye(2), params.parts)
    means = np.array([mean[flow] for mean, _ in states]).reshape(len(states), params.parts, 2)
    variances = [np.diag(add @ cov[flow, flow] @ add.T) for _, cov in states]
    return Currents(
        readonly([one.t for one in steps]),
        readonly(means[:, FIXED:].sum(axis=1)),
        readonly(means[:, :FIXED].sum(axis=1)),
        readonly(np.sqrt(np.maximum(variances, 0.0))),
    )
