"""Algorithm 1 (001 eqs. 7, 9, 12, 13, 25-28): flow and through-water speed from a track. Pure.

With e = x - z the learner is, as the paper has it,

    z'  = xi phi(z,t) + V_L psi + beta,   beta = xi phi(x,t) - xi phi(z,t) + K e
    xi' = gamma eps outer phi(x,t),       V_L' = speed_gain eps . psi,       eps = e - e_delta

so that z' = xi phi(x,t) + V_L psi + K e, and the position error obeys

    e'   = dx/dt - xi phi(x,t) - V_L psi - K e
    eps' = dx/dt - xi phi(x,t) - sat(V_L) psi - K eps

Euler's rule, which the paper uses, needs steps much shorter than 1/K; the files of a glider may
hold a sample in half an hour. `advance` instead holds phi and psi over a substep at their values
in its middle. What is left of the flow, F = xi phi, then changes by F' = gamma |phi|² eps, and
along and across psi the equations part into two damped oscillators

    eps' = r - K eps,   r' = -b eps

(r: the velocity not yet explained; b = gamma |phi|², plus speed_gain |psi|² along psi unless the
speed is saturated), whose solution is known. The Lyapunov function of 001 eq. (16) can not grow in
such a substep, so that no spacing is unstable; the only error is that of phi within a substep.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from gliderwatch.estimation.basis import Basis, Kernel, phi
from gliderwatch.estimation.excitation import excitation, excite
from gliderwatch.estimation.oscillator import response
from gliderwatch.estimation.substeps import Complex, Substeps, cut
from gliderwatch.model import Array, readonly


@dataclass(frozen=True, slots=True)
class AdaptiveParams:
    """Gains and basis functions of the learner (000 Table I).

    ``sigma`` width (m), ``kernel`` see `Basis`, ``omega`` angular frequency (rad/s), ``nu`` phase
    (rad), ``k`` K (1/s; Table I has a multiple of the unit matrix), ``gamma`` learning rate of the
    flow (1/s²), ``speed_gain`` that of the speed (1/s²; gamma when None, as in 001), ``max_speed``
    u_0 (m/s) beyond which the learnt speed saturates (001 eq. 3; never when None).
    Raises ValueError when sigma or k is not positive or a learning rate negative.
    """

    sigma: float
    kernel: Kernel
    omega: float
    nu: float
    k: float
    gamma: float
    speed_gain: float | None = None
    max_speed: float | None = None

    def __post_init__(self) -> None:
        if not (self.sigma > 0.0 and self.k > 0.0):
            raise ValueError(f"sigma and k must be positive, not {self.sigma} and {self.k}")
        if not (self.gamma >= 0.0 and self.rate_of_speed >= 0.0):
            raise ValueError(f"gamma and speed_gain must not be negative: {self.gamma}, {self.speed_gain}")

    @property
    def rate_of_speed(self) -> float:
        """The learning rate of the speed that holds (1/s²)."""
        return self.gamma if self.speed_gain is None else self.speed_gain

    def basis(self, centres: object) -> Basis:
        """The basis with these parameters around ``centres`` (m, shape (N, 2))."""
        return Basis.uniform(centres, self.sigma, self.omega, self.nu, self.kernel)


@dataclass(frozen=True, slots=True)
class AdaptiveState:
    """What the learner knows.

    ``e`` = x - z (m, (2,)), the controlled Lagrangian localisation error: kept in place of z, so that
    it stays good in another plane and after a drift at the surface. ``e_delta`` (m, (2,)), what of
    it saturation explains. ``xi`` (m/s, (2, N)), weights of the flow. ``speed`` V_L (m/s). ``gram``
    ((N+2, N+2)): forgetting mean over the flight of v outer v with v = [psi, phi], which holds
    each entry of W (001 eq. 15) once; not yet divided by the weight of the time so far.
    ``flown`` (s) is that time.
    """

    e: Array
    e_delta: Array
    xi: Array
    speed: float
    gram: Array
    flown: float


@dataclass(frozen=True, slots=True)
class AdaptiveInfo:
    """What one call of `advance` found.

    ``clle_max``, greatest |e| (m) at the ends of the substeps; ``flow`` F_L = xi phi(z,t) at the end
    (m/s, (2,)); ``flow_speed_max``, greatest |F_L| on the way (m/s); ``speed`` V_L at the end (m/s);
    ``excitation``, smallest eigenvalue of W; ``n_steps``, number of substeps.
    """

    clle_max: float
    flow: Array
    flow_speed_max: float
    speed: float
    excitation: float
    n_steps: int


def init(speed: float, n_basis: int) -> AdaptiveState:
    """The state before any track: no error, no flow, V_L = ``speed`` (m/s)."""
    zero = readonly(np.zeros(2))
    size = n_basis + 2
    return AdaptiveState(
        zero, zero, readonly(np.zeros((2, n_basis))), speed, readonly(np.zeros((size, size))), 0.0
    )


def with_basis(state: AdaptiveState, n_more: int) -> AdaptiveState:
    """The state with ``n_more`` functions appended to the basis, of weight 0 and not yet excited."""
    return AdaptiveState(
        e=state.e,
        e_delta=state.e_delta,
        xi=readonly(np.pad(state.xi, ((0, 0), (0, n_more)))),
        speed=state.speed,
        gram=readonly(np.pad(state.gram, (0, n_more))),
        flown=state.flown,
    )


def advance(
    state: AdaptiveState,
    t: Array,
    x: Array,
    heading: Array,
    basis: Basis,
    params: AdaptiveParams,
) -> tuple[AdaptiveState, AdaptiveInfo]:
    """Learn from one more stretch of the track.

    ``t`` (s, shape (n,), increasing), ``x`` (m, (n, 2)), ``heading`` (unit vectors east, north, (n-1, 2))
    holding from t[i] to t[i+1], or their mean where it turned within; a row of zeros means at the
    surface: the speed is left alone there. The track is straight between its points. A track in
    pieces gives what the whole gives.
    Raises ValueError when the shapes do not fit, t does not increase or a number is not finite.
    """
    if state.xi.shape != (2, len(basis)):
        raise ValueError(
            f"{state.xi.shape[1]} weights for {len(basis)} basis functions: use with_basis first"
        )
    steps = cut(t, x, heading)
    values = phi(*steps.middle, basis)
    e, e_delta, speed, xi = _integrate(state, steps, values, params)
    z = steps.x - e
    flow = np.sum(xi * phi(np.column_stack([z.real, z.imag]), steps.t, basis), axis=1)
    flown, gram = excite(state.flown, state.gram, steps, values)
    after = AdaptiveState(
        _pair(e[-1]), _pair(e_delta), readonly([xi[-1].real, xi[-1].imag]), speed, gram, flown
    )
    info = AdaptiveInfo(
        clle_max=float(np.abs(e).max()),
        flow=_pair(flow[-1]),
        flow_speed_max=float(np.abs(flow).max()),
        speed=speed,
        excitation=excitation(flown, gram),
        n_steps=len(steps.h),
    )
    return after, info


def _integrate(
    state: AdaptiveState,
    steps: Substeps,
    values: Array,
    params: AdaptiveParams,
) -> tuple[Complex, complex, float, Complex]:
    """Errors e (m+1,) and weights xi (m+1, N) at the ends of the substeps; e_delta and V_L at the last."""
    u_0 = math.inf if params.max_speed is None else params.max_speed
    speed, e, e_delta = state.speed, [complex(*state.e)], complex(*state.e_delta)
    eps = e[0] - e_delta
    xi = np.empty((len(steps.h) + 1, len(state.gram) - 2), dtype=np.complex128)
    xi[0] = state.xi[0] + 1j * state.xi[1]
    for i, (phi_i, rate, m, unit, fade, build, free, stiff) in enumerate(_rows(steps, values, params)):
        flow = complex(xi[i] @ phi_i)
        used = min(speed, u_0)
        r = (rate - flow) * unit.conjugate() - m * used
        eps *= unit.conjugate()
        # beyond u_0 the speed no longer acts on eps, which leaves the stiffness of the flow alone
        along = _moved(free if speed <= u_0 else stiff, eps.real, r.real)
        across = _moved(stiff, eps.imag, r.imag)
        end, integral = (complex(p, q) for p, q in zip(along, across, strict=True))
        eps = unit * end
        xi[i + 1] = xi[i] + (params.gamma * unit * integral) * phi_i
        excess = used - speed
        speed += params.rate_of_speed * m * integral.real
        # the excess varies within the substep: the mean of its ends stands for it
        excess = 0.5 * (excess + min(speed, u_0) - speed)
        e_delta = fade * e_delta + build * excess * m * unit
        e.append(eps + e_delta)
    return np.array(e), e_delta, speed, xi


def _moved(answer: Any, eps: float, r: float) -> tuple[float, float]:
    """The error after a substep, and its integral over it, in one direction."""
    a, c, q = answer
    return a * eps + c * r, c * eps + q * r


def _rows(steps: Substeps, values: Array, params: AdaptiveParams) -> Iterator[tuple[Any, ...]]:
    """What `_integrate` needs of each substep, as Python numbers: much faster one by one than NumPy's."""
    m = np.abs(steps.psi)
    unit = np.where(m > 0.0, steps.psi, 1.0) / np.where(m > 0.0, m, 1.0)
    square = np.sum(values * values, axis=1)
    b, c = params.gamma * square, params.rate_of_speed * m * m
    fade = np.exp(-params.k * steps.h)
    free, stiff = response(params.k, b + c, steps.h), response(params.k, b, steps.h)
    columns = (steps.rate, m, unit, fade, (1.0 - fade) / params.k, free, stiff)
    return zip(values.astype(np.complex128), *(c.tolist() for c in columns), strict=True)


def _pair(z: complex) -> Array:
    return readonly([z.real, z.imag])
