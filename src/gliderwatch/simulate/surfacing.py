"""At the surface: drift, fixes, and the depth-averaged current that follows from the misfit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.onboard import Point, Vector, displacement, nmea, offset, turn
from gliderwatch.simulate.scenario import FaultKind, FixIn
from gliderwatch.simulate.telemetry import CYCLE
from gliderwatch.simulate.vehicle import NODE, Flown, Glider

_BURST = 16
_BETWEEN = 8
_WAVES = 0.04
_GUST = 0.3
_FAST_NOISE = 0.1


class _Plan(NamedTuple):
    """Cycles of a surfacing: up, file closed, next file opened, first fix, last row of fixes, down."""

    up: int
    closed: int
    opened: int
    first: int
    last: int
    down: int


class _Fixes(NamedTuple):
    """Fixes: cycles, latitudes and longitudes (degrees)."""

    cycles: NDArray[np.int64]
    lat: Array
    lon: Array

    def point(self, i: int) -> Point:
        return Point(float(self.lat[i]), float(self.lon[i]))


def surface(glider: Glider, flown: Flown | None) -> tuple[int, int]:
    """Drift at the surface until the next dive, and reckon the current of the dive before (if any).

    Returns:
        The last cycle of the file of that dive, and the first one of the next file.
    """
    plan = _plan(glider)
    fixes = _drift(glider, plan)
    drift = _seen_drift(fixes)
    _log(glider, plan, fixes)
    if flown:
        _reckon(glider, flown, plan, fixes, drift)
    glider.fix, glider.fix_cycle = fixes.point(-1), int(fixes.cycles[-1])
    glider.drift = drift
    return plan.closed, plan.opened


def _plan(glider: Glider) -> _Plan:
    """Draw the times of a surfacing.

    With the fix in the dive's own file, that file is closed after the fix, GPS is off during the
    communication, and the next file begins after it. Otherwise the file is closed at once, and
    the next one, opened in the next cycle, holds fix and communication.
    """

    def cycles(least: float, most: float) -> int:
        return round(glider.rng.uniform(least, most) / CYCLE)

    up, talk = glider.cycle, cycles(*glider.scenario.communications)
    first = up + cycles(40, 70)
    if glider.scenario.fix_in is FixIn.OWN:
        closed = first + cycles(80, 120)
        opened = closed + talk
        last = opened + cycles(24, 40)
    else:
        closed = up + cycles(8, 20)
        opened = closed + 1
        last = first + _BURST + talk
    return _Plan(up, closed, opened, first, last, last + _BURST + cycles(12, 40))


def _drift(glider: Glider, plan: _Plan) -> _Fixes:
    """Drift with current and wind from surfacing to diving; fixes on the way, rounded as in NMEA.

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
    bursts = [start + np.arange(_BURST) for start in (plan.first, plan.last)]
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
    return _Fixes(cycles, lat, lon)


def _seen_drift(fixes: _Fixes) -> Vector:
    """Drift (m/s, true north) between the first and the last row of fixes."""
    duration = CYCLE * float(fixes.cycles[-_BURST:].mean() - fixes.cycles[:_BURST].mean())
    first = Point(float(fixes.lat[:_BURST].mean()), float(fixes.lon[:_BURST].mean()))
    last = Point(float(fixes.lat[-_BURST:].mean()), float(fixes.lon[-_BURST:].mean()))
    way = displacement(first, last)
    return Vector(way.east / duration, way.north / duration)


def _reckon(glider: Glider, flown: Flown, plan: _Plan, fixes: _Fixes, drift: Vector) -> None:
    """Reckon and log the depth-averaged current: provisional at the first fix, final before diving.

    The provisional one takes all of the misfit between the fixes for current under water. The final
    one knows the drift at the surface and puts both ends of the dive where it began and ended.
    """
    way = displacement(glider.fix, fixes.point(0))
    between = CYCLE * (plan.first - glider.fix_cycle)
    before = CYCLE * (flown.start - glider.fix_cycle)
    after = CYCLE * (plan.first - flown.end)
    under = Vector(
        way.east - glider.drift.east * before - drift.east * after,
        way.north - glider.drift.north * before - drift.north * after,
    )
    for kind, cycle, made, duration in (
        ("initial", plan.first, way, between),
        ("final", plan.last, under, CYCLE * (flown.end - flown.start)),
    ):
        magnetic = turn(made, glider.scenario.variation)
        water = Vector(
            (magnetic.east - flown.own.east) / duration, (magnetic.north - flown.own.north) / duration
        )
        glider.water = _reported(glider, flown, water)
        for name in ("m_water_v", f"m_{kind}_water_v"):
            glider.log.add(f"{name}x", cycle, glider.water.east)
            glider.log.add(f"{name}y", cycle, glider.water.north)


def _reported(glider: Glider, flown: Flown, water: Vector) -> Vector:
    """The current as the glider reports it, wrong where it has that fault."""
    wrong = sum(glider.scenario.sizes(FaultKind.DAC_WRONG, flown.truth.t_surface))
    way = float(np.hypot(*flown.own))
    return Vector(water.east - wrong * flown.own.north / way, water.north + wrong * flown.own.east / way)


def _log(glider: Glider, plan: _Plan, fixes: _Fixes) -> None:
    """Log GPS and depth; a newly opened file repeats the fix known so far, as gliders do."""
    log, rng = glider.log, glider.rng
    lat, lon = np.round(nmea(fixes.lat), 4), np.round(nmea(fixes.lon), 4)
    known = np.searchsorted(fixes.cycles, plan.opened) - 1
    old = fixes.point(int(known)) if known >= 0 else glider.fix
    for name, values, value in (("lat", lat, old.lat), ("lon", lon, old.lon)):
        log.add(f"m_gps_{name}", plan.opened, np.round(nmea(np.asarray(value)), 4))
        log.add(f"m_gps_{name}", fixes.cycles, values)
        log.add(f"m_{name}", fixes.cycles, values)
    log.add("m_gps_status", [plan.up, plan.opened], [2, 2])
    log.add("m_gps_status", fixes.cycles, 0)
    log.add("m_gps_mag_var", fixes.cycles, glider.scenario.variation)
    cycles = np.arange(plan.up + 1, plan.down)
    log.add("m_depth", cycles, np.abs(_WAVES * rng.standard_normal(len(cycles))))
