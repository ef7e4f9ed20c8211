"""What the flow at a glider does from dive to dive: a Gaussian process as a linear state. Pure.

Each component of the flow is the sum of a lasting part that wanders (random walk), a passing part that fades
(Ornstein-Uhlenbeck), and tides with slowly changing amplitudes (002: cos and sin of each constituent,
averaged over the dive). State, 4 + 4 numbers a constituent: lasting east, north; passing east,
north; then of each constituent cos east, sin east, cos north, sin north (m/s).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gliderwatch.model import Array, readonly

HOUR, DAY = 3600.0, 86400.0
LASTING = slice(0, 2)
"""Place of the lasting part in the state: there a flow changes for good, as at a front."""


@dataclass(frozen=True, slots=True)
class Tide:
    """A tidal constituent: period (s), usual amplitude of cos and sin in a component (m/s)."""

    period: float
    amplitude: float


@dataclass(frozen=True, slots=True)
class FlowParams:
    """Sizes and memories of the parts, in a component.

    ``lasting`` usual size of the lasting part (m/s) and ``wander`` its change in a day (m/s); ``passing``
    usual size of the passing part (m/s) and ``memory`` its time constant (s); ``tide_wander`` the part of
    a tide's amplitude that changes in a day; ``scale`` (m) over which currents differ by their own size.
    """

    lasting: float = 0.3
    wander: float = 0.1
    passing: float = 0.08
    memory: float = 30 * HOUR
    tides: tuple[Tide, ...] = (Tide(12.4206 * HOUR, 0.06), Tide(23.9345 * HOUR, 0.04))
    tide_wander: float = 0.1
    scale: float = 60e3

    @property
    def size(self) -> int:
        """How many numbers the state has."""
        return 4 + 4 * len(self.tides)

    @property
    def amplitudes(self) -> list[float]:
        """Usual sizes of the tidal part of the state (m/s)."""
        return [tide.amplitude for tide in self.tides for _ in range(4)]


def prior(params: FlowParams) -> Array:
    """Variance (m2/s2, (size,)) of the state before any dive; its mean is zero."""
    return np.square([params.lasting] * 2 + [params.passing] * 2 + params.amplitudes)


def transition(dt: float, params: FlowParams) -> Array:
    """What is left of each number after ``dt`` seconds, (size,)."""
    kept = np.ones(params.size)
    kept[2:4] = math.exp(-dt / params.memory)
    return kept


def noise(dt: float, factor: float, crossed: float, params: FlowParams) -> Array:
    """Variance (m2/s2, (size,)) that ``dt`` seconds add to each number.

    ``factor`` multiplies that of the parts which are not tide. ``crossed`` (m/s) is by how much the flow
    usually differs along the way of the glider, see `crossing`.
    """
    lasting = factor * (params.wander**2 * dt / DAY + crossed**2)
    passing = factor * params.passing**2 * -math.expm1(-2 * dt / params.memory)
    tides = np.square(params.amplitudes) * params.tide_wander**2 * dt / DAY
    return np.concatenate([[lasting] * 2, [passing] * 2, tides])


def crossing(flow: Array, ground: Array, dt: float, params: FlowParams) -> float:
    """By how much (m/s) a flow (m/s, (2,)) usually differs after ``dt`` seconds at a velocity over ground.

    A strong current is a narrow one: it differs by its own size over a distance of ``params.scale``.
    """
    return float(np.hypot(*flow)) * min(float(np.hypot(*ground)) * dt / params.scale, 1.0)


@lru_cache(maxsize=64)
def mean_flow(start: float, end: float, params: FlowParams) -> Array:
    """The rows (2, size) that give the mean flow (east, north) between two times (s) from the state.

    A tide averaged over T is sinc(omega T / 2) times that in the middle (002).

    >>> m2 = FlowParams(tides=(Tide(360 / 28.9841042 * HOUR, 0.1),))
    >>> mean_flow(0.0, 3 * HOUR, m2)[0].round(5).tolist()
    [1.0, 0.0, 1.0, 0.0, 0.658, 0.6239, 0.0, 0.0]
    """
    rows = np.zeros((2, params.size))
    rows[[0, 1], [0, 1]] = rows[[0, 1], [2, 3]] = 1.0
    for i, tide in enumerate(params.tides):
        half = math.pi * (end - start) / tide.period
        smooth = math.sin(half) / half if half > 0 else 1.0
        angle = math.pi * (start + end) / tide.period
        at = 4 + 4 * i
        rows[0, at : at + 2] = rows[1, at + 2 : at + 4] = smooth * math.cos(angle), smooth * math.sin(angle)
    return readonly(rows)
