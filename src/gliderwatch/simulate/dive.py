"""One dive: the sawtooth, the way steered, the current, and what the glider logs of it."""

from __future__ import annotations

from collections.abc import Iterator
from math import asin, atan2, cos, hypot, prod, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.flight import steady_glide
from gliderwatch.simulate.onboard import Vector, along_heading, displacement, nmea, offset, own_speed, turn
from gliderwatch.simulate.scenario import DiveTruth, FaultKind
from gliderwatch.simulate.telemetry import CYCLE
from gliderwatch.simulate.vehicle import NODE, Flown, Glider, integral

_INFLECTION = 20.0
_LEAST_RANGE = 10.0
_DEPTH_NOISE, _PITCH_NOISE, _COMPASS_NOISE, _ROLL_NOISE = 0.04, 0.005, 0.01, 0.02
_HEADING_MEMORY = 120.0
_REACHED = 800.0
_AMPERES = 0.25


class _Motion(NamedTuple):
    """What the glider really does, every cycle: depth (m), pitch (rad, up), horizontal speed (m/s)."""

    depth: Array
    pitch: Array
    speed: Array


class _Course(NamedTuple):
    """At each node: commanded and made heading (rad, true north), index of the waypoint."""

    commanded: Array
    made: Array
    waypoint: NDArray[np.int64]


class _Reckoning(NamedTuple):
    """What the glider measures every cycle, and the way it believes to have made (m, magnetic north)."""

    depth: Array
    pitch: Array
    compass: Array
    speed: Array
    east: Array
    north: Array


def dive(glider: Glider, segment: str) -> Flown:
    """Dive, and be at the surface again; ``segment`` names the file that logs it."""
    scenario, rng, start = glider.scenario, glider.rng, glider.cycle
    motion = _motion(glider)
    n = len(motion.depth)
    depth = np.clip(motion.depth + _DEPTH_NOISE * rng.standard_normal(n), 0.0, None)
    pitch = motion.pitch + _PITCH_NOISE * rng.standard_normal(n)
    believed = own_speed(depth, pitch, CYCLE)
    course = _steer(glider, believed)
    heading = np.interp(np.arange(n), NODE * np.arange(len(course.made)), np.unwrap(course.made))
    compass = heading + scenario.variation + _COMPASS_NOISE * rng.standard_normal(n)
    reckoning = _Reckoning(depth, pitch, compass, believed, *along_heading(believed, compass, CYCLE))
    _log(glider, motion, course, reckoning)
    east, north = along_heading(motion.speed, heading, CYCLE)
    at = np.unique(np.append(np.arange(0, n, NODE), n - 1))
    far_east, far_north = glider.carried(glider.time(start) + CYCLE * at, east[at], north[at])
    end, duration = start + n - 1, CYCLE * (n - 1)
    truth = DiveTruth(
        segment=segment,
        t_dive=glider.time(start),
        t_surface=glider.time(end),
        speed=float(motion.speed.mean()),
        believed_speed=float(believed.mean()),
        through_water=Vector(float(east[-1]) / duration, float(north[-1]) / duration),
        current=Vector(float(far_east[-1]) / duration, float(far_north[-1]) / duration),
        faults=tuple(str(fault.kind) for fault in scenario.faults if fault.onset <= glider.time(end)),
    )
    glider.move(end, float(east[-1] + far_east[-1]), float(north[-1] + far_north[-1]))
    return Flown(start, end, Vector(float(reckoning.east[-1]), float(reckoning.north[-1])), truth)


def _legs(glider: Glider) -> Iterator[tuple[float, float, float, float]]:
    """Duration (s), pitch (rad), speed down and horizontal speed (m/s) of each leg of a dive."""
    scenario, rng = glider.scenario, glider.rng
    elapsed, depth, start = 0.0, 0.0, glider.time(glider.cycle)
    top, bottom = scenario.depths
    down, surfacing = True, False
    while not surfacing:
        pitch = scenario.pitch + scenario.pitch_sigma * rng.standard_normal()
        drag = prod(scenario.sizes(FaultKind.REMORA, start + elapsed))
        glide = steady_glide(pitch, scenario.drive, scenario.airframe, drag=drag)
        if down:
            target = max(bottom + scenario.bottom_sigma * rng.standard_normal(), top + _LEAST_RANGE)
        else:
            surfacing = elapsed + depth / glide.vertical >= scenario.interval
            target = 0.0 if surfacing else top
        duration = abs(target - depth) / glide.vertical
        sign = 1.0 if down else -1.0
        yield duration, -sign * pitch, sign * glide.vertical, glide.horizontal
        elapsed, depth, down = elapsed + duration, target, not down


