"""A tide put onto a real mission: what is real stays so, and a current that it never met is added.

Fixes move by the way of the tide since the start, what the glider reckons by that until its last fix, and
each current by the mean of the tide over the dive that it is of. The glider steers as it did. Pure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gliderwatch.model import Array, Segment, Series, readonly
from gliderwatch.navigation.geodesy import from_plane, magnetic_to_true
from gliderwatch.score.graft import navigate
from gliderwatch.simulate.ocean import Ellipse
from gliderwatch.simulate.seas import SEAS, sea_mission

TIDAL = [name for name, sea in SEAS.items() if max(*sea.m2, *sea.k1) > 0.1]
"""The kinds of sea whose tides are worth it (m/s)."""
_STEP = 60.0
_CURRENTS = ("current", "current_initial", "current_final")
_EARLY = 120.0
"""s: a current that comes so long before the last sample of a dive is of that dive too."""


@dataclass(frozen=True, slots=True)
class Way:
    """The way (m: east, north) of the tide since a start, at times (s)."""

    t: Array
    way: Array

    def at(self, t: Array) -> Array:
        """The way (m, (n, 2)) at times (s, (n,))."""
        return np.column_stack([np.interp(t, self.t, part) for part in self.way.T])


def way_of(ellipses: Sequence[Ellipse], start: float, end: float) -> Way:
    """The way of a tide, without its change from place to place, from a start to an end (s)."""
    t = np.arange(0.0, end - start + _STEP, _STEP)
    current = np.sum([np.column_stack(ellipse.current(t)) for ellipse in ellipses], axis=0)
    steps = (current[1:] + current[:-1]) / 2 * _STEP
    return Way(start + t, np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]))


def in_tide(segments: Sequence[Segment], kind: str, seed: int) -> list[Segment]:
    """The segments of a mission with the tide that a seed draws for a kind of sea, `TIDAL`."""
    start, end = segments[0].id.opened_at, segments[-1].last_t
    way = way_of(sea_mission(kind, seed).sea.tides, start, end)
    dives = navigate(segments)
    begins, ends = (np.array([getattr(dive, name) for dive in dives]) for name in ("t_dive", "t_surface"))
    mean = (way.at(ends) - way.at(begins)) / (ends - begins)[:, None]

    def since_fix(t: Array) -> Array:
        """When the last fix was that a position reckoned at a time rests on."""
        k = begins.searchsorted(t, "right") - 1
        in_dive = (k >= 0) & (t < ends[k])
        return np.where(in_dive, begins[k], t)

    declination, out = 0.0, []
    for segment in segments:
        declination = segment.declination if segment.declination is not None else declination
        found = dict(segment.quantities)
        for name, when in (("fix", _came), ("dr", lambda lat: since_fix(lat.t))):
            lat, lon = segment.get(f"{name}_lat"), segment.get(f"{name}_lon")
            if len(lat) and len(lat) == len(lon):
                found |= _moved(name, lat, lon, way.at(when(lat)))
        for name in _CURRENTS:
            x, y = segment.get(f"{name}_x"), segment.get(f"{name}_y")
            if len(x) and len(x) == len(y):
                k = ends.searchsorted(x.t + _EARLY) - 1
                none = (k < 0) | ((x.v == 0) & (y.v == 0))
                more = magnetic_to_true(np.where(none[:, None], 0.0, mean[k]), -declination)
                found[f"{name}_x"] = Series(x.t, readonly(x.v + more[:, 0]))
                found[f"{name}_y"] = Series(y.t, readonly(y.v + more[:, 1]))
        out.append(replace(segment, quantities=found))
    return out


def _came(lat: Series) -> Array:
    """When each value of a series came (s) that repeats the one before until there is another."""
    is_new = np.concatenate([[True], lat.v[1:] != lat.v[:-1]])
    return lat.t[np.maximum.accumulate(np.where(is_new, np.arange(len(lat)), 0))]


def _moved(name: str, lat: Series, lon: Series, way: Array) -> dict[str, Series]:
    places = [from_plane(by, *place) for place, by in zip(zip(lat.v, lon.v, strict=True), way, strict=True)]
    north, east = np.array(places).T
    return {f"{name}_lat": Series(lat.t, readonly(north)), f"{name}_lon": Series(lon.t, readonly(east))}
