"""One dive: how it is steered, the sawtooth, the current, what the instruments log of it. Pure."""

from __future__ import annotations

from math import asin, atan2, cos, hypot, sin, tan
from typing import NamedTuple

import gsw
import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.flight import (
    Vector,
    along_heading,
    displacement,
    nmea,
    offset,
    own_speed,
    steady_glide,
    turn,
)
from gliderwatch.simulate.scenario import DiveTruth, Scenario
from gliderwatch.simulate.telemetry import CYCLE, SCIENCE_CYCLE
from gliderwatch.simulate.vehicle import NODE, Flown, Glider, Motion, fly

# ----------------------------------------
# The way a glider steers: for its waypoints, by what it believes of itself and of the current.

_HEADING_MEMORY = 120.0
_REACHED = 800.0


class Course(NamedTuple):
    """At each node: commanded heading and the one kept by the compass (rad, true north if the compass
    is), index of the waypoint."""

    commanded: Array
    kept: Array
    waypoint: NDArray[np.int64]


def steer(glider: Glider, believed: Array) -> Course:
    """Steer for the waypoints by dead reckoning.

    Every minute the glider points so that its ``believed`` speed through the water (m/s, every cycle)
    and the current it knows add up to a course for the waypoint; the controller misses that by an
    error with a memory of two minutes.
    """
    scenario, step = glider.scenario, CYCLE * NODE
    memory = np.exp(-step / _HEADING_MEMORY)
    kicks = scenario.heading_sigma * glider.rng.standard_normal(-(-len(believed) // NODE) + 1)
    water = turn(glider.water, -glider.variation)
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
        kept = commanded + error
        rows.append((commanded, kept, glider.waypoint))
        east += step * (speed * sin(kept) + water.east)
        north += step * (speed * cos(kept) + water.north)
        error = memory * error + (1 - memory**2) ** 0.5 * float(kick)
    commands, headings, waypoint = zip(*rows, strict=True)
    return Course(np.array(commands), np.array(headings), np.array(waypoint))


# ----------------------------------------
# What a glider's instruments make of a dive, and write into its logs.

Cycles = NDArray[np.int64]

DEEP = 200.0
"""A glider that goes deeper than this (m) has an oil pump, others a piston."""
DR_UNDERWATER, DR_AWAITING_FIX, DR_AWAITING_POSTFIX, DR_AWAITING_DIVE = 1, 2, 3, 4
"""Values of x_dr_state."""

_ROLL_NOISE = 0.02
_STRIKE = (0.82, 0.94, 0.9)
"""rad: roll, pitch, half the swing of heading while a shark holds on: 47, 54, over 100 degrees (000)."""
_RANGE = 90.0
_AMPERES, _VOLTS, _CAPACITY = 0.25, 15.0, 550.0
_INCHES = 0.9
_S_M_PER_MS_CM = 0.1
_SCIENCE_NOISE = (0.002, 0.0003, 0.002)
_PER_CYCLE = round(CYCLE / SCIENCE_CYCLE)


class Reckoning(NamedTuple):
    """What the glider measures every cycle, and the way it believes to have made (m, magnetic north)."""

    depth: Array
    pitch: Array
    compass: Array
    speed: Array
    east: Array
    north: Array


class Way(NamedTuple):
    """Where the glider really is at the nodes of a dive: times (s), metres from the sea's origin."""

    t: Array
    east: Array
    north: Array


def log_dive(glider: Glider, motion: Motion, course: Course, reckoning: Reckoning) -> None:
    """Log a dive from its first cycle to its last."""
    log, n = glider.log, len(motion.depth)
    cycles = glider.cycle + np.arange(n)
    nodes = glider.cycle + NODE * np.arange(len(course.commanded))
    begun = glider.cycle + motion.turns.astype(np.int64)
    for each, factor in ((log, 1), (glider.science, _PER_CYCLE)):
        each.yos += [(factor * int(cycle), i) for i, cycle in enumerate(begun[::2])]
        each.yos.append((factor * int(cycles[-1] + 1), 0))
    _log_attitude(glider, cycles, motion, reckoning)
    _log_position(glider, cycles, reckoning)
    _log_steering(glider, nodes, course)
    _log_pump(glider, cycles, motion)
    _log_power(glider, nodes, motion)
    _log_bottom(glider, cycles[::NODE], motion, reckoning.depth[::NODE])
    log.add("m_tot_num_inflections", begun, glider.inflections + np.arange(len(begun)))
    glider.inflections += len(begun)
    log.add("x_dr_state", cycles[0], DR_UNDERWATER)
    log.add("m_dr_time", cycles[::NODE], CYCLE * (cycles[::NODE] - cycles[0]))


def _round_the_circle(angle: Array) -> Array:
    """An angle (rad) from 0 to below 2 pi, also once it is rounded to four bytes."""
    return np.minimum(angle % (2 * np.pi), 6.283185)


def _log_attitude(glider: Glider, cycles: Cycles, motion: Motion, reckoning: Reckoning) -> None:
    log, n, t = glider.log, len(cycles), glider.times(cycles)
    roll = _ROLL_NOISE * glider.rng.standard_normal(n) + glider.health.roll(t)
    pitch, heading = reckoning.pitch, reckoning.compass
    struck = glider.health.struck(t)
    if struck.any():
        to_and_fro = np.where(cycles % 2, 1.0, -1.0)
        shaken = np.outer(_STRIKE, struck * to_and_fro) * glider.luck.uniform(0.5, 1, (3, n))
        roll, pitch, heading = roll + shaken[0], pitch + shaken[1], heading + shaken[2]
    log.add("m_depth", cycles, reckoning.depth)
    log.add("m_depth_rate", cycles, np.gradient(reckoning.depth, CYCLE))
    log.add("m_pitch", cycles, pitch)
    log.add("m_roll", cycles, roll)
    log.add("m_heading", cycles, _round_the_circle(heading))
    log.add("m_speed", cycles, reckoning.speed)
    log.add("m_avg_speed", cycles, np.cumsum(reckoning.speed) / np.arange(1, n + 1))
    log.add("m_battpos", cycles, -_INCHES * motion.pitch + 0.01 * glider.luck.standard_normal(n))


def _log_position(glider: Glider, cycles: Cycles, reckoning: Reckoning) -> None:
    """Dead reckoning: the own way and the known current since the last fix."""
    log = glider.log
    adrift = CYCLE * (cycles - glider.fix_cycle)
    east = reckoning.east + glider.water.east * adrift
    north = reckoning.north + glider.water.north * adrift
    c, s = np.cos(glider.variation), np.sin(glider.variation)
    lat, lon = offset(glider.fix, c * east - s * north, c * north + s * east)
    log.add("m_lat", cycles, nmea(lat))
    log.add("m_lon", cycles, nmea(lon))
    fix = glider.to_lmc(glider.fix)
    log.add("m_x_lmc", cycles, fix.east + east)
    log.add("m_y_lmc", cycles, fix.north + north)


def _log_steering(glider: Glider, nodes: Cycles, course: Course) -> None:
    log, scenario = glider.log, glider.scenario
    goals = np.array([(place.lat, place.lon) for place in scenario.waypoints])[course.waypoint]
    local = np.array([glider.to_lmc(place) for place in scenario.waypoints])[course.waypoint]
    log.add("c_wpt_lat", nodes, nmea(goals[:, 0]))
    log.add("c_wpt_lon", nodes, nmea(goals[:, 1]))
    log.add("c_wpt_x_lmc", nodes, local[:, 0])
    log.add("c_wpt_y_lmc", nodes, local[:, 1])
    log.add("c_heading", nodes, _round_the_circle(course.commanded + glider.variation))
    # A wing that is gone turns the glider: the fin holds against it.
    pull = 0.4 * glider.health.roll(glider.times(nodes))
    fin = course.commanded - course.kept - pull + 0.02 * glider.luck.standard_normal(len(nodes))
    log.add("m_fin", nodes, np.clip(fin, -0.45, 0.45))


def _log_pump(glider: Glider, cycles: Cycles, motion: Motion) -> None:
    """A shallow glider moves water, a deep one oil; a leak of oil also spoils the vacuum."""
    log, scenario = glider.log, glider.scenario
    names = ("c_de_oil_vol", "m_de_oil_vol")
    if scenario.depths[1] <= DEEP:
        names = ("c_ballast_pumped", "m_ballast_pumped")
    log.add(names[0], cycles, 1e6 * scenario.drive * np.sign(motion.pitch))
    log.add(names[1], cycles, 1e6 * motion.pumped)
    if scenario.thruster:
        log.add("m_thruster_power", cycles, motion.power)
        log.add("c_thruster_on", cycles, np.where(motion.power > 0.1, scenario.thruster.command, 0.0))


def _log_power(glider: Glider, nodes: Cycles, motion: Motion) -> None:
    log, rng, luck, n = glider.log, glider.rng, glider.luck, len(nodes)
    hours = CYCLE * nodes / 3600
    thruster = np.cumsum(motion.power)[::NODE] * CYCLE / 3600 / _VOLTS
    used = _AMPERES * hours + glider.charge + thruster
    glider.charge += float(motion.power.sum()) * CYCLE / 3600 / _VOLTS
    log.add("m_coulomb_amphr_total", nodes, used)
    log.add("m_lithium_battery_relative_charge", nodes, 100 * np.clip(1 - used / _CAPACITY, 0, 1))
    log.add("m_battery", nodes, 15.2 - 0.001 * hours + 0.01 * rng.standard_normal(n))
    leaked = 2.0 * (1 - glider.health.oil(glider.time(glider.cycle)))
    log.add("m_vacuum", nodes, 7.5 - leaked + 0.02 * rng.standard_normal(n))
    log.add("m_veh_temp", nodes, 18.0)
    log.add("m_digifin_leakdetect_reading", nodes, 1022.0)
    log.add("m_leakdetect_voltage", nodes, 2.49 + 0.001 * rng.standard_normal(n))
    for place in ("forward", "science"):
        log.add(f"m_leakdetect_voltage_{place}", nodes, 2.49 + 0.001 * luck.standard_normal(n))


def _log_bottom(glider: Glider, cycles: Cycles, motion: Motion, depth: Array) -> None:
    """The altimeter hears the bottom on the way down, within its range."""
    altitude = motion.water_depth[::NODE] - depth
    echoes = (motion.pitch[::NODE] < -0.1) & (altitude < _RANGE) & (altitude > 0)
    noise = 0.1 * glider.luck.standard_normal(len(cycles))
    heights = np.maximum(altitude[echoes] + noise[echoes], 0.1)
    glider.log.add("m_altitude", cycles[echoes], heights)
    glider.log.add("m_water_depth", cycles[0], -1.0)
    glider.log.add("m_water_depth", cycles[echoes], heights + depth[echoes])


def log_science(glider: Glider, motion: Motion, way: Way) -> None:
    """Log the CTD, if its data are wanted."""
    scenario, log = glider.scenario, glider.science
    if not scenario.science and not scenario.full_rate:
        return
    flight = np.arange(len(motion.depth))
    n = _PER_CYCLE * (len(flight) - 1) + 1
    at = np.arange(n) / _PER_CYCLE
    t = way.t[0] + CYCLE * at
    depth = np.interp(at, flight, motion.depth)
    temperature, salinity = scenario.water.properties(
        t, np.interp(t, way.t, way.east), np.interp(t, way.t, way.north), depth
    )
    pressure = 1.006 * depth
    noise = np.array(_SCIENCE_NOISE)[:, None] * glider.luck.standard_normal((3, n))
    cycles = _PER_CYCLE * glider.cycle + np.arange(n)
    log.add("sci_water_temp", cycles, temperature + noise[0])
    conductivity = _S_M_PER_MS_CM * gsw.C_from_SP(salinity, temperature, pressure)
    log.add("sci_water_cond", cycles, conductivity + noise[1])
    log.add("sci_water_pressure", cycles, np.maximum(0.1 * pressure + noise[2], 0.0))
    log.add("sci_ctd41cp_timestamp", cycles, log.clock(cycles) - 0.3)


# ----------------------------------------
# One dive: the sawtooth, the way steered, the current, and what is true of it.

_DEPTH_NOISE, _PITCH_NOISE, _COMPASS_NOISE = 0.04, 0.005, 0.01


def dive(glider: Glider, segment: str) -> Flown:
    """Dive, and be at the surface again; ``segment`` names the file that logs it."""
    scenario, rng, start = glider.scenario, glider.rng, glider.cycle
    _face_the_stream(glider)
    glider.wander_trim()
    glider.find_north()
    motion = fly(glider)
    n = len(motion.depth)
    t = glider.times(start + np.arange(n))
    depth = np.clip(motion.depth + _DEPTH_NOISE * rng.standard_normal(n), 0.0, None)
    pitch = motion.pitch + _PITCH_NOISE * rng.standard_normal(n)
    believed = own_speed(depth, pitch, CYCLE) * _allowance(scenario)
    course = steer(glider, believed)
    kept = np.interp(np.arange(n), NODE * np.arange(len(course.kept)), np.unwrap(course.kept))
    compass = kept + glider.variation + _COMPASS_NOISE * rng.standard_normal(n)
    reckoning = Reckoning(depth, pitch, compass, believed, *along_heading(believed, compass, CYCLE))
    log_dive(glider, motion, course, reckoning)
    east, north = along_heading(motion.speed, kept - glider.health.compass(t), CYCLE)
    at = np.unique(np.append(np.arange(0, n, NODE), n - 1))
    far_east, far_north = glider.carried(t[at], east[at], north[at], motion.depth[at])
    way = Way(t[at], glider.east + east[at] + far_east, glider.north + north[at] + far_north)
    log_science(glider, motion, way)
    end, duration = start + n - 1, CYCLE * (n - 1)
    through = Vector(float(east[-1]) / duration, float(north[-1]) / duration)
    current = Vector(float(far_east[-1]) / duration, float(far_north[-1]) / duration)
    glider.move(end, float(east[-1] + far_east[-1]), float(north[-1] + far_north[-1]))
    truth = _truth(glider, segment, (start, end), motion, float(believed.mean()), through, current)
    return Flown(start, end, Vector(float(reckoning.east[-1]), float(reckoning.north[-1])), truth)


def _allowance(scenario: Scenario) -> float:
    """The part of depth rate over tan(pitch) that the glider takes for its speed."""
    if not scenario.allowed:
        return 1.0
    glide = steady_glide(scenario.pitch, scenario.drive, scenario.airframe)
    return 1 - scenario.allowed * (1 - tan(scenario.pitch) * glide.horizontal / glide.vertical)


def _truth(
    glider: Glider,
    segment: str,
    cycles: tuple[int, int],
    motion: Motion,
    believed: float,
    through: Vector,
    current: Vector,
) -> DiveTruth:
    start, end = (glider.time(cycle) for cycle in cycles)
    return DiveTruth(
        segment=segment,
        t_dive=start,
        t_surface=end,
        speed=float(motion.speed.mean()),
        believed_speed=believed,
        through_water=through,
        current=current,
        faults=glider.health.named(end),
        depth_rate=float(np.abs(np.diff(motion.depth)).mean() / CYCLE),
        deepest=float(motion.depth.max()),
        end=glider.place,
    )


def _face_the_stream(glider: Glider) -> None:
    """A strong current sets against the way to the waypoint that the glider had when it began."""
    goal = displacement(glider.place, glider.scenario.waypoints[glider.waypoint])
    away = hypot(goal.east, goal.north)
    began = float(glider.health.stream(np.array(glider.time(glider.cycle)))) > 0
    if away and not (began and any(glider.against)):
        glider.against = Vector(-goal.east / away, -goal.north / away)
