"""A sea with known truth: currents (slow weather, tides, inertial motion, a front), layers of water, and the
bottom. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array, readonly
from gliderwatch.simulate.stand_in import StandIn

# ----------------------------------------
# Temperature, salinity and conductivity of a layered sea, and its bottom.

_SHALLOWEST = 15.0


@dataclass(frozen=True, slots=True)
class Layer:
    """A boundary between two layers of water that waves lift and sink.

    ``depth`` (m) at rest and ``thickness`` (m) of the boundary; what is below is warmer by
    ``temperature`` (K) and saltier by ``salinity``. The wave has an ``amplitude`` (m), a ``period``
    (s), a ``wavelength`` (m, going east) and a ``phase`` (rad at t = 0).
    """

    depth: float
    thickness: float = 5.0
    temperature: float = -6.0
    salinity: float = 0.5
    amplitude: float = 5.0
    period: float = 12.42 * 3600.0
    wavelength: float = 30e3
    phase: float = 0.0

    def __post_init__(self) -> None:
        if min(self.thickness, self.period, self.wavelength) <= 0:
            raise ValueError("thickness, period and wavelength of a layer are above 0")

    def place(self, t: Array, east: Array) -> Array:
        """Depth of the boundary (m) at times (s) and places (m east of the origin)."""
        angle = 2 * pi * (t / self.period - east / self.wavelength) + self.phase
        return np.asarray(self.depth + self.amplitude * np.sin(angle))


@dataclass(frozen=True, slots=True)
class Water:
    """``temperature`` (degrees Celsius) and practical ``salinity`` at the surface, and the layers below; with
    a ``stand_in`` its temperature is that."""

    temperature: float = 24.0
    salinity: float = 35.5
    layers: tuple[Layer, ...] = (Layer(30.0),)
    stand_in: StandIn | None = None

    def properties(self, t: Array, east: Array, north: Array, depth: Array) -> tuple[Array, Array]:
        """Temperature (degrees Celsius) and salinity at times (s), places (m from the origin) and depths
        (m)."""
        if self.stand_in is not None:
            return self.stand_in.water(t, east, north, depth), np.full(t.shape, self.salinity)
        temperature, salinity = np.full(t.shape, self.temperature), np.full(t.shape, self.salinity)
        for layer in self.layers:
            below = 0.5 * (1 + np.tanh((depth - layer.place(t, east)) / layer.thickness))
            temperature, salinity = temperature + layer.temperature * below, salinity + layer.salinity * below
        return temperature, salinity


@dataclass(frozen=True, slots=True)
class Bottom:
    """The sea floor: a slope with hills, nowhere shallower than 15 m.

    ``depth`` (m) at the origin, ``slope`` (m/m, deeper to the east and to the north), ``hills`` (m) of
    a ``wavelength`` (m).
    """

    depth: float
    slope: tuple[float, float] = (0.0, 0.0)
    hills: float = 2.0
    wavelength: float = 3e3

    def __post_init__(self) -> None:
        if not (self.depth >= _SHALLOWEST and self.wavelength > 0):
            raise ValueError(f"a bottom is at least {_SHALLOWEST:g} m deep, and its hills have a wavelength")

    def water_depth(self, east: Array, north: Array) -> Array:
        """Depth of the water (m) at places (m from the origin)."""
        k = 2 * pi / self.wavelength
        hills = np.sin(k * (0.8 * east + 0.6 * north)) * np.cos(k * (0.55 * north - 0.35 * east))
        depth = self.depth + self.slope[0] * east + self.slope[1] * north + self.hills * hills
        return np.asarray(np.maximum(depth, _SHALLOWEST))


# ----------------------------------------
# A current with known truth: slow weather, tides, inertial motion, a front. Pure: seed in, numbers out.

_MODES = 6
_STEP = 1800.0
_EARTH = 7.292115e-5
"""Angular frequency of the earth's rotation (rad/s)."""
_INERTIAL_MEMORY = 3 * 86400.0


class Constituent(StrEnum):
    """A tidal constituent."""

    M2 = "M2"
    S2 = "S2"
    N2 = "N2"
    K1 = "K1"
    O1 = "O1"
    M4 = "M4"

    @property
    def frequency(self) -> float:
        """Angular frequency (rad/s)."""
        return radians(_DEGREES_AN_HOUR[self]) / 3600


_DEGREES_AN_HOUR = {
    Constituent.M2: 28.9841042,
    Constituent.S2: 30.0,
    Constituent.N2: 28.4397295,
    Constituent.K1: 15.0410686,
    Constituent.O1: 13.9430356,
    Constituent.M4: 57.9682084,
}


