"""What is remembered of past surfacings, and what follows from it for the way ahead. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.forecast.constants import (
    CURRENT_CHANGE,
    DOUBT,
    FIRST_MISSES,
    FIRST_MISSES_WEIGHT,
    MISSES_MEMORY,
    MOST_STRETCH,
    SAME_WAYPOINT,
)
from gliderwatch.forecast.steering import WAYS, Plan
from gliderwatch.forecast.timing import quantile
from gliderwatch.model import Array, Fix
from gliderwatch.navigation.frame import way

Place = tuple[float, float]
"""Latitude and longitude (degrees)."""
Vector = tuple[float, float]
"""East and north."""


@dataclass(frozen=True, slots=True)
class Surfacings:
    """What is known after a surfacing.

    ``fix`` of it; ``duration`` (s) of the last dive, ``intervals`` (s) between the last surfacings, with the
    `timing.error` of those before they were over; ``surface`` (s) the times between fix and dive, and
    ``drift`` (m/s) in them beside the current. ``heading`` the mean vector of the last dive (None: not
    seen yet), ``lengths`` those of the last ones; ``speed`` (m/s) that the glider believes; ``current``
    (m/s) of the last dive, ``change`` ((m/s)2, a component) the mean square of its changes;
    ``bearing`` (rad) of the waypoint when that dive began. ``waypoints`` in order, the present one last;
    ``scores`` of the ways of steering, mean square errors of their courses; ``misses``, see `factor`.
    """

    fix: Fix | None = None
    duration: float = 0.0
    intervals: tuple[float, ...] = ()
    errors: tuple[float, ...] = ()
    surface: tuple[float, ...] = ()
    drift: Vector = (0.0, 0.0)
    heading: Vector | None = None
    lengths: tuple[float, ...] = ()
    speed: float | None = None
    current: Vector | None = None
    change: float = CURRENT_CHANGE**2
    bearing: float | None = None
    waypoints: tuple[Place, ...] = ()
    scores: tuple[float, ...] = (DOUBT,) * len(WAYS)
    misses: tuple[float, ...] = ()


def is_same(a: Place, b: Place) -> bool:
    """Whether two waypoints are the same one.

    >>> is_same((38.3892, -73.5), (38.389, -73.5)), is_same((38.38, -73.5), (38.389, -73.5))
    (True, False)
    """
    return a == b or float(np.hypot(*way(*a, *b))) < SAME_WAYPOINT


def goals(state: Surfacings) -> tuple[Array, ...]:
    """The waypoint, and the one that came after it when the glider last went there (m from the fix, (2,))."""
    if state.fix is None or not state.waypoints:
        return ()
    *past, now = state.waypoints
    after = [b for a, b in zip(past, state.waypoints[1:], strict=True) if is_same(a, now)]
    return tuple(way(*place, state.fix.lat, state.fix.lon) for place in (now, *after[-1:]))


def bearing(state: Surfacings) -> float | None:
    """Bearing of the waypoint from the fix (rad, counter-clockwise from east); None without one."""
    ahead = goals(state)
    return math.atan2(ahead[0][1], ahead[0][0]) if ahead else None


def plan(state: Surfacings, speed: float, current: Vector) -> Plan:
    """What the glider knows of its way: it reckons with a speed and a current (m/s)."""
    heading, length = np.array(state.heading or (0.0, 0.0)), max(state.lengths, default=1.0)
    return Plan(heading, state.bearing, length, np.array(current), speed, goals(state))


def factor(misses: Sequence[float]) -> float:
    """By how much the axes of the ellipse must be longer than reckoned, for 95 % of places to be in it.

    ``misses`` are the distances from the places expected, in parts of the ellipse as reckoned.
    """
    found = quantile(misses, FIRST_MISSES, FIRST_MISSES_WEIGHT, MISSES_MEMORY)
    return min(found, MOST_STRETCH)
