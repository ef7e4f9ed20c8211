"""The sawtooth of a dive: legs of steady flight, turned over at the inflections."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, hypot
from typing import NamedTuple

import numpy as np

from gliderwatch.model import Array
from gliderwatch.simulate.flight import Glide, steady_glide
from gliderwatch.simulate.onboard import Vector, displacement, turn
from gliderwatch.simulate.telemetry import CYCLE
from gliderwatch.simulate.vehicle import Glider, integral

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
        water = turn(glider.water, -scenario.variation)
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
    elapsed, depth, start = 0.0, 0.0, glider.time(glider.cycle)
    top, bottom = scenario.depths
    down, surfacing = True, False
    while not surfacing:
        pitch = scenario.pitch + scenario.pitch_sigma * rng.standard_normal()
        speed = _glide(glider, pitch, down, start + elapsed)[0].vertical * health.free(start + elapsed)
        if down:
            limit = float(way.water_depth(np.array(elapsed))) - scenario.altitude
            target = min(bottom + scenario.bottom_sigma * rng.standard_normal(), limit)
            # In a net it would be on its way for ever: it turns when it has to think of surfacing.
            target = max(min(target, depth + speed * scenario.interval), top + _LEAST_RANGE)
        else:
            surfacing = elapsed + depth / speed >= scenario.interval
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
