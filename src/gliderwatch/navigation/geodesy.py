"""Local planes, compass headings and magnetic to true north. Pure.

A plane has its origin at a fix, x to the east and y to the north, in metres. It is meant for the
length of a dive (kilometres): distances use the radii of curvature of WGS 84 at the mean latitude
of the two ends, so that displacements over a dive are right to better than a metre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array, Fix, readonly

_SEMI_MAJOR = 6378137.0
_ECCENTRICITY2 = 6.69437999014e-3


def radii(lat: float | Array) -> tuple[Array, Array]:
    """Metres per radian of latitude and of longitude at latitude `lat` (degrees), WGS 84."""
    phi = np.radians(np.asarray(lat, dtype=np.float64))
    w2 = 1 - _ECCENTRICITY2 * np.sin(phi) ** 2
    meridian = _SEMI_MAJOR * (1 - _ECCENTRICITY2) / w2**1.5
    parallel = _SEMI_MAJOR / np.sqrt(w2) * np.cos(phi)
    return meridian, parallel


def _radii_of_point(lat: float) -> tuple[float, float]:
    """`radii` at one latitude: an array of one number takes ten times as long."""
    phi = math.radians(lat)
    w2 = 1 - _ECCENTRICITY2 * math.sin(phi) ** 2
    return _SEMI_MAJOR * (1 - _ECCENTRICITY2) / w2**1.5, _SEMI_MAJOR / math.sqrt(w2) * math.cos(phi)


def to_plane(lat: float | Array, lon: float | Array, lat0: float, lon0: float) -> Array:
    """Metres east and north, shape (..., 2), of positions (degrees) seen from an origin (degrees).

    >>> to_plane(10.0, 20.001, 10.0, 20.0).round(1).tolist()
    [109.6, 0.0]
    >>> to_plane(0.0, -179.999, 0.0, 179.999).round(0).tolist()
    [223.0, 0.0]
    """
    lat, lon = np.asarray(lat, dtype=np.float64), np.asarray(lon, dtype=np.float64)
    meridian, parallel = radii((lat + lat0) / 2)
    dlon = (lon - lon0 + 180.0) % 360.0 - 180.0
    return np.stack([parallel * np.radians(dlon), meridian * np.radians(lat - lat0)], axis=-1)


@lru_cache(maxsize=1024)
def displacement(lat: float, lon: float, lat0: float, lon0: float) -> Array:
    """`to_plane` of one point, shape (2,), remembered: fixes and waypoints come again and again."""
    meridian, parallel = _radii_of_point((lat + lat0) / 2)
    dlon = (lon - lon0 + 180.0) % 360.0 - 180.0
    return readonly([parallel * math.radians(dlon), meridian * math.radians(lat - lat0)])


def velocity(start: Fix, end: Fix) -> Array:
    """Mean velocity over ground (m/s, (2,): east, north) from one fix to another, at least 1 s later."""
    moved = displacement(end.lat, end.lon, start.lat, start.lon)
    return np.asarray(moved / max(end.t - start.t, 1.0))


def from_plane(x: Sequence[float] | Array, lat0: float, lon0: float) -> tuple[float, float]:
    """Latitude and longitude (degrees) of one point (m east, m north) of the plane at an origin.

    >>> lat, lon = from_plane(to_plane(38.5, -63.2, 38.0, -63.0), 38.0, -63.0)
    >>> round(lat, 6), round(lon, 6)
    (38.5, -63.2)
    """
    lat, (east, north) = lat0, map(float, x)
    for _ in range(4):  # the radii depend on the latitude sought; this converges like 1e-3 a round
        lat = lat0 + math.degrees(north / _radii_of_point((lat + lat0) / 2)[0])
    lon = lon0 + math.degrees(east / _radii_of_point((lat + lat0) / 2)[1])
    return lat, (lon + 180.0) % 360.0 - 180.0


def heading_vectors(heading: float | Array) -> Array:
    """Unit vectors (east, north), shape (..., 2), of compass headings (rad, clockwise from north).

    >>> heading_vectors(np.pi / 2).round(6).tolist()
    [1.0, 0.0]
    """
    heading = np.asarray(heading, dtype=np.float64)
    return np.stack([np.sin(heading), np.cos(heading)], axis=-1)


def magnetic_to_true(vectors: Array, declination: float) -> Array:
    """Vectors (east, north), shape (..., 2), given relative to magnetic north, relative to true north.

    `declination` (rad) is positive where magnetic north lies east of true north; a Slocum's
    ``m_gps_mag_var`` has the other sign. A bearing grows by the declination.

    >>> magnetic_to_true(np.array([0.0, 1.0]), np.pi / 6).round(3).tolist()
    [0.5, 0.866]
    """
    c, s = np.cos(declination), np.sin(declination)
    rotation: NDArray[np.float64] = np.array([[c, s], [-s, c]])
    return np.asarray(vectors @ rotation.T, dtype=np.float64)
