"""The next surfacing: when, where, and how sure, learnt from the past ones. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from statistics import median

import numpy as np

from gliderwatch.forecast import timing
from gliderwatch.forecast.constants import (
    ALIKE,
    CHI2_COVERED,
    COMMUNICATION,
    CURRENT_CHANGE,
    DIVE_MEMORY,
    DOUBT,
    DRIFT_GAIN,
    FASTEST,
    FASTEST_DRIFT,
    FIRST_MISSES,
    FIRST_MISSES_WEIGHT,
    FLOORS,
    GPS_ERROR,
    HABIT_DIVES,
    INTERVALS_KEPT,
    LEGS_KEPT,
    LONG_DRIFT,
    MISSES_KEPT,
    MISSES_MEMORY,
    MOST_AT_SURFACE,
    MOST_STRETCH,
    SAME_WAYPOINT,
    SLOWEST,
    STEADY_HEADING,
    UNSEEN,
    WAYPOINT_LATE,
    WAYPOINTS_HEARD,
    WAYPOINTS_KEPT,
    WILD_CHANGE,
    WORST_COURSE,
)
from gliderwatch.forecast.steering import UNSENT, WAYS, Leg, Plan, courses
from gliderwatch.forecast.timing import quantile
from gliderwatch.model import Array, Dive, Fix, NextSurfacing, Segment, Track, Unusable, readonly
from gliderwatch.navigation.flight import joined
from gliderwatch.navigation.geodesy import displacement, from_plane, to_plane, velocity

# ----------------------------------------
# What is remembered of past surfacings, and what follows from it for the way ahead.

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
    ``scores`` of the ways of steering, mean square errors of their courses; ``misses``, see `factor`;
    ``legs`` the last ones where no waypoint was ever sent, their places in degrees (latitude, longitude).
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
    legs: tuple[Leg, ...] = ()


def is_same(a: Place, b: Place) -> bool:
    """Whether two waypoints are the same one.

    >>> is_same((38.3892, -73.5), (38.389, -73.5)), is_same((38.38, -73.5), (38.389, -73.5))
    (True, False)
    """
    return a == b or math.hypot(*displacement(*a, *b).tolist()) < SAME_WAYPOINT


@lru_cache(maxsize=64)  # asked for four times a dive
def goals(state: Surfacings) -> tuple[Array, ...]:
    """The waypoint, and the one that came after it when the glider last went there (m from the fix, (2,))."""
    if state.fix is None or not state.waypoints:
        return ()
    *past, now = state.waypoints
    after = [b for a, b in zip(past, state.waypoints[1:], strict=True) if is_same(a, now)]
    lat, lon = state.fix.lat, state.fix.lon
    return tuple(readonly(displacement(*place, lat, lon)) for place in (now, *after[-1:]))


def bearing(state: Surfacings) -> float | None:
    """Bearing of the waypoint from the fix (rad, counter-clockwise from east); None without one."""
    ahead = goals(state)
    return math.atan2(ahead[0][1], ahead[0][0]) if ahead else None


def plan(state: Surfacings, speed: float, current: Vector) -> Plan:
    """What the glider knows of its way: it reckons with a speed and a current (m/s)."""
    heading, length = np.array(state.heading or (0.0, 0.0)), max(state.lengths, default=1.0)
    return Plan(heading, state.bearing, length, np.array(current), speed, goals(state), _legs_from(state))


def _legs_from(state: Surfacings) -> tuple[Leg, ...]:
    """The legs, with places in m from the fix; none where a waypoint is known."""
    if state.fix is None or state.waypoints or not state.legs:
        return ()
    lat, lon = np.array([leg.place for leg in state.legs]).T
    places = to_plane(lat, lon, state.fix.lat, state.fix.lon).tolist()
    return tuple(replace(leg, place=(x, y)) for leg, (x, y) in zip(state.legs, places, strict=True))


def factor(misses: Sequence[float]) -> float:
    """By how much the axes of the ellipse must be longer than reckoned, for 95 % of places to be in it.

    ``misses`` are the distances from the places expected, in parts of the ellipse as reckoned.
    """
    found = quantile(misses, FIRST_MISSES, FIRST_MISSES_WEIGHT, MISSES_MEMORY)
    return min(found, MOST_STRETCH)


# ----------------------------------------
# Which waypoint a glider was bound for when it came up.

WaypointLog = tuple[tuple[float, float, float], ...]
"""Waypoints as they were reported: time (s), latitude and longitude (degrees), in order of time."""


def read_waypoints(before: WaypointLog, segment: Segment) -> WaypointLog:
    """The waypoints reported until now and those in one more segment; what changes nothing is left out."""
    t, lat, lon = joined(segment.get("waypoint_lat"), segment.get("waypoint_lon"))
    if not len(t):
        return before
    reported = zip(t.tolist(), lat.tolist(), lon.tolist(), strict=True)
    out: list[tuple[float, float, float]] = []
    for report in sorted({*before, *reported}):
        if not out or report[1:] != out[-1][1:]:
            out.append(report)
    return tuple(out[-WAYPOINTS_HEARD:])


def active_waypoint(log: WaypointLog, t: float) -> Place | None:
    """The waypoint at a fix at time ``t`` (s), of those reported; None before any.

    >>> active_waypoint(((0.0, 27.0, -84.0), (9000.0, 27.5, -84.0)), 8000.0)
    (27.0, -84.0)
    """
    before = [(lat, lon) for reported, lat, lon in log if reported <= t + WAYPOINT_LATE]
    return before[-1] if before else None


# ----------------------------------------
# What a dive teaches of the next surfacing.


def learn(
    state: Surfacings, dive: Dive, waypoint: Place | None, expected: NextSurfacing | None = None
) -> Surfacings:
    """The state after one more dive; one that has not ended changes nothing.

    Dives come in order; one whose current was corrected is taken again from the state before it.
    ``waypoint`` (degrees) is the last one reported until now; ``expected`` what was made of ``state``, with
    which the ellipse is calibrated (None: nothing was).
    """
    end = dive.end
    if end is None:
        return state
    waypoints, heading = _waypoints(state.waypoints, waypoint), _heading_flown(state, dive)
    lengths = (
        state.lengths if dive.track is None or heading is None else (*state.lengths, math.hypot(*heading))
    )
    speed, current, change = _driven(state, dive, heading)
    intervals, errors, surface = _timed(state, dive, end)
    return Surfacings(
        fix=end,
        duration=dive.t_surface - dive.t_dive,
        intervals=intervals,
        errors=errors,
        surface=surface,
        drift=_drift(state, dive),
        heading=heading,
        lengths=lengths[-HABIT_DIVES:],
        speed=speed,
        current=current,
        change=change,
        bearing=bearing(state),
        waypoints=waypoints,
        scores=_scores(state, dive, end),
        misses=_misses(state, dive, end, expected),
        legs=() if waypoints else (*state.legs, *_halves(state, dive))[-LEGS_KEPT:],
    )


def _halves(state: Surfacings, dive: Dive) -> Iterator[Leg]:
    """The two halves of a dive as legs; none where it circled, or where it is not known what the glider
    reckoned with."""
    if dive.track is None or dive.start is None or state.current is None or state.speed is None:
        return
    track, n = dive.track, len(dive.track.heading)
    middle = int(np.searchsorted(track.t, (track.t[0] + track.t[-1]) / 2))
    for part in (slice(0, middle), slice(middle, n)):
        dt = np.diff(track.t)[part]
        time = float(dt.sum())
        east, north = (dt @ track.heading[part] / max(time, 1.0)).tolist()
        if time > 0 and math.hypot(east, north) > STEADY_HEADING:
            place = from_plane(track.x[part.start], dive.start.lat, dive.start.lon)
            yield Leg(place, math.atan2(north, east), state.current, state.speed, time)


def is_unseen(dive: Dive) -> bool:
    """Whether data are missing before the end of a dive, so that the glider may have been up unnoticed."""
    return dive.features.unobserved > UNSEEN or dive.unusable is Unusable.DATA_MISSING


def _is_stale(dive: Dive) -> bool:
    return dive.unusable is Unusable.STALE_FIX


def ground(dive: Dive) -> Array | None:
    """Velocity over ground (m/s, (2,)) between the fixes of a dive; None where one is not known or stale."""
    if dive.start is None or dive.end is None or _is_stale(dive):
        return None
    return velocity(dive.start, dive.end)


def called(state: Surfacings, fix: Fix, waypoint: Place | None) -> Surfacings:
    """The state after a surfacing of which nothing but a call has told: it begins the way ahead, and nothing
    is learnt of the way there."""
    return replace(state, fix=fix, waypoints=_waypoints(state.waypoints, waypoint))


def _timed(
    state: Surfacings, dive: Dive, end: Fix
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """Intervals, their errors, and times at the surface, with those of a dive."""
    if state.fix is None or is_unseen(dive):
        return state.intervals, state.errors, state.surface
    interval = max(end.t - state.fix.t, 1.0)
    errors = state.errors
    if state.intervals:
        errors = (*errors, timing.error(interval, timing.usual(state.intervals)))
    surface = (*state.surface, max(dive.t_dive - state.fix.t, 0.0))[-HABIT_DIVES:]
    return (*state.intervals, interval)[-INTERVALS_KEPT:], errors[-MISSES_KEPT:], surface


def _scores(state: Surfacings, dive: Dive, end: Fix) -> tuple[float, ...]:
    """The scores of the ways of steering, after what each says of a dive and how it was.

    The way through the water is that over ground less the current: it is known without headings too.
    """
    over_ground, speed, current = ground(dive), state.speed, state.current
    if over_ground is None or speed is None or current is None or state.fix is None or state.heading is None:
        return state.scores
    met = current if dive.current is None else (dive.current.u, dive.current.v)
    u, v = over_ground.tolist()
    east, north = (u - met[0]) / speed, (v - met[1]) / speed
    made, scores = courses(plan(state, speed, current), max(end.t - state.fix.t, 1.0)), []
    for score, course in zip(state.scores, made, strict=True):
        part = (1 - DIVE_MEMORY) * (1 - course.unknown)
        x, y = course.heading.tolist()
        square = min((x - east) ** 2 + (y - north) ** 2, WORST_COURSE)
        scores.append((1 - part) * score + part * square)
    return tuple(scores)


def _misses(state: Surfacings, dive: Dive, end: Fix, expected: NextSurfacing | None) -> tuple[float, ...]:
    """The misses after one more dive, see `state.factor`."""
    if expected is None or expected.lat is None or expected.lon is None or is_unseen(dive) or _is_stale(dive):
        return state.misses
    if state.fix is None or expected.after != state.fix.t:
        return state.misses
    off = displacement(end.lat, end.lon, expected.lat, expected.lon)
    (x, y), east, north, cross = off.tolist(), expected.east, expected.north, expected.cross
    square = (x * x * north - 2 * x * y * cross + y * y * east) / (east * north - cross**2)
    distance = math.sqrt(square / CHI2_COVERED) * factor(state.misses)
    return (*state.misses, distance)[-MISSES_KEPT:]


def _waypoints(earlier: tuple[Place, ...], reported: Place | None) -> tuple[Place, ...]:
    if reported is None or (earlier and is_same(earlier[-1], reported)):
        return earlier
    return (*earlier, reported)[-WAYPOINTS_KEPT:]


def _heading_flown(state: Surfacings, dive: Dive) -> Vector | None:
    """The mean heading vector of a dive, from fix to fix; that of the last one where it is not known."""
    return state.heading if dive.track is None else _mean_heading(dive.track)


@lru_cache(maxsize=64)  # a dive comes again when its current is corrected
def _mean_heading(track: Track) -> Vector:
    dt = track.t[1:] - track.t[:-1]
    east, north = (dt @ track.heading / dt.sum()).tolist()
    return east, north


def _drift(state: Surfacings, dive: Dive) -> Vector:
    """The drift at the surface with that before a dive."""
    before = state.fix
    if before is None or dive.start is None or state.current is None or _is_stale(dive):
        return state.drift
    if dive.start.t - before.t < LONG_DRIFT or is_unseen(dive):
        return state.drift
    drift = velocity(before, dive.start).tolist()
    east, north = (
        (1 - DRIFT_GAIN) * old + DRIFT_GAIN * min(max(new - flow, -FASTEST_DRIFT), FASTEST_DRIFT)
        for old, new, flow in zip(state.drift, drift, state.current, strict=True)
    )  # the current is that of the dive before
    return east, north


def _driven(
    state: Surfacings, dive: Dive, heading: Vector | None
) -> tuple[float | None, Vector | None, float]:
    """The speed that the glider believes, the current, and its usual change, with those of a dive."""
    if dive.current is None:
        return state.speed, state.current, state.change
    current, change = (dive.current.u, dive.current.v), state.change
    if state.current is not None:
        square = math.dist(current, state.current) ** 2 / 2
        change = DIVE_MEMORY * change + (1 - DIVE_MEMORY) * min(square, WILD_CHANGE * change)
    over_ground, way = ground(dive), np.array(heading or (0.0, 0.0))
    speed = state.speed
    if dive.track is not None and over_ground is not None and np.hypot(*way) >= STEADY_HEADING:
        own = float((over_ground - current) @ way / (way @ way))
        speed = min(max(own, SLOWEST), FASTEST)
    return speed, current, change


# ----------------------------------------
# The next surfacing: when, where, and how sure. Pure.
#
# A surfacing is the first fix after a dive: only then a glider is heard and seen. From that fix it drifts
# at the surface, then it dives; the way to the next fix is
#
#     x = T_s (F + u) + T_d (V h + F)
#
# with T_s and T_d the times at the surface and under water, F the mean flow, u the drift at the surface
# beside it, V the speed through the water and h the mean heading vector. `docs/next-surfacing.md` says how
# each is found and how well it does.

__all__ = ["Flow", "Surfacings", "expect", "learn"]

_BOTH = readonly(np.eye(2))
"""What two components have alike."""
Flow = Callable[[float, float], tuple[Array, Array]]
"""Mean flow (m/s, (2,): east, north) between two times (s), and its covariance (m2/s2, (2, 2))."""


def expect(
    state: Surfacings, speed: float, speed_sigma: float, flow: Flow, surfacing_hours: float | None = None
) -> NextSurfacing | None:
    """The next surfacing after the last one; None before the first.

    ``speed`` through the water with its standard error (m/s), ``flow`` the forecast of the flow;
    ``surfacing_hours`` is the interval configured, which counts beside those seen until there are four.
    """
    fix = state.fix
    if fix is None:
        return None
    interval, why = _interval(state, surfacing_hours)
    t_sigma = interval * timing.spread(state.errors)
    at_surface = min(median(state.surface) if state.surface else COMMUNICATION, MOST_AT_SURFACE * interval)
    dive = interval - at_surface
    water, water_cov, share = _water(state, *flow(fix.t, fix.t + interval))
    # the last current is what the glider's own speed left of its way: the two belong together
    own = speed if state.speed is None else share * speed + (1 - share) * state.speed
    heading, heading_cov, way = _heading(state, own, water, dive)
    over_ground = own * heading + water
    displacement = dive * over_ground + at_surface * (water + np.array(state.drift))
    cov = factor(state.misses) ** 2 * (
        interval**2 * water_cov
        + dive**2 * (speed_sigma**2 * (heading[:, None] * heading) + own**2 * heading_cov)
        + t_sigma**2 * (over_ground[:, None] * over_ground)
        + GPS_ERROR**2 * _BOTH
    )
    lat, lon = from_plane(displacement.tolist(), fix.lat, fix.lon)
    return NextSurfacing(
        after=fix.t,
        t=fix.t + interval,
        t_sigma=t_sigma,
        lat=lat,
        lon=lon,
        east=float(cov[0, 0]),
        cross=float(cov[0, 1]),
        north=float(cov[1, 1]),
        source=f"time: {why}; heading: {way}",
    )


def _interval(state: Surfacings, hours: float | None) -> tuple[float, str]:
    """The next interval (s), and what it rests on."""
    if hours is None and not state.intervals:
        return state.duration + COMMUNICATION, "as long as the first dive"
    missing = INTERVALS_KEPT - len(state.intervals) if hours is not None else 0
    configured = (hours * 3600,) * missing if hours is not None else ()
    why = "as configured" if not state.intervals else "as configured and before" if missing else "as before"
    return timing.usual((*configured, *state.intervals)), why


def _water(state: Surfacings, forecast: Array, cov: Array) -> tuple[Array, Array, float]:
    """Mean flow (m/s, (2,)), its covariance (m2/s2), and the share of the forecast in it.

    The rest is the last current, which on many missions is as good. The two are weighed by their variances as
    estimates whose errors are `ALIKE`: both miss what the flow does next.
    """
    if state.current is None:
        return forecast, cov, 1.0
    theirs, last = float(cov[0, 0] + cov[1, 1]) / 2, state.change
    common = ALIKE * (theirs * last) ** 0.5
    share = min(max((last - common) / (last + theirs - 2 * common), 0.0), 1.0)
    mean = share * forecast + (1 - share) * np.array(state.current)
    return mean, share * cov + (1 - share) * last * _BOTH, share


def _heading(state: Surfacings, speed: float, flow: Array, dive: float) -> tuple[Array, Array, str]:
    """Mean heading vector ((2,)) of the next dive (s), its covariance, and the way of steering trusted most.

    The ways count by what they were worth before. Of the part of a dive that comes after the last waypoint
    known the heading is not known: any is as likely.
    """
    current = state.current or (float(flow[0]), float(flow[1]))
    made = courses(plan(state, max(state.speed or speed, SLOWEST), current), dive)
    scores = np.array(state.scores)
    weights = (scores + FLOORS) ** -2
    weights /= weights.sum()
    vectors = np.array([course.heading for course in made])
    mean = weights @ vectors
    off = vectors - mean
    unknown = np.array([course.unknown for course in made])
    own = float(weights @ (scores + unknown**2)) / 2
    cov = np.asarray((weights[:, None] * off).T @ off + own * _BOTH)
    best = int(np.argmax(weights))
    if not state.waypoints:
        return mean, cov, UNSENT if state.legs and best == len(WAYS) - 1 else WAYS[0]
    return mean, cov, WAYS[best]
