"""A current with known truth: residual, slow weather, tidal ellipses. Pure: seed in, numbers out.

The current is uniform with depth, so that it is itself the depth average that a glider estimates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.model import Array, readonly

M2_PERIOD = 12.4206012 * 3600
K1_PERIOD = 23.9344696 * 3600
_MODES = 6
_STEP = 1800.0


@dataclass(frozen=True, slots=True)
class Ellipse:
    """One tidal constituent.

    ``period`` (s), ``major`` and ``minor`` axis (m/s; a positive minor axis turns counter-clockwise),
    ``inclination`` of the major axis (rad, counter-clockwise from east), ``phase`` (rad at t = 0).
    """

    period: float
    major: float
    minor: float
    inclination: float
    phase: float

    def current(self, t: Array) -> tuple[Array, Array]:
        """Eastward and northward current (m/s) at times ``t`` (s)."""
        angle = 2 * np.pi * t / self.period - self.phase
        along, across = self.major * np.cos(angle), self.minor * np.sin(angle)
        c, s = np.cos(self.inclination), np.sin(self.inclination)
        return along * c - across * s, along * s + across * c


TIDES = (
    Ellipse(M2_PERIOD, major=0.06, minor=0.02, inclination=0.6, phase=0.4),
    Ellipse(K1_PERIOD, major=0.03, minor=-0.01, inclination=1.2, phase=2.0),
)


@dataclass(frozen=True, slots=True)
class Sea:
    """What kind of sea it is.

    ``residual`` is the mean current (m/s; east, north). ``sigma`` (m/s, a component), ``tau`` (s) and
    ``scale`` (m) are strength, memory and size of the slow Ornstein-Uhlenbeck part.
    """

    residual: tuple[float, float] = (0.05, 0.02)
    sigma: float = 0.06
    tau: float = 30 * 3600.0
    scale: float = 40e3
    tides: tuple[Ellipse, ...] = TIDES


@dataclass(frozen=True, slots=True)
class Ocean:
    """One realisation of a sea between ``nodes[0]`` and ``nodes[-1]`` (s).

    ``wave_numbers`` (rad/m, shape (modes, 2)) and ``amplitudes`` (m/s, shape (4 modes, nodes)) make
    the slow part: a sum of plane waves whose amplitudes wander.
    """

    sea: Sea
    nodes: Array
    wave_numbers: Array
    amplitudes: Array

    def current(self, t: Array, east: Array, north: Array) -> tuple[Array, Array]:
        """Eastward and northward current (m/s).

        Args:
            t: Times (s), shape (n,).
            east: Metres east of the origin of the mission, shape (n,).
            north: Metres north of it, shape (n,).

        Raises:
            ValueError: a time outside the span that was made.
        """
        if t.min() < self.nodes[0] or t.max() > self.nodes[-1]:
            raise ValueError("time outside the ocean's span: make the ocean for a longer mission")
        u, v = np.full(t.shape, self.sea.residual[0]), np.full(t.shape, self.sea.residual[1])
        for j, (k_east, k_north) in enumerate(self.wave_numbers):
            angle = k_east * east + k_north * north
            a, b, c, d = (np.interp(t, self.nodes, row) for row in self.amplitudes[4 * j : 4 * j + 4])
            u += a * np.cos(angle) + b * np.sin(angle)
            v += c * np.cos(angle) + d * np.sin(angle)
        for ellipse in self.sea.tides:
            tide_u, tide_v = ellipse.current(t)
            u, v = u + tide_u, v + tide_v
        return u, v


def make_ocean(sea: Sea, start: float, end: float, rng: np.random.Generator) -> Ocean:
    """A realisation of ``sea`` for times from ``start`` to ``end`` (s).

    The wandering amplitudes are exact samples of an Ornstein-Uhlenbeck process every half hour; wave
    numbers are drawn so that the covariance in space is sigma^2 exp(-d^2 / (2 scale^2)) on average
    over seeds (Rahimi and Recht 2007, random Fourier features).
    """
    nodes = np.arange(start, end + _STEP, _STEP)
    decay = np.exp(-_STEP / sea.tau)
    kicks = rng.standard_normal((len(nodes), 4 * _MODES))
    kicks[1:] *= np.sqrt(1 - decay**2)
    for i in range(1, len(nodes)):
        kicks[i] += decay * kicks[i - 1]
    amplitudes = sea.sigma / np.sqrt(_MODES) * kicks.T
    wave_numbers = rng.standard_normal((_MODES, 2)) / sea.scale
    return Ocean(sea, readonly(nodes), readonly(wave_numbers), readonly(amplitudes))
