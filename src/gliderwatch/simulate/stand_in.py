"""The analytic temperature that stands in for the ocean model of 003: a moving thermocline, eddies, waves.
Pure.

A box of 60 x 60 km and 100 m, as the paper's; its values are anomalies of 18.34 degrees Celsius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.model import Array

SIDE, DEPTH = 60e3, 100.0
"""m: sides and depth of the box."""
MEAN = 18.34
"""Degrees Celsius that are taken off: about the mean in the box."""
_TURN = 2 * np.pi


@dataclass(frozen=True, slots=True)
class StandIn:
    """The box in a simulated sea: the sea's origin lies ``east`` and ``north`` (m) of its corner; ``start``
    (s)."""

    east: float
    north: float
    start: float

    def water(self, t: Array, east: Array, north: Array, depth: Array) -> Array:
        """Temperature (degrees Celsius) at times (s), places (m from the sea's origin) and depths (m)."""
        place = [(self.east + east) / SIDE, (self.north + north) / SIDE, depth / DEPTH]
        return MEAN + temperature(np.stack(place, axis=-1), t - self.start)


def temperature(place: Array, t: Array | float) -> Array:
    """Temperature less `MEAN` (K, (...)) at places in the box ((..., 3): east, north, depth; 0 to 1), times
    (s).

    >>> temperature(np.array([0.1, 0.2, 0.3]), 0.0).round(6).item()
    6.232862
    """
    x, y, z = place[..., 0] * 60, place[..., 1] * 60, place[..., 2] * 100
    d = np.asarray(t, dtype=np.float64) / 86400.0
    warm = np.exp(-((x - 15 - 2.5 * d) ** 2 + (y - 20 - d) ** 2) / 200)
    cold = np.exp(-((x - 45 + 2 * d) ** 2 + (y - 42 - 0.5 * d) ** 2) / 162)
    fine = (
        np.sin(_TURN * (x / 16 - y / 30 - d / 5))
        + np.sin(_TURN * (x / 28 + y / 13 + d / 4) + 1)
        + np.sin(_TURN * (x / 20 + y / 40 - 24 * d / 17.4) + 2)
    )
    h = 35 + 12 * warm - 10 * cold + 4 * np.sin(_TURN * (x / 55 + y / 70 - d / 8)) + 1.5 * fine
    w = 14 + 3 * np.sin(_TURN * (y / 60 - d / 10))
    wave = 0.8 * np.exp(-z / 30) * np.cos(_TURN * (x / 45 - y / 60 - d / 6))
    return np.asarray(14 + 6 * (1 - np.tanh((z - h) / w)) + wave - MEAN)
