"""The way of a dive and the numbers that speak for or against a fault. Pure."""

from __future__ import annotations

from math import atan2, degrees
from statistics import median

import numpy as np

from gliderwatch.model import Array, Current, Fix, Series, Track, readonly
from gliderwatch.navigation.fixes import FASTEST
from gliderwatch.navigation.flight import SPARSE, Flight
from gliderwatch.navigation.frame import to_plane
from gliderwatch.navigation.samples import Samples, get

NOMINAL_SPEED = 0.3
"""m/s: shapes a track where the glider reports no speed; the fixes correct its length."""
FEW = 3
"""Samples in a dive that say how much the thruster was on, or the pump moved."""
STEEP = 0.1
"""rad: pitch of a glider that dives or climbs and does not turn."""
PUMPED = 20e-6
"""m3: a pump that moved less is on its way."""
CIRCLING = 0.1
"""Length of the mean heading vector below which a mean direction means nothing."""


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
    vectors = _headings(samples, t, flight, to_plane(end.lat, end.lon, start.lat, start.lon))
    reckoned = _onboard(samples, t, flight, start)
    if reckoned is None:
        steps = vectors * np.diff(t)[:, None] * _speed(samples, flight)
        reckoned = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    misfit = to_plane(end.lat, end.lon, start.lat, start.lon) - reckoned[-1]
    x = reckoned + misfit * ((t - start.t) / (end.t - start.t))[:, None]
    return Track(readonly(t), readonly(x), readonly(vectors))


def _headings(samples: Samples, t: Array, flight: Flight, moved: Array) -> Array:
    """Unit vectors between successive times of `t`, zero outside the flight.

    Where no heading is known at all the course is taken for steady, along the way over ground ``moved`` (m, (2,)):
    the estimator puts its own direction in place of that.
    """
    middle = (t[1:] + t[:-1]) / 2
    if not len(get(samples, "heading_e").between(flight.start, flight.end)):
        length = float(np.hypot(*moved))
        course = moved / length if length > 1.0 else np.array([1.0, 0.0])
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
    if len(lat) < 4:
        return None
    gaps, covered = np.diff(lat.t), float(lat.t[-1] - lat.t[0])
    if covered < 0.8 * flight.duration or gaps.max() > max(SPARSE, 0.2 * flight.duration):
        return None
    xy = to_plane(lat.v, lon.v, float(lat.v[0]), float(lon.v[0]))
    if (np.hypot(*np.diff(xy, axis=0).T) > FASTEST * gaps + 100.0).any():
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


def evidence(samples: Samples, flight: Flight, track: Track) -> dict[str, float]:
    """Numbers of one dive for people and rules; keys and units in `docs/nomenclature.md`."""
    interval = float(track.t[-1] - track.t[0])
    mean, flown = mean_heading(track)
    out = {
        "duration_h": (flight.end - flight.start) / 3600,
        "fix_gap_minutes": (float(track.t[-1]) - flight.end) / 60,
        "drift_h": (interval - (flight.end - flight.start)) / 3600,
        "ground_speed": float(np.hypot(*track.x[-1])) / interval,
        "heading_steadiness": float(np.hypot(*mean)) * interval / max(flown, 1.0),
        "heading_mean": degrees(atan2(mean[0], mean[1])) % 360,
    }
    commanded = get(samples, "commanded").between(flight.start, flight.end)
    reckoned = get(samples, "reckoned").between(flight.start, flight.end)
    headings = get(samples, "heading_e").between(flight.start, flight.end)
    if (len(commanded) or len(reckoned) or not len(headings)) and has_reckoning(samples, flight):
        out["heading_reckoned"] = 1.0
    elif len(commanded):
        out["heading_commanded"] = len(commanded) / len(headings)
    elif len(reckoned) or not len(headings):
        out["heading_assumed"] = 1.0
    return out | attitude(samples, flight)


def mean_heading(track: Track) -> tuple[Array, float]:
    """Mean over the whole interval of the heading vector (zero at the surface), and seconds flown."""
    dt = np.diff(track.t)
    mean = (track.heading * dt[:, None]).sum(axis=0) / (track.t[-1] - track.t[0])
    return mean, float(dt[np.any(track.heading != 0, axis=1)].sum())


