"""The damped oscillator that the learner is along and across the heading. Pure."""

from __future__ import annotations

import numpy as np

from gliderwatch.model import Array


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
