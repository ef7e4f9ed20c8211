"""How deep to fly in the next segment: the band of `band.follow` within what the glider may do. Pure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.layers.band import Band, Method, Mode, Tracking, follow
from gliderwatch.layers.casts import casts_of
from gliderwatch.layers.composite import Layer
from gliderwatch.layers.constants import LEAST_BAND, WRONG_ECHOES
from gliderwatch.model import Array, Segment, readonly


@dataclass(frozen=True, slots=True)
class LayerParams:
    """What a glider is to do about layers.

    ``sensor`` is the property (`water.casts_of`); no advice goes above ``min_depth`` (m: ships) or below
    ``max_depth`` (m), nor nearer to the bottom than ``altitude`` (m). ``full_casts`` a segment go over all
    depths; ``method`` chooses the band, ``extension`` (m) is added to the layer (None: a bin).
    """

    sensor: str
    max_depth: float
    min_depth: float
    altitude: float
    method: Method
    full_casts: int
    extension: float | None = None


@dataclass(frozen=True, slots=True)
class LayerAdvice:
    """What is advised after the segment that ended at ``t`` (s).

    ``full`` are all depths that may be flown, ``band`` those of the layer (None: fly ``full``), after
    ``full_casts`` over ``full``; ``altitude`` (m) is to be kept above the bottom. ``layers`` are those of the
    ``sensor`` in the segment, ``mode`` and ``why`` as in `band.Tracking`, ``notes`` what limits the advice.
    """

    t: float
    sensor: str
    mode: Mode
    full: Band
    band: Band | None
    full_casts: int
    altitude: float
    layers: tuple[Layer, ...]
    why: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Layered:
    """What is known of the layers after a segment, and what is advised for the next."""

    tracking: Tracking
    advice: LayerAdvice


def after(before: Tracking, segment: Segment, params: LayerParams) -> Layered | None:
    """What is known after one more segment, and the advice; None where it has no casts to learn from."""
    casts = casts_of(segment, params.sensor)
    tracking = follow(before, casts, params.sensor, params.method, params.extension)
    if tracking == before or not casts:
        return None
    return Layered(tracking, advise(tracking, segment, float(casts[-1].t[-1]), params))


def advise(tracking: Tracking, segment: Segment, t: float, params: LayerParams) -> LayerAdvice:
    """The advice for the next segment, within the depths that may be flown over the bottom of this one."""
    floor, notes = _floor(segment), list[str]()
    deepest = params.max_depth
    if floor is not None and floor - params.altitude < deepest:
        deepest = floor - params.altitude
        notes.append(f"the bottom was at {floor:.0f} m")
    full = Band(min(params.min_depth, deepest), max(deepest, 0.0))
    band, mode, why = tracking.band, tracking.mode, tracking.why
    if band is not None:
        if band.bottom > full.bottom:
            notes.append(f"it would go to {band.bottom:.0f} m")
        band = Band(max(band.top, full.top), min(band.bottom, full.bottom))
        if band.bottom - band.top < LEAST_BAND:
            band, mode, why = None, Mode.COMPLETE, "the layer lies outside of the depths that may be flown"
    casts = params.full_casts if band is not None else 0
    return LayerAdvice(
        t, params.sensor, mode, full, band, casts, params.altitude, tracking.layers, why, tuple(notes)
    )


def _floor(segment: Segment) -> float | None:
    """The shallow end of the depths of the bottom (m) measured in a segment; None where none was."""
    found = list[float]()
    water, altitude, depth = (segment.get(name) for name in ("water_depth", "altitude", "depth"))
    if len(water):
        found.append(_shallow(water.v))
    if len(altitude) and len(depth):
        found.append(_shallow(readonly(altitude.v + np.interp(altitude.t, depth.t, depth.v))))
    return min(found, default=None)


def _shallow(bottoms: Array) -> float:
    return float(np.quantile(bottoms, WRONG_ECHOES, method="lower"))
