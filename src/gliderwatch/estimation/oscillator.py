"""The damped oscillator that the learner is along and across the heading, alone and pulled. Pure."""

from __future__ import annotations

import numpy as np

from gliderwatch.model import Array

TERMS = 11
"""Of the series of an exponential: of a matrix of norm 1/4 the next is below 1e-15."""


def response(k: float, b: Array, h: Array) -> Array:
    """Solution of eps' = r - K eps, r' = -b eps over each of m steps: (m, 3), columns a, c (s), q (s²).

    After the step eps_1 = a eps_0 + c r_0; the integral of eps over it is c eps_0 + q r_0.
    ``k`` is K (1/s, positive), ``b`` the stiffness (1/s², (m,), not negative), ``h`` the step (s, (m,)). With
    mu = K/2 and d = sqrt(mu² - b): c = exp(-mu h) sinh(d h)/d, a = exp(-mu h) cosh(d h) - mu c,
    q = (1 - exp(-mu h) cosh(d h) - mu c)/b. Holds for b = 0, over-, under- and critical
    damping, and long steps.

    >>> response(0.5, np.array([0.0]), np.array([1e4]))[:, 1]  # without stiffness eps ends at r/K
    array([2.])
    """
    mu = 0.5 * k
    d = np.sqrt((mu * mu - b).astype(np.complex128))
    fast = mu + d
    # the slow root as b / fast: as mu - d it has no digits left where b is small
    e_slow, e_fast = np.exp(-b / fast * h), np.exp(-fast * h)
    near = np.abs(d * h) < 1e-2
    dh2 = np.where(near, d * h, 0.0) ** 2
    c_near = h * np.exp(-mu * h) * (1.0 + dh2 / 6.0 + dh2**2 / 120.0)
    c = np.where(near, c_near, (e_slow - e_fast) / np.where(near, 1.0, 2.0 * d)).real
    even = 0.5 * (e_slow + e_fast).real
    # r hardly changes where b is weak: then q is its limit for b -> 0, right to 1e-7
    weak = b * h * h < 1e-6
    q_weak = (h + np.expm1(-k * h) / k) / k
    q = np.where(weak, q_weak, (1.0 - even - mu * c) / np.where(weak, 1.0, b))
    return np.column_stack([even - mu * c, c, q])


def alone(k: float, b: Array, h: Array) -> Array:
    """`response` in the shape of `pulled`, for a flow that nothing draws: the gap moves nothing."""
    a, c, q = response(k, b, h).T
    zero = np.zeros(len(h))
    return np.stack([[a, c, zero], [c, q, zero], [zero, zero, zero]]).transpose(2, 0, 1)


def pulled(k: float, b: Array, c: Array, pull: Array, h: Array) -> Array:
    """Solution of the oscillator while the flow is drawn to a reference: (m, 3, 3) over each of m steps.

    With g the gap between reference and flow, and r_0 what of the velocity was not explained at the start,

        eps' = r_0 - (g_0 - g) - c (integral of eps) - K eps,   g' = -b eps - pull g

    Rows: eps after the step, the integrals of eps and of g over it. Columns: their parts by eps_0, r_0
    and g_0. ``k`` is K (1/s, positive); ``b`` stiffness of the flow and ``c`` that of the speed (1/s², (m,)),
    ``pull`` (1/s, (m,)), none of them negative; ``h`` the step (s, (m,)). Without a pull `response`
    is the same with b + c.

    >>> no, slow = np.array([0.0]), np.array([1e-3])
    >>> round(pulled(0.5, no, no, slow, np.array([1e5]))[0, 2, 2])  # the gap closes in 1/pull
    1000
    """
    # in units of 1/K of time and m/s all numbers are of like size; the fifth is the constant r_0 - g_0
    a = np.zeros((len(h), 5, 5))
    a[:, 0] = [-1.0, 1.0, 0.0, 0.0, 1.0]
    a[:, 0, 2] = -c / k**2
    a[:, 1, 0], a[:, 1, 1] = -b / k**2, -pull / k
    a[:, 2, 0] = a[:, 3, 1] = 1.0
    e = _exponential(a * (k * h)[:, None, None])
    out = np.stack([e[:, [0, 2, 3], 0], e[:, [0, 2, 3], 4], e[:, [0, 2, 3], 1] - e[:, [0, 2, 3], 4]], axis=-1)
    out *= np.array([1.0 / k, 1.0 / k**2, 1.0 / k])[:, None]
    out[:, :, 0] *= k
    return out


def _exponential(a: Array) -> Array:
    """Exponentials of matrices ((m, n, n)): Taylor's series of a small part of each, squared up again."""
    size = float(np.abs(a).sum(axis=2).max(initial=0.0))
    halvings = max(0, int(np.ceil(np.log2(max(size, 1e-300)))) + 2)  # to a norm of at most 1/4
    part = a / 2.0**halvings
    one = np.eye(a.shape[-1])
    e = one + part / TERMS
    for n in range(TERMS - 1, 0, -1):
        e = one + part @ e / n
    for _ in range(halvings):
        e = e @ e
    return e
