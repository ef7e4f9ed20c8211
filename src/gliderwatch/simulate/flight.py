"""How a simulated glider flies, and how its own navigation reckons. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from gliderwatch.model import Array
from gliderwatch.navigation.geodesy import radii

# ----------------------------------------
# Navigation as a Slocum does it on board, with its own errors. Pure.
#
# The glider knows depth, pitch and heading under water and its position at the surface, nothing else.
# Its frame is turned to magnetic north. `variation` is the sensor `m_gps_mag_var`: the angle from
# magnetic to true north (rad, west positive), so that a true bearing is the magnetic one less variation.

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


def wrapped(degrees: Array) -> Array:
    """A longitude or a difference of two, brought to -180 to 180 degrees.

    >>> wrapped(np.array([180.25, -180.25, -84.0])).tolist()
    [-179.75, 179.75, -84.0]
    """
    return np.asarray(np.where(np.abs(degrees) > 180.0, (degrees + 180.0) % 360.0 - 180.0, degrees))


def offset(origin: Point, east: Array, north: Array) -> tuple[Array, Array]:
    """Latitude and longitude (degrees) some tens of kilometres or less from ``origin`` (m)."""
    lat = origin.lat + np.degrees(north / radii(origin.lat)[0])
    return lat, wrapped(origin.lon + np.degrees(east / radii((lat + origin.lat) / 2)[1]))


def displacement(origin: Point, to: Point) -> Vector:
    """East and north (m) from one place to another; the inverse of `offset`."""
    east = np.radians(wrapped(np.asarray(to.lon - origin.lon))) * radii((to.lat + origin.lat) / 2)[1]
    return Vector(float(east), float(np.radians(to.lat - origin.lat) * radii(origin.lat)[0]))


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


# ----------------------------------------
# Steady flight of a buoyancy-driven glider. Pure.
#
# Source: Merckelbach, Smeed and Griffiths (2010), Vertical water velocities from underwater gliders,
# J. Atmos. Oceanic Technol. 27, 547-563: balance of lift, drag and net buoyancy, the angle of attack
# following from pitch alone. Coefficients of a Slocum: Merckelbach et al. (2019), A dynamic flight
# model for Slocum gliders, J. Atmos. Oceanic Technol. 36, 281-296.

GRAVITY = 9.81
DENSITY = 1025.0
_STALL = 0.6
_EFFICIENCY = 0.55


@dataclass(frozen=True, slots=True)
class Airframe:
    """Coefficients of the flight model.

    ``parasite_drag`` C_D0 and ``induced_drag`` C_D1 (1/rad^2) in C_D = C_D0 + C_D1 alpha^2,
    ``lift_slope`` a (1/rad, hull and wings) in C_L = a alpha, ``area`` S (m^2) they refer to.
    """

    parasite_drag: float = 0.15
    induced_drag: float = 10.5
    lift_slope: float = 7.5
    area: float = 0.1


@dataclass(frozen=True, slots=True)
class Thruster:
    """A thruster that pushes along the hull with ``thrust`` (N) on climbs, and on dives if ``on_dives``.

    A Slocum with 410 cc that climbs at a pitch of 0.48 rad with 4 W makes 0.39 m/s in depth (electa,
    2022): 2.8 N.
    """

    thrust: float = 2.8
    on_dives: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.thrust <= 20:
            raise ValueError(f"a thrust of {self.thrust:g} N: it is above 0, at most 20")

    @property
    def command(self) -> float:
        """What it is commanded to (% of its full power)."""
        return min(15 * self.thrust, 100.0)

    def power(self, glide: Glide) -> float:
        """Electrical power (W) in a glide."""
        return self.thrust * glide.speed / _EFFICIENCY


@dataclass(frozen=True, slots=True)
class Glide:
    """Horizontal and vertical speed through the water (m/s, both positive) and angle of attack (rad)."""

    horizontal: float
    vertical: float
    attack: float

    @property
    def speed(self) -> float:
        """Speed along the path (m/s)."""
        return sqrt(self.horizontal**2 + self.vertical**2)


def steady_glide(
    pitch: float, drive: float, airframe: Airframe, *, drag: float = 1.0, thrust: float = 0.0
) -> Glide:
    """The steady glide at a pitch and a net buoyancy.

    With gamma = theta + alpha the angle of the path, q = rho U^2 S / 2, B = rho g V and T the thrust:
    q (C_D0 + C_D1 alpha^2) = B sin(gamma) + T cos(alpha) along the path, and
    q a alpha = B cos(gamma) - T sin(alpha) across it. Without thrust alpha follows from pitch alone
    (Merckelbach et al. 2010): alpha = (C_D0 + C_D1 alpha^2) / (a tan(theta + alpha)).

    Args:
        pitch: theta, angle of the hull from the horizontal (rad, positive up and down alike).
        drive: Volume that the glider is too light or too heavy by (m^3, positive).
        airframe: Coefficients.
        drag: Factor on C_D0: above 1 for what sticks to the hull.
        thrust: Force of a thruster along the hull (N).

    Raises:
        ValueError: no steady glide: too flat for this drag, or no drive.

    >>> glide = steady_glide(0.45, 150e-6, Airframe())
    >>> round(glide.horizontal, 3), round(glide.vertical, 3)
    (0.253, 0.136)
    """
    if not (pitch > 0 and drive > 0):
        raise ValueError(f"no steady glide at pitch {pitch} rad and drive {drive} m3: both must be positive")
    buoyancy, attack = DENSITY * GRAVITY * drive, 0.0
    for _ in range(200):
        before, path = attack, pitch + attack
        total = drag * airframe.parasite_drag + airframe.induced_drag * attack**2
        pressure = (buoyancy * sin(path) + thrust * cos(attack)) / total
        attack = (buoyancy * cos(path) - thrust * sin(attack)) / (airframe.lift_slope * pressure)
        if not abs(attack) < _STALL:
            break
        if abs(attack - before) < 1e-12:
            speed = sqrt(2 * pressure / (DENSITY * airframe.area))
            return Glide(speed * cos(path), speed * sin(path), attack)
    raise ValueError(
        f"no steady glide at pitch {pitch:.3g} rad with a drag factor of {drag:.3g}: glide steeper"
    )
