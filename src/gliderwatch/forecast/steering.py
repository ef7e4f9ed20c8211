"""Where a glider heads: the ways of steering that are thought of, and what each says of a dive. Pure.

A glider steers for a waypoint, with or without allowance for the current it knows; the pilot may steer by
other means as well. Which of it, shows in the dives before.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.forecast.constants import (
    ANY_HEADING,
    GOAL_BEARINGS,
    GOAL_DISTANCES,
    GOAL_REACHED,
    GOAL_RINGS,
    HEADING_ERROR,
    LEG_STEPS,
    MOST_ALLOWANCE,
    NEW_GOAL,
    SLOWEST,
)
from gliderwatch.model import Array, readonly

WAYS = ("as before", "beside the waypoint", "at the waypoint", "at the waypoint against the current")
"""The ways of steering, in the order of what is told of them."""
UNSENT = "to where it headed before, against the current"
"""The last of them, where no waypoint is known."""
_BEARINGS = 2 * math.pi * np.arange(GOAL_BEARINGS) / GOAL_BEARINGS
_GOALS = readonly(
    np.outer(np.geomspace(*GOAL_DISTANCES, GOAL_RINGS), np.exp(1j * _BEARINGS))
    .ravel()[:, None]
    .view(np.float64)
)
"""m from the fix, (n, 2): where a glider may head that sends no waypoint."""


@dataclass(frozen=True, slots=True)
class Leg:
    """A part of a dive: the ``place`` of its begin ((2,), m from the fix), its mean ``heading`` (rad,
    counter-clockwise from east), ``current`` ((2,)) and ``speed`` (m/s) that the glider reckoned with, and
    its ``time`` (s)."""

    place: tuple[float, float]
    heading: float
    current: tuple[float, float]
    speed: float
    time: float


@dataclass(frozen=True, slots=True)
class Plan:
    """What a glider knows of its way at a surfacing.

    ``heading`` ((2,), mean vector of the last dive), ``bearing`` (rad, counter-clockwise from east, None: not
    known) of the waypoint of that dive at its start, ``length`` of the mean heading vector on a straight way;
    ``current`` (m/s, (2,)) and ``speed`` (m/s) it reckons with; ``goals`` (m, (2,)) from the fix: the
    waypoint and the one after it, as far as known, and where none is the ``legs`` flown before.
    """

    heading: Array
    bearing: float | None
    length: float
    current: Array
    speed: float
    goals: tuple[Array, ...] = ()
    legs: tuple[Leg, ...] = ()


@dataclass(frozen=True, slots=True)
class Course:
    """Mean heading vector ((2,)) of a dive by one way of steering, and the part of it, 0 to 1, that comes
    after the last waypoint known, where the heading is not known."""

    heading: Array
    unknown: float = 0.0


def courses(plan: Plan, time: float) -> tuple[Course, ...]:
    """The course of a dive of that ``time`` (s) by each of `WAYS`.

    Without a waypoint it is as before, or against the current to where it headed before: with a tide the
    heading changes from dive to dive, the goal does not.
    """
    before = Course(plan.heading)
    if not plan.goals:
        return before, before, before, _to_unsent_goal(plan, time) if plan.legs else before
    beside = 0.0
    if plan.bearing is not None:
        beside = math.atan2(plan.heading[1], plan.heading[0]) - plan.bearing
    aside = before if plan.bearing is None else _along(plan, time, beside, against=False)
    return before, aside, _along(plan, time, 0.0, against=False), _along(plan, time, 0.0, against=True)


def _to_unsent_goal(plan: Plan, time: float) -> Course:
    """The course of a dive of that ``time`` (s) to where the glider headed before, against the current.

    Where that is, its headings show: in a tide it aims otherwise on each dive, and from another place, and it
    all points to one goal. Goals all around compete (Bayes' rule from leg to leg, with a new goal now and
    then: the forward pass of a hidden Markov model), and the course is the mean over what is left of them.
    """
    weights = np.full(len(_GOALS), 1 / len(_GOALS))
    for likelihood in _likelihoods(plan.legs):
        weights = ((1 - NEW_GOAL) * weights + NEW_GOAL / len(weights)) * likelihood
        weights /= weights.sum()
    current, speed = np.array([plan.current]), np.array([max(plan.speed, SLOWEST)])
    headings, there = _steered(np.zeros((1, 2)), current, speed, np.array([time]))
    return Course(plan.length * (weights @ headings[0]), float(weights @ there[0]))


def _likelihoods(legs: Sequence[Leg]) -> Array:
    """How well each goal explains the heading of each leg, (k, n)."""
    places = np.array([leg.place for leg in legs])
    speeds = np.array([max(leg.speed, SLOWEST) for leg in legs])
    currents, times = np.array([leg.current for leg in legs]), np.array([leg.time for leg in legs])
    headings, there = _steered(places, currents, speeds, times)
    aims = np.arctan2(headings[:, :, 1], headings[:, :, 0])
    off = _apart(aims, np.array([[leg.heading] for leg in legs])) / HEADING_ERROR
    return np.where(there < 1, np.exp(-(off**2) / 2), 0.0) + ANY_HEADING


def _steered(places: Array, currents: Array, speeds: Array, times: Array) -> tuple[Array, Array]:
    """Mean heading vectors ((k, n, 2)) of ways from places ((k, 2), m) to each of the goals, against currents
    ((k, 2), m/s), at speeds and for times ((k,), m/s and s); and the part of the time after the goal is
    reached ((k, n))."""
    here = np.repeat(places[:, None, :], len(_GOALS), axis=1)
    headings, there = np.zeros_like(here), np.zeros(here.shape[:2])
    speeds, step = speeds[:, None], (times / LEG_STEPS)[:, None, None]
    under_way = np.ones(here.shape[:2], dtype=bool)
    for _ in range(LEG_STEPS):
        way = _GOALS - here
        distance = np.maximum(np.hypot(way[:, :, 0], way[:, :, 1]), 1.0)
        under_way &= distance > GOAL_REACHED
        x, y = way[:, :, 0] / distance, way[:, :, 1] / distance
        left = x * currents[:, None, 1] - y * currents[:, None, 0]
        sine = np.clip(left / speeds, -MOST_ALLOWANCE, MOST_ALLOWANCE)
        cosine = np.sqrt(1 - sine**2)
        heading = np.stack([x * cosine + y * sine, y * cosine - x * sine], axis=2) * under_way[:, :, None]
        headings += heading / LEG_STEPS
        there += ~under_way / LEG_STEPS
        here = here + step * (speeds[:, :, None] * heading + currents[:, None, :])
    return headings, there


def _apart(angles: Array, others: Array) -> Array:
    """By how much angles (rad) differ from others."""
    return np.asarray(np.abs((angles - others + math.pi) % (2 * math.pi) - math.pi))


def _along(plan: Plan, time: float, beside: float, against: bool) -> Course:
    """The course from waypoint to waypoint, an angle (rad) ``beside`` them, or ``against`` the current."""
    # complex numbers, east + i north: arrays of two take ten times as long
    current = complex(*plan.current.tolist())
    here, left, heading = 0j, time, 0j
    for place in plan.goals:
        goal = complex(*place.tolist())
        way = goal - here
        distance = max(abs(way), 1.0)
        aim = cmath.phase(way) + beside
        if against:
            aim -= _allowance(plan.speed, current, way / distance)
        unit = cmath.rect(plan.length, aim)
        progress = ((plan.speed * unit + current) * way.conjugate()).real / distance
        spent = min(left, distance / progress) if progress > 0 else left
        heading, left, here = heading + spent * unit, left - spent, goal
        if left <= 0:
            break
    return Course(np.array([heading.real, heading.imag]) / time, left / time)


def _allowance(speed: float, current: complex, along: complex) -> float:
    """Angle (rad) to the right of the way ``along`` (of length 1) that makes good for a ``current`` at a
    ``speed`` (m/s); vectors are east + i north.

    >>> round(_allowance(0.2, 0.1 + 0j, 1j), 4)  # to the north, a current to the right: steer to the left
    -0.5236
    """
    left = (along.conjugate() * current).imag
    return math.asin(min(max(left / max(speed, SLOWEST), -MOST_ALLOWANCE), MOST_ALLOWANCE))
