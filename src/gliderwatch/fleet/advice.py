"""Where a glider should look next, to learn most of a field (003, section 4). Pure.

Two ways: the gradient of the paper, of the field's mean variance J = tr(C M) after one more sample, averaged
over the water column (eqs. 8 to 11); and a look-ahead that compares whole next legs. Both are bound by what a
pilot would look at: the leg is what the glider reaches through the water and with it, it stays in a polygon,
in the box, in water that is deep enough, and away from other gliders. Of the legs that are allowed the best
is advised; where none is, nothing.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, tau
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gliderwatch.fleet.constants import APART, GRID, HEADINGS, LEG_SAMPLES, LOOK_DEPTHS, SPREAD
from gliderwatch.fleet.scalar_field import (
    FieldParams,
    Information,
    inverse,
    overlap,
    rows,
    sample_variance,
    seconds_of_information,
    update,
)
from gliderwatch.model import Array, readonly
from gliderwatch.navigation.geodesy import from_plane, heading_vectors, to_plane

Point = tuple[float, float]
Way = Literal["gradient", "look_ahead"]
_GOLDEN = 0.6180339887
_WAY_POINTS = 9


@dataclass(frozen=True, slots=True)
class Box:
    """The box of a field: ``south``, ``west``, ``north``, ``east`` (degrees), ``top`` and ``bottom`` (m)."""

    south: float
    west: float
    north: float
    east: float
    top: float
    bottom: float

    @property
    def sides(self) -> Array:
        """Lengths (m) from west to east and from south to north, through the middle."""
        lat, lon = (self.south + self.north) / 2, self.west + (self.east - self.west) % 360.0 / 2
        half = to_plane(self.north, self.west + (self.east - self.west) % 360.0, lat, lon)
        return np.asarray(2 * half)

    def place(self, lat: Array, lon: Array, depth: Array) -> Array:
        """Coordinates in the box ((n, 3): east, north, depth, 0 to 1 inside) of positions (degrees) and
        depths (m)."""
        east = ((np.asarray(lon) - self.west + 180.0) % 360.0 - 180.0) / ((self.east - self.west) % 360.0)
        north = (np.asarray(lat) - self.south) / (self.north - self.south)
        return np.stack([east, north, (depth - self.top) / (self.bottom - self.top)], axis=-1)


@dataclass(frozen=True, slots=True)
class Leg:
    """What a glider does until it comes up next: from ``lat``, ``lon`` (degrees) at ``speed`` (m/s) through
    the water for ``duration`` (s), while the water goes at ``flow`` (m/s, east and north)."""

    lat: float
    lon: float
    speed: float
    duration: float
    flow: tuple[float, float] = (0.0, 0.0)

    def end(self, heading: float) -> Point:
        """Where it comes up with a heading (rad from true north): latitude, longitude."""
        way = self.speed * heading_vectors(heading) + np.array(self.flow)
        return from_plane(way * self.duration, self.lat, self.lon)


@dataclass(frozen=True, slots=True)
class Bounds:
    """Where gliders may be sent: inside a ``polygon`` (latitude, longitude; none: anywhere in the box), not
    where the water is ``shallowest`` (m) or less by the ``soundings`` ((n, 3): latitude, longitude, depth of
    the water in m; the nearest counts), not within ``apart`` (m) of the ``others``."""

    polygon: tuple[Point, ...] = ()
    shallowest: float | None = None
    soundings: Array = field(default_factory=lambda: readonly(np.empty((0, 3))))
    others: tuple[Point, ...] = ()
    apart: float = APART


@dataclass(frozen=True, slots=True)
class Advice:
    """The heading (rad from true north) and waypoint (degrees) to fly next; ``variance`` is the part of the
    field's mean variance that the leg takes away, ``apart`` (m) how far its end is from the next other
    glider."""

    heading: float
    lat: float
    lon: float
    variance: float
    apart: float | None


def mean_variance(known: Information, params: FieldParams) -> float:
    """J = tr(C M), the field's variance averaged over the box (003 eq. 8)."""
    return float(np.sum(inverse(known.d) * overlap(params)))


