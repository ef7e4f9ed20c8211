"""Where a simulated glider is, and where it believes to be, as a mission goes on."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.faults import Health
from gliderwatch.simulate.ocean import Ocean
from gliderwatch.simulate.onboard import Point, Vector, displacement, offset, turn
from gliderwatch.simulate.scenario import DiveTruth, Scenario
from gliderwatch.simulate.telemetry import CYCLE, Log

NODE = 15
"""Cycles between the times at which the current is looked up and the rudder is moved."""
_TRIM_MEMORY = 86400.0


@dataclass(slots=True)
class Glider:
    """State of a glider.

    ``place``, ``east`` and ``north`` (m from the origin of the sea) are true. ``fix`` is the last fix,
    had at ``fix_cycle``; ``drift`` (m/s, true north) the drift at the surface as seen by fixes; ``water``
    (m/s, magnetic north) the current it reckons with; ``waypoint`` the index of its goal; ``lmc`` the
    origin of its local mission coordinates. ``against`` (unit vector) is the way of the current that
    sets against it; ``inflections`` counts, ``charge`` (A h) is used up; ``trim`` is what the water adds to
    its drive, in units of `Scenario.drive_sigma`. ``rng`` moves the glider,
    ``luck`` all that came to be simulated later, so that neither disturbs the other.
    """

    scenario: Scenario
    ocean: Ocean
    rng: np.random.Generator
    luck: np.random.Generator
    log: Log
    science: Log
    place: Point
    fix: Point
    lmc: Point
    east: float = 0.0
    north: float = 0.0
    cycle: int = 0
    fix_cycle: int = 0
    drift: Vector = Vector(0.0, 0.0)
    water: Vector = Vector(0.0, 0.0)
    waypoint: int = 0
    against: Vector = Vector(0.0, 0.0)
    inflections: int = 0
    charge: float = 0.0
    trim: float = 0.0
    health: Health = field(init=False)
    trimming: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        self.health, self.trimming = self.scenario.health, self.scenario.rng(4)
        self.trim = float(self.trimming.standard_normal())

    def trim_anew(self) -> None:
        """Let ``trim`` wander by the time of a dive."""
        kept = exp(-self.scenario.interval / _TRIM_MEMORY)
        self.trim = kept * self.trim + sqrt(1 - kept**2) * float(self.trimming.standard_normal())

    def time(self, cycle: int) -> float:
        """Time (s) of a cycle."""
        return self.scenario.start + CYCLE * cycle

    def times(self, cycles: NDArray[np.int64]) -> Array:
        """Times (s) of some cycles."""
        return np.asarray(self.scenario.start + CYCLE * cycles, dtype=np.float64)

    def move(self, end: int, east: float, north: float) -> None:
        """Be ``east`` and ``north`` (m) of here at cycle ``end``."""
        lat, lon = offset(self.place, np.asarray(east), np.asarray(north))
        self.place, self.cycle = Point(float(lat), float(lon)), end
        self.east, self.north = self.east + east, self.north + north

    def carried(self, t: Array, east: Array, north: Array, depth: Array | float = 0.0) -> tuple[Array, Array]:
        """How far (m) the current has carried it at ``t`` (s) and ``depth`` (m) while it made
        ``east``, ``north`` (m)."""
        far_east, far_north = np.zeros_like(t), np.zeros_like(t)
        added = self.health.stream(t)
        for _ in range(2):
            u, v = self.ocean.current(t, self.east + east + far_east, self.north + north + far_north, depth)
            far_east = integral(t, u + added * self.against.east)
            far_north = integral(t, v + added * self.against.north)
        return far_east, far_north

    def to_lmc(self, place: Point) -> Vector:
        """Local mission coordinates (m, magnetic north) of a place."""
        return turn(displacement(self.lmc, place), self.scenario.variation)


class Flown(NamedTuple):
    """A dive as the surfacing needs it: cycles, way believed to be made (m, magnetic north), truth."""

    start: int
    end: int
    own: Vector
    truth: DiveTruth


def integral(t: Array, rate: Array) -> Array:
    """Integral of ``rate`` over ``t`` from the first time on, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (rate[1:] + rate[:-1]) / 2)])
