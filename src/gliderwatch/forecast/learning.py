"""What a dive teaches of the next surfacing. Pure."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gliderwatch.estimation.observation import are_apart
from gliderwatch.forecast import timing
from gliderwatch.forecast.constants import (
    CHI2_COVERED,
    DIVE_MEMORY,
    DRIFT_GAIN,
    FASTEST,
    FASTEST_DRIFT,
    HABIT_DIVES,
    INTERVALS_KEPT,
    LONG_DRIFT,
    MISSES_KEPT,
    SLOWEST,
    STEADY_HEADING,
    UNSEEN,
    WAYPOINTS_KEPT,
    WILD_CHANGE,
    WORST_COURSE,
)
from gliderwatch.forecast.state import Place, Surfacings, bearing, factor, is_same, plan
from gliderwatch.forecast.steering import courses
from gliderwatch.model import Array, Dive, Expected, Fix, Unusable
from gliderwatch.navigation.frame import way


def learn(
    state: Surfacings, dive: Dive, waypoint: Place | None, expected: Expected | None = None
) -> Surfacings:
    """The state after one more dive; one that has not ended changes nothing.

    Dives come in order; one whose current was corrected is taken again from the state before it.
    ``waypoint`` (degrees) is the last one told until now; ``expected`` what was made of ``state``, with which
    the ellipse is calibrated (None: nothing was). A new deployment begins anew.
    """
    end = dive.end
    if end is None:
        return state
    if state.fix is not None and are_apart(state.fix, dive.start or end):
        state = Surfacings()
    after = replace(
        _timed(state, dive, end),
        scores=_scores(state, dive, end),
        misses=_misses(state, dive, end, expected),
        bearing=bearing(state),
        waypoints=_waypoints(state.waypoints, waypoint),
        fix=end,
    )
    return _driven(_adrift(_flown(after, dive), state.fix, dive), dive)


def is_unseen(dive: Dive) -> bool:
    """Whether data are missing before the end of a dive, so that the glider may have been up unnoticed."""
    return dive.features.unobserved > UNSEEN or dive.unusable is Unusable.DATA_MISSING


def _is_stale(dive: Dive) -> bool:
    return dive.unusable is Unusable.STALE_FIX


def ground(dive: Dive) -> Array | None:
    """Velocity over ground (m/s, (2,)) between the fixes of a dive; None where one is not known or stale."""
    if dive.start is None or dive.end is None or _is_stale(dive):
        return None
    moved = way(dive.end.lat, dive.end.lon, dive.start.lat, dive.start.lon)
    return np.asarray(moved / max(dive.end.t - dive.start.t, 1.0))


def _timed(state: Surfacings, dive: Dive, end: Fix) -> Surfacings:
    """The state with the times of a dive."""
    known = replace(state, duration=dive.t_surface - dive.t_dive)
    if state.fix is None or is_unseen(dive):
        return known
    interval = max(end.t - state.fix.t, 1.0)
    errors = state.errors
    if state.intervals:
        errors = (*errors, timing.error(interval, timing.usual(state.intervals)))
    return replace(
        known,
        intervals=(*state.intervals, interval)[-INTERVALS_KEPT:],
        errors=errors[-MISSES_KEPT:],
        surface=(*state.surface, max(dive.t_dive - state.fix.t, 0.0))[-HABIT_DIVES:],
    )


def _scores(state: Surfacings, dive: Dive, end: Fix) -> tuple[float, ...]:
    """The scores of the ways of steering, after what each says of a dive and how it was.

    The way through the water is that over ground less the current: it is known without headings too.
    """
    over_ground, speed, known = ground(dive), state.speed, state.current
    if over_ground is None or speed is None or known is None or state.fix is None or state.heading is None:
        return state.scores
    met = known if dive.current is None else (dive.current.u, dive.current.v)
    really = (over_ground - met) / speed
    made, scores = courses(plan(state, speed, known), max(end.t - state.fix.t, 1.0)), []
    for score, course in zip(state.scores, made, strict=True):
        part = (1 - DIVE_MEMORY) * (1 - course.unknown)
        square = min(float(np.sum((course.heading - really) ** 2)), WORST_COURSE)
        scores.append((1 - part) * score + part * square)
    return tuple(scores)


def _misses(state: Surfacings, dive: Dive, end: Fix, expected: Expected | None) -> tuple[float, ...]:
    """The misses after one more dive, see `state.factor`."""
    if expected is None or expected.lat is None or expected.lon is None or is_unseen(dive) or _is_stale(dive):
        return state.misses
    if state.fix is None or expected.after != state.fix.t:
        return state.misses
    off = way(end.lat, end.lon, expected.lat, expected.lon)
    cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]])
    distance = math.sqrt(float(off @ np.linalg.solve(cov, off)) / CHI2_COVERED) * factor(state.misses)
    return (*state.misses, distance)[-MISSES_KEPT:]


def _waypoints(known: tuple[Place, ...], told: Place | None) -> tuple[Place, ...]:
    if told is None or (known and is_same(known[-1], told)):
        return known
    return (*known, told)[-WAYPOINTS_KEPT:]


def _flown(state: Surfacings, dive: Dive) -> Surfacings:
    """The state with the mean heading vector of a dive, from fix to fix."""
    if dive.track is None:
        return state
    dt = np.diff(dive.track.t)
    east, north = (dt @ dive.track.heading / dt.sum()).tolist()
    return replace(
        state, heading=(east, north), lengths=(*state.lengths, math.hypot(east, north))[-HABIT_DIVES:]
    )


def _adrift(state: Surfacings, before: Fix | None, dive: Dive) -> Surfacings:
    """The state with the drift at the surface before a dive."""
    if before is None or dive.start is None or state.current is None or _is_stale(dive):
        return state
    time = dive.start.t - before.t
    if time < LONG_DRIFT or is_unseen(dive):
        return state
    moved = way(dive.start.lat, dive.start.lon, before.lat, before.lon)
    beside = moved / time - state.current  # that of the dive before
    east, north = (1 - DRIFT_GAIN) * np.array(state.drift) + DRIFT_GAIN * np.clip(
        beside, -FASTEST_DRIFT, FASTEST_DRIFT
    )
    return replace(state, drift=(float(east), float(north)))


def _driven(state: Surfacings, dive: Dive) -> Surfacings:
    """The state with the current of a dive, and the speed that the glider believes."""
    if dive.current is None:
        return state
    current, change = (dive.current.u, dive.current.v), state.change
    if state.current is not None:
        square = math.dist(current, state.current) ** 2 / 2
        change = DIVE_MEMORY * change + (1 - DIVE_MEMORY) * min(square, WILD_CHANGE * change)
    state = replace(state, current=current, change=change)
    over_ground, heading = ground(dive), np.array(state.heading or (0.0, 0.0))
    if dive.track is None or over_ground is None or np.hypot(*heading) < STEADY_HEADING:
        return state
    own = float((over_ground - current) @ heading / (heading @ heading))
    return replace(state, speed=min(max(own, SLOWEST), FASTEST))
