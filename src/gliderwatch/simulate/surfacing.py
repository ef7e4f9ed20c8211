"""At the surface: fixes, and the depth-averaged current that follows from the misfit."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np

from gliderwatch.simulate.fixes import Fixes, Plan, drift, heard, make_plan, seen_drift
from gliderwatch.simulate.instruments import DR_AWAITING_DIVE, DR_AWAITING_FIX, DR_AWAITING_POSTFIX
from gliderwatch.simulate.onboard import Vector, displacement, turn, written
from gliderwatch.simulate.scenario import DiveTruth
from gliderwatch.simulate.telemetry import CYCLE, SCIENCE_CYCLE
from gliderwatch.simulate.vehicle import Flown, Glider

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
    known = heard(glider, plan, fixes)
    seen = seen_drift(glider, known)
    _log(glider, plan, fixes, known)
    truth = _reckon(glider, flown, plan, known, seen) if flown else None
    glider.fix, glider.fix_cycle = known.point(-1), int(known.cycles[-1])
    glider.drift = seen
    if plan.restart:
        glider.lmc = glider.fix
        glider.log.mission = plan.opened
        glider.science.mission = round(plan.opened * CYCLE / SCIENCE_CYCLE)
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
        magnetic = turn(made, glider.scenario.variation)
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
        reported=turn(glider.water, -glider.scenario.variation),
        artefacts=tuple(name for name, there in named.items() if there),
    )


def _reported(glider: Glider, flown: Flown, water: Vector) -> Vector:
    """The current as the glider reports it, wrong where it has that fault."""
    wrong, way = glider.health.dac(flown.truth.t_surface), hypot(*flown.own)
    if not wrong or not way:
        return water
    return Vector(water.east - wrong * flown.own.north / way, water.north + wrong * flown.own.east / way)


def _log(glider: Glider, plan: Plan, fixes: Fixes, known: Fixes) -> None:
    """Log GPS and depth; a newly opened file repeats the fix known so far, as gliders do."""
    log, rng = glider.log, glider.rng
    fresh = fixes.cycles >= known.cycles[0]
    files = [plan.opened, *(plan.own_file or ())[:1]]
    for name, values, old in (("lat", fixes.lat, glider.fix.lat), ("lon", fixes.lon, glider.fix.lon)):
        reported = np.where(fresh, values, old)
        for opened in files:
            i = int(np.searchsorted(fixes.cycles, opened)) - 1
            repeated = reported[i] if i >= 0 else old
            log.add(f"m_gps_{name}", opened, written(np.asarray(repeated)))
        log.add(f"m_gps_{name}", fixes.cycles, written(reported))
        log.add(f"m_{name}", fixes.cycles[fresh], written(values[fresh]))
    place = glider.to_lmc(known.point(-1))
    log.add("m_x_lmc", known.cycles[-1], place.east)
    log.add("m_y_lmc", known.cycles[-1], place.north)
    log.add("m_gps_status", [plan.up, *files], 2)
    log.add("m_gps_status", fixes.cycles, np.where(fresh, 0, 1))
    log.add("m_gps_mag_var", fixes.cycles, glider.scenario.variation)
    states = (plan.up, DR_AWAITING_FIX), (int(known.cycles[0]), DR_AWAITING_POSTFIX)
    for cycle, state in (*states, (plan.last, DR_AWAITING_DIVE)):
        log.add("x_dr_state", cycle, state)
    cycles = np.arange(plan.up + 1, plan.down)
    log.add("m_depth", cycles, np.abs(_WAVES * rng.standard_normal(len(cycles))))
