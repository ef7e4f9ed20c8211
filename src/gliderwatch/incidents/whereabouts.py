"""Where a glider is at any moment, with its error; between two surfacings it has no fix. Pure."""

from __future__ import annotations

from math import atan2, degrees, exp, sqrt

import numpy as np

from gliderwatch.forecast.constants import CHI2_COVERED, GPS_ERROR
from gliderwatch.incidents.constants import FLOW_SIGMA, UNKNOWN_FLOW
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.model import Array, NextSurfacing
from gliderwatch.navigation.geodesy import from_plane, to_plane
from gliderwatch.sea.gauss_markov import FlowParams

Pair = tuple[float, float]


def whereabouts(
    expected: NextSurfacing | None, place: Pair | None, flow: Pair | None, due: float | None, now: float
) -> DriftEllipse | None:
    """Where a glider is at `now` (s) with 95 %; None where no position is known.

    `place` is its last fix (degrees), `flow` the last known current (east, north; m/s). Until the surfacing
    that is `expected` it is on the straight way there; what makes that place uncertain (course, speed,
    current) lasts for the dive, so that the error grows in step with the time. From then on until it is
    overdue, `due` (s), it is about there, and less surely; after that it may drift (`drift`).
    """
    if expected is None:
        return None if place is None else DriftEllipse(*place, GPS_ERROR, GPS_ERROR, 0.0)
    if place is None or expected.lat is None or expected.lon is None or now >= (due or expected.t):
        return drift(expected, place, flow, now)
    part = max(now - expected.after, 0.0) / max(expected.t - expected.after, 1.0)
    way = to_plane(expected.lat, expected.lon, *place) * min(part, 1.0)
    cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]]) * part**2
    return ellipse(from_plane(way, *place), cov + GPS_ERROR**2 * np.eye(2))


def drift(expected: NextSurfacing, place: Pair | None, flow: Pair | None, now: float) -> DriftEllipse | None:
    """Where a glider is at `now` (s) that stopped to fly; None where no position is known.

    It drifts with the last known `flow` (east, north; m/s) from where it was expected, since then. The
    ellipse also reaches to where it would be, had it drifted since its last fix, at `place` (degrees). It
    grows as the integral of an Ornstein-Uhlenbeck process of `FLOW_SIGMA` and the memory of a current.
    """
    u = np.array(flow if flow is not None else (0.0, 0.0))
    if expected.lat is not None and expected.lon is not None:
        origin, since = (expected.lat, expected.lon), expected.t
        cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]])
        if place is not None:
            flown = to_plane(*origin, *place) - u * (expected.t - expected.after)
            cov = cov + np.outer(flown, flown) / CHI2_COVERED
    elif place is not None:
        origin, since, cov = place, expected.after, np.zeros((2, 2))
    else:
        return None
    elapsed = max(now - since, 0.0)
    memory = FlowParams().memory
    r = elapsed / memory
    spread = FLOW_SIGMA if flow is not None else UNKNOWN_FLOW * FLOW_SIGMA
    cov = cov + 2 * (spread * memory) ** 2 * (r - 1 + exp(-r)) * np.eye(2)
    return ellipse(from_plane(u * elapsed, *origin), cov)


def ellipse(place: Pair, cov: Array) -> DriftEllipse:
    """The 95 % ellipse about a place (degrees) of a covariance of east and north (m2)."""
    values, vectors = np.linalg.eigh(cov)
    east, north = vectors[:, 1]
    minor, major = (sqrt(CHI2_COVERED * max(float(v), 0.0)) for v in values)
    return DriftEllipse(*place, major, minor, degrees(atan2(east, north)) % 180.0)
