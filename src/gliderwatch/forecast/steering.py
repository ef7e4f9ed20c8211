"""Where a glider heads: the ways of steering that are thought of, and what each says of a dive. Pure.

A glider steers for a waypoint, with or without allowance for the current it knows; the pilot may steer by
other means as well. Which of it, shows in the dives before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gliderwatch.forecast.constants import (
    COURSE_CHANGE,
    FAR,
    HEADING_ERROR,
    MOST_ALLOWANCE,
    SLOWEST,
    STEADY_HEADING,
)
from gliderwatch.model import Array, readonly

WAYS = ("as before", "beside the waypoint", "at the waypoint", "at the waypoint against the current")
"""The ways of steering, in the order of what is told of them."""
COURSES = readonly(np.arange(-math.pi, math.pi, math.radians(1.0)))
"""rad: courses that are thought of where no waypoint is known."""
AGAINST = "on the course before, against the current"
"""The last of them, where no waypoint is known."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What a glider knows of its way at a surfacing.

    ``heading`` ((2,), mean vector of the last dive), ``bearing`` (rad, counter-clockwise from east, None: not
    known) of the waypoint of that dive at its start, or of the course that it steered, ``length`` of the mean
    heading vector on a straight way; ``current`` (m/s, (2,)) and ``speed`` (m/s) it reckons with; ``goals``
    (m, (2,)) from the fix: the waypoint and the one after it, as far as known.
    """

    heading: Array
    bearing: float | None
    length: float
    current: Array
    speed: float
    goals: tuple[Array, ...] = ()


@dataclass(frozen=True, slots=True)
class Course:
    """Mean heading vector ((2,)) of a dive by one way of steering, and the part of it, 0 to 1, that comes
    after the last waypoint known, where the heading is not known."""

    heading: Array
    unknown: float = 0.0


def courses(plan: Plan, time: float) -> tuple[Course, ...]:
    """The course of a dive of that ``time`` (s) by each of `WAYS`.

    Without a waypoint it is as before, or against the current on the course that was steered before: with a
    tide the heading changes from dive to dive, the course does not.
    """
    before = Course(plan.heading)
    if not plan.goals:
        if plan.bearing is None:
            return (before,) * len(WAYS)
        far = FAR * np.array([math.cos(plan.bearing), math.sin(plan.bearing)])
        return before, before, before, _along(replace(plan, goals=(far,)), time, 0.0, against=True)
    beside = 0.0
    if plan.bearing is not None:
        beside = math.atan2(plan.heading[1], plan.heading[0]) - plan.bearing
    aside = before if plan.bearing is None else _along(plan, time, beside, against=False)
    return before, aside, _along(plan, time, 0.0, against=False), _along(plan, time, 0.0, against=True)


def steered(heading: Array, speed: float, current: Array, before: float | None) -> float | None:
    """The course (rad, counter-clockwise from east) that a glider meant to make good on a dive.

    With the mean ``heading`` vector ((2,)) that it steered it reckoned with a ``speed`` through the water and
    the ``current`` ((2,), both m/s) of the dive before. In a current stronger than it several courses lead to
    one heading: then the one ``before`` tells which. None where it circled.
    """
    if float(np.hypot(*heading)) < STEADY_HEADING:
        return None
    left = np.cos(COURSES) * current[1] - np.sin(COURSES) * current[0]
    aims = COURSES - np.arcsin(np.clip(left / max(speed, SLOWEST), -MOST_ALLOWANCE, MOST_ALLOWANCE))
    squares = (_apart(aims, math.atan2(heading[1], heading[0])) / HEADING_ERROR) ** 2
    if before is not None:
        squares += np.minimum(_apart(COURSES, before) / COURSE_CHANGE, 1.0) ** 2
    return float(COURSES[int(np.argmin(squares))])


def _apart(angles: Array, angle: float) -> Array:
    """By how much angles (rad) differ from one."""
    return np.asarray(np.abs((angles - angle + math.pi) % (2 * math.pi) - math.pi))


def _along(plan: Plan, time: float, beside: float, against: bool) -> Course:
    """The course from waypoint to waypoint, an angle (rad) ``beside`` them, or ``against`` the current."""
    here, left, heading = np.zeros(2), time, np.zeros(2)
    for goal in plan.goals:
        way = goal - here
        distance = max(float(np.hypot(*way)), 1.0)
        aim = math.atan2(way[1], way[0]) + beside
        if against:
            aim -= _allowance(plan, way / distance)
        unit = plan.length * np.array([math.cos(aim), math.sin(aim)])
        progress = float((plan.speed * unit + plan.current) @ way) / distance
        spent = min(left, distance / progress) if progress > 0 else left
        heading, left, here = heading + spent * unit, left - spent, goal
        if left <= 0:
            break
    return Course(heading / time, left / time)


def _allowance(plan: Plan, along: Array) -> float:
    """Angle (rad) to the right of the way ``along`` ((2,), unit) that makes good for the current.

    >>> north = np.array([0.0, 1.0])
    >>> plan = Plan(north, None, 1.0, np.array([0.1, 0.0]), 0.2)
    >>> round(_allowance(plan, north), 4)  # a current to the right: steer to the left
    -0.5236
    """
    left = float(along[0] * plan.current[1] - along[1] * plan.current[0])
    return math.asin(min(max(left / max(plan.speed, SLOWEST), -MOST_ALLOWANCE), MOST_ALLOWANCE))
