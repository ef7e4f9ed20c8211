"""Faults put onto real missions, segment by segment. Pure.

What is real stays real: currents, gaps, artefacts, cadences, the order of things. From a moment on the
glider is made slower, or its reported current wrong. What the fault would have changed beyond the
data (another way steered, later surfacings) is not there: the mission goes on as it was flown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from math import inf

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array, Dive, Segment, Series, readonly
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.navigation.geodesy import from_plane, magnetic_to_true
from gliderwatch.navigation.track import closure

_POSITIONS = ("fix", "dr")
_CURRENTS = ("current", "current_initial", "current_final")
_SLOWED = ("speed_onboard", "depth_rate", "depth")
_SURFACE = 5.0
"""Metres: where a glider counts as at the surface stays where it is."""
_LEG = 20e3
_EARLY = 120.0
"""s: a current that comes so long before the last sample of a dive is of that dive too."""


class GraftKind(StrEnum):
    """What is grafted; `Graft` says what its size is."""

    SLOWED = "slowed"
    DAC_WRONG = "dac_wrong"


@dataclass(frozen=True, slots=True)
class Graft:
    """A fault to put onto a real mission.

    ``size`` is of `slowed` the part of the speed through the water that is lost (drag on the whole body:
    depth rate and the glider's own speed fall with it, the current stays right), of `dac_wrong` the error
    of the current to the left of the way (m/s; the glider is healthy). Raises ValueError for a
    size that cannot be.
    """

    kind: GraftKind
    size: float

    def __post_init__(self) -> None:
        low, high = (0.0, 0.95) if self.kind is GraftKind.SLOWED else (-2.0, 2.0)
        if not low <= self.size <= high:
            raise ValueError(f"{self.kind} of size {self.size:g}: it is {low:g} to {high:g}")


def navigate(segments: Iterable[Segment]) -> list[Dive]:
    """The dives of a mission whose segments come in the order of time."""
    state, dives = Navigation(), dict[float, Dive]()
    for segment in segments:
        state, updated = extend(state, segment)
        dives |= {dive.t_dive: dive for dive in updated}
    return [dives[t] for t in sorted(dives) if dives[t].end is not None]


def own_speeds(dives: Sequence[Dive]) -> dict[float, float]:
    """By start of dive (s), the speed (m/s) that the glider's own reckoning had, where it can be known."""
    found = {}
    for dive in dives:
        closed = closure(dive.track, dive.current) if dive.track and dive.current else None
        if closed is not None and 0.0 < closed.along_speed < 1.5:
            found[dive.t_dive] = closed.along_speed
    return found


def grafted(
    segments: Sequence[Segment], graft: Graft, onset: float, usual: float, end: float = inf
) -> list[Segment]:
    """The segments with a fault since ``onset`` (s); one that slows the glider ends at ``end`` (s). ``usual``
    (m/s) is the speed of dives that tell none."""
    dives = [dive for dive in navigate(segments) if dive.track is not None]
    change = (
        _slowed(dives, graft.size, (onset, end), usual)
        if graft.kind is GraftKind.SLOWED
        else _wrong(dives, graft.size, onset)
    )
    return changed(segments, change)


Change = Callable[[Segment, float], Mapping[str, Series]]
"""The quantities that a segment has after it, by the segment and its declination (rad)."""


def changed(segments: Iterable[Segment], change: Change) -> list[Segment]:
    """The segments, in the order of time, after a change; one without a declination has that before it."""
    declination, out = 0.0, []
    for segment in segments:
        declination = segment.declination if segment.declination is not None else declination
        out.append(replace(segment, quantities=change(segment, declination)))
    return out


def moved(segment: Segment, name: str, way: Callable[[Series], Array]) -> dict[str, Series]:
    """The positions ``name`` (`fix`, `dr`) of a segment after the ``way`` (m, (n, 2): east, north) of their
    latitudes; none where it has none. One too far for a plane is moved in legs."""
    lat, lon = segment.get(f"{name}_lat"), segment.get(f"{name}_lon")
    if not len(lat) or len(lat) != len(lon):
        return {}
    places = [_from(*place) for place in zip(lat.v.tolist(), lon.v.tolist(), way(lat), strict=True)]
    north, east = zip(*places, strict=True)
    return {f"{name}_lat": Series(lat.t, readonly(north)), f"{name}_lon": Series(lon.t, readonly(east))}


def _from(lat: float, lon: float, way: Array) -> tuple[float, float]:
    legs = 1 + int(np.hypot(*way) / _LEG)
    for _ in range(legs):
        lat, lon = from_plane(way / legs, lat, lon)
    return lat, lon


def along(t: Array, way: Array, at: Array) -> Array:
    """The way (m, (n, 2)) at times ``at`` (s), of which the ``way`` at times ``t`` is known."""
    return np.stack([np.interp(at, t, way[:, 0]), np.interp(at, t, way[:, 1])], axis=-1)


def with_error(segment: Segment, declination: float, error: Callable[[Array], Array]) -> dict[str, Series]:
    """The currents of a segment with an ``error`` (m/s, (n, 2): east, north) by their times (s). Zeros, which
    stand for none, stay."""
    found = {}
    for name in _CURRENTS:
        x, y = segment.get(f"{name}_x"), segment.get(f"{name}_y")
        if len(x) and len(x) == len(y):
            none = (x.v == 0) & (y.v == 0)
            more = magnetic_to_true(np.where(none[:, None], 0.0, error(x.t)), -declination)
            found[f"{name}_x"] = Series(x.t, readonly(x.v + more[:, 0]))
            found[f"{name}_y"] = Series(y.t, readonly(y.v + more[:, 1]))
    return found


def last_ended(ends: Array, t: Array | float) -> NDArray[np.intp]:
    """Of dives that end so (s), the one that a current reported at a time (s) is of; -1: of none."""
    return np.asarray(np.searchsorted(ends, np.asarray(t) + _EARLY) - 1)


def _slowed(dives: Sequence[Dive], size: float, during: tuple[float, float], usual: float) -> Change:
    """Takes a part of the way through the water out of all positions, and of speeds and depths."""
    onset, end = during
    t, lost = lost_way(dives, size, onset, usual, end)

    def change(segment: Segment, _: float) -> Mapping[str, Series]:
        out = dict(segment.quantities)
        for name in (n for n in _SLOWED if n in out):
            at, v = out[name].t, out[name].v
            kept = np.minimum(v, _SURFACE) if name == "depth" else 0.0
            out[name] = Series(
                at, readonly(np.where((at < onset) | (at >= end), v, kept + (1.0 - size) * (v - kept)))
            )
        for name in _POSITIONS:
            out |= moved(segment, name, lambda lat: -along(t, lost, lat.t))
        return out

    return change


def lost_way(
    dives: Sequence[Dive], size: float, onset: float, usual: float, end: float = inf
) -> tuple[Array, Array]:
    """Times (s) and the way (m: east, north) lost until then: part ``size`` of speed times heading."""
    speeds, times, steps = own_speeds(dives), [onset - 1.0], [np.zeros(2)]
    for dive in dives:
        assert dive.track is not None
        speed = speeds.get(dive.t_dive, usual)
        for (a, b), heading in zip(pairwise(dive.track.t.tolist()), dive.track.heading, strict=True):
            begin, until = max(a, onset), min(b, end)
            if until > begin:
                times += [begin, until]
                steps += [np.zeros(2), size * speed * (until - begin) * heading]
    return np.array(times), np.cumsum(steps, axis=0)


def _wrong(dives: Sequence[Dive], size: float, onset: float) -> Change:
    """Adds to each reported current an error to the left of the dive that it is about."""
    ends = np.array([dive.t_surface for dive in dives])

    def error(at: Array) -> Array:
        return np.array([_error(dives, ends, t, size, onset) for t in at.tolist()])

    def change(segment: Segment, declination: float) -> Mapping[str, Series]:
        return {**segment.quantities, **with_error(segment, declination, error)}

    return change


def _error(dives: Sequence[Dive], ends: Array, t: float, size: float, onset: float) -> Array:
    """The error (m/s: east, north) of what is reported at ``t`` (s) of the dive that ended last."""
    i = int(last_ended(ends, t))
    if i < 0 or ends[i] < onset:
        return np.zeros(2)
    track = dives[i].track
    assert track is not None
    way = np.diff(track.t) @ track.heading
    length = float(np.hypot(*way))
    return size * np.array([-way[1], way[0]]) / length if length > 0 else np.zeros(2)