def _motion(glider: Glider) -> _Motion:
    """Fly the legs of a dive; pitch and depth rate turn over together about each inflection."""
    durations, pitches, rates, speeds = (np.array(column) for column in zip(*_legs(glider), strict=True))
    turns = np.cumsum(durations)
    t = CYCLE * np.arange(round(turns[-1] / CYCLE) + 1)
    half = min(_INFLECTION, 0.4 * durations.min())
    knots = np.column_stack([turns[:-1] - half, turns[:-1] + half]).ravel()

    def over(legs: Array) -> Array:
        return np.interp(t, knots, np.repeat(legs, 2)[1:-1])

    depth = np.clip(integral(t, over(rates)), 0.0, None)
    speed, begin = over(speeds), glider.time(glider.cycle)
    for fault in glider.scenario.faults:
        if fault.kind is FaultKind.WING_LOSS:
            speed *= np.where(begin + t >= fault.onset, 1 - fault.size, 1.0)
    return _Motion(depth, over(pitches), speed)


def _steer(glider: Glider, believed: Array) -> _Course:
    """Steer for the waypoints by dead reckoning.

    Every minute the glider points so that speed through the water and the current it knows add up to
    a course for the waypoint; the controller misses that by an error with a memory of two minutes.
    """
    scenario, step = glider.scenario, CYCLE * NODE
    memory = np.exp(-step / _HEADING_MEMORY)
    kicks = scenario.heading_sigma * glider.rng.standard_normal(-(-len(believed) // NODE) + 1)
    water = turn(glider.water, -scenario.variation)
    adrift = CYCLE * (glider.cycle - glider.fix_cycle)
    east, north, error = water.east * adrift, water.north * adrift, float(kicks[0])
    goals = [displacement(glider.fix, waypoint) for waypoint in scenario.waypoints]
    rows = []
    for i, kick in enumerate(kicks[1:]):
        goal = goals[glider.waypoint]
        if hypot(goal.east - east, goal.north - north) < _REACHED:
            glider.waypoint = (glider.waypoint + 1) % len(goals)
            goal = goals[glider.waypoint]
        speed = max(float(believed[min(i * NODE, len(believed) - 1)]), 0.05)
        bearing = atan2(goal.east - east, goal.north - north)
        across = water.east * cos(bearing) - water.north * sin(bearing)
        commanded = bearing - asin(min(max(across / speed, -0.8), 0.8))
        made = commanded + error
        rows.append((commanded, made, glider.waypoint))
        east += step * (speed * sin(made) + water.east)
        north += step * (speed * cos(made) + water.north)
        error = memory * error + (1 - memory**2) ** 0.5 * float(kick)
    headings, made_good, waypoint = zip(*rows, strict=True)
    return _Course(np.array(headings), np.array(made_good), np.array(waypoint))


def _log(glider: Glider, motion: _Motion, course: _Course, reckoning: _Reckoning) -> None:
    """Log a dive from its first cycle to its last."""
    scenario, log, rng = glider.scenario, glider.log, glider.rng
    n = len(motion.depth)
    cycles = glider.cycle + np.arange(n)
    nodes = glider.cycle + NODE * np.arange(len(course.commanded))
    adrift = CYCLE * (cycles - glider.fix_cycle)
    reckoned = (reckoning.east + glider.water.east * adrift, reckoning.north + glider.water.north * adrift)
    c, s = np.cos(scenario.variation), np.sin(scenario.variation)
    lat, lon = offset(glider.fix, c * reckoned[0] - s * reckoned[1], c * reckoned[1] + s * reckoned[0])
    log.add("m_depth", cycles, reckoning.depth)
    log.add("m_depth_rate", cycles, np.gradient(reckoning.depth, CYCLE))
    log.add("m_pitch", cycles, reckoning.pitch)
    log.add("m_roll", cycles, _ROLL_NOISE * rng.standard_normal(n))
    log.add("m_heading", cycles, reckoning.compass % (2 * np.pi))
    log.add("m_speed", cycles, reckoning.speed)
    log.add("m_lat", cycles, nmea(lat))
    log.add("m_lon", cycles, nmea(lon))
    ballast = 1e6 * scenario.drive * np.sign(motion.pitch)
    log.add("c_ballast_pumped", cycles, ballast)
    log.add("m_ballast_pumped", cycles, ballast)
    goals = np.array([(place.lat, place.lon) for place in scenario.waypoints])[course.waypoint]
    log.add("c_wpt_lat", nodes, nmea(goals[:, 0]))
    log.add("c_wpt_lon", nodes, nmea(goals[:, 1]))
    log.add("c_heading", nodes, (course.commanded + scenario.variation) % (2 * np.pi))
    hours = CYCLE * nodes / 3600
    log.add("m_coulomb_amphr_total", nodes, _AMPERES * hours)
    log.add("m_battery", nodes, 15.2 - 0.001 * hours + 0.01 * rng.standard_normal(len(nodes)))
    log.add("m_vacuum", nodes, 7.5 + 0.02 * rng.standard_normal(len(nodes)))
    log.add("m_leakdetect_voltage", nodes, 2.49 + 0.001 * rng.standard_normal(len(nodes)))
