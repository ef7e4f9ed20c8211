"""The samples of a segment as navigation needs them, and when the glider flew and when it drifted at the
surface. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import EMPTY, Array, Segment, Series, readonly
from gliderwatch.navigation.constants import (
    DENIES_DIVE,
    DIVING_DEPTH,
    DIVING_PITCH,
    FASTEST_RECKONED,
    FULL_POWER,
    LONGEST_STEP,
    MOSTLY_STEEP,
    RECKONING_GROWS,
    SCIENCE_SPACING,
    SHORTEST_STEP,
    SLOWEST_RECKONED,
    SPACING,
)
from gliderwatch.navigation.geodesy import heading_vectors, magnetic_to_true, to_plane

# ----------------------------------------
# The samples of a segment as navigation needs them: thinned, and relative to true north.

Samples = Mapping[str, Series]


_VOLUMES = ("ballast", "oil_volume")
_KEPT = ("pitch", "roll", "depth", "speed_onboard", "dr_state", "dr_time", "thruster_on", "vacuum", *_VOLUMES)
_PAIRS = (("fix_lat", "fix_lon"), ("dr_lat", "dr_lon"))
_EXACT = ("fix_", "current_")
"""Beginnings of the names of quantities of which every value matters."""
_SCIENCE = ("temperature", "conductivity", "science_pressure", "oxygen")
_FIRST = ("dr_", "waypoint_", "gps_status", "inflections")
"""Of those that jump, the first in each bin is kept: a mean would be a value that never was."""


def downsample(quantities: Mapping[str, Series]) -> dict[str, Series]:
    """The quantities of a segment with samples finer than `SPACING`, of science finer than
    `SCIENCE_SPACING`, averaged.

    Angles of compass are averaged as vectors; of what jumps the first in each bin is kept, fixes
    and currents keep all rows. Doing it twice changes nothing.
    """
    out = {}
    for name, series in quantities.items():
        if name.startswith(_EXACT):
            out[name] = series
            continue
        bins = np.floor(series.t / (SCIENCE_SPACING if name in _SCIENCE else SPACING))
        others = bins[1:] != bins[:-1]
        if others.all():  # as sparse already as it is to be
            out[name] = series
            continue
        starts = np.flatnonzero(np.concatenate([[True], others]))
        if name.startswith(_FIRST):
            out[name] = Series(readonly(series.t[starts]), readonly(series.v[starts]))
        elif name.startswith("heading"):
            mean = _mean(np.exp(1j * series.v), starts)
            out[name] = Series(readonly(_mean(series.t, starts)), readonly(np.angle(mean) % (2 * np.pi)))
        else:
            out[name] = Series(readonly(_mean(series.t, starts)), readonly(_mean(series.v, starts)))
    return out


def _mean(values: NDArray[Any], starts: NDArray[np.intp]) -> NDArray[Any]:
    counts = np.diff(np.append(starts, len(values)))
    return np.asarray(np.add.reduceat(values, starts) / counts)


def joined(a: Series, b: Series) -> tuple[Array, Array, Array]:
    """Times at which both series have a value, and the two values there."""
    if a.t is b.t or (len(a) == len(b) and (a.t == b.t).all()):
        return a.t, a.v, b.v
    t, i, j = np.intersect1d(a.t, b.t, return_indices=True)
    return t, a.v[i], b.v[j]


def prepare(segment: Segment, declination: float) -> Samples:
    """What navigation needs of a segment; vectors relative to true north by `declination` (rad).

    Keys: ``fix_lat, fix_lon, dr_lat, dr_lon`` (degrees), ``heading_e, heading_n`` (unit vectors;
    the commanded heading where the measured one is absent, else the
    direction of the dead-reckoned way), ``pitch, roll`` (rad), ``depth`` (m),
    ``speed_onboard`` (m/s), ``dr_state``, ``dr_time`` (s), ``thruster_on`` (0 to 1; by its power where the
    setting is absent), ``vacuum`` (Pa), ``ballast``, ``oil_volume`` (m3); ``commanded``, 1 at each heading
    that is a commanded one, ``reckoned`` at each that is a
    direction of the dead-reckoned way.
    """
    source = "heading" if len(segment.get("heading")) else "heading_commanded"
    wanted = (*_KEPT, "thruster_power", source, *(name for pair in _PAIRS for name in pair))
    given = downsample({name: segment.quantities[name] for name in wanted if name in segment.quantities})
    out = {name: given[name] for name in _KEPT if name in given}
    if "thruster_on" not in given and "thruster_power" in given:
        power = given["thruster_power"]
        out["thruster_on"] = Series(power.t, readonly(np.sqrt(np.minimum(power.v / FULL_POWER, 1.0))))
    for pair in _PAIRS:
        t, lat, lon = joined(given.get(pair[0], EMPTY), given.get(pair[1], EMPTY))
        _add(out, pair, t, np.stack([lat, lon], axis=-1))
    heading = given.get(source, EMPTY)
    t, vectors = heading.t, magnetic_to_true(heading_vectors(heading.v), declination)
    if source == "heading_commanded":
        name = "commanded"
        if not len(t):
            name, (t, vectors) = "reckoned", _dead_reckoned_headings(out)
        if len(t):
            out[name] = Series(readonly(t), readonly(np.ones(len(t))))
    _add(out, ("heading_e", "heading_n"), t, vectors)
    return MappingProxyType(out)


def _dead_reckoned_headings(samples: Mapping[str, Series]) -> tuple[Array, NDArray[np.float64]]:
    """Directions of the dead-reckoned way, for files without headings: times in the middle of steps, unit
    vectors.

    Steps to a fix, at the surface, are faster than any flight, or none at all.
    """
    lat, lon = samples.get("dr_lat", EMPTY), samples.get("dr_lon", EMPTY)
    if len(lat) < 2:
        return lat.t[:0], np.empty((0, 2))
    dt = np.diff(lat.t)
    step = np.diff(to_plane(lat.v, lon.v, float(lat.v[0]), float(lon.v[0])), axis=0)
    speed = np.hypot(*step.T) / np.maximum(dt, 1e-3)
    good = (
        (dt >= SHORTEST_STEP) & (dt <= LONGEST_STEP) & (speed > SLOWEST_RECKONED) & (speed < FASTEST_RECKONED)
    )
    return (lat.t[1:] - dt / 2)[good], step[good] / (speed * dt)[good, None]


def _add(out: dict[str, Series], names: tuple[str, str], t: Array, vectors: Array) -> None:
    if len(t):
        for i, name in enumerate(names):
            out[name] = Series(readonly(t), readonly(vectors[:, i]))


def concatenated(first: Samples, second: Samples) -> Samples:
    """The samples of both, in order of time; where they overlap in time both are kept."""
    out = dict(first)
    for name, series in second.items():
        before = out.get(name)
        if before is None or not len(before):
            out[name] = series
            continue
        t, v = np.concatenate([before.t, series.t]), np.concatenate([before.v, series.v])
        order = np.argsort(t, kind="stable")
        out[name] = Series(readonly(t[order]), readonly(v[order]))
    return MappingProxyType(out)


def after(samples: Samples, t: float) -> Samples:
    """The samples later than `t` (s)."""
    out = {}
    for name, series in samples.items():
        i = int(series.t.searchsorted(t, "right"))
        if i < len(series):
            out[name] = Series(series.t[i:], series.v[i:])
    return MappingProxyType(out)


def get(samples: Samples, name: str) -> Series:
    """The samples of one quantity, empty where there are none."""
    return samples.get(name, EMPTY)


# ----------------------------------------
# When between two fixes the glider flew, and when it drifted at the surface.

UNDERWATER = 1
"""Value of a Slocum's ``x_dr_state`` between its last fix before a dive and its surfacing."""


