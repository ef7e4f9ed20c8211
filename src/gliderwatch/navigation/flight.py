"""When between two fixes the glider flew, and when it drifted at the surface. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from gliderwatch.model import EMPTY, Array, Series
from gliderwatch.navigation.constants import (
    DENIES_DIVE,
    DIVING_DEPTH,
    DIVING_PITCH,
    MOSTLY_STEEP,
    RECKONING_GROWS,
)
from gliderwatch.navigation.samples import Samples, get

UNDERWATER = 1
"""Value of a Slocum's ``x_dr_state`` between its last fix before a dive and its surfacing."""


@dataclass(frozen=True, slots=True)
class Flight:
    """The first and last moment under water (s) seen in the samples, and what told it."""

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
    told = {"depth": depth.t[depth.v > DIVING_DEPTH]}
    if len(pitch):
        steep = pitch.t[np.abs(pitch.v) > DIVING_PITCH]
        told["pitch"] = _not_denied(steep, depth, after, before) if len(depth) else _mostly_steep(pitch)
    elif (reckoning := _reckoning(samples, after, before)) is not None:
        told["dead reckoning"] = _not_denied(reckoning, depth, after, before)
    elif len(heading) and not len(depth):
        return Flight(after, before, "heading")
    else:
        told["heading"] = _not_denied(heading.t, depth, after, before)
    times = np.concatenate(list(told.values()))
    if not len(times):
        return None
    evidence = " and ".join(name for name, t in told.items() if len(t))
    return Flight(float(times.min()), float(times.max()), evidence)


def lengthened(
    flight: Flight, samples: Samples, before: float, holes: Iterable[tuple[float, float]]
) -> Flight:
    """The flight until the glider is at the surface again, if the files hold only its beginning.

    Some tell of every third yo only. Where for longer than `DENIES_DIVE` after what was seen there is no
    depth (pitch, where depth is not sent) and no position, the flight goes on to the first of them: at the
    surface a glider tells its position at once. Where a whole file is missing (``holes``, s) that cannot be
    said.
    """
    told = "depth" if len(get(samples, "depth").between(flight.start, before)) else "pitch"
    times = np.concatenate([get(samples, told).t, get(samples, "fix_lat").t])
    end = float(np.min(times[times > flight.end], initial=before))
    if end - flight.end <= DENIES_DIVE or any(a < end and b > flight.end for a, b in holes):
        return flight
    return replace(flight, end=end)


def unseen(samples: Samples, after: float, before: float) -> Flight | None:
    """All of the time between two positions where the files tell nothing of it: there may be a whole dive."""
    told = ("depth", "pitch", "heading_e", "dr_state", "dr_time")
    if any(len(get(samples, name).between(after, before)) for name in told):
        return None
    return Flight(after, before, "nothing")


def _is_stuck(depth: Series, pitch: Series) -> bool:
    """Whether depth is always the same number while the glider glides down and up: it is not measured."""
    glides = _mostly_steep(pitch)
    both = len(glides) > 0 and pitch.v.min() < -DIVING_PITCH and pitch.v.max() > DIVING_PITCH
    return bool(len(depth) > 1 and both and np.ptp(depth.v) == 0.0)


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
    i = np.clip(np.searchsorted(edges, t, "right"), 1, len(edges) - 1)
    denied = shallow[i - 1] & shallow[i] & (edges[i] - edges[i - 1] <= DENIES_DIVE)
    return np.asarray(t[~denied])
