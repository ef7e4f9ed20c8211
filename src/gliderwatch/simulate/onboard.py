"""Navigation as a Slocum does it on board, with its own errors. Pure.

The glider knows depth, pitch and heading under water and its position at the surface, nothing else.
Its frame is turned to magnetic north. `variation` is the sensor `m_gps_mag_var`: the angle from
magnetic to true north (rad, west positive), so that a true bearing is the magnetic one less variation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gliderwatch.model import Array

_A, _E2 = 6378137.0, 6.69437999014e-3
_FLAT = 0.15
_SMOOTH = 5


class Point(NamedTuple):
    """A place: degrees north and east."""

    lat: float
    lon: float


class Vector(NamedTuple):
    """East and north parts of a displacement (m) or a velocity (m/s)."""

    east: float
    north: float


def _radii(lat: Array) -> tuple[Array, Array]:
    """Radii of curvature along the meridian and across it (m), WGS 84, at a latitude (degrees)."""
    w = 1 - _E2 * np.sin(np.radians(lat)) ** 2
    return _A * (1 - _E2) / w**1.5, _A / np.sqrt(w)


def wrapped(degrees: Array) -> Array:
    """A longitude or a difference of two, brought to -180 to 180 degrees.

    >>> wrapped(np.array([180.25, -180.25, -84.0])).tolist()
    [-179.75, 179.75, -84.0]
    """
    return np.asarray(np.where(np.abs(degrees) > 180.0, (degrees + 180.0) % 360.0 - 180.0, degrees))


def offset(origin: Point, east: Array, north: Array) -> tuple[Array, Array]:
    """Latitude and longitude (degrees) some tens of kilometres or less from ``origin`` (m)."""
    meridian, _ = _radii(np.asarray(origin.lat))
    lat = origin.lat + np.degrees(north / meridian)
    middle = (lat + origin.lat) / 2
    _, across = _radii(middle)
    return lat, wrapped(origin.lon + np.degrees(east / (across * np.cos(np.radians(middle)))))


def displacement(origin: Point, to: Point) -> Vector:
    """East and north (m) from one place to another; the inverse of `offset`."""
    meridian, _ = _radii(np.asarray(origin.lat))
    middle = (to.lat + origin.lat) / 2
    _, across = _radii(np.asarray(middle))
    east = np.radians(wrapped(np.asarray(to.lon - origin.lon))) * across * np.cos(np.radians(middle))
    return Vector(float(east), float(np.radians(to.lat - origin.lat) * meridian))


def turn(vector: Vector, angle: float) -> Vector:
    """``vector`` turned clockwise by ``angle`` (rad): from true to magnetic axes by the variation."""
    c, s = np.cos(angle), np.sin(angle)
    return Vector(float(vector.east * c + vector.north * s), float(vector.north * c - vector.east * s))


def own_speed(depth: Array, pitch: Array, step: float) -> Array:
    """Horizontal speed through the water (m/s) as the glider believes it: depth rate over tan(pitch).

    No angle of attack, so it is about a tenth too high; near inflections, where pitch is too small to
    divide by, the last good value is held. ``depth`` (m) and ``pitch`` (rad, up positive) every
    ``step`` s, shape (n,).
    """
    edge = _SMOOTH // 2
    rate = np.convolve(
        np.gradient(np.pad(depth, edge, mode="edge"), step), np.ones(_SMOOTH) / _SMOOTH, "valid"
    )
    good = np.abs(pitch) > _FLAT
    speed = np.where(good, -rate / np.tan(np.where(good, pitch, 1.0)), 0.0)
    last = np.maximum.accumulate(np.where(good, np.arange(len(speed)), 0))
    return np.asarray(np.clip(speed[last], 0.0, None))


def along_heading(speed: Array, heading: Array, step: float) -> tuple[Array, Array]:
    """East and north displacement (m) since the first sample, in the frame that ``heading`` refers to."""
    east, north = speed * np.sin(heading), speed * np.cos(heading)
    return step * (np.cumsum(east) - east[0]), step * (np.cumsum(north) - north[0])


def nmea(degrees: Array) -> Array:
    """Degrees as gliders write them, DDMM.mmmm.

    >>> float(nmea(np.array(-27.5)))
    -2730.0
    """
    whole = np.trunc(degrees)
    return np.asarray(100 * whole + 60 * (degrees - whole))


def written(degrees: Array) -> Array:
    """As `nmea`, with the four decimals that gliders send of a fix; 60 minutes are the next degree.

    >>> written(np.array([-27.51, -1.9999999999])).tolist()
    [-2730.6, -200.0]
    """
    value = np.round(nmea(degrees), 4)
    next_degree = 100 * np.round(np.asarray(degrees))
    return np.asarray(np.where(np.abs(value) % 100 < 60, value, next_degree))
