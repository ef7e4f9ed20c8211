"""Steady flight of a buoyancy-driven glider. Pure.

Source: Merckelbach, Smeed and Griffiths (2010), Vertical water velocities from underwater gliders,
J. Atmos. Oceanic Technol. 27, 547-563: balance of lift, drag and net buoyancy, the angle of attack
following from pitch alone. Coefficients of a Slocum: Merckelbach et al. (2019), A dynamic flight
model for Slocum gliders, J. Atmos. Oceanic Technol. 36, 281-296.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, sqrt, tan

GRAVITY = 9.81
_STALL = 0.6


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
class Glide:
    """Horizontal and vertical speed through the water (m/s, both positive) and angle of attack (rad)."""

    horizontal: float
    vertical: float
    attack: float


def steady_glide(pitch: float, drive: float, airframe: Airframe, *, drag: float = 1.0) -> Glide:
    """The steady glide at a pitch and a net buoyancy.

    alpha = (C_D0 + C_D1 alpha^2) / (a tan(theta + alpha)),
    U^2 = 2 g V sin(theta + alpha) / (S (C_D0 + C_D1 alpha^2)), V the net volume: density cancels.

    Args:
        pitch: theta, angle of the hull from the horizontal (rad, positive up and down alike).
        drive: Volume that the glider is too light or too heavy by (m^3, positive).
        airframe: Coefficients.
        drag: Factor on C_D0: above 1 for what sticks to the hull.

    Raises:
        ValueError: no steady glide: too flat for this drag, or no drive.

    >>> glide = steady_glide(0.45, 150e-6, Airframe())
    >>> round(glide.horizontal, 3), round(glide.vertical, 3)
    (0.253, 0.136)
    """
    if not (pitch > 0 and drive > 0):
        raise ValueError(f"no steady glide at pitch {pitch} rad and drive {drive} m3: both must be positive")
    parasite, attack = airframe.parasite_drag * drag, 0.0
    for _ in range(100):
        before = attack
        total = parasite + airframe.induced_drag * attack**2
        attack = total / (airframe.lift_slope * tan(pitch + attack))
        if attack > _STALL:
            break
        if abs(attack - before) < 1e-12:
            path = pitch + attack
            speed = sqrt(2 * GRAVITY * drive * sin(path) / (airframe.area * total))
            return Glide(speed * cos(path), speed * sin(path), attack)
    raise ValueError(f"no steady glide at pitch {pitch} rad with a drag factor of {drag}: glide steeper")