@dataclass(frozen=True, slots=True)
class Flight:
    """The first and last moment under water (s) seen in the samples, and what showed it."""

    start: float
    end: float
    evidence: str

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.end - self.start


def find_flight(samples: Samples, after: float, before: float) -> Flight | None:
    """The flight between two times, or None for a drift at the surface.

    Depth tells. Some files hold it only near the surface, or seldom: where it does not deny it, pitch
    tells; where no pitch is reported, the state of dead reckoning; where that is not in the file
    either, heading, which is not reported at the surface. Where only heading is there at all,
    all of the interval is taken for flight.
    """
    depth, pitch, heading = (
        get(samples, name).between(after, before) for name in ("depth", "pitch", "heading_e")
    )
    if _is_stuck(depth, pitch):
        depth = EMPTY
    seen = {"depth": depth.t[depth.v > DIVING_DEPTH]}
    if len(pitch):
        steep = pitch.t[np.abs(pitch.v) > DIVING_PITCH]
        seen["pitch"] = _not_denied(steep, depth, after, before) if len(depth) else _mostly_steep(pitch)
    elif (reckoning := _reckoning(samples, after, before)) is not None:
        seen["dead reckoning"] = _not_denied(reckoning, depth, after, before)
    elif len(heading) and not len(depth):
        return Flight(after, before, "heading")
    else:
        seen["heading"] = _not_denied(heading.t, depth, after, before)
    times = np.concatenate(list(seen.values()))
    if not len(times):
        return None
    evidence = " and ".join(name for name, t in seen.items() if len(t))
    return Flight(float(times.min()), float(times.max()), evidence)


