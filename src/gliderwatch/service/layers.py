"""The layers of gliders whose settings ask for them: learnt from each segment, with advice for the next."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from pathlib import Path

from gliderwatch.config import Config
from gliderwatch.layers.advice import LayerAdvice, LayerParams, after
from gliderwatch.layers.band import Method, Tracking
from gliderwatch.layers.casts import is_own
from gliderwatch.model import SegmentId
from gliderwatch.store.state_file import Store


@dataclass(frozen=True, slots=True)
class GliderLayers:
    """What a glider is to do about layers; ``outputs`` is the folder for advice, None: none is wanted."""

    params: LayerParams
    outputs: Path | None = None


def layers_of(config: Config, glider: str) -> GliderLayers | None:
    """The settings of a glider; None where layers are off."""
    known = config.gliders.get(glider.lower())
    setting = None if known is None else known.layers
    if setting is None:
        return None
    params = LayerParams(
        setting.sensor,
        setting.max_depth,
        setting.min_depth,
        setting.altitude,
        Method(setting.method),
        setting.full_casts,
        setting.extension,
    )
    return GliderLayers(params, None if setting.outputs is None else Path(setting.outputs))


def science_of(config: Config) -> tuple[str, ...] | None:
    """The science sensors that gliders' layers name, besides the properties that are always read; None where
    nothing is made of science files: neither fields, nor layers."""
    sensors = {glider.layers.sensor for glider in config.gliders.values() if glider.layers is not None}
    if not sensors and not config.fields:
        return None
    return tuple(sorted(name for name in sensors if is_own(name)))


def learn(store: Store, identity: SegmentId, layers: GliderLayers) -> None:
    """Learn the layers of a segment that is held; inside of a transaction.

    What was learnt of another sensor counts for nothing.
    """
    before = store.layers.before(identity)
    known = before is not None and before.advice.sensor == layers.params.sensor
    tracking = before.tracking if before is not None and known else Tracking()
    store.layers.keep(identity, after(tracking, store.segments.get(identity), layers.params))


def newest(store: Store, glider: str, since: float = -inf) -> LayerAdvice | None:
    """The last advice to a glider, if it was given at `since` (s) or later."""
    found = [layered.advice for _, layered in store.layers.segments(glider, 1)]
    return found[0] if found and found[0].t >= since else None
