"""Algorithm 1 as printed, by Euler's rule: what the exact solution is compared with."""

from __future__ import annotations

import math

import numpy as np

from gliderwatch.estimation.adaptive import AdaptiveParams, AdaptiveState
from gliderwatch.estimation.basis import Basis, phi
from gliderwatch.model import Array, readonly


def euler_step(
    state: AdaptiveState,
    t: float,
    dt: float,
    x: Array,
    x_next: Array,
    *,
    heading: Array,
    basis: Basis,
    params: AdaptiveParams,
) -> AdaptiveState:
    """Lines 2 to 7 of Algorithm 1 to the letter: one step of Euler's rule, for dense data only.

    From time ``t`` (s) and place ``x`` (m, (2,)) to t + ``dt`` and ``x_next``, under ``heading`` (unit
    vector, (2,)), All right-hand sides use the old
    state. Stable for K dt well below 1. Does not follow the excitation. `advance` converges to the
    same as dt goes to 0.
    """
    values = phi(x, t, basis)
    u_0 = math.inf if params.max_speed is None else params.max_speed
    eps = state.e - state.e_delta
    z_rate = state.xi @ values + state.speed * heading + params.k * state.e
    e_delta_rate = (min(state.speed, u_0) - state.speed) * heading - params.k * state.e_delta
    return AdaptiveState(
        e=readonly(state.e + (x_next - x) - z_rate * dt),
        e_delta=readonly(state.e_delta + e_delta_rate * dt),
        xi=readonly(state.xi + dt * np.outer(params.gamma * eps, values)),
        speed=state.speed + params.rate_of_speed * dt * float(eps @ heading),
        gram=state.gram,
        flown=state.flown,
    )