@dataclass(frozen=True, slots=True)
class Ellipse:
    """The ellipse of one tidal constituent.

    ``major`` and ``minor`` axis (m/s; a positive minor axis turns counter-clockwise),
    ``inclination`` of the major axis (rad, counter-clockwise from east), ``phase`` (rad at t = 0), all at the
    origin. From there the tide comes later by ``lag`` (rad/m; east, north), as a long wave does, and both
    axes grow by ``growth`` (1/m; east, north), at most e times and at least to the e-th part.
    """

    constituent: Constituent
    major: float
    minor: float = 0.0
    inclination: float = 0.0
    phase: float = 0.0
    lag: tuple[float, float] = (0.0, 0.0)
    growth: tuple[float, float] = (0.0, 0.0)

    def current(self, t: Array, east: Array | float = 0.0, north: Array | float = 0.0) -> tuple[Array, Array]:
        """Eastward and northward current (m/s) at times ``t`` (s) and places (m from the origin)."""
        late = self.lag[0] * east + self.lag[1] * north
        size = np.exp(np.tanh(self.growth[0] * east + self.growth[1] * north))
        angle = self.constituent.frequency * t - self.phase - late
        along, across = size * self.major * np.cos(angle), size * self.minor * np.sin(angle)
        c, s = np.cos(self.inclination), np.sin(self.inclination)
        return along * c - across * s, along * s + across * c


TIDES = (
    Ellipse(Constituent.M2, major=0.06, minor=0.02, inclination=0.6, phase=0.4),
    Ellipse(Constituent.K1, major=0.03, minor=-0.01, inclination=1.2, phase=2.0),
)


@dataclass(frozen=True, slots=True)
class Front:
    """A jet along a front that meanders.

    ``speed`` (m/s) in its middle, ``width`` (m) to where it has fallen to 0.42 of that, ``direction``
    (rad, counter-clockwise from east) that it flows to, ``distance`` (m) of its middle to the left
    of the origin, seen along the flow. Meanders have an ``amplitude`` (m), a ``wavelength`` (m) and
    move along at ``phase_speed`` (m/s).
    """

    speed: float
    width: float = 25e3
    direction: float = 0.8
    distance: float = 20e3
    amplitude: float = 8e3
    wavelength: float = 200e3
    phase_speed: float = 0.1

    def __post_init__(self) -> None:
        if min(self.width, self.wavelength) <= 0:
            raise ValueError("a front has a width and a wavelength above 0 m")

    def current(self, t: Array, east: Array, north: Array) -> tuple[Array, Array]:
        """Eastward and northward current (m/s) at times (s) and places (m from the origin)."""
        c, s = np.cos(self.direction), np.sin(self.direction)
        along, left = east * c + north * s, north * c - east * s
        k = 2 * pi / self.wavelength
        angle = k * (along - self.phase_speed * t)
        middle = self.distance + self.amplitude * np.sin(angle)
        slope = np.arctan(self.amplitude * k * np.cos(angle))
        speed = self.speed / np.cosh((left - middle) / self.width) ** 2
        return speed * np.cos(self.direction + slope), speed * np.sin(self.direction + slope)


@dataclass(frozen=True, slots=True)
class Sea:
    """What kind of sea it is.

    ``residual`` is the mean current (m/s; east, north). ``sigma`` (m/s, a component), ``tau`` (s) and
    ``scale`` (m) are strength, memory and size of the slow Ornstein-Uhlenbeck part. ``shear`` is the
    part (0 to 1) of all this, and of the front, that is gone far below ``shear_depth`` (m); tides reach
    the bottom. ``inertial`` (m/s) is the usual strength of near-inertial motion at the surface, which
    falls off over ``inertial_depth`` (m) and turns with depth.
    """

    residual: tuple[float, float] = (0.05, 0.02)
    sigma: float = 0.06
    tau: float = 30 * 3600.0
    scale: float = 40e3
    tides: tuple[Ellipse, ...] = TIDES
    shear: float = 0.0
    shear_depth: float = 50.0
    inertial: float = 0.0
    inertial_depth: float = 40.0
    front: Front | None = None

    def __post_init__(self) -> None:
        if min(self.tau, self.scale, self.shear_depth, self.inertial_depth) <= 0:
            raise ValueError("tau, scale, shear_depth and inertial_depth are above 0")
        if not (0 <= self.shear <= 1 and self.sigma >= 0 and self.inertial >= 0):
            raise ValueError("shear is a part, 0 to 1; sigma and inertial are not negative")


