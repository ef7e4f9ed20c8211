"""When between two fixes the glider flew, and when it drifted at the surface. Pure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.model import Array, Series
from gliderwatch.navigation.samples import Samples, get

DIVING_DEPTH = 3.0
"""Metres: deeper than the pitching of a glider at the surface in waves."""
DIVING_PITCH = 0.2
"""Radians: a glider glides steeper than this, and lies flatter at the surface."""
SPARSE = 1800.0
"""Seconds: the coarsest cadence of a real-time file; samples further apart leave a hole."""


@dataclass(frozen=True, slots=True)
class Flight:
    """The first and last moment under water (s) seen in the samples, and what told it."""

    start: float
    end: float
    evidence: str


def find_flight(samples: Samples, after: float, before: float) -> Flight | None:
    """The flight between two times, or None for a drift at the surface.

    Depth and pitch tell: some files hold depth only near the surface. Then the time since dead
    reckoning began. Headings inside a hole of the depths count where no pitch is reported: at the
    surface a glider reports none. Where only heading is there at all, all of the interval
    is taken for flight.
    """
    depth, pitch, heading = (
        get(samples, name).between(after, before) for name in ("depth", "pitch", "heading_e")
    )
    told = {
        "depth": depth.t[depth.v > DIVING_DEPTH],
        "pitch": pitch.t[np.abs(pitch.v) > DIVING_PITCH],
        "dead reckoning": _reckoning(samples, after, before),
    }
    if not len(pitch):
        told["heading"] = _in_holes(heading.t, depth, after, before)
    times = np.concatenate(list(told.values()))
    if not len(times):
        return None
    evidence = " and ".join(name for name, t in told.items() if len(t))
    if evidence == "heading" and not len(depth):
        return Flight(after, before, evidence)
    return Flight(float(times.min()), float(times.max()), evidence)


def _reckoning(samples: Samples, after: float, before: float) -> Array:
    """Times at which the glider says that it is dead reckoning, that is under water."""
    reckoning = get(samples, "dr_time").between(after, before)
    return reckoning.t[reckoning.v > 0]


def _in_holes(t: Array, series: Series, after: float, before: float) -> Array:
    """Those of the times `t` that lie where `series` has no sample for longer than `SPARSE`."""
    edges = np.concatenate([[after], series.t, [before]])
    i = np.clip(np.searchsorted(edges, t, "right"), 1, len(edges) - 1)
    return np.asarray(t[edges[i] - edges[i - 1] > SPARSE])
