"""The current of an ocean model or of a radar, on a grid in time, depth, latitude and longitude. Pure.

Where a field cannot answer it says in words why not, for the pilot: a reference that is missing is no error.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from gliderwatch.model import Array, Fix, readonly
from gliderwatch.sea.constants import POINTS, STALE, WET

Flow = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Field:
    """Eastward and northward currents ``u``, ``v`` (m/s, (T, Z, Y, X)); NaN is land or a gap.

    ``t`` (s, (T,)), ``lat`` and ``lon`` (degrees, (Y,), (X,)) increase; ``lon`` may go beyond 180. ``depth``
    (m, downward, (Z,)) increases; it is empty where there are no depths, and then Z is 1. ``source`` names
    the files for words; ``stale`` (s): see `STALE`. Raises ValueError where shapes or orders are not so.
    """

    t: Array
    depth: Array
    lat: Array
    lon: Array
    u: Array
    v: Array
    source: str
    stale: float = STALE

    def __post_init__(self) -> None:
        shape = (len(self.t), max(len(self.depth), 1), len(self.lat), len(self.lon))
        if self.u.shape != shape or self.v.shape != shape:
            raise ValueError(f"currents of shapes {self.u.shape} and {self.v.shape} on a grid of {shape}")
        if min(shape) < 1 or min(shape[2:]) < 2:
            raise ValueError(f"a grid of {shape} (time, depth, latitude, longitude) is too small")
        if any((np.diff(axis) <= 0).any() for axis in (self.t, self.depth, self.lat, self.lon)):
            raise ValueError("times, depths, latitudes and longitudes of a field must increase")

    def at(self, t: float, lat: float, lon: float, depth: float) -> Flow | str:
        """Current (m/s; east, north) averaged from the surface to a ``depth`` (m), or why there is none.

        Linear in time (s), latitude and longitude (degrees). A field without depths is taken as it is.
        """
        when = self._when(t)
        if isinstance(when, str):
            return when
        east = self.lon[0] + (lon - self.lon[0]) % 360.0
        if not (self.lat[0] <= lat <= self.lat[-1] and east <= self.lon[-1]):
            return f"{lat:.3f}, {lon:.3f} is outside the area of {self.source} ({self._area()})"
        rows, columns = _bracket(self.lat, lat), _bracket(self.lon, float(east))
        layers = _layers(self.depth, depth)
        weight = np.multiply.outer(np.multiply.outer(when[1], rows[1]), columns[1])
        block = np.ix_(when[0], np.arange(len(layers)), rows[0], columns[0])
        u, wet = _wet_mean(self.u[block], layers, weight)
        v, wet_too = _wet_mean(self.v[block], layers, weight)
        if min(wet, wet_too) < WET:
            return f"{self.source} has no current at {lat:.3f}, {lon:.3f}: land or a gap"
        return u, v

    def between(self, start: Fix, end: Fix, depth: float) -> Flow | str:
        """Mean current (m/s) on the straight way between two fixes of a dive to ``depth`` (m), or why not."""
        found: list[Flow] = []
        east = (end.lon - start.lon + 180.0) % 360.0 - 180.0
        for k in range(POINTS):
            part = (k + 0.5) / POINTS
            t = start.t + part * (end.t - start.t)
            each = self.at(t, start.lat + part * (end.lat - start.lat), start.lon + part * east, depth)
            if isinstance(each, str):
                return each
            found.append(each)
        u, v = np.mean(found, axis=0).tolist()
        return u, v

    def _when(self, t: float) -> tuple[Array, Array] | str:
        """Places and weights of the times around ``t`` (s), or why it is out of reach."""
        first, last = float(self.t[0]), float(self.t[-1])
        before = float(np.median(np.diff(self.t))) if len(self.t) > 1 else 0.0
        if t > last + self.stale:
            hours = (t - last) / 3600
            return (
                f"{self.source} is stale: it ends at {_words(last)}, {hours:.0f} h before; bring newer files"
            )
        if t < first - before:
            return f"{self.source} begins at {_words(first)} only; bring older files"
        places, weights = _bracket(self.t, min(max(t, first), last))
        if float(np.ptp(self.t[places])) > self.stale:
            return f"{self.source} has a gap from {_words(self.t[places[0]])} to {_words(self.t[places[-1]])}"
        return places, weights

    def _area(self) -> str:
        west, east = ((x + 180.0) % 360.0 - 180.0 for x in (self.lon[0], self.lon[-1]))
        return f"latitude {self.lat[0]:.2f} to {self.lat[-1]:.2f}, longitude {west:.2f} to {east:.2f}"


def _bracket(axis: Array, x: float) -> tuple[Array, Array]:
    """Places on an increasing axis on both sides of ``x``, which is within it, and their weights."""
    k = int(np.searchsorted(axis, x, "right")) - 1
    if axis[k] == x:  # so that a neighbour of no weight cannot make it land or a gap
        return np.array([k]), np.ones(1)
    part = float((x - axis[k]) / (axis[k + 1] - axis[k]))
    return np.array([k, k + 1]), np.array([1 - part, part])


def _layers(depth: Array, deepest: float) -> Array:
    """Weights of the levels ``depth`` (m, (Z,)) in the mean from the surface to ``deepest`` (m).

    The profile is linear between the levels and constant above the first; below the last there is nothing.
    Without levels it is one weight.

    >>> _layers(np.array([0.0, 10.0, 20.0]), 15.0).round(3).tolist()
    [0.333, 0.583, 0.083]
    """
    if len(depth) < 2 or deepest <= depth[0]:
        return readonly(np.eye(max(len(depth), 1))[0])
    bottom = min(deepest, float(depth[-1]))
    edges = np.concatenate([[0.0], depth[depth < bottom], [bottom]])
    hats = np.array([np.interp(edges, depth, one) for one in np.eye(len(depth))])
    return readonly((hats[:, 1:] + hats[:, :-1]) / 2 @ np.diff(edges) / bottom)


def _wet_mean(values: Array, layers: Array, weight: Array) -> tuple[float, float]:
    """Mean of ``values`` (times, Z, rows, columns) over what is water, and which part of the ``weight`` is.

    A column that ends above the depth asked for is averaged down to its bottom.
    """
    there = np.isfinite(values)
    filled = np.where(there, values, 0.0)
    thick = np.einsum("z,tzyx->tyx", layers, there)
    sums = np.einsum("z,tzyx->tyx", layers, filled)
    columns = sums / np.where(thick > 0, thick, 1.0)
    wet = weight * (thick > 0)
    part = float(wet.sum())
    return float((wet * columns).sum()) / part if part else 0.0, part


def _words(t: float) -> str:
    return f"{datetime.fromtimestamp(float(t), UTC):%Y-%m-%d %H:%M} UTC"