@dataclass(frozen=True, slots=True)
class Ocean:
    """One realisation of a sea between ``nodes[0]`` and ``nodes[-1]`` (s).

    ``wave_numbers`` (rad/m, shape (modes, 2)) and ``amplitudes`` (m/s, shape (4 modes, nodes)) make
    the slow part: a sum of plane waves whose amplitudes wander. ``envelope`` (m/s, complex, shape
    (nodes,)) is that of the near-inertial motion, of frequency ``coriolis`` (rad/s).
    """

    sea: Sea
    nodes: Array
    wave_numbers: Array
    amplitudes: Array
    envelope: NDArray[np.complex128]
    coriolis: float

    def current(self, t: Array, east: Array, north: Array, depth: Array | float = 0.0) -> tuple[Array, Array]:
        """Eastward and northward current (m/s).

        Args:
            t: Times (s), shape (n,).
            east: Metres east of the origin of the mission, shape (n,).
            north: Metres north of it, shape (n,).
            depth: Depths (m), shape (n,) or one for all.

        Raises:
            ValueError: a time outside the span that was made.
        """
        if t.min() < self.nodes[0] or t.max() > self.nodes[-1]:
            raise ValueError("time outside the ocean's span: make the ocean for a longer mission")
        u, v = self._slow(t, east, north)
        if self.sea.front:
            front_u, front_v = self.sea.front.current(t, east, north)
            u, v = u + front_u, v + front_v
        if self.sea.shear:
            left = 1 - self.sea.shear * (1 - np.exp(-np.asarray(depth) / self.sea.shear_depth))
            u, v = u * left, v * left
        for ellipse in self.sea.tides:
            tide_u, tide_v = ellipse.current(t, east, north)
            u, v = u + tide_u, v + tide_v
        if self.sea.inertial:
            turning = self._inertial(t, depth)
            u, v = u + turning.real, v + turning.imag
        return u, v

    def _slow(self, t: Array, east: Array, north: Array) -> tuple[Array, Array]:
        u, v = np.full(t.shape, self.sea.residual[0]), np.full(t.shape, self.sea.residual[1])
        for j, (k_east, k_north) in enumerate(self.wave_numbers):
            angle = k_east * east + k_north * north
            a, b, c, d = (np.interp(t, self.nodes, row) for row in self.amplitudes[4 * j : 4 * j + 4])
            u += a * np.cos(angle) + b * np.sin(angle)
            v += c * np.cos(angle) + d * np.sin(angle)
        return u, v

    def _inertial(self, t: Array, depth: Array | float) -> NDArray[np.complex128]:
        """Near-inertial current (m/s), east + i north: clockwise in the northern hemisphere."""
        downward = np.asarray(depth) / self.sea.inertial_depth
        envelope = np.interp(t, self.nodes, self.envelope)
        turned: NDArray[np.complex128] = envelope * np.exp(-1j * (self.coriolis * t + downward) - downward)
        return turned


def make_ocean(sea: Sea, start: float, end: float, rng: np.random.Generator, *, lat: float = 30.0) -> Ocean:
    """A realisation of ``sea`` about latitude ``lat`` (degrees) for times from ``start`` to ``end`` (s).

    The wandering amplitudes are exact samples of an Ornstein-Uhlenbeck process every half hour; wave
    numbers are drawn so that the covariance in space is sigma^2 exp(-d^2 / (2 scale^2)) on average
    over seeds (Rahimi and Recht 2007, random Fourier features).
    """
    nodes = np.arange(start, end + _STEP, _STEP)
    amplitudes = sea.sigma / np.sqrt(_MODES) * _wandering(len(nodes), 4 * _MODES, sea.tau, rng).T
    wave_numbers = rng.standard_normal((_MODES, 2)) / sea.scale
    envelope = _wandering(len(nodes), 2, _INERTIAL_MEMORY, rng) @ np.array([1.0, 1.0j])
    coriolis = 2 * _EARTH * sin(radians(lat))
    return Ocean(
        sea,
        readonly(nodes),
        readonly(wave_numbers),
        readonly(amplitudes),
        sea.inertial / np.sqrt(2) * envelope,
        coriolis,
    )


def _wandering(n: int, columns: int, memory: float, rng: np.random.Generator) -> Array:
    """Ornstein-Uhlenbeck processes of variance 1 at the nodes, shape (n, columns)."""
    decay = np.exp(-_STEP / memory)
    kicks = rng.standard_normal((n, columns))
    kicks[1:] *= np.sqrt(1 - decay**2)
    for i in range(1, n):
        kicks[i] += decay * kicks[i - 1]
    return kicks
