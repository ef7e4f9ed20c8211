"""The way of a dive, and whether it closes with the current. Pure."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array, Current, Fix, Series, Track, readonly
from gliderwatch.navigation.constants import (
    CIRCLING,
    FASTEST_OVER_GROUND,
    JUMP,
    NOMINAL_SPEED,
    RECKONED_GAP,
    RECKONED_PART,
    RECKONED_POSITIONS,
    SPARSE,
)
from gliderwatch.navigation.flight import Flight, Samples, get
from gliderwatch.navigation.geodesy import displacement, to_plane


def build_track(samples: Samples, flight: Flight, start: Fix, end: Fix) -> Track:
    """The dead-reckoned track from fix to fix, the misfit spread linearly in time.

    The glider's own dead-reckoned positions give the shape where they cover the flight, otherwise its
    heading and speed. At the surface before and after the flight the track drifts with the misfit
    alone and has no heading.
    """
    heading = get(samples, "heading_e").between(flight.start, flight.end)
    measured = len(heading) and not any(len(get(samples, name)) for name in ("commanded", "reckoned"))
    shape = heading.t if measured else get(samples, "dr_lat").between(flight.start, flight.end).t
    inner = np.unique(np.concatenate([[flight.start, flight.end], heading.t, shape]))
    t = np.unique(np.concatenate([[start.t], inner[(inner > start.t) & (inner < end.t)], [end.t]]))
    moved = displacement(end.lat, end.lon, start.lat, start.lon)
    vectors = _headings(samples, t, flight, moved)
    reckoned = _onboard(samples, t, flight, start)
    if reckoned is None:
        steps = vectors * np.diff(t)[:, None] * _speed(samples, flight)
        reckoned = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    misfit = moved - reckoned[-1]
    x = reckoned + misfit * ((t - start.t) / (end.t - start.t))[:, None]
    return Track(readonly(t), readonly(x), readonly(vectors))


def _headings(samples: Samples, t: Array, flight: Flight, moved: Array) -> Array:
    """Unit vectors between successive times of `t`, zero outside the flight.

    Where no heading is known at all the course is taken for steady, along the way over ground ``moved`` (m,
    (2,)): the estimator puts its own direction in place of that.
    """
    middle = (t[1:] + t[:-1]) / 2
    if not len(get(samples, "heading_e").between(flight.start, flight.end)):
        way = float(np.hypot(*moved))
        course = moved / way if way > 1.0 else np.array([1.0, 0.0])
        flown = (middle >= flight.start) & (middle <= flight.end)
        return np.asarray(np.where(flown[:, None], course, 0.0))
    e, n = get(samples, "heading_e").between(flight.start, flight.end), get(samples, "heading_n")
    n = n.between(flight.start, flight.end)
    vectors = np.stack([np.interp(middle, e.t, e.v), np.interp(middle, n.t, n.v)], axis=-1)
    length = np.hypot(vectors[:, 0], vectors[:, 1])
    flying = (middle >= flight.start) & (middle <= flight.end) & (length > 1e-6)
    return np.asarray(np.where(flying[:, None], vectors / np.maximum(length, 1e-6)[:, None], 0.0))


def _speed(samples: Samples, flight: Flight) -> float:
    speed = get(samples, "speed_onboard").between(flight.start, flight.end)
    return float(np.mean(speed.v)) if len(speed) else NOMINAL_SPEED


def has_reckoning(samples: Samples, flight: Flight) -> bool:
    """Whether the glider's own dead reckoning gives the shape of a flight."""
    return _reckoning(samples, flight) is not None