def gradient(cov: Array, place: Array, params: FieldParams) -> Array:
    """-dJ/d(x, y) ((2,)) of one more sample at ``place`` ((2,): east, north), averaged over depths (003 eq.
    11).

    J(p) = J - p' C M C p / (R + p' C p), p = phi(r): down its slope is where a sample tells most.
    """
    depth = (np.arange(LOOK_DEPTHS) + 0.5) / LOOK_DEPTHS
    at = np.column_stack([np.tile(place, (LOOK_DEPTHS, 1)), depth])
    phi, slopes = rows(at, params), _slopes(at, params)
    seen = phi @ cov
    about = seen @ overlap(params) @ cov
    r = sample_variance(np.ones(1), params)[0]
    top, low = np.einsum("ni,ni->n", about, phi), r + np.einsum("ni,ni->n", seen, phi)
    top_slope, low_slope = (2 * np.einsum("kni,ni->kn", slopes, each) for each in (about, seen))
    return np.asarray(((top_slope * low - top * low_slope) / low**2).mean(axis=1))


def leg_samples(leg: Leg, heading: float, box: Box) -> Array:
    """Places ((n, 3)) in the box of samples along a leg.

    How many yos it has matters little: depths are spread over all of it, by the golden ratio.
    """
    part = (np.arange(LEG_SAMPLES) + 0.5) / LEG_SAMPLES
    lat, lon = _way(leg, heading, part)
    place = box.place(lat, lon, np.zeros(LEG_SAMPLES))
    place[:, 2] = np.arange(LEG_SAMPLES) * _GOLDEN % 1.0
    return place


def gains(cov: Array, leg: Leg, headings: Sequence[float], box: Box, params: FieldParams) -> list[float]:
    """By how much J falls once a leg is flown, by its heading: tr(M C Phi' (R + Phi C Phi')^-1 Phi C)."""
    parts, phi, noise = _measurements([(leg, heading) for heading in headings], box, params)
    seen = phi @ cov
    weighed = seen @ overlap(params)
    out = list[float]()
    for here in parts:
        inner = np.diag(noise[here]) + seen[here] @ phi[here].T
        out.append(float(np.sum(np.linalg.solve(inner, seen[here]) * weighed[here])))
    return out


def with_planned(
    known: Information, legs: Sequence[tuple[Leg, float]], box: Box, params: FieldParams
) -> Information:
    """What will be known, values apart, once other gliders have flown ``legs`` with their headings (rad)."""
    if not legs:
        return known
    _, phi, noise = _measurements(legs, box, params)
    return update(known, phi, np.zeros(len(phi)), noise)


def advise(
    known: Information,
    leg: Leg,
    box: Box,
    bounds: Bounds,
    params: FieldParams,
    way: Way = "look_ahead",
) -> Advice | None:
    """The next leg, of those that are allowed, that lowers the uncertainty of the field most; None: none is.

    ``gradient``: the paper's heading, or the allowed one next to it.
    """
    cov = inverse(known.d)
    headings, first = np.arange(HEADINGS) * tau / HEADINGS, 0.0
    if way == "gradient":
        here = box.place(np.array([leg.lat]), np.array([leg.lon]), np.array([box.top]))[0, :2]
        east, north = gradient(cov, here, params) / box.sides
        first = float(np.arctan2(east, north))
        headings = headings + first
    allowed = [h for h in headings.tolist() if is_allowed(leg, h, box, bounds)]
    if not allowed:
        return None
    if way == "gradient":
        allowed = [max(allowed, key=lambda heading: cos(heading - first))]
    lowered, best = max(zip(gains(cov, leg, allowed, box, params), allowed, strict=True))
    lat, lon = leg.end(best)
    apart = min(_distances(bounds.others, lat, lon).tolist(), default=None)
    return Advice(best % tau, lat, lon, lowered / float(np.sum(cov * overlap(params))), apart)


