"""Steady flight of a buoyancy-driven glider. Pure.

Source: Merckelbach, Smeed and Griffiths (2010), Vertical water velocities from underwater gliders,
J. Atmos. Oceanic Technol. 27, 547-563: balance of lift, drag and net buoyancy, the angle of attack
following from pitch alone. Coefficients of a Slocum: Merckelbach et al. (2019), A dynamic flight
model for Slocum gliders, J. Atmos. Oceanic Technol. 36, 281-296.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, sqrt

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
