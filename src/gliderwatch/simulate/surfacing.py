"""At the surface: drift, fixes, and the depth-averaged current that follows from the misfit. Pure."""

from __future__ import annotations

from dataclasses import replace
from math import hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.dive import DR_AWAITING_DIVE, DR_AWAITING_FIX, DR_AWAITING_POSTFIX
from gliderwatch.simulate.flight import Point, Vector, displacement, offset, turn, written
from gliderwatch.simulate.scenario import DiveTruth, FixIn
from gliderwatch.simulate.telemetry import CYCLE, SCIENCE_CYCLE
from gliderwatch.simulate.vehicle import NODE, Flown, Glider

# ----------------------------------------
# Drift at the surface, and the fixes that a glider has of it.

BURST = 16
"""Fixes in a row at both ends of a stay at the surface."""

_BETWEEN = 8
_GUST = 0.3
_FAST_NOISE = 0.1
_SEARCHING = (60.0, 240.0)


class Plan(NamedTuple):
    """Cycles of a surfacing: up, file closed, next dive's file opened, first fix, last row of fixes,
    down; first and last cycle of the surface's own file, if it has one; whether the first fixes
    reported are the old one, and whether a new mission begins."""

    up: int
    closed: int
    opened: int
    first: int
    last: int
    down: int
    own_file: tuple[int, int] | None
    stale: bool
    restart: bool


class Fixes(NamedTuple):
    """Fixes: cycles, latitudes and longitudes (degrees)."""

    cycles: NDArray[np.int64]
    lat: Array
    lon: Array

    def point(self, i: int) -> Point:
        """The i-th place."""
        return Point(float(self.lat[i]), float(self.lon[i]))

    def since(self, cycle: int) -> Fixes:
        """The fixes from a cycle on."""
        i = int(np.searchsorted(self.cycles, cycle))
        return Fixes(self.cycles[i:], self.lat[i:], self.lon[i:])


def make_plan(glider: Glider) -> Plan:
    """Draw the times of a surfacing.

    With the fix in the dive's own file, that file is closed after the fix, GPS is off during the
    communication, and the next file begins after it. Otherwise the file is closed at once, and
    the next one, opened in the next cycle, holds fix and communication. A glider with a file for
    each stay at the surface opens it after the communication, or in the latter case before it, and
    closes it before the next dive's.
    """

    def cycles(least: float, most: float) -> int:
        return round(glider.rng.uniform(least, most) / CYCLE)

    scenario, rates, luck = glider.scenario, glider.scenario.rates, glider.luck.random(3)
    up, talk = glider.cycle, cycles(*scenario.communications)
    first, brief = up + cycles(40, 70), round((10 + 50 * luck[0]) / CYCLE)
    own_file = None
    if scenario.fix_in is FixIn.OWN:
        closed = first + cycles(80, 120)
        opened = closed + talk
        if scenario.surface_segments:
            own_file = (opened, opened + brief)
            opened += brief + 1
        last = opened + cycles(24, 40)
    else:
        closed = up + cycles(8, 20)
        opened = closed + 1
        last = first + BURST + talk
        if scenario.surface_segments:
            own_file = (opened, last + BURST + brief)
            opened = own_file[1] + 1
    down = max(last + BURST + cycles(12, 40), opened + 1)
    stale, restart = bool(luck[1] < rates.stale_fix), bool(luck[2] < rates.restart)
    return Plan(up, closed, opened, first, last, down, own_file, stale, restart)


def drift(glider: Glider, plan: Plan) -> Fixes:
    """Drift with current and wind from surfacing to diving; fixes on the way.

    The error of a fix is mostly slow, so it differs between the ends of a surfacing, not between fixes.
    """
    scenario, rng = glider.scenario, glider.rng
    nodes = np.unique(np.append(np.arange(plan.up, plan.down, NODE), plan.down))
    t = scenario.start + CYCLE * nodes
    gust = 1 + _GUST * rng.standard_normal(2)
    east = scenario.wind_drift.east * gust[0] * (t - t[0])
    north = scenario.wind_drift.north * gust[1] * (t - t[0])
    far_east, far_north = glider.carried(t, east, north)
    east, north = east + far_east, north + far_north
    between = np.arange(plan.first, plan.closed if scenario.fix_in is FixIn.OWN else plan.last, _BETWEEN)
    bursts = [start + np.arange(BURST) for start in (plan.first, plan.last)]
    cycles = np.unique(np.concatenate([between, *bursts]))
    slow = scenario.gps_sigma * rng.standard_normal((2, 2))
    fast = _FAST_NOISE * scenario.gps_sigma * rng.standard_normal((2, len(cycles)))
    ends = [plan.first, plan.last]
    lat, lon = offset(
        glider.place,
        np.interp(cycles, nodes, east) + np.interp(cycles, ends, slow[0]) + fast[0],
        np.interp(cycles, nodes, north) + np.interp(cycles, ends, slow[1]) + fast[1],
    )
    glider.move(plan.down, float(east[-1]), float(north[-1]))
    return Fixes(cycles, lat, lon)


def shared_fixes(glider: Glider, plan: Plan, fixes: Fixes) -> Fixes:
    """The fixes that the glider really has: without those in whose place the old one is reported."""
    if not plan.stale:
        return fixes
    if glider.scenario.fix_in is FixIn.OWN:
        return fixes.since(plan.last)
    return fixes.since(plan.first + round(glider.luck.uniform(*_SEARCHING) / CYCLE))


