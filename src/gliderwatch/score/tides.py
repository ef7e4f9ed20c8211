"""A tide put onto a real mission: what is real stays so, and a current that it never met is added.

Fixes move by the way of the tide since the start, what the glider reckons by that until its last fix, and
each current by the mean of the tide over the dive that it is of. The glider steers as it did. Pure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gliderwatch.model import Array, Segment, Series
from gliderwatch.score.graft import along, changed, last_ended, moved, navigate, with_error
from gliderwatch.simulate.ocean import Ellipse
from gliderwatch.simulate.seas import SEAS, sea_mission

TIDAL = [name for name, sea in SEAS.items() if max(*sea.m2, *sea.k1) > 0.1]
"""The kinds of sea whose tides are worth it (m/s)."""
_STEP = 60.0


def way_of(ellipses: Sequence[Ellipse], start: float, end: float) -> tuple[Array, Array]:
    """Times (s) from a start to an end, and the way (m: east, north) of a tide until then, without its change
    from place to place."""
    t = np.arange(0.0, end - start + _STEP, _STEP)
    current = np.sum([np.column_stack(ellipse.current(t)) for ellipse in ellipses], axis=0)
    steps = (current[1:] + current[:-1]) / 2 * _STEP
    return start + t, np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def in_tide(segments: Sequence[Segment], kind: str, seed: int) -> list[Segment]:
    """The segments of a mission with the tide that a seed draws for a kind of sea, `TIDAL`."""
    t, way = way_of(sea_mission(kind, seed).sea.tides, segments[0].id.opened_at, segments[-1].last_t)
    dives = navigate(segments)
    begins, ends = (np.array([getattr(dive, name) for dive in dives]) for name in ("t_dive", "t_surface"))
    mean = (along(t, way, ends) - along(t, way, begins)) / (ends - begins)[:, None]

    def since_fix(at: Array) -> Array:
        """When the last fix was that a position reckoned at a time rests on."""
        k = begins.searchsorted(at, "right") - 1
        in_dive = (k >= 0) & (at < ends[k])
        return np.where(in_dive, begins[k], at)

    def error(at: Array) -> Array:
        k = last_ended(ends, at)
        return np.where(k[:, None] < 0, 0.0, mean[k])

    def change(segment: Segment, declination: float) -> Mapping[str, Series]:
        return {
            **segment.quantities,
            **moved(segment, "fix", lambda lat: along(t, way, _came(lat))),
            **moved(segment, "dr", lambda lat: along(t, way, since_fix(lat.t))),
            **with_error(segment, declination, error),
        }

    return changed(segments, change)


def _came(lat: Series) -> Array:
    """When each value of a series came (s) that repeats the one before until there is another."""
    is_new = np.concatenate([[True], lat.v[1:] != lat.v[:-1]])
    return lat.t[np.maximum.accumulate(np.where(is_new, np.arange(len(lat)), 0))]