def is_allowed(leg: Leg, heading: float, box: Box, bounds: Bounds) -> bool:
    """Whether a leg ends in the box, in the polygon and away from others, and stays in deep water.

    A glider that is outside the polygon may come in, and then not leave it again.
    """
    lat, lon = _way(leg, heading, np.linspace(0.0, 1.0, _WAY_POINTS))
    end = box.place(lat[-1:], lon[-1:], np.array([box.top]))[0, :2]
    if not ((end >= 0) & (end <= 1)).all():
        return False
    if (_distances(bounds.others, float(lat[-1]), float(lon[-1])) < bounds.apart).any():
        return False
    plane = to_plane(lat, lon, leg.lat, leg.lon)
    if bounds.polygon:
        corners = np.array(bounds.polygon)
        within = inside(plane, to_plane(corners[:, 0], corners[:, 1], leg.lat, leg.lon))
        if not within[int(within.argmax()) :].all():
            return False
    if bounds.shallowest is None or not len(bounds.soundings):
        return True
    known = to_plane(bounds.soundings[:, 0], bounds.soundings[:, 1], leg.lat, leg.lon)
    nearest = np.square(plane[:, None] - known).sum(-1).argmin(axis=1)
    return bool((bounds.soundings[nearest, 2] > bounds.shallowest).all())


def inside(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """Whether points ((n, 2)) lie inside a polygon ((m, 2)): whether a ray crosses its sides an odd number of
    times.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> inside(np.array([[0.5, 0.5], [1.5, 0.5]]), square).tolist()
    [True, False]
    """
    odd = np.zeros(len(points), dtype=np.bool_)
    x, y = points.T
    for (xa, ya), (xb, yb) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if ya != yb:
            odd ^= ((ya > y) != (yb > y)) & (x < (xb - xa) * (y - ya) / (yb - ya) + xa)
    return odd


def _measurements(
    legs: Sequence[tuple[Leg, float]], box: Box, params: FieldParams
) -> tuple[list[slice], Array, Array]:
    """Which samples in the box are of each leg with its heading (rad), their rows ((n, L)), and the variance
    of each ((n,))."""
    place = np.vstack([leg_samples(leg, heading, box) for leg, heading in legs])
    within = ((place >= 0) & (place <= 1)).all(axis=1)
    ends = np.cumsum(within.reshape(len(legs), LEG_SAMPLES).sum(axis=1)).tolist()
    parts = [slice(a, b) for a, b in itertools.pairwise([0, *ends])]
    each = np.array([seconds_of_information(params) * LEG_SAMPLES / leg.duration for leg, _ in legs])
    return parts, rows(place[within], params), np.repeat(each, LEG_SAMPLES)[within]


def _slopes(at: Array, params: FieldParams) -> Array:
    """d phi / d(x, y) ((2, n, L)) at places ((n, 3)); the functions of depth alone have none."""
    phi = rows(at, params)
    centre = np.indices((GRID, GRID, GRID)).reshape(3, -1) / (GRID - 1)
    out = np.zeros((2, *phi.shape))
    for k in range(2):
        out[k, :, : GRID**3] = (centre[k] - at[:, k, None]) / SPREAD * phi[:, : GRID**3]
    return out


def _way(leg: Leg, heading: float, part: Array) -> tuple[Array, Array]:
    """Latitudes and longitudes (degrees) at parts of a leg (0 to 1)."""
    lat, lon = leg.end(heading)
    east = (lon - leg.lon + 180.0) % 360.0 - 180.0
    return leg.lat + part * (lat - leg.lat), leg.lon + part * east


def _distances(others: Sequence[Point], lat: float, lon: float) -> Array:
    """Distances (m) of positions (degrees) from a place."""
    points = np.array(others, dtype=np.float64).reshape(-1, 2)
    plane = to_plane(points[:, 0], points[:, 1], lat, lon)
    return np.asarray(np.hypot(plane[:, 0], plane[:, 1]))
