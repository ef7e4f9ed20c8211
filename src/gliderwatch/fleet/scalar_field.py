"""A scalar field in a box of the sea, estimated from the samples of many gliders (003). Pure.

The field is g(r, t) = phi(r)^T c(t) (003 eq. 1), r in [0, 1]^3: east, north and depth in the box. Its filter
is in information form, D = C^-1 and g = D c: samples add to both, in any order. Two estimators:

- ``fading``, the default: each coefficient forgets (Ornstein-Uhlenbeck), and functions of depth alone carry
  the mean profile, so that the 343 Gaussians of the paper are left with what differs from it.
- ``literal``: 003 as it stands, 343 coefficients in a random walk (eq. 2), a small variance of the samples.

Samples come in batches. A batch is known by its id, and the samples of one `BIN` of time are taken as of its
middle. `run` folds batches in the order of bins and ids, so that any order of arrival ends in the same field,
to the bit: what comes late makes it go on from the checkpoint before.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from gliderwatch.fleet.constants import (
    BIN,
    FORGOTTEN,
    GRID,
    INFORMATION_RATE,
    LONGEST_STAND,
    MEMORY,
    PAPER_STEP,
    PAPER_VARIANCE,
    PAPER_WALK,
    POINTS,
    PROFILE,
    PROFILE_MEMORY,
    PROFILE_SPREAD,
    SPREAD,
)
from gliderwatch.model import Array, readonly

Estimator = Literal["fading", "literal"]


@dataclass(frozen=True, slots=True)
class FieldParams:
    """How a field behaves, in the unit of its values.

    ``deviation``: usual size of what differs from the mean profile. ``mean`` and ``spread``: what a value is
    before any sample, and by how much the mean profile may be another.
    """

    estimator: Estimator = "fading"
    deviation: float = 1.0
    mean: float = 0.0
    spread: float = 10.0

    @property
    def size(self) -> int:
        """How many coefficients the field has."""
        return GRID**3 + (PROFILE if self.estimator == "fading" else 0)


@dataclass(frozen=True, slots=True)
class Information:
    """What is known of the coefficients: ``d`` = C^-1 ((L, L)) and ``g`` = D c ((L,))."""

    d: Array
    g: Array

    def coefficients(self) -> tuple[Array, Array]:
        """Mean ((L,)) and covariance ((L, L)) of the coefficients."""
        cov = inverse(self.d)
        return cov @ self.g, cov


@dataclass(frozen=True, slots=True)
class Batch:
    """Samples that one glider sent at once; ``id`` is its name for all relays, ``glider`` who took them.

    ``t`` (s, (n,)), ``place`` ((n, 3): east, north, depth in the box), ``value`` ((n,)) and ``stand`` (s,
    (n,)), the time that each sample stands for.
    """

    id: str
    glider: str
    t: Array
    place: Array
    value: Array
    stand: Array


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """What is known after all samples of a bin; ``bin`` counts those of `BIN` s since 1970."""

    bin: int
    known: Information

    @property
    def t(self) -> float:
        """Time (s) that it is of: the middle of the bin."""
        return (self.bin + 0.5) * BIN


# --------------------------------------------------------------------------- basis


def gaussians(place: Array) -> Array:
    """Values ((n, 343)) of the Gaussians at places ((n, 3)); index (ix 7 + iy) 7 + iz.

    phi_j = exp(-|r - r_j|^2 / (2 V)) (003, section 2).

    >>> float(gaussians(np.array([[0.5, 0.5, 0.5]]))[0, 171])
    1.0
    """
    x, y, z = (_axis(place[:, k], GRID, SPREAD) for k in range(3))
    return np.asarray(np.einsum("ni,nj,nk->nijk", x, y, z, optimize=True).reshape(len(place), -1))


def rows(place: Array, params: FieldParams) -> Array:
    """Values ((n, L)) at places ((n, 3)) of all functions that the field is made of."""
    values = gaussians(place)
    if params.estimator == "literal":
        return values
    return np.hstack([values, _axis(place[:, 2], PROFILE, PROFILE_SPREAD)])


@cache
def overlap(params: FieldParams) -> Array:
    """M ((L, L)), the integral of phi phi^T over the box: tr(C M) is the mean variance of the field (003 eq.
    8).

    Each function is a product of functions of one coordinate; so are the integrals.
    """
    s = np.linspace(0.0, 1.0, POINTS)
    weight = np.full(POINTS, 1 / (POINTS - 1))
    weight[[0, -1]] /= 2
    across = np.hstack([_axis(s, GRID, SPREAD), np.ones((POINTS, 1))])
    down = np.hstack([_axis(s, GRID, SPREAD), _axis(s, PROFILE, PROFILE_SPREAD)])
    flat, deep = across.T * weight @ across, down.T * weight @ down
    ix, iy, iz = (axis.ravel() for axis in np.indices((GRID, GRID, GRID)))
    if params.estimator == "fading":
        whole = np.full(PROFILE, GRID)
        ix, iy, iz = (
            np.concatenate(pair) for pair in ((ix, whole), (iy, whole), (iz, np.arange(GRID, GRID + PROFILE)))
        )
    return readonly(flat[np.ix_(ix, ix)] * flat[np.ix_(iy, iy)] * deep[np.ix_(iz, iz)])


def _axis(at: Array, n: int, spread: float) -> Array:
    """Gaussians ((m, n)) on one axis, centres 0 to 1, at coordinates ((m,))."""
    return np.asarray(np.exp(-np.square(at[:, None] - np.linspace(0.0, 1.0, n)) / (2 * spread)))


# --------------------------------------------------------------------------- filter


def prior(params: FieldParams) -> Information:
    """What is known before any sample."""
    return Information(readonly(np.diag(1 / _prior_variance(params))), readonly(np.zeros(params.size)))


def predict(known: Information, kept: Array, noise: Array) -> Information:
    """What is known of c+ = kept c + n, n of variance ``noise`` a coefficient ((L,), above 0).

    With M = D / (kept kept^T) and S = diag(sqrt noise): B = (I + S M S)^-1, D+ = S^-1 (I - B) S^-1,
    g+ = S^-1 B S g / kept. A random walk (003 eq. 2) is kept = 1.
    """
    s = np.sqrt(noise)
    scale = s / kept
    inner = np.outer(scale, scale)
    inner *= known.d
    inner.flat[:: len(s) + 1] += 1.0
    inner = inverse(inner)
    g = inner @ (known.g * scale) / s
    np.negative(inner, out=inner)
    inner.flat[:: len(s) + 1] += 1.0
    inner /= np.outer(s, s)  # symmetric to the bit, as what is kept is its lower triangle
    return Information(inner, g)


def elapse(known: Information, dt: float, params: FieldParams) -> Information:
    """What is known of the field ``dt`` s later."""
    if dt <= 0:
        return known
    variance = _prior_variance(params)
    if params.estimator == "literal":
        return predict(known, np.ones(params.size), PAPER_WALK * dt * variance)
    memory = np.full(params.size, MEMORY)
    memory[GRID**3 :] = PROFILE_MEMORY * (params.spread / params.deviation) ** 2
    part = np.minimum(dt / memory, FORGOTTEN)
    return predict(known, np.exp(-part), variance * -np.expm1(-2 * part))


def update(known: Information, phi: Array, value: Array, variance: Array) -> Information:
    """What is known with samples ``value`` ((n,)) of rows ``phi`` ((n, L)) and errors of ``variance`` ((n,)).

    D + Phi^T R^-1 Phi, g + Phi^T R^-1 y.
    """
    root = 1 / np.sqrt(variance)
    scaled = phi * root[:, None]
    return Information(known.d + scaled.T @ scaled, known.g + scaled.T @ (value * root))


def run(
    start: Checkpoint | None, batches: Iterable[Batch], params: FieldParams, most: int | None = None
) -> tuple[Checkpoint, ...]:
    """What is known after each bin that has samples, beginning behind ``start`` (None: with the prior), of
    ``most`` bins (None: of all).

    ``batches`` are all that have samples in those bins, in any order; samples of earlier bins are passed
    over.
    """
    parts: dict[int, list[Batch]] = {}
    for batch in sorted(batches, key=lambda each: each.id):
        for k in np.unique(np.floor(batch.t / BIN)).astype(int).tolist():
            if start is None or k > start.bin:
                parts.setdefault(k, []).append(batch)
    last, out = start, list[Checkpoint]()
    for k in sorted(parts)[:most]:
        known = prior(params) if last is None else elapse(last.known, (k - last.bin) * BIN, params)
        last = Checkpoint(k, _with_samples(known, parts[k], k, params))
        out.append(last)
    return tuple(out)


def at(checkpoint: Checkpoint | None, t: float, params: FieldParams) -> Information:
    """What is known of the field at a time (s) after a checkpoint; None: before any sample."""
    return prior(params) if checkpoint is None else elapse(checkpoint.known, t - checkpoint.t, params)


def estimate(known: Information, place: Array, params: FieldParams) -> tuple[Array, Array]:
    """The field and its standard error, both in its unit ((n,)), at places in the box ((n, 3))."""
    mean, cov = known.coefficients()
    phi = rows(place, params)
    return params.mean + phi @ mean, np.sqrt(np.einsum("ni,ni->n", phi @ cov, phi))


def sample_variance(stand: Array, params: FieldParams) -> Array:
    """Variance of samples that stand for times of ``stand`` s ((n,)), in squares of the field's unit."""
    longest = np.inf if params.estimator == "literal" else LONGEST_STAND
    return seconds_of_information(params) / np.clip(stand, 1.0, longest)


