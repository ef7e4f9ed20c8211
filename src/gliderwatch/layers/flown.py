"""Advised bands flown through recorded water: what would have been seen, at what travel. Pure.

What is outside a band is not seen, so each method lives with what its own advice let it see.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gliderwatch.layers.band import Band, Method, Mode, Tracking, follow
from gliderwatch.layers.casts import Cast, bin_of
from gliderwatch.layers.composite import FLOORS, Composite, composite
from gliderwatch.layers.constants import (
    COUNTED,
    FULL_CASTS,
    LEAST_CASTS,
    LEAST_EXTENSION,
    PART_OF_PEAK,
)
from gliderwatch.model import Array

Advise = Callable[[Tracking, Sequence[Cast]], Tracking]


@dataclass(frozen=True, slots=True)
class Total:
    """Means over segments: ``coverage`` and ``travel`` as in `Flown`; how many ``segments``, and how many of
    them ``complete``, without a band."""

    coverage: float
    travel: float
    segments: int
    complete: int


@dataclass(frozen=True, slots=True)
class Flown:
    """One segment: ``t`` (s) its begin, its ``mode`` and ``band`` (None: all depths), ``coverage`` the part
    of the gradient above a quarter of its peak that its casts went through, ``travel`` its part of the way of
    full casts."""

    t: float
    mode: Mode
    band: Band | None
    coverage: float
    travel: float


def fly(segments: Sequence[Sequence[Cast]], advise: Advise, full_casts: int = 0) -> list[Flown]:
    """Each segment of full `segments` as `advise` would have had it flown, its first `full_casts` in full."""
    tracking, out = Tracking(), []
    for casts in segments:
        if len(casts) < LEAST_CASTS:
            continue
        bands = [tracking.band if i >= full_casts else None for i in range(len(casts))]
        ways = [_way(cast, band) for cast, band in zip(casts, bands, strict=True)]
        full_way = sum(cast.bottom - cast.top for cast in casts)
        travel = sum(bottom - top for top, bottom in ways) / full_way
        covered = _covered(composite(casts, bin_of(casts)), ways)
        out.append(Flown(float(casts[0].t[0]), tracking.mode, tracking.band, covered, travel))
        seen = [cast.within(*way) for cast, way in zip(casts, ways, strict=True)]
        tracking = advise(tracking, [cast for cast in seen if len(cast.depth) > 1])
    return out


def _way(cast: Cast, band: Band | None) -> tuple[float, float]:
    """The depths (m) between which a cast would have gone; no height where the band is out of reach."""
    if band is None:
        return cast.top, cast.bottom
    top = max(cast.top, band.top)
    return top, max(min(cast.bottom, band.bottom), top)


def _covered(truth: Composite, ways: Sequence[tuple[float, float]]) -> float:
    """The part of the gradient above a quarter of its peak that the casts went through, any of them."""
    with np.errstate(invalid="ignore"):
        weight = np.where(np.abs(truth.gradient) > PART_OF_PEAK * truth.peak, np.abs(truth.gradient), 0.0)
    if not weight.any():
        return 1.0
    went = np.max([_seen(truth.edges, *way) for way in ways], axis=0)
    return float(went @ weight / weight.sum())


def _seen(edges: Array, top: float, bottom: float) -> Array:
    """1 for each bin between `edges` (m) of which half at least lies between two depths (m), else 0."""
    inside = np.minimum(edges[1:], bottom) - np.maximum(edges[:-1], top)
    return np.asarray(inside >= np.diff(edges) / 2, dtype=float)


# --------------------------------------------------------------------------- methods


def full(before: Tracking, casts: Sequence[Cast]) -> Tracking:
    """All depths, always."""
    return before


def kept(before: Tracking, casts: Sequence[Cast], property_name: str) -> Tracking:
    """The band of the first segment in which there is a layer, kept."""
    return before if before.band is not None else follow(before, casts, property_name)


def peak(before: Tracking, casts: Sequence[Cast], property_name: str) -> Tracking:
    """The depth of the largest gradient of the last cast, with the height of the first band (Zhang et al.,
    2012: extended until the whole layer is covered)."""
    if before.band is None:
        before = follow(before, casts, property_name)
    if before.band is None or not casts:
        return before
    found = composite([casts[-1]] * LEAST_CASTS, bin_of(casts))
    if not found.peak > 0:
        return before
    assert before.top is not None
    assert before.bottom is not None
    i = int(np.nanargmax(np.abs(found.gradient)))
    middle = (found.edges[i] + found.edges[i + 1]) / 2
    half = (before.bottom - before.top) / 2 + max(LEAST_EXTENSION, before.bin)
    return _banded(before, middle - half, middle + half)


def threshold(before: Tracking, casts: Sequence[Cast], property_name: str) -> Tracking:
    """From the first to the last depth of the last cast where the gradient is above a threshold that is set
    in advance, the floor of the property; extended by a bin (Feng et al., 2021)."""
    if not casts:
        return before
    height = bin_of(casts)
    found = composite([casts[-1]] * LEAST_CASTS, height)
    with np.errstate(invalid="ignore"):
        above = np.flatnonzero(np.abs(found.gradient) > FLOORS.get(property_name, 0.0))
    if not len(above):
        return before
    extension = max(LEAST_EXTENSION, height)
    top, bottom = found.edges[above[0]] - extension, found.edges[above[-1] + 1] + extension
    return _banded(before, float(top), float(bottom))


def _banded(before: Tracking, top: float, bottom: float) -> Tracking:
    return replace(before, mode=Mode.TRACK, band=Band(max(top, 0.0), bottom))


def methods(property_name: str) -> dict[str, tuple[Advise, int]]:
    """Each method by its name, and how many full casts a segment it asks for."""
    by_composite = partial(follow, property_name=property_name)
    return {
        "full yos": (full, 0),
        "first band kept": (partial(kept, property_name=property_name), 0),
        "peak of the last cast": (partial(peak, property_name=property_name), 0),
        "threshold set in advance": (partial(threshold, property_name=property_name), 0),
        "filter": (partial(follow, property_name=property_name, method=Method.FILTER), 0),
        "composite": (by_composite, 0),
        "composite, two full casts": (by_composite, FULL_CASTS),
    }


def compare(segments: Sequence[Sequence[Cast]], property_name: str) -> dict[str, list[Flown]]:
    """All methods through the same water: the segments that have `COUNTED` casts."""
    long = [casts for casts in segments if len(casts) >= COUNTED]
    return {name: fly(long, advise, n) for name, (advise, n) in methods(property_name).items()}


def total(flown: Sequence[Flown]) -> Total:
    """The means of what was flown; at least one segment."""
    coverage, travel = (float(np.mean([getattr(f, name) for f in flown])) for name in ("coverage", "travel"))
    return Total(coverage, travel, len(flown), sum(f.band is None for f in flown))
