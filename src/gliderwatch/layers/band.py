"""The band to fly in the next segment, from the casts of the last (004, brought to shore). Pure.

A Slocum can not be steered while it dives: the loop closes once a surfacing. The states are those of 004
Fig. 3: a complete segment, then the layer is tracked, until it is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import chain

import numpy as np

from gliderwatch.layers import constants as c
from gliderwatch.layers.casts import Cast, bin_of
from gliderwatch.layers.composite import Composite, Layer, composite, layers_of
from gliderwatch.model import Array
from gliderwatch.papers.extremum_seeking import begin, step

Costs = list[tuple[float, float]]
"""Of one cast: how much deeper (m) from sample to sample, and the cost (1) there."""


class Method(StrEnum):
    """How the band is chosen: by the composite of all casts, or by the filter of 004."""

    COMPOSITE = "composite"
    FILTER = "filter"


class Mode(StrEnum):
    """``COMPLETE``: fly all depths; ``TRACK``: fly the band; ``RESET``: the layer was lost, fly all."""

    COMPLETE = "complete"
    TRACK = "track"
    RESET = "reset"


@dataclass(frozen=True, slots=True)
class Band:
    """Depths (m) between which to fly: climb to ``top``, dive to ``bottom``."""

    top: float
    bottom: float


@dataclass(frozen=True, slots=True)
class Tracking:
    """What is known of the layers of a glider after a segment.

    ``mode`` and ``band`` are the advice for the next segment; the band is None where all depths are to be
    flown. ``top`` and ``bottom`` (m) are the smoothed limits of the layers, ``peak`` (unit per m) the
    reference of the gradient, ``complete_t`` (s) the end of the last segment of all depths, ``bin`` (m) the
    height of its bins; ``layers`` are those of the last segment, ``why`` says in words why the mode is so.
    """

    mode: Mode = Mode.COMPLETE
    band: Band | None = None
    top: float | None = None
    bottom: float | None = None
    peak: float = 0.0
    complete_t: float | None = None
    bin: float = 0.0
    layers: tuple[Layer, ...] = ()
    why: str = "no casts yet"


def follow(
    before: Tracking,
    casts: Sequence[Cast],
    property_name: str,
    method: Method = Method.COMPOSITE,
    extension: float | None = None,
) -> Tracking:
    """What is known after a segment with `casts`, and the advice for the next.

    `property_name` is what the casts hold (`FLOORS`); `extension` (m) is added to the layer above and below,
    else it is a bin, 2 m at least. Without two casts all stays as it was.
    """
    if len(casts) < c.LEAST_CASTS:
        return before
    # While it tracks, in the bins of the last segment of all depths: gradients in others are not alike, and
    # the few samples within a band would have others.
    height = bin_of(casts) if before.band is None else before.bin
    found = composite(casts, height)
    now = replace(before, layers=layers_of(found, property_name), bin=height)
    last_t = float(casts[-1].t[-1])
    if before.complete_t is None or _flew_all(before.band, casts, height):
        now = replace(now, complete_t=last_t)
    by_filter = method is Method.FILTER and before.band is not None
    costs = [costs_of(cast, before.peak) for cast in casts] if by_filter else []
    lost = _low(costs) if by_filter else _lost(before, now, found, last_t)
    if lost:
        mode = Mode.COMPLETE if before.band is None else Mode.RESET
        # Where all depths were seen and nothing is there, what was known of the layer is of no use any more.
        return replace(now, mode=mode, band=None, top=None, bottom=None, peak=found.peak, why=lost)
    extension = extension or max(c.LEAST_EXTENSION, height)
    if by_filter:
        return _shifted(now, costs, extension)
    return _tracked(before, now, found, extension)


def _flew_all(band: Band | None, casts: Sequence[Cast], height: float) -> bool:
    """Whether two casts went well below the band: as advised, or because nobody had the advice flown."""
    if band is None:
        return True
    return sum(cast.bottom > band.bottom + 2 * height for cast in casts) >= c.LEAST_CASTS


def _lost(before: Tracking, now: Tracking, found: Composite, last_t: float) -> str:
    """Why the layer is not to be tracked; empty where it is."""
    if not now.layers:
        return "no layer"
    best = max(now.layers, key=lambda layer: abs(layer.strength))
    if best.confidence < c.LEAST_CONFIDENCE:
        return f"only {best.confidence:.0%} of the casts show the layer"
    if before.band is not None and found.peak < c.LOST * before.peak:
        return f"its gradient fell to {found.peak / before.peak:.0%}"
    if before.band is not None and now.complete_t is not None and last_t - now.complete_t > c.LONGEST_TRACK:
        return f"no segment of all depths for {c.LONGEST_TRACK / 3600:.0f} h"
    return ""


def _tracked(before: Tracking, now: Tracking, found: Composite, extension: float) -> Tracking:
    """The band of the composite: smoothed limits, extended."""
    top, bottom = now.layers[0].top, now.layers[-1].bottom
    above = below = extension
    if before.top is not None and before.bottom is not None:
        top = c.NEW_PART * top + (1 - c.NEW_PART) * before.top
        bottom = c.NEW_PART * bottom + (1 - c.NEW_PART) * before.bottom
        above += min(abs(top - before.top), c.MOST_MOVED * extension)
        below += min(abs(bottom - before.bottom), c.MOST_MOVED * extension)
    first, last = np.flatnonzero(np.isfinite(found.gradient))[[0, -1]]
    seen_top, seen_bottom = found.edges[first], found.edges[last + 1]
    # Where no band ended the casts, the bottom did, and it may lie deeper where the glider comes to.
    free = before.band is None or abs(seen_bottom - before.band.bottom) > found.bin / 2
    if now.layers[0].top <= seen_top:
        above += c.EDGE_EXTENSIONS * extension
    if now.layers[-1].bottom >= seen_bottom - (found.bin if free else 0.0):
        below += c.EDGE_EXTENSIONS * extension
    band = _steady(before.band, Band(max(top - above, 0.0), bottom + below), extension)
    return replace(now, mode=Mode.TRACK, band=band, top=top, bottom=bottom, peak=found.peak, why="")


def _steady(before: Band | None, band: Band, extension: float) -> Band:
    """The band as it was, where it would change by little."""
    if before is None:
        return band
    change = max(abs(band.top - before.top), abs(band.bottom - before.bottom))
    return before if change < c.STILL * extension else band


def _low(costs: Sequence[Costs]) -> str:
    """Why the filter is to be reset, as in 004 (Fig. 3); empty where it is not."""
    largest = max((cost for cast in costs for _, cost in cast), default=0.0)
    return f"its cost stayed below {c.LOST:.0%} of the largest" if largest < c.LOST else ""


def _shifted(now: Tracking, costs: Sequence[Costs], extension: float) -> Tracking:
    """The band moved by the gradient of the cost that the filter of 004 finds along the casts."""
    assert now.top is not None
    assert now.bottom is not None
    half = (now.bottom - now.top) / 2 + extension
    shift = max(
        float(np.clip(c.SHIFT * half**2 * cost_slope(costs), -half / 2, half / 2)), extension - now.top
    )
    top, bottom = now.top + shift, now.bottom + shift
    band = _steady(now.band, Band(max(top - extension, 0.0), bottom + extension), extension)
    return replace(now, mode=Mode.TRACK, band=band, top=top, bottom=bottom, why="")


def cost_slope(costs: Sequence[Costs]) -> float:
    """Mean of dJ/dz (1/m) that the filter of 004 finds along casts, by the `costs` of each.

    The motion from sample to sample is the perturbation of eq. (5a).
    """
    slopes = list[float]()
    estimate = begin(c.FILTER_Q, c.FILTER_R)
    for d, cost in chain.from_iterable(costs):
        estimate = step(estimate, d, 0.0, cost, c.FILTER_Q, c.FILTER_R)
        slopes.append(estimate.gradient)
    return float(np.mean(slopes)) if slopes else 0.0


def costs_of(cast: Cast, peak: float) -> Costs:
    """Change of depth (m) and normalised cost of eq. (6), of samples that lie `LEAST_STEP` apart in depth.

    J is the gradient as a part of the largest, `peak` (unit/m), 1 at most. None where `peak` is not above 0.
    """
    if not peak > 0:
        return []
    kept = _apart(cast.depth)
    dz, dv = np.diff(cast.depth[kept]), np.diff(cast.value[kept])
    cost = np.minimum(np.abs(dv / dz) / peak, 1.0)
    return list(zip(dz.tolist(), cost.tolist(), strict=True))


def _apart(depth: Array) -> list[int]:
    """The first sample, and each that lies more than `LEAST_STEP` from the one kept before it."""
    kept = [0] if len(depth) else []
    for i, z in enumerate(depth.tolist()):
        if abs(z - depth[kept[-1]]) > c.LEAST_STEP:
            kept.append(i)
    return kept