def seconds_of_information(params: FieldParams) -> float:
    """Time (s) of sampling, times the square of the field's unit, that has one unit of information."""
    literal = params.estimator == "literal"
    return (PAPER_VARIANCE * PAPER_STEP if literal else INFORMATION_RATE) * params.deviation**2


def inverse(matrix: Array) -> Array:
    """The inverse of a symmetric positive definite matrix, symmetric to the bit.

    Raises np.linalg.LinAlgError where it is not positive definite.
    """
    from scipy.linalg.lapack import dpotrf, dpotri  # noqa: PLC0415 (slow; every command loads this module)

    factor, bad = dpotrf(matrix, lower=1)
    half, bad_too = dpotri(factor, lower=1)  # three times as fast as to solve for the unit matrix
    if bad or bad_too:
        raise np.linalg.LinAlgError("the information of a field is not positive definite")
    whole = np.asarray(half + half.T)  # above the diagonal there is nothing
    whole.flat[:: len(whole) + 1] = half.diagonal()
    return whole


def _with_samples(known: Information, batches: list[Batch], k: int, params: FieldParams) -> Information:
    """What is known with the samples of one bin."""
    inside = [np.floor(batch.t / BIN) == k for batch in batches]

    def of(name: str) -> Array:
        parts = [getattr(batch, name)[here] for batch, here in zip(batches, inside, strict=True)]
        return np.concatenate(parts)

    variance = sample_variance(of("stand"), params)
    return update(known, rows(of("place"), params), of("value") - params.mean, variance)


@cache
def _prior_variance(params: FieldParams) -> Array:
    """Variance of each coefficient ((L,)) before any sample."""
    profile = max(params.size - GRID**3, 0)
    return readonly(np.r_[np.full(GRID**3, params.deviation**2), np.full(profile, params.spread**2)])