def seen_drift(glider: Glider, fixes: Fixes) -> Vector:
    """Drift (m/s, true north) between the first and the last row of fixes; without these the drift before."""
    duration = CYCLE * float(fixes.cycles[-BURST:].mean() - fixes.cycles[:BURST].mean())
    if duration < 60:
        return glider.drift
    lon = fixes.lon if np.ptp(fixes.lon) < 180 else fixes.lon % 360  # a mean over the antimeridian
    first = Point(float(fixes.lat[:BURST].mean()), float(lon[:BURST].mean()))
    last = Point(float(fixes.lat[-BURST:].mean()), float(lon[-BURST:].mean()))
    way = displacement(first, last)
    return Vector(way.east / duration, way.north / duration)


# ----------------------------------------
# At the surface: fixes, and the depth-averaged current that follows from the misfit.

_WAVES = 0.04
_GARBAGE = 0.3
"""Strength (m/s, a component) of a current that is nonsense."""


def surface(glider: Glider, flown: Flown | None) -> tuple[Plan, DiveTruth | None]:
    """Drift at the surface until the next dive, and reckon the current of the dive before (if any).

    Returns:
        The times of the surfacing, and the truth of the dive with what was reported of it.
    """
    plan = make_plan(glider)
    fixes = drift(glider, plan)
    shared = shared_fixes(glider, plan, fixes)
    seen = seen_drift(glider, shared)
    _log(glider, plan, fixes, shared)
    truth = _reckon(glider, flown, plan, shared, seen) if flown else None
    glider.fix, glider.fix_cycle = shared.point(-1), int(shared.cycles[-1])
    glider.drift = seen
    if plan.restart:
        glider.lmc = glider.fix
        glider.log.missions.append(plan.opened)
        glider.science.missions.append(round(plan.opened * CYCLE / SCIENCE_CYCLE))
    return plan, truth


def _reckon(glider: Glider, flown: Flown, plan: Plan, fixes: Fixes, drifted: Vector) -> DiveTruth:
    """Reckon and log the depth-averaged current: provisional at the first fix, final before diving.

    The provisional one takes all of the misfit between the fixes for current under water. The final
    one knows the drift at the surface and puts both ends of the dive where it began and ended.
    """
    first = int(fixes.cycles[0])
    way = displacement(glider.fix, fixes.point(0))
    before = CYCLE * (flown.start - glider.fix_cycle)
    after = CYCLE * (first - flown.end)
    under = Vector(
        way.east - glider.drift.east * before - drifted.east * after,
        way.north - glider.drift.north * before - drifted.north * after,
    )
    reports = [("initial", first, way, CYCLE * (first - glider.fix_cycle))] if first < plan.last else []
    reports.append(("final", plan.last, under, CYCLE * (flown.end - flown.start)))
    garbage = plan.restart and glider.luck.random() < glider.scenario.rates.dac_garbage
    for kind, cycle, made, duration in reports:
        magnetic = turn(made, glider.variation)
        water = Vector(
            (magnetic.east - flown.own.east) / duration, (magnetic.north - flown.own.north) / duration
        )
        if kind == "final" and garbage:
            water = Vector(*(_GARBAGE * glider.luck.standard_normal(2)))
        glider.water = _reported(glider, flown, water)
        for name in ("m_water_v", f"m_{kind}_water_v"):
            glider.log.add(f"{name}x", cycle, glider.water.east)
            glider.log.add(f"{name}y", cycle, glider.water.north)
    named = {"stale_fix": plan.stale, "restart": plan.restart, "dac_garbage": garbage}
    return replace(
        flown.truth,
        reported=turn(glider.water, -glider.variation),
        artefacts=tuple(name for name, there in named.items() if there),
    )


def _reported(glider: Glider, flown: Flown, water: Vector) -> Vector:
    """The current as the glider reports it, wrong where it has that fault."""
    wrong, way = glider.health.dac(flown.truth.t_surface), hypot(*flown.own)
    if not wrong or not way:
        return water
    return Vector(water.east - wrong * flown.own.north / way, water.north + wrong * flown.own.east / way)


def _log(glider: Glider, plan: Plan, fixes: Fixes, shared: Fixes) -> None:
    """Log GPS and depth; a newly opened file repeats the fix known so far, as gliders do."""
    log, rng = glider.log, glider.rng
    fresh = fixes.cycles >= shared.cycles[0]
    files = [plan.opened, *(plan.own_file or ())[:1]]
    for name, values, old in (("lat", fixes.lat, glider.fix.lat), ("lon", fixes.lon, glider.fix.lon)):
        reported = np.where(fresh, values, old)
        for opened in files:
            i = int(np.searchsorted(fixes.cycles, opened)) - 1
            repeated = reported[i] if i >= 0 else old
            log.add(f"m_gps_{name}", opened, written(np.asarray(repeated)))
        log.add(f"m_gps_{name}", fixes.cycles, written(reported))
        log.add(f"m_{name}", fixes.cycles[fresh], written(values[fresh]))
    place = glider.to_lmc(shared.point(-1))
    log.add("m_x_lmc", shared.cycles[-1], place.east)
    log.add("m_y_lmc", shared.cycles[-1], place.north)
    log.add("m_gps_status", [plan.up, *files], 2)
    log.add("m_gps_status", fixes.cycles, np.where(fresh, 0, 1))
    log.add("m_gps_mag_var", fixes.cycles, glider.variation)
    states = (plan.up, DR_AWAITING_FIX), (int(shared.cycles[0]), DR_AWAITING_POSTFIX)
    for cycle, state in (*states, (plan.last, DR_AWAITING_DIVE)):
        log.add("x_dr_state", cycle, state)
    cycles = np.arange(plan.up + 1, plan.down)
    log.add("m_depth", cycles, np.abs(_WAVES * rng.standard_normal(len(cycles))))
