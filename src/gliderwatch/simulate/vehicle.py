"""Where a simulated glider is, where it believes to be, and the sawtooth it flies. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import repeat
from math import ceil, exp, hypot, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.flight import Glide, Point, Vector, displacement, offset, steady_glide, turn
from gliderwatch.simulate.ocean import Ocean
from gliderwatch.simulate.scenario import DiveTruth, Health, Scenario
from gliderwatch.simulate.telemetry import CYCLE, Log
from gliderwatch.slocum.sensors import model_declination

# ----------------------------------------
# Where a simulated glider is, and where it believes to be, as a mission goes on.

NODE = 15
"""Cycles between the times at which the current is looked up and the rudder is moved."""
_TRIM_MEMORY = 86400.0


@dataclass(frozen=True, slots=True)
class Yo:
    """A behavior of a dive: climb to ``top`` and dive to ``bottom`` (m), ``half_cycles`` times in all; None:
    until the glider is to surface."""

    top: float
    bottom: float
    half_cycles: int | None = None


@dataclass(slots=True)
class Glider:
    """State of a glider.

    ``place``, ``east`` and ``north`` (m from the origin of the sea) are true. ``fix`` is the last fix,
    had at ``fix_cycle``; ``drift`` (m/s, true north) the drift at the surface as seen by fixes; ``water``
    (m/s, magnetic north) the current it reckons with; ``waypoint`` the index of its goal; ``lmc`` the
    origin of its local mission coordinates. ``against`` (unit vector) is the way of the current that
    sets against it; ``inflections`` counts, ``charge`` (A h) is used up; ``trim`` is what the water adds to
    its drive, in units of `Scenario.drive_sigma`; ``variation`` is m_gps_mag_var (rad), ``declination``
    (rad) what the World Magnetic Model has at the launch. ``rng`` moves the glider, ``luck`` all that came
    to be simulated later, so that neither disturbs the other. ``yos`` are flown one after another in each
    dive, the last without an end; none: to the depths of the scenario.
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
    yos: tuple[Yo, ...] = ()
    health: Health = field(init=False)
    variation: float = field(init=False)
    declination: float = field(init=False)
    trimming: np.random.Generator = field(init=False)
    timing: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        self.health, self.trimming = self.scenario.health, self.scenario.rng(4)
        self.timing = self.scenario.rng(5)
        self.variation, start = self.scenario.variation, self.scenario.start
        self.declination = model_declination(*self.scenario.place, start)[0]
        self.trim = float(self.trimming.standard_normal())

    def wander_trim(self) -> None:
        """Let ``trim`` wander by the time of a dive."""
        kept = exp(-self.scenario.interval / _TRIM_MEMORY)
        self.trim = kept * self.trim + sqrt(1 - kept**2) * float(self.trimming.standard_normal())

    def find_north(self) -> None:
        """Take the ``variation`` of the last fix: it changes along the way as the World Magnetic Model has
        it."""
        here = model_declination(*self.fix, self.time(self.cycle))[0]
        self.variation = self.scenario.variation - (here - self.declination)

    def turns(self) -> Iterator[tuple[float, float]]:
        """Upper and lower turn (m) of each leg of a dive, without end."""
        for yo in self.yos:
            if yo.half_cycles is not None:
                yield from repeat((yo.top, yo.bottom), yo.half_cycles)
            else:
                yield from repeat((yo.top, yo.bottom))
        yield from repeat(self.scenario.depths)

    def next_interval(self) -> float:
        """How long (s) the next dive is to be."""
        jitter = self.scenario.interval_jitter
        return self.scenario.interval + (float(self.timing.uniform(-jitter, jitter)) if jitter else 0.0)

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
        return turn(displacement(self.lmc, place), self.variation)


class Flown(NamedTuple):
    """A dive as the surfacing needs it: cycles, way believed to be made (m, magnetic north), truth."""

    start: int
    end: int
    own: Vector
    truth: DiveTruth


