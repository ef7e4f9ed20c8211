"""The way a glider steers: for its waypoints, by what it believes of itself and of the current."""

from __future__ import annotations

from math import asin, atan2, cos, hypot, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.onboard import displacement, turn
from gliderwatch.simulate.telemetry import CYCLE
from gliderwatch.simulate.vehicle import NODE, Glider

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
        kept = commanded + error
        rows.append((commanded, kept, glider.waypoint))
        east += step * (speed * sin(kept) + water.east)
        north += step * (speed * cos(kept) + water.north)
        error = memory * error + (1 - memory**2) ** 0.5 * float(kick)
    commands, headings, waypoint = zip(*rows, strict=True)
    return Course(np.array(commands), np.array(headings), np.array(waypoint))
