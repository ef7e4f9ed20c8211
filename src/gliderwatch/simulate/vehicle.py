"""Where a simulated glider is, and where it believes to be, as a mission goes on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gliderwatch.model import Array
from gliderwatch.simulate.ocean import Ocean
from gliderwatch.simulate.onboard import Point, Vector, offset
from gliderwatch.simulate.scenario import DiveTruth, Scenario
from gliderwatch.simulate.telemetry import CYCLE, Log

NODE = 15
"""Cycles between the times at which the current is looked up and the rudder is moved."""


@dataclass(slots=True)
class Glider:
    """State of a glider.

    ``place``, ``east`` and ``north`` (m from the launch) are true. ``fix`` is the last fix, had at
    ``fix_cycle``; ``drift`` (m/s, true north) the drift at the surface as seen by fixes; ``water``
    (m/s, magnetic north) the current it reckons with; ``waypoint`` the index of its goal.
    """

    scenario: Scenario
    ocean: Ocean
    rng: np.random.Generator
    log: Log
    place: Point
    fix: Point
    cycle: int = 0
    east: float = 0.0
    north: float = 0.0
    fix_cycle: int = 0
    drift: Vector = Vector(0.0, 0.0)
    water: Vector = Vector(0.0, 0.0)
    waypoint: int = 0

    def time(self, cycle: int) -> float:
        """Time (s) of a cycle."""
        return self.scenario.start + CYCLE * cycle

    def move(self, end: int, east: float, north: float) -> None:
        """Be ``east`` and ``north`` (m) of here at cycle ``end``."""
        lat, lon = offset(self.place, np.asarray(east), np.asarray(north))
        self.place, self.cycle = Point(float(lat), float(lon)), end
        self.east, self.north = self.east + east, self.north + north

    def carried(self, t: Array, east: Array, north: Array) -> tuple[Array, Array]:
        """How far (m) the current has carried it at ``t`` (s) while it made ``east``, ``north`` (m)."""
        far_east, far_north = np.zeros_like(t), np.zeros_like(t)
        for _ in range(2):
            u, v = self.ocean.current(t, self.east + east + far_east, self.north + north + far_north)
            far_east, far_north = integral(t, u), integral(t, v)
        return far_east, far_north


class Flown(NamedTuple):
    """A dive as the surfacing needs it: cycles, way believed to be made (m, magnetic north), truth."""

    start: int
    end: int
    own: Vector
    truth: DiveTruth


def integral(t: Array, rate: Array) -> Array:
    """Integral of ``rate`` over ``t`` from the first time on, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (rate[1:] + rate[:-1]) / 2)])