def lengthened(
    flight: Flight, samples: Samples, before: float, holes: Iterable[tuple[float, float]]
) -> Flight:
    """The flight until the glider is at the surface again, if the files hold only its beginning.

    Some tell of every third yo only. Where for longer than `DENIES_DIVE` after what was seen there is no
    depth (pitch, where depth is not sent) and no position, the flight goes on to the first of them: at the
    surface a glider reports its position at once. Where a whole file is missing (``holes``, s) that is not
    certain.
    """
    sensor = "depth" if len(get(samples, "depth").between(flight.start, before)) else "pitch"
    times = np.concatenate([get(samples, sensor).t, get(samples, "fix_lat").t])
    end = float(np.min(times[times > flight.end], initial=before))
    if end - flight.end <= DENIES_DIVE or any(a < end and b > flight.end for a, b in holes):
        return flight
    return replace(flight, end=end)


def unseen(samples: Samples, after: float, before: float) -> Flight | None:
    """All of the time between two positions where the files tell nothing of it: there may be a whole dive."""
    names = ("depth", "pitch", "heading_e", "dr_state", "dr_time")
    if any(len(get(samples, name).between(after, before)) for name in names):
        return None
    return Flight(after, before, "nothing")


def _is_stuck(depth: Series, pitch: Series) -> bool:
    """Whether depth is always the same number while the glider glides down and up: it is not measured."""
    if len(depth) < 2 or depth.v.min() != depth.v.max():
        return False
    both = len(pitch) > 0 and pitch.v.min() < -DIVING_PITCH and pitch.v.max() > DIVING_PITCH
    return bool(both and len(_mostly_steep(pitch)) > 0)


def _mostly_steep(pitch: Series) -> Array:
    """Times of steep pitches, none where most of those between them are flat: a glider in waves."""
    steep = np.abs(pitch.v) > DIVING_PITCH
    at = np.flatnonzero(steep)
    flies = len(at) > 0 and steep[at[0] : at[-1] + 1].mean() > MOSTLY_STEEP
    return pitch.t[at] if flies else pitch.t[:0]


def _reckoning(samples: Samples, after: float, before: float) -> Array | None:
    """Times at which the glider says that it is dead reckoning under water; None: it does not say."""
    state = get(samples, "dr_state").between(after, before)
    if len(state):
        return np.asarray(state.t[state.v == UNDERWATER])
    counted = get(samples, "dr_time").between(after, before)
    if not len(counted):
        return None
    grows = np.diff(counted.v) > RECKONING_GROWS * np.diff(counted.t)
    return np.asarray(counted.t[1:][grows])


def _not_denied(t: Array, depth: Series, after: float, before: float) -> Array:
    """Those of the times `t` that are not between two shallow depths at most `DENIES_DIVE` apart.

    At the fixes before and after the glider is at the surface.
    """
    if not len(depth):
        return t
    edges = np.concatenate([[after], depth.t, [before]])
    shallow = np.concatenate([[True], depth.v <= DIVING_DEPTH, [True]])
    i = np.minimum(np.maximum(edges.searchsorted(t, "right"), 1), len(edges) - 1)
    denied = shallow[i - 1] & shallow[i] & (edges[i] - edges[i - 1] <= DENIES_DIVE)
    return np.asarray(t[~denied])