def closure(track: Track, current: Current) -> dict[str, float]:
    """The closure test: what is left of the ground velocity (m/s) without the current.

    ``along_speed`` is its part along the mean heading, divided by the length of that mean: the speed that
    the glider's own flight model believes. ``across_misfit`` is the part across: near zero when
    fixes, compass and current agree. ``across_sigma`` is how much of it a few headings in a dive
    leave open: the standard error of their mean at that speed. Empty where the glider circled.
    """
    mean, flown = mean_heading(track)
    length = float(np.hypot(*mean))
    interval = float(track.t[-1] - track.t[0])
    if length * interval < CIRCLING * max(flown, 1.0):
        return {}
    rest = track.x[-1] / interval - np.array([current.u, current.v])
    along = float(rest @ mean) / length**2
    headings = track.heading[np.any(track.heading != 0, axis=1)]
    aside = (mean[0] * headings[:, 1] - mean[1] * headings[:, 0]) / length
    return {
        "along_speed": along,
        "across_misfit": float(mean[0] * rest[1] - mean[1] * rest[0]) / length,
        # a heading of the track is the mean of two samples, which halves their variance
        "across_sigma": abs(along) * float(np.std(aside)) * (2 / len(aside)) ** 0.5,
    }


def attitude(samples: Samples, flight: Flight) -> dict[str, float]:
    """Depth, pitch, roll and depth rate of the flight, as far as reported."""
    out = {}
    depth = get(samples, "depth").between(flight.start, flight.end)
    pitch = get(samples, "pitch").between(flight.start, flight.end)
    roll = get(samples, "roll").between(flight.start, flight.end)
    speed = get(samples, "speed_onboard").between(flight.start, flight.end)
    thruster = get(samples, "thruster_on").between(flight.start, flight.end)
    if len(depth) > 3 and np.diff(depth.t).max() < SPARSE:
        out["depth_max"] = float(depth.v.max())
    for name, part in (("pitch_dive", pitch.v[pitch.v < -STEEP]), ("pitch_climb", pitch.v[pitch.v > STEEP])):
        if len(part):
            out[name] = float(np.mean(part))
    if len(roll):
        out |= {"roll_mean": float(np.mean(roll.v)), "roll_std": float(np.std(roll.v))}
    if len(speed):
        out["onboard_speed"] = float(np.mean(speed.v))
    if len(thruster) >= FEW:
        out["thruster"] = float(np.mean(thruster.v))
    return out | _depth_rates(depth) | _yos(pitch) | _volumes(samples, flight)


def _yos(pitch: Series) -> dict[str, float]:
    """How often the glider turned from dive to climb."""
    steep = pitch.v[np.abs(pitch.v) > STEEP]
    yos = int(np.sum((steep[:-1] < 0) & (steep[1:] > 0)))
    return {"yos": float(yos)} if yos else {}


def _volumes(samples: Samples, flight: Flight) -> dict[str, float]:
    """Volume pumped (m3) while diving and while climbing, of either pump, and vacuum (Pa)."""
    out = {}
    moved = max((get(samples, name) for name in ("ballast", "oil_volume")), key=len)
    v = moved.between(flight.start, flight.end).v
    # the pump has moved most of the time: what lies between is it moving
    for name, part in (("ballast_dive", v[v < -PUMPED]), ("ballast_climb", v[v > PUMPED])):
        if len(part) >= FEW:
            out[name] = median(part.tolist())
    vacuum = get(samples, "vacuum").between(flight.start, flight.end)
    return out | ({"vacuum": median(vacuum.v.tolist())} if len(vacuum) else {})


def _depth_rates(depth: Series) -> dict[str, float]:
    """Median rates of descent and climb (m/s) from depths at most 5 min apart, below the surface layer."""
    if len(depth) < 6:
        return {}
    dt = np.diff(depth.t)
    near = (dt > 0) & (dt < 300) & (np.minimum(depth.v[1:], depth.v[:-1]) > 3.0)
    rate = np.diff(depth.v)[near] / dt[near]
    out = {}
    for name, part in (("depth_rate_dive", rate[rate > 0.02]), ("depth_rate_climb", rate[rate < -0.02])):
        if len(part) >= 2:
            out[name] = median(part.tolist())
    return out
