"""What a glider's instruments make of a dive, and write into its logs."""

from __future__ import annotations

from typing import NamedTuple

import gsw
import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.motion import Motion
from gliderwatch.simulate.onboard import nmea, offset
from gliderwatch.simulate.steering import Course
from gliderwatch.simulate.telemetry import CYCLE, SCIENCE_CYCLE
from gliderwatch.simulate.vehicle import NODE, Glider

Cycles = NDArray[np.int64]

DEEP = 200.0
"""A glider that goes deeper than this (m) has an oil pump, others a piston."""
DR_UNDERWATER, DR_AWAITING_FIX, DR_AWAITING_POSTFIX, DR_AWAITING_DIVE = 1, 2, 3, 4
"""Values of x_dr_state."""

_ROLL_NOISE = 0.02
_STRIKE = 0.7
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
    """Where the glider really is at the nodes of a dive: times (s), metres east of the sea's origin."""

    t: Array
    east: Array


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
    pitch = reckoning.pitch
    struck = glider.health.struck(t)
    if struck.any():
        to_and_fro = np.where(cycles % 2, 1.0, -1.0)
        shaken = _STRIKE * struck * to_and_fro * glider.luck.uniform(0.5, 1, (2, n))
        roll, pitch = roll + 1.5 * shaken[0], pitch + shaken[1]
    log.add("m_depth", cycles, reckoning.depth)
    log.add("m_depth_rate", cycles, np.gradient(reckoning.depth, CYCLE))
    log.add("m_pitch", cycles, pitch)
    log.add("m_roll", cycles, roll)
    log.add("m_heading", cycles, _round_the_circle(reckoning.compass))
    log.add("m_speed", cycles, reckoning.speed)
    log.add("m_avg_speed", cycles, np.cumsum(reckoning.speed) / np.arange(1, n + 1))
    log.add("m_battpos", cycles, -_INCHES * motion.pitch + 0.01 * glider.luck.standard_normal(n))


def _log_position(glider: Glider, cycles: Cycles, reckoning: Reckoning) -> None:
    """Dead reckoning: the own way and the known current since the last fix."""
    log = glider.log
    adrift = CYCLE * (cycles - glider.fix_cycle)
    east = reckoning.east + glider.water.east * adrift
    north = reckoning.north + glider.water.north * adrift
    c, s = np.cos(glider.scenario.variation), np.sin(glider.scenario.variation)
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
    log.add("c_heading", nodes, _round_the_circle(course.commanded + scenario.variation))
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
    log.add("m_leakdetect_voltage", nodes, 2.49 + 0.001 * rng.standard_normal(n))
    for place in ("forward", "science"):
        log.add(f"m_leakdetect_voltage_{place}", nodes, 2.49 + 0.001 * luck.standard_normal(n))


def _log_bottom(glider: Glider, cycles: Cycles, motion: Motion, depth: Array) -> None:
    """The altimeter hears the bottom on the way down, within its range."""
    altitude = motion.water_depth[::NODE] - depth
    heard = (motion.pitch[::NODE] < -0.1) & (altitude < _RANGE) & (altitude > 0)
    noise = 0.1 * glider.luck.standard_normal(len(cycles))
    heights = np.maximum(altitude[heard] + noise[heard], 0.1)
    glider.log.add("m_altitude", cycles[heard], heights)
    glider.log.add("m_water_depth", cycles[0], -1.0)
    glider.log.add("m_water_depth", cycles[heard], heights + depth[heard])


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
    temperature, salinity = scenario.water.properties(t, np.interp(t, way.t, way.east), depth)
    pressure = 1.006 * depth
    noise = np.array(_SCIENCE_NOISE)[:, None] * glider.luck.standard_normal((3, n))
    cycles = _PER_CYCLE * glider.cycle + np.arange(n)
    log.add("sci_water_temp", cycles, temperature + noise[0])
    conductivity = _S_M_PER_MS_CM * gsw.C_from_SP(salinity, temperature, pressure)
    log.add("sci_water_cond", cycles, conductivity + noise[1])
    log.add("sci_water_pressure", cycles, np.maximum(0.1 * pressure + noise[2], 0.0))
    log.add("sci_ctd41cp_timestamp", cycles, log.clock(cycles) - 0.3)