def integral(t: Array, rate: Array) -> Array:
    """Integral of ``rate`` over ``t`` from the first time on, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (rate[1:] + rate[:-1]) / 2)])


# ----------------------------------------
# The sawtooth of a dive: legs of steady flight, turned over at the inflections.

_INFLECTION = 20.0
_LEAST_RANGE = 10.0
_STEADY = 600.0
"""A leg is flown in pieces of at most this time (s), so that faults that grow are felt within a leg."""


class Motion(NamedTuple):
    """What the glider really does, every cycle.

    Depth (m), pitch (rad, up), horizontal speed (m/s), volume as pumped (m^3, up), power of the
    thruster (W), depth of the water where it flies (m; infinite where there is no bottom); and
    ``turns``, the cycles since the start of the dive at which a leg begins.
    """

    depth: Array
    pitch: Array
    speed: Array
    pumped: Array
    power: Array
    water_depth: Array
    turns: Array


class _Piece(NamedTuple):
    """A piece of a leg: duration (s), pitch (rad, up), speed down and ahead (m/s), pumped volume
    (m^3, up), power of the thruster (W), and whether it is the first of its leg."""

    duration: float
    pitch: float
    down: float
    ahead: float
    pumped: float
    power: float
    first: bool


class _Way:
    """The line along which the glider expects to go, and the bottom below it."""

    def __init__(self, glider: Glider) -> None:
        scenario = glider.scenario
        goal = displacement(glider.fix, scenario.waypoints[glider.waypoint])
        away = hypot(goal.east, goal.north) or 1.0
        ahead = steady_glide(scenario.pitch, scenario.drive, scenario.airframe).horizontal
        water = turn(glider.water, -glider.variation)
        self._velocity = Vector(
            ahead * goal.east / away + water.east, ahead * goal.north / away + water.north
        )
        self._bottom, self._east, self._north = scenario.bottom, glider.east, glider.north

    def water_depth(self, elapsed: Array) -> Array:
        """Depth of the water (m) ``elapsed`` s after the start of the dive."""
        if self._bottom is None:
            return np.full(np.shape(elapsed), np.inf)
        east = self._east + self._velocity.east * elapsed
        return self._bottom.water_depth(east, self._north + self._velocity.north * elapsed)


def fly(glider: Glider) -> Motion:
    """Fly the legs of a dive; pitch and depth rate turn over together about each inflection."""
    way = _Way(glider)
    pieces = list(_legs(glider, way))
    columns = [np.array(column, dtype=float) for column in zip(*pieces, strict=True)]
    durations, pitches, rates, speeds, pumped, power, first = columns
    turns = np.cumsum(durations)
    t = CYCLE * np.arange(round(turns[-1] / CYCLE) + 1)
    half = min(_INFLECTION, 0.4 * durations.min())
    knots = np.column_stack([turns[:-1] - half, turns[:-1] + half]).ravel()

    def over(legs: Array) -> Array:
        return np.interp(t, knots, np.repeat(legs, 2)[1:-1])

    begun = np.concatenate([[0.0], turns[:-1]])[first > 0]
    return _held(
        glider,
        t,
        Motion(
            depth=np.clip(integral(t, over(rates)), 0.0, None),
            pitch=over(pitches),
            speed=over(speeds),
            pumped=over(pumped),
            power=over(power),
            water_depth=way.water_depth(t),
            turns=np.round(begun / CYCLE),
        ),
    )


def _held(glider: Glider, t: Array, motion: Motion) -> Motion:
    """The motion with what lost wings take of the speed, and never through the bottom."""
    speed = motion.speed * glider.health.gliding(glider.time(glider.cycle) + t)
    return motion._replace(speed=speed, depth=np.minimum(motion.depth, motion.water_depth))


def _legs(glider: Glider, way: _Way) -> Iterator[_Piece]:
    """The legs of a dive, one after another, until it is time to surface."""
    scenario, rng, health = glider.scenario, glider.rng, glider.health
    elapsed, depth, start, interval = 0.0, 0.0, glider.time(glider.cycle), glider.next_interval()
    down, turns = True, glider.turns()
    surfacing = False
    while not surfacing:
        top, bottom = next(turns)
        pitch = scenario.pitch + scenario.pitch_sigma * rng.standard_normal()
        speed = _glide(glider, pitch, down, start + elapsed)[0].vertical * health.free(start + elapsed)
        if down:
            limit = float(way.water_depth(np.array(elapsed))) - scenario.altitude
            target = min(bottom + scenario.bottom_sigma * rng.standard_normal(), limit)
            # In a net it would be on its way for ever: it turns when it has to think of surfacing.
            target = max(min(target, depth + speed * interval), top + _LEAST_RANGE)
        else:
            surfacing = elapsed + depth / speed >= interval
            target = 0.0 if surfacing else top
        left, first = abs(target - depth), True
        while left > 1e-6:
            piece = _piece(glider, pitch, down, start + elapsed, left)._replace(first=first)
            yield piece
            elapsed, left, first = elapsed + piece.duration, left - piece.duration * abs(piece.down), False
        depth, down = target, not down


def _glide(glider: Glider, pitch: float, down: bool, t: float) -> tuple[Glide, float, float]:
    """The steady glide at a time, the volume pumped (m^3), and the power of the thruster (W)."""
    scenario, health = glider.scenario, glider.health
    pumped = scenario.drive * health.pumped(t)
    drive = (pumped if down else pumped * health.oil(t)) * (1 + scenario.drive_sigma * glider.trim)
    thruster = scenario.thruster if scenario.thruster and (scenario.thruster.on_dives or not down) else None
    thrust = thruster.thrust if thruster else 0.0
    glide = steady_glide(pitch, drive, scenario.airframe, drag=health.drag(t), thrust=thrust)
    return glide, pumped, thruster.power(glide) if thruster else 0.0


def _piece(glider: Glider, pitch: float, down: bool, t: float, left: float) -> _Piece:
    """A piece of a leg with ``left`` m to go."""
    glide, pumped, power = _glide(glider, pitch, down, t)
    free = glider.health.free(t)
    duration = left / (glide.vertical * free)
    sign = 1.0 if down else -1.0
    return _Piece(
        duration / ceil(duration / _STEADY),
        -sign * pitch,
        sign * glide.vertical * free,
        glide.horizontal * free,
        -sign * pumped,
        power,
        True,
    )