def _reckoning(samples: Samples, flight: Flight) -> tuple[Series, Series] | None:
    """The glider's own positions on a flight; None if too sparse, or if they jump to a fix."""
    lat = get(samples, "dr_lat").between(flight.start, flight.end)
    lon = get(samples, "dr_lon").between(flight.start, flight.end)
    if len(lat) < RECKONED_POSITIONS:
        return None
    gaps, covered = np.diff(lat.t), float(lat.t[-1] - lat.t[0])
    if covered < RECKONED_PART * flight.duration or gaps.max() > max(SPARSE, RECKONED_GAP * flight.duration):
        return None
    xy = to_plane(lat.v, lon.v, float(lat.v[0]), float(lon.v[0]))
    if (np.hypot(*np.diff(xy, axis=0).T) > FASTEST_OVER_GROUND * gaps + JUMP).any():
        return None
    return lat, lon


def _onboard(samples: Samples, t: Array, flight: Flight, start: Fix) -> Array | None:
    """The glider's own dead reckoning at times `t`, from 0 at the start of the flight; None if too sparse.

    Before its first and after its last position the glider is taken to go on at the mean rate.
    """
    found = _reckoning(samples, flight)
    if found is None:
        return None
    lat, lon = found
    covered, xy = float(lat.t[-1] - lat.t[0]), to_plane(lat.v, lon.v, start.lat, start.lon)
    rate = (xy[-1] - xy[0]) / covered
    first = xy[0] - rate * (lat.t[0] - flight.start)
    last = xy[-1] + rate * (flight.end - lat.t[-1])
    times = np.concatenate([[flight.start], lat.t, [flight.end]])
    xy = np.concatenate([[first], xy, [last]]) - first
    return np.stack([np.interp(t, times, xy[:, 0]), np.interp(t, times, xy[:, 1])], axis=-1)


@lru_cache(maxsize=64)
def mean_heading(track: Track) -> tuple[Array, float]:
    """Mean over the whole interval of the heading vector (zero at the surface), and seconds flown."""
    dt = track.t[1:] - track.t[:-1]
    mean = (track.heading * dt[:, None]).sum(axis=0) / (track.t[-1] - track.t[0])
    return readonly(mean), float(dt[flown(track)].sum())


@lru_cache(maxsize=64)
def flown(track: Track) -> NDArray[np.bool_]:
    """Which intervals of a track have a heading, (n - 1,): at the surface there is none."""
    return np.asarray((track.heading[:, 0] != 0) | (track.heading[:, 1] != 0))


class Closure(NamedTuple):
    """What is left of the ground velocity of a dive without its current.

    ``along_speed`` (m/s) is its part along the mean heading, divided by the length of that mean: the speed
    that the glider's own flight model believes. ``across_misfit`` (m/s) is the part across: near zero when
    fixes, compass and current agree. ``across_sigma`` (m/s) is how much of it a few headings in a dive
    leave open: the standard error of their mean at that speed.
    """

    along_speed: float
    across_misfit: float
    across_sigma: float


def closure(track: Track, current: Current) -> Closure | None:
    """The closure test of a dive; None where the glider circled."""
    mean, seconds = mean_heading(track)
    length = float(np.hypot(*mean))
    interval = float(track.t[-1] - track.t[0])
    if length * interval < CIRCLING * max(seconds, 1.0):
        return None
    rest = track.x[-1] / interval - np.array([current.u, current.v])
    along = float(rest @ mean) / length**2
    spread, n = _swing(track)
    return Closure(
        along_speed=along,
        across_misfit=float(mean[0] * rest[1] - mean[1] * rest[0]) / length,
        # a heading of the track is the mean of two samples, which halves their variance
        across_sigma=abs(along) * spread * (2 / n) ** 0.5,
    )


@lru_cache(maxsize=64)
def _swing(track: Track) -> tuple[float, int]:
    """By how much the headings of a track swing about their mean, as parts of a unit vector, and how many
    they are."""
    mean, _ = mean_heading(track)
    headings = track.heading[flown(track)]
    aside = (mean[0] * headings[:, 1] - mean[1] * headings[:, 0]) / float(np.hypot(*mean))
    return float(np.std(aside)), len(aside)
