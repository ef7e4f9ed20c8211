"""Filters with different parameters side by side, weighted by how well each has foretold the mission. Pure.

That is maximum likelihood on a grid, refitted with every dive at the cost of one step: no search that could
end elsewhere on another run, and what is uncertain in the parameters is part of the forecast's covariance.
The grid holds ratios; the scale of all variances is learnt for each set from its own innovations.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.currents import augmented
from gliderwatch.currents.augmented import Belief, Parameters
from gliderwatch.currents.constituents import HOUR, Constituent
from gliderwatch.model import Array, readonly

MEMORY = 100
"""Dives after which what a set has foretold counts for a third: seas change along the way."""
TAIL = 6.0
"""Degrees of freedom of Student's t by which innovations are judged: one wild dive must not decide."""
SCALE_MEMORY, FEW = 40, 6
"""Dives over which the scale is learnt, and how many its first guess counts for."""
FAR, SCALE, FIRST = 9.0, (0.1, 9.0), 1.5
"""An innovation's normalised square counts as this at most; bounds of the scale, and its first guess:
little is known at first, and forecasts should say so."""
STRENGTH = {
    Constituent.M2: 1.0,
    Constituent.S2: 0.46,
    Constituent.N2: 0.2,
    Constituent.K1: 1.0,
    Constituent.O1: 0.7,
    Constituent.M4: 0.2,
}
"""Usual amplitude of a tide as part of that of the first of its kind (equilibrium tide: S2 0.46, N2 0.19 of
M2, O1 0.71 of K1)."""


@dataclass(frozen=True, slots=True)
class Bank:
    """What the filters know after a dive that ended at ``t`` (s).

    ``mean`` (m/s, (G, n, 2)); ``cov`` (m2/s2, (G, n (n + 1) / 2)) upper triangles, row by row; ``fit`` (G,)
    logarithm of the likelihood, what is long ago counting less; ``scale`` (G,) factor on the variances.
    """

    t: float
    mean: Array
    cov: Array
    fit: Array
    scale: Array


@dataclass(frozen=True, slots=True)
class Mixture:
    """A mean flow (m/s, (2,)) with its covariance (m2/s2, (2, 2))."""

    mean: Array
    cov: Array


def grid(
    steps: Sequence[float],
    memories: Sequence[float],
    tides: Sequence[tuple[float, float]],
    constituents: Sequence[Constituent],
) -> Parameters:
    """All combinations.

    ``steps`` (m/s) usual change of the residual in 3 h; ``memories`` (s); ``tides`` usual amplitude of M2 and
    K1 (m/s) with the part of it that changes in a day.
    """
    strength = np.array([STRENGTH[each] for each in constituents])
    rows = []
    for step, memory, (amplitude, wander) in itertools.product(steps, memories, tides):
        sigma = step / np.sqrt(-2 * np.expm1(-3 * HOUR / memory))
        rows.append((sigma, memory, (wander * amplitude) ** 2 / (24 * HOUR), amplitude**2))
    sigma, tau, q, prior = np.array(rows).T
    return Parameters(
        readonly(sigma),
        readonly(tau),
        readonly(np.outer(q, strength**2)),
        readonly(np.outer(prior, strength**2)),
        readonly([each.omega for each in constituents]),
    )


def init(t: float, params: Parameters) -> Bank:
    """Before any dive, at a time (s)."""
    belief, sets = augmented.init(t, params), len(params.sigma)
    return Bank(t, belief.mean, _packed(belief.cov), readonly(np.zeros(sets)), readonly(np.full(sets, FIRST)))


def belief(bank: Bank) -> Belief:
    """What each filter knows, its covariances not scaled."""
    n = bank.mean.shape[1]
    cov = np.empty((len(bank.mean), n, n))
    rows, columns = np.triu_indices(n)
    cov[:, rows, columns] = cov[:, columns, rows] = bank.cov
    return Belief(bank.t, bank.mean, cov)


def forecast(bank: Bank, start: float, end: float, params: Parameters) -> Mixture:
    """The mean flow between two times (s) not before the last dive's end."""
    each = augmented.forecast(belief(bank), start, end, params)
    return _mixed(bank, each.mean, each.var * bank.scale)


def learn(
    bank: Bank, start: float, end: float, current: Array, sigma: float, dives: int, params: Parameters
) -> tuple[Bank, Mixture]:
    """The bank after a dive, and the mean flow that it had expected.

    ``current`` (m/s, (2,)) with error ``sigma`` (m/s) in a component, ``dives`` seen before.
    """
    after, each = augmented.learn(belief(bank), start, end, current, sigma, params)
    variance = (each.var + sigma**2) * bank.scale
    square = np.sum((current - each.mean) ** 2, axis=1) / variance
    likelihood = -np.log(variance) - (TAIL + 2) / 2 * np.log1p(square / TAIL)
    surprise = np.minimum(square / 2, FAR) - 1
    scale = np.clip(bank.scale * (1 + surprise / min(dives + 1 + FEW, SCALE_MEMORY)), *SCALE)
    fit = bank.fit * (1 - 1 / MEMORY) + likelihood
    learnt = Bank(end, after.mean, _packed(after.cov), readonly(fit), readonly(scale))
    return learnt, _mixed(bank, each.mean, each.var * bank.scale)


def weights(bank: Bank) -> Array:
    """What each filter counts for (G,); they add up to 1."""
    relative = np.exp(bank.fit - bank.fit.max())
    return np.asarray(relative / relative.sum())


def _mixed(bank: Bank, mean: Array, var: Array) -> Mixture:
    """Mean and covariance of the mixture of forecasts with ``mean`` ((G, 2)) and ``var`` ((G,))."""
    weight = weights(bank)
    middle = weight @ mean
    apart = mean - middle
    cov = (weight @ var) * np.eye(2) + (weight[:, None] * apart).T @ apart
    return Mixture(readonly(middle), readonly(cov))


def _packed(cov: Array) -> Array:
    rows, columns = np.triu_indices(cov.shape[1])
    return readonly(cov[:, rows, columns])
