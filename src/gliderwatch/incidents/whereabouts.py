"""Where a glider is at any moment, with its error: between two surfacings nothing tells it. Pure."""

from __future__ import annotations

from math import atan2, degrees, sqrt

import numpy as np

from gliderwatch.forecast.constants import CHI2_COVERED, GPS_ERROR
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.incidents.overdue import drift
from gliderwatch.model import Array, NextSurfacing
from gliderwatch.navigation.geodesy import from_plane, to_plane

Pair = tuple[float, float]


def whereabouts(
    expected: NextSurfacing | None, place: Pair | None, flow: Pair | None, due: float | None, now: float
) -> DriftEllipse | None:
    """Where a glider is at `now` (s) with 95 %; None where no position is known.

    `place` is its last fix (degrees), `flow` the last known current (east, north; m/s). Until the surfacing
    that is `expected` it is on the straight way there; what makes that place uncertain (course, speed,
    current) lasts for the dive, so that the error grows in step with the time. From then on until it is
    overdue, `due` (s), it is about there, and less surely; after that it may drift (`overdue.drift`).
    """
    if expected is None:
        return None if place is None else DriftEllipse(*place, GPS_ERROR, GPS_ERROR, 0.0)
    if place is None or expected.lat is None or expected.lon is None or now >= (due or expected.t):
        return drift(expected, place, flow, now)
    part = max(now - expected.after, 0.0) / max(expected.t - expected.after, 1.0)
    way = to_plane(expected.lat, expected.lon, *place) * min(part, 1.0)
    cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]]) * part**2
    return ellipse(from_plane(way, *place), cov + GPS_ERROR**2 * np.eye(2))


def ellipse(place: Pair, cov: Array) -> DriftEllipse:
    """The 95 % ellipse about a place (degrees) of a covariance of east and north (m2)."""
    values, vectors = np.linalg.eigh(cov)
    east, north = vectors[:, 1]
    minor, major = (sqrt(CHI2_COVERED * max(float(v), 0.0)) for v in values)
    return DriftEllipse(*place, major, minor, degrees(atan2(east, north)) % 180.0)
