"""Extremum seeking with an unscented Kalman filter, on a layer of the sea: paper 004, exactly. Pure.

A perturbation moves the depth up and down; the filter estimates from it how the cost, the gradient of a
property, changes with depth, and the depth drifts to where the cost is greatest. The input of the system is
the depth alone (004, "Application"), so the filter has two states and is written out in numbers.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from enum import StrEnum


@dataclass(frozen=True, slots=True)
class SeekingParams:
    """Parameters of the loop, as 004 Tables 1 and 2 have them; the defaults are Table 1.

    ``period`` T_p (s) and ``amplitude`` A_p (m per control step) of the perturbation, ``gain`` k (per control
    step), ``r`` and ``q`` the covariances R and Q, ``z_min`` (m) of eq. (6), ``threshold`` J_thr, ``window``
    t_win (s) of the moving averages, ``dt`` (s) the control step, ``speed`` (m/s) of a complete dive. The
    loop is given up where the cost stayed below ``lost`` for ``patience`` periods (T_cd = 3 T_p).

    The window of 2 s in Tables 1 and 2 we read as that of both averages together, 1 s each: so the runs are
    those of Figs. 7, 8 and 10. With 2 s each, the blended profile at a turn gives a cost above 1, which
    drives the loop off its layer, and by Table 2 it does not sink to the lower layer.
    """

    period: float = 91.0
    amplitude: float = 0.0135
    gain: float = 1.5e-4
    r: float = 3e-5
    q: float = 3e-5
    z_min: float = 0.05
    threshold: float = 0.25
    window: float = 1.0
    dt: float = 0.05
    speed: float = 0.4
    lost: float = 0.5
    patience: float = 3.0


@dataclass(frozen=True, slots=True)
class Estimate:
    """State x = (dJ/du, J) of the filter: ``gradient`` (1/m), ``cost``, and their covariance ``p_gg``,
    ``p_gj``, ``p_jj``."""

    gradient: float
    cost: float
    p_gg: float
    p_gj: float
    p_jj: float


def begin(q: float, r: float) -> Estimate:
    """The filter before any measurement: nothing is known, P0 = diag(Q, R)."""
    return Estimate(0.0, 0.0, q, 0.0, r)


def step(before: Estimate, d: float, gain: float, y: float, q: float, r: float) -> Estimate:
    """One control step of the filter (004 eqs. 5a to 5c): prediction by perturbation `d` (m), update by `y`.

    Unscented transform with alpha = 1, beta = kappa = 0 (004 Table 1): the centre has no weight, four points
    sqrt(2) standard deviations away have 1/4 each. Of this model the sums over them are known: below.
    Process noise `q` on the gradient alone. Raises ValueError where the covariance is none any more.
    """
    g, p_gg = before.gradient, before.p_gg
    if p_gg <= 0 or before.p_jj * p_gg < before.p_gj**2:
        raise ValueError("the covariance of the filter is not positive: R and Q must be above zero")
    slope = d + 2 * gain * g
    mean_j = before.cost + d * g + gain * (g**2 + p_gg)
    p_jj = before.p_jj + 2 * slope * before.p_gj + slope**2 * p_gg + (gain * p_gg) ** 2
    p_gj = before.p_gj + slope * p_gg
    s = p_jj + r
    k_g, k_j = p_gj / s, p_jj / s
    error = y - mean_j
    return Estimate(
        g + k_g * error, mean_j + k_j * error, p_gg + q - k_g**2 * s, p_gj - k_g * k_j * s, p_jj - k_j**2 * s
    )


def perturbation(t: float, amplitude: float, period: float) -> float:
    """d = A_p cos(2 pi t / T_p) (m per control step) at `t` s since the loop began."""
    return amplitude * math.cos(2 * math.pi * t / period)


def reach(params: SeekingParams) -> float:
    """Height (m) of the band that the perturbation alone sweeps: 2 A_p T_p / (2 pi dt)."""
    return params.amplitude * params.period / (math.pi * params.dt)


@dataclass(slots=True)
class Cost:
    """The cost J = |dT| / |dz| of eq. (6), not yet normalised, of a series that is measured step by step.

    Both are differences of two averages over `n` samples, `n` samples apart; the cost is 0 where |dz| is not
    above `z_min` (m), as at a turn, and before 2 n samples were seen.
    """

    n: int
    z_min: float
    _samples: deque[tuple[float, float]] = field(init=False)
    _sums: list[float] = field(init=False, default_factory=lambda: [0.0, 0.0, 0.0, 0.0])

    def __post_init__(self) -> None:
        self._samples = deque(maxlen=2 * self.n)

    def add(self, z: float, value: float) -> float:
        """The cost (units of `value` per m) with one more sample, at depth `z` (m)."""
        new_z, new_v, old_z, old_v = self._sums
        if len(self._samples) >= self.n:
            mid_z, mid_v = self._samples[-self.n]
            new_z, new_v, old_z, old_v = new_z - mid_z, new_v - mid_v, old_z + mid_z, old_v + mid_v
        if len(self._samples) == 2 * self.n:
            last_z, last_v = self._samples[0]
            old_z, old_v = old_z - last_z, old_v - last_v
        self._samples.append((z, value))
        self._sums = [new_z + z, new_v + value, old_z, old_v]
        if len(self._samples) < 2 * self.n:
            return 0.0
        dz = (self._sums[0] - old_z) / self.n
        return abs((self._sums[1] - old_v) / self.n / dz) if abs(dz) > self.z_min else 0.0


class Mode(StrEnum):
    """States of 004 Fig. 3; a complete dive goes up to the surface, down, and up until a layer is met."""

    SURFACING = "surfacing"
    DOWN = "down"
    UP = "up"
    TRACK = "track"


@dataclass(frozen=True, slots=True)
class Loop:
    """The state machine of 004 Fig. 3: ``mode``, the desired depth ``u`` (m), the ``largest`` cost of the
    complete dive, by which the cost is normalised, the ``estimate`` of the filter and when it began (s),
    ``high_t`` when the cost was last at the level below which the layer counts as lost (s)."""

    mode: Mode = Mode.DOWN
    u: float = 0.0
    largest: float = 0.0
    estimate: Estimate | None = None
    began: float = 0.0
    high_t: float = 0.0
    resets: int = 0


def drive(loop: Loop, t: float, raw: float, depth: float, params: SeekingParams) -> Loop:
    """The loop one control step on, at `t` (s), the cost `raw` just measured, the bottom at `depth` m.

    The desired depth stays above the bottom. Raises ValueError as `step` does.
    """
    travel = params.speed * params.dt
    match loop.mode:
        case Mode.SURFACING:
            u = max(loop.u - travel, 0.0)
            return replace(loop, u=u, mode=Mode.DOWN if u == 0.0 else loop.mode, largest=0.0)
        case Mode.DOWN:
            u = min(loop.u + travel, depth)
            mode = Mode.UP if u >= depth else loop.mode
            return replace(loop, u=u, mode=mode, largest=max(loop.largest, raw))
        case Mode.UP:
            if loop.largest > 0 and raw / loop.largest > params.threshold:
                start = begin(params.q, params.r)
                return replace(loop, mode=Mode.TRACK, estimate=start, began=t, high_t=t)
            u = max(loop.u - travel, 0.0)
            return replace(loop, u=u, mode=Mode.DOWN if u == 0.0 else loop.mode)
        case Mode.TRACK:
            return _track(loop, t, raw / loop.largest, depth, params)


def _track(loop: Loop, t: float, cost: float, depth: float, params: SeekingParams) -> Loop:
    """One step of the loop with the filter; a reset where the layer is lost."""
    high_t = t if cost >= params.lost else loop.high_t
    if t - high_t > params.patience * params.period:
        return replace(loop, mode=Mode.SURFACING, estimate=None, resets=loop.resets + 1)
    d = perturbation(t - loop.began, params.amplitude, params.period)
    assert loop.estimate is not None
    estimate = step(loop.estimate, d, params.gain, cost, params.q, params.r)
    u = min(max(loop.u + d + params.gain * estimate.gradient, 0.0), depth)
    return replace(loop, u=u, estimate=estimate, high_t=high_t)
