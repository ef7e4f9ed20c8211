"""The samples of a segment as navigation needs them: thinned, and relative to true north. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import EMPTY, Array, Segment, Series, readonly
from gliderwatch.navigation.constants import (
    FASTEST_RECKONED,
    FULL_POWER,
    LONGEST_STEP,
    SHORTEST_STEP,
    SLOWEST_RECKONED,
    SPACING,
)
from gliderwatch.navigation.frame import heading_vectors, magnetic_to_true, to_plane

Samples = Mapping[str, Series]


_VOLUMES = ("ballast", "oil_volume")
_KEPT = ("pitch", "roll", "depth", "speed_onboard", "dr_state", "dr_time", "thruster_on", "vacuum", *_VOLUMES)
_PAIRS = (("fix_lat", "fix_lon"), ("dr_lat", "dr_lon"))
_EXACT = ("fix_", "current_")
"""Beginnings of the names of quantities of which every value matters."""
_FIRST = ("dr_", "waypoint_", "gps_status", "inflections")
"""Of those that jump, the first in each bin is kept: a mean would be a value that never was."""


def compact(quantities: Mapping[str, Series]) -> dict[str, Series]:
    """The quantities of a segment with samples finer than `SPACING` averaged.

    Angles of compass are averaged as vectors; of what jumps the first in each bin is kept, fixes
    and currents stay whole. Doing it twice changes nothing.
    """
    out = {}
    for name, series in quantities.items():
        if name.startswith(_EXACT) or len(starts := _bins(series.t)) == len(series):
            out[name] = series
        elif name.startswith(_FIRST):
            out[name] = Series(readonly(series.t[starts]), readonly(series.v[starts]))
        elif name.startswith("heading"):
            mean = _mean(np.exp(1j * series.v), starts)
            out[name] = Series(readonly(_mean(series.t, starts)), readonly(np.angle(mean) % (2 * np.pi)))
        else:
            out[name] = Series(readonly(_mean(series.t, starts)), readonly(_mean(series.v, starts)))
    return out


def _bins(t: Array) -> NDArray[np.intp]:
    """Index of the first sample in each bin of `SPACING` seconds that holds any."""
    bins = np.floor(t / SPACING)
    return np.flatnonzero(np.concatenate([[True], bins[1:] != bins[:-1]])) if len(t) else np.empty(0, np.intp)


def _mean(values: NDArray[Any], starts: NDArray[np.intp]) -> NDArray[Any]:
    counts = np.diff(np.append(starts, len(values)))
    return np.asarray(np.add.reduceat(values, starts) / counts)


def joined(a: Series, b: Series) -> tuple[Array, Array, Array]:
    """Times at which both series have a value, and the two values there."""
    if len(a) == len(b) and np.array_equal(a.t, b.t):
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
    given = compact({name: segment.quantities[name] for name in wanted if name in segment.quantities})
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
            name, (t, vectors) = "reckoned", _reckoned(out)
        if len(t):
            out[name] = Series(readonly(t), readonly(np.ones(len(t))))
    _add(out, ("heading_e", "heading_n"), t, vectors)
    return MappingProxyType(out)


def _reckoned(samples: Mapping[str, Series]) -> tuple[Array, NDArray[np.float64]]:
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
