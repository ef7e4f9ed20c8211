"""The current at a glider as one linear stochastic model, seen through means over dives. Pure.

In each component the current is u = r + Re(sum c_k). The residual r is an Ornstein-Uhlenbeck process,
dr = -r/tau dt + sigma sqrt(2/tau) dW; each tide a noisy oscillator, dc = i omega c dt + sqrt(q) dW with W
complex and of unit strength in both parts, so that its amplitude wanders. I, the integral of u since the
dive began, is part of the state while the glider dives: the depth-averaged current of a dive that lasts T is
I/T, exact for any T and any gap between dives, and a forecast of I is the displacement by the current.

Numbers of a component: r, then Re c and Im c of each tide, then I. Both components have the same
covariance. Everything is done for G sets of parameters at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.model import Array, readonly


@dataclass(frozen=True, slots=True)
class Parameters:
    """G sets of parameters for the same C tides.

    ``sigma`` (m/s, (G,)) usual size of the residual in a component and ``tau`` (s, (G,)) its memory; ``q``
    (m2/s3, (G, C)) variance that a second adds to each part of a tide; ``prior`` (m2/s2, (G, C)) variance
    of these parts before any dive; ``omega`` (rad/s, (C,)).
    """

    sigma: Array
    tau: Array
    q: Array
    prior: Array
    omega: Array

    @property
    def size(self) -> int:
        """Numbers a component between dives, n = 1 + 2 C."""
        return 1 + 2 * len(self.omega)


@dataclass(frozen=True, slots=True)
class Belief:
    """What is known of the current at a time ``t`` (s): ``mean`` (m/s, (G, n, 2): east, north) and ``cov``
    (m2/s2, (G, n, n)) of a component."""

    t: float
    mean: Array
    cov: Array


@dataclass(frozen=True, slots=True)
class Forecast:
    """Mean flow over an interval: ``mean`` (m/s, (G, 2)), and ``var`` of a component (m2/s2, (G,))."""

    mean: Array
    var: Array


def init(t: float, params: Parameters) -> Belief:
    """What is known before any dive."""
    sets, n = len(params.sigma), params.size
    cov = np.zeros((sets, n, n))
    cov[:, 0, 0] = params.sigma**2
    k = np.arange(1, n)
    cov[:, k, k] = np.repeat(params.prior, 2, axis=1)
    return Belief(t, readonly(np.zeros((sets, n, 2))), readonly(cov))


def transition(dt: float, params: Parameters) -> tuple[Array, Array]:
    """What ``dt`` seconds make of the state, and covariance of what chance adds: (G, n+1, n+1) each.

    The stochastic integrals are exact, so that two steps do what one of their length does.
    """
    n = params.size
    f, q = (np.zeros((len(params.sigma), n + 1, n + 1)) for _ in range(2))
    kept, variance, tau = np.exp(-dt / params.tau), params.sigma**2, params.tau
    f[:, 0, 0], f[:, n, 0], f[:, n, n] = kept, tau * (1 - kept), 1.0
    q[:, 0, 0] = variance * -np.expm1(-2 * dt / tau)
    q[:, 0, n] = q[:, n, 0] = variance * tau * np.expm1(-dt / tau) ** 2
    q[:, n, n] = variance * _wandered(dt, tau)
    for k, omega in enumerate(params.omega.tolist()):
        a, b = 1 + 2 * k, 2 + 2 * k
        angle, each = omega * dt, params.q[:, k]
        cos, sin = np.cos(angle), np.sin(angle)
        f[:, a, a] = f[:, b, b] = cos
        f[:, b, a], f[:, a, b] = sin, -sin
        f[:, n, a], f[:, n, b] = sin / omega, (cos - 1) / omega
        q[:, a, a] = q[:, b, b] = each * dt
        q[:, a, n] = q[:, n, a] = each * (1 - cos) / omega**2
        q[:, b, n] = q[:, n, b] = each * (angle - sin) / omega**2
        q[:, n, n] += each * 2 * (angle - sin) / omega**3
    return f, q


def _wandered(dt: float, tau: Array) -> Array:
    """Variance (s2) of the integral of what an Ornstein-Uhlenbeck process of variance 1 gains in ``dt`` s."""
    x = dt / tau
    kept = np.exp(-x)
    exact = 2 * x - 3 + 4 * kept - kept**2
    # the terms cancel where x is small
    return np.asarray(tau**2 * np.where(x < 1e-3, 2 / 3 * x**3 * (1 - 0.75 * x), exact))


def _moved(belief: Belief, dt: float, params: Parameters) -> tuple[Array, Array]:
    """Mean (G, n+1, 2) and covariance (G, n+1, n+1) after ``dt`` s, I counted from now."""
    f, q = transition(dt, params)
    from_now = f[:, :, :-1]
    return from_now @ belief.mean, from_now @ belief.cov @ from_now.transpose(0, 2, 1) + q


def at(belief: Belief, t: float, params: Parameters) -> Belief:
    """What is known of the current at a later time ``t`` (s), without a dive until then."""
    if t <= belief.t:
        return belief
    mean, cov = _moved(belief, t - belief.t, params)
    return Belief(t, readonly(mean[:, :-1]), readonly(cov[:, :-1, :-1]))


def forecast(belief: Belief, start: float, end: float, params: Parameters) -> Forecast:
    """The mean flow between two times (s) that are not before the belief's."""
    mean, cov = _moved(at(belief, start, params), end - start, params)
    lasts = end - start
    return Forecast(readonly(mean[:, -1] / lasts), readonly(cov[:, -1, -1] / lasts**2))


def learn(
    belief: Belief, start: float, end: float, current: Array, sigma: float, params: Parameters
) -> tuple[Belief, Forecast]:
    """What is known at the end of a dive by its ``current`` (m/s, (2,)), and what was expected of that.

    ``sigma`` (m/s) is the current's standard error in a component, ``start`` and ``end`` (s) the dive's.
    """
    lasts = end - start
    mean, cov = _moved(at(belief, start, params), lasts, params)
    expected = Forecast(readonly(mean[:, -1] / lasts), readonly(cov[:, -1, -1] / lasts**2))
    row = cov[:, :-1, -1] / lasts
    gain = row / (expected.var + sigma**2)[:, None]
    after = mean[:, :-1] + gain[:, :, None] * (current - expected.mean)[:, None, :]
    left = cov[:, :-1, :-1] - gain[:, :, None] * row[:, None, :]
    return Belief(end, readonly(after), readonly((left + left.transpose(0, 2, 1)) / 2)), expected
