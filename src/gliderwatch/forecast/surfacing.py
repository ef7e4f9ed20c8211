"""The next surfacing: when, where, and how sure. Pure.

A surfacing is the first fix after a dive: only then a glider is heard and seen. From that fix it drifts at
the surface, then it dives; the way to the next fix is

    x = T_s (F + u) + T_d (V h + F)

with T_s and T_d the times at the surface and under water, F the mean flow, u the drift at the surface beside
it, V the speed through the water and h the mean heading vector. `docs/next-surfacing.md` says how each
is found and how well it does.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median

import numpy as np

from gliderwatch.forecast import timing
from gliderwatch.forecast.constants import (
    ALIKE,
    COMMUNICATION,
    FLOORS,
    GPS_ERROR,
    INTERVALS_KEPT,
    MOST_AT_SURFACE,
    SLOWEST,
)
from gliderwatch.forecast.learning import learn
from gliderwatch.forecast.state import Surfacings, factor, plan
from gliderwatch.forecast.steering import WAYS, courses
from gliderwatch.model import Array, Expected
from gliderwatch.navigation.frame import from_plane

__all__ = ["Flow", "Surfacings", "expect", "learn"]

Flow = Callable[[float, float], tuple[Array, Array]]
"""Mean flow (m/s, (2,): east, north) between two times (s), and its covariance (m2/s2, (2, 2))."""


def expect(
    state: Surfacings, speed: float, speed_sigma: float, flow: Flow, surfacing_hours: float | None = None
) -> Expected | None:
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
        + dive**2 * (speed_sigma**2 * np.outer(heading, heading) + own**2 * heading_cov)
        + t_sigma**2 * np.outer(over_ground, over_ground)
        + GPS_ERROR**2 * np.eye(2)
    )
    lat, lon = from_plane(displacement, fix.lat, fix.lon)
    return Expected(
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
    theirs, last = float(np.trace(cov)) / 2, state.change
    common = ALIKE * (theirs * last) ** 0.5
    share = min(max((last - common) / (last + theirs - 2 * common), 0.0), 1.0)
    mean = share * forecast + (1 - share) * np.array(state.current)
    return mean, share * cov + (1 - share) * last * np.eye(2), share


def _heading(state: Surfacings, speed: float, flow: Array, dive: float) -> tuple[Array, Array, str]:
    """Mean heading vector ((2,)) of the next dive (s), its covariance, and the way of steering trusted most.

    The ways count by what they were worth before. Of the part of a dive that comes after the last waypoint
    known the heading is not known: any is as likely.
    """
    known = state.current or (float(flow[0]), float(flow[1]))
    made = courses(plan(state, max(state.speed or speed, SLOWEST), known), dive)
    scores = np.array(state.scores)
    weights = (scores + FLOORS) ** -2
    weights /= weights.sum()
    vectors = np.array([course.heading for course in made])
    mean = weights @ vectors
    off = vectors - mean
    unknown = np.array([course.unknown for course in made])
    own = float(weights @ (scores + unknown**2)) / 2
    cov = np.asarray((weights[:, None] * off).T @ off + own * np.eye(2))
    return mean, cov, WAYS[int(np.argmax(weights))] if state.waypoints else WAYS[0]
