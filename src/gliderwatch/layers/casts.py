"""The casts of a segment: its ways down and up, each a profile. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gliderwatch.layers.constants import LEAST_BIN, LEAST_CAST, LEAST_PART, SAMPLES_A_BIN
from gliderwatch.model import Array, Series, readonly


@dataclass(frozen=True, slots=True)
class Cast:
    """One way down or up: times ``t`` (s), ``depth`` (m) and ``value``, each (n,), in the order of time."""

    t: Array
    depth: Array
    value: Array

    @property
    def top(self) -> float:
        """The least depth (m)."""
        return float(self.depth.min())

    @property
    def bottom(self) -> float:
        """The greatest depth (m)."""
        return float(self.depth.max())

    def within(self, top: float, bottom: float) -> Cast:
        """What of it lies between two depths (m)."""
        keep = (self.depth >= top) & (self.depth <= bottom)
        return Cast(readonly(self.t[keep]), readonly(self.depth[keep]), readonly(self.value[keep]))


def split(depth: Series, value: Series) -> tuple[Cast, ...]:
    """The casts in samples of `depth` (m) and of a value; the depth is straight between its samples.

    A turn is where the way goes back by `LEAST_CAST`, or by `LEAST_PART` of all depths: a glider that drifts
    at depth makes no casts. Samples of the value before the first and after the last depth are left out.
    """
    if len(depth) < 2 or not len(value):
        return ()
    value = value.between(float(depth.t[0]), float(depth.t[-1]))
    z = np.interp(value.t, depth.t, depth.v)
    casts = []
    least = max(LEAST_CAST, LEAST_PART * float(np.ptp(z))) if len(z) else LEAST_CAST
    turns = _turns(z, least)
    for i, j in pairwise(turns):
        if abs(z[j] - z[i]) >= least:
            part = slice(i, j + 1)
            casts.append(Cast(readonly(value.t[part]), readonly(z[part]), readonly(value.v[part])))
    return tuple(casts)


def _turns(z: Array, least: float) -> list[int]:
    """Where the way turns, with the first and the last sample."""
    if not len(z):
        return []
    turns, low, high, sign = [0], 0, 0, 0
    for i in range(1, len(z)):
        low, high = (i if z[i] < z[low] else low), (i if z[i] > z[high] else high)
        if sign >= 0 and z[high] - z[i] >= least:
            turns.append(high)
            sign, low, high = -1, i, i
        elif sign <= 0 and z[i] - z[low] >= least:
            turns.append(low)
            sign, low, high = 1, i, i
    turns.append(len(z) - 1 if sign == 0 else high if sign > 0 else low)
    return turns


def bin_of(casts: Sequence[Cast]) -> float:
    """The height of a bin (m) for the spacing of samples of `casts`."""
    steps = [np.abs(np.diff(cast.depth)) for cast in casts if len(cast.depth) > 1]
    spacing = float(np.median(np.concatenate(steps))) if steps else 0.0
    return max(SAMPLES_A_BIN * spacing, LEAST_BIN)
