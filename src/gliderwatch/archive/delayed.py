"""A mission in delayed mode: the currents of its dives with the angle of attack, and the speed and the way
that the smoothed currents leave (002)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid

from gliderwatch.estimation.dive_measurement import observe
from gliderwatch.model import Array, Assessment, Dive, Flag, readonly
from gliderwatch.navigation.geodesy import from_plane
from gliderwatch.sea.smoother import Currents, MeanCurrent

SHORT = 0.1
"""Length of the mean heading vector of a dive below which its way through the water tells no speed."""


def losses(dives: Iterable[Assessment]) -> dict[float, tuple[float, float]]:
    """By the start (s) of each dive with flag 1 the slip that was estimated, and its standard error."""
    keys = ("slip", "slip_sigma")
    return {
        dive.t_dive: (dive.evidence["slip"], dive.evidence["slip_sigma"])
        for dive in dives
        if dive.flag == Flag.ANOMALY and all(key in dive.evidence for key in keys)
    }


def mean_currents(
    dives: Iterable[Dive], slips: Mapping[float, tuple[float, float]] = MappingProxyType({})
) -> list[MeanCurrent]:
    """The depth-averaged currents of dives, with the angle of attack in the reckoning.

    On board the way through the water is reckoned from depth rate and pitch, so that the part that the angle
    of attack takes (`slip` of an observation) is left in the current: it is given back, half of it being its
    error (002, "delayed mode"). Where something was lost, ``slips`` has what counts instead (`losses`).
    """
    out = list[MeanCurrent]()
    for dive in dives:
        if dive.track is None or dive.current is None or dive.end is None:
            continue
        seen = observe(dive)
        rest = seen.rest
        if rest is None or seen.current is None or (out and seen.start < out[-1].end):
            continue
        slip, error = slips.get(dive.t_dive, (seen.slip, 0.5 * seen.slip))
        sigma = float(np.hypot(seen.current_sigma, error * np.hypot(*rest)))
        current = readonly(seen.current + slip * rest)
        out.append(MeanCurrent(seen.start, seen.end, current, sigma, dive.end.lat))
    return out


def speeds(dives: Sequence[Dive], found: Currents) -> tuple[Array, Array]:
    """Speed through the water (m/s) of each dive by what is left of its ground velocity, and the middle of
    each (s)."""
    t, speed = list[float](), list[float]()
    for dive, inside in _within(dives, found):
        seen = observe(dive)
        if seen.steadiness > SHORT:
            current = _mean(found.t[inside], found.total[inside])
            t.append((seen.start + seen.end) / 2)
            speed.append(float(np.hypot(*(seen.ground - current))) / seen.steadiness)
    return readonly(np.array(t)), readonly(np.array(speed))


def way(dives: Sequence[Dive], found: Currents) -> tuple[Array, Array]:
    """Where the glider was: times (s, (n,)) and places (degrees, (n, 2): latitude, longitude).

    The track of a dive has its mean current at each moment; here it has the one of that moment, so that the
    ends stay where they are, and what lies between is moved by the tide.
    """
    times, places = list[float](), list[Array]()
    for dive, inside in _within(dives, found):
        if dive.track is None or dive.start is None:
            continue
        t, current = found.t[inside], found.total[inside]
        beside = current - _mean(t, current)
        moved = cumulative_trapezoid(beside, t, axis=0, initial=0)
        track = np.stack([np.interp(t, dive.track.t, dive.track.x[:, i]) for i in range(2)], -1)
        times += t.tolist()
        places += [np.array(from_plane(x, dive.start.lat, dive.start.lon)) for x in track + moved]
    return readonly(np.array(times)), readonly(np.array(places).reshape(-1, 2))


def _within(dives: Sequence[Dive], found: Currents) -> Iterator[tuple[Dive, slice]]:
    """The dives during which there are currents, each with their place."""
    for dive in dives:
        if dive.track is None or dive.end is None:
            continue
        seen = observe(dive)
        first, last = np.searchsorted(found.t, (seen.start - 1.0, seen.end + 1.0))
        if last - first > 1:
            yield dive, slice(int(first), int(last))


def _mean(t: Array, v: Array) -> Array:
    """The mean over time (of (n, 2): (2,)) of what is given at times (s)."""
    return np.asarray(trapezoid(v, t, axis=0) / (t[-1] - t[0]))
