"""The band to fly in the next segment, from the casts of the last (004, brought to shore). Pure.

A Slocum can not be steered while it dives: the loop closes once a surfacing. The states are those of 004
Fig. 3: a complete segment, then the layer is tracked, until it is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from gliderwatch.layers import constants as c
from gliderwatch.layers.casts import Cast, bin_of
from gliderwatch.layers.composite import Composite, Layer, composite, layers_of
from gliderwatch.model import Array
from gliderwatch.papers.extremum_seeking import begin, step


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
    reference of the gradient, ``complete_t`` (s) the end of the last segment of all depths, ``bin`` (m)
    and ``layers`` those of the last segment, ``why`` says in words why the mode is what it is.
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
    height = bin_of(casts)
    found = composite(casts, height)
    now = replace(before, layers=layers_of(found, property_name), bin=height)
    last_t = float(casts[-1].t[-1])
    if before.complete_t is None or _flew_all(before.band, casts, height):
        now = replace(now, complete_t=last_t)
    lost = _lost(before, now, found, last_t)
    if lost:
        mode = Mode.COMPLETE if before.band is None else Mode.RESET
        # Where all depths were seen and nothing is there, what was known of the layer is of no use any more.
        return replace(now, mode=mode, band=None, top=None, bottom=None, peak=found.peak, why=lost)
    extension = extension or max(c.LEAST_EXTENSION, height)
    if method is Method.FILTER and before.band is not None:
        return _shifted(now, casts, extension)
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


def _shifted(now: Tracking, casts: Sequence[Cast], extension: float) -> Tracking:
    """The band moved by the gradient of the cost that the filter of 004 finds along the casts."""
    assert now.top is not None
    assert now.bottom is not None
    half = (now.bottom - now.top) / 2 + extension
    slope = cost_slope(casts, now.peak)
    shift = max(float(np.clip(c.SHIFT * half**2 * slope, -half / 2, half / 2)), extension - now.top)
    top, bottom = now.top + shift, now.bottom + shift
    band = _steady(now.band, Band(max(top - extension, 0.0), bottom + extension), extension)
    return replace(now, mode=Mode.TRACK, band=band, top=top, bottom=bottom, why="")


def cost_slope(casts: Sequence[Cast], peak: float) -> float:
    """Mean of dJ/dz (1/m) that the filter of 004 finds along `casts`; J is the gradient, of `peak` (unit/m).

    The motion from sample to sample is the perturbation of eq. (5a).
    """
    slopes = list[float]()
    estimate = begin(c.FILTER_Q, c.FILTER_R)
    for cast in casts:
        for d, cost in _costs(cast, peak):
            estimate = step(estimate, d, 0.0, cost, c.FILTER_Q, c.FILTER_R)
            slopes.append(estimate.gradient)
    return float(np.mean(slopes)) if slopes else 0.0


def _costs(cast: Cast, peak: float) -> list[tuple[float, float]]:
    """Change of depth (m) and normalised cost of eq. (6) from each sample of a cast to the next."""
    dz: Array = np.diff(cast.depth)
    dv: Array = np.diff(cast.value)
    with np.errstate(all="ignore"):
        cost = np.where(np.abs(dz) > c.LEAST_STEP, np.abs(dv / dz), 0.0) / peak
    return list(zip(dz.tolist(), np.minimum(cost, 1.0).tolist(), strict=True)) if peak > 0 else []
