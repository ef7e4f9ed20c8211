"""Temperature, salinity and conductivity of a layered sea, and its bottom. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from gliderwatch.model import Array

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
    """``temperature`` (degrees Celsius) and practical ``salinity`` at the surface, and the layers below."""

    temperature: float = 24.0
    salinity: float = 35.5
    layers: tuple[Layer, ...] = (Layer(30.0),)

    def properties(self, t: Array, east: Array, depth: Array) -> tuple[Array, Array]:
        """Temperature (degrees Celsius) and salinity at times (s), places (m east) and depths (m)."""
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
