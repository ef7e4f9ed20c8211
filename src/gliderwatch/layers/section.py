"""A property along the way of a glider: one mean profile a segment, on one axis of depth. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.layers.casts import Cast, bin_of
from gliderwatch.layers.constants import MOST_DEPTHS
from gliderwatch.model import Array, readonly


@dataclass(frozen=True, slots=True)
class Section:
    """Profiles at times ``t`` (n,) (s, the middle of each segment's casts), between depths ``edges`` (m + 1,)
    (m): ``value`` (n, m), NaN where no sample was."""

    t: Array
    edges: Array
    value: Array


def section(segments: Sequence[Sequence[Cast]]) -> Section:
    """The section of the casts of some segments, in the order given; those without casts are left out.

    The height of a bin is the median of those of the segments (`casts.bin_of`), more where there would be
    above `MOST_DEPTHS` bins.
    """
    held = [casts for casts in segments if casts]
    deepest = max((cast.bottom for casts in held for cast in casts), default=0.0)
    height = float(np.median([bin_of(casts) for casts in held])) if held else 1.0
    n = min(max(math.ceil(deepest / height), 1), MOST_DEPTHS)
    edges = readonly(np.linspace(0.0, max(n * height, deepest), n + 1))
    rows = [_profile(casts, edges) for casts in held]
    t = [(float(casts[0].t[0]) + float(casts[-1].t[-1])) / 2 for casts in held]
    return Section(readonly(np.array(t)), edges, readonly(np.array(rows).reshape(len(held), n)))


def _profile(casts: Sequence[Cast], edges: Array) -> Array:
    """The mean of all samples in each bin (n,); NaN where there is none."""
    depth = np.concatenate([cast.depth for cast in casts])
    value = np.concatenate([cast.value for cast in casts])
    counts, _ = np.histogram(depth, edges)
    sums, _ = np.histogram(depth, edges, weights=value)
    with np.errstate(invalid="ignore"):
        return readonly(sums / np.where(counts > 0, counts, np.nan))
