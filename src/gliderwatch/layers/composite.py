"""The composite gradient of the casts of a segment, and the layers in it. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gliderwatch.layers.casts import Cast
from gliderwatch.layers.constants import (
    BRIDGED,
    DENSITY_FLOOR,
    ERRORS,
    LEAST_CASTS,
    PART_OF_PEAK,
    SALINITY_FLOOR,
    TEMPERATURE_FLOOR,
)
from gliderwatch.model import Array, readonly

FLOORS = {"temperature": TEMPERATURE_FLOOR, "salinity": SALINITY_FLOOR, "density": DENSITY_FLOOR}
"""Unit per m: a gradient of a property below it is no layer; other properties have none."""


@dataclass(frozen=True, slots=True)
class Composite:
    """Gradients in bins of height ``bin`` (m), from the depth ``top`` (m) down.

    ``gradient`` (n,) and its standard error ``error`` (n,) are medians over the casts, in units per m, NaN
    where too few casts went; ``each`` (casts, n) are the gradients of the casts, NaN where one did not go.
    """

    top: float
    bin: float
    gradient: Array
    error: Array
    each: Array

    @property
    def edges(self) -> Array:
        """Depths (m) between which the bins lie (n + 1,)."""
        return readonly(self.top + self.bin * np.arange(len(self.gradient) + 1))

    @property
    def peak(self) -> float:
        """The largest gradient, without its sign; 0 where there is none."""
        seen = self.gradient[np.isfinite(self.gradient)]
        return float(np.abs(seen).max()) if len(seen) else 0.0


@dataclass(frozen=True, slots=True)
class Layer:
    """Where a property changes most: between depths ``top`` and ``bottom`` (m); ``strength`` the largest
    gradient in it (unit per m, with its sign), ``confidence`` the part of the casts that show it."""

    top: float
    bottom: float
    strength: float
    confidence: float


def composite(casts: Sequence[Cast], height: float) -> Composite:
    """The composite of `casts` in bins of `height` m, whose edges are at whole multiples of it."""
    deepest = max((cast.bottom for cast in casts if len(cast.depth)), default=0.0)
    first = min((cast.top for cast in casts if len(cast.depth)), default=0.0)
    low, high = math.floor(first / height), math.ceil(deepest / height)
    edges = readonly(height * np.arange(low, high + 1))
    each = np.array([_gradients(cast, edges) for cast in casts]).reshape(len(casts), max(len(edges) - 1, 0))
    n = np.isfinite(each).sum(axis=0)
    gradient, error = np.full(each.shape[1], np.nan), np.full(each.shape[1], np.nan)
    enough = n >= LEAST_CASTS
    if enough.any():
        seen = each[:, enough]
        gradient[enough] = np.nanmedian(seen, axis=0)
        # The standard error of a median is sqrt(pi / 2) times that of a mean.
        error[enough] = math.sqrt(math.pi / 2) * np.nanstd(seen, axis=0, ddof=1) / np.sqrt(n[enough])
    return Composite(low * height, height, readonly(gradient), readonly(error), readonly(each))


def _gradients(cast: Cast, edges: Array) -> Array:
    """Change per m between the edges (m); NaN where the cast went through less than half of a bin."""
    if len(cast.depth) < 2:
        return np.full(len(edges) - 1, np.nan)
    order = np.argsort(cast.depth, kind="stable")
    ends = np.clip(edges, cast.top, cast.bottom)
    height = np.diff(ends)
    at = np.interp(ends, cast.depth[order], cast.value[order])
    with np.errstate(all="ignore"):
        return np.where(height >= np.diff(edges) / 2, np.diff(at) / height, np.nan)


def layers_of(found: Composite, property_name: str) -> tuple[Layer, ...]:
    """The layers, from the surface down. `property_name` chooses what gradient is none (`FLOORS`)."""
    inside = in_layer(found, property_name)
    return tuple(_layer(found, i, j) for i, j in runs(inside))


def in_layer(found: Composite, property_name: str) -> NDArray[np.bool_]:
    """Which bins are in a layer; gaps of `BRIDGED` bins are closed."""
    with np.errstate(invalid="ignore"):
        least = np.fmax(max(PART_OF_PEAK * found.peak, FLOORS.get(property_name, 0.0)), ERRORS * found.error)
        inside = np.abs(found.gradient) > least
    for i, j in runs(~inside):
        if i > 0 and j < len(inside) and j - i <= BRIDGED:
            inside[i:j] = True
    return inside


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where flags are set in a row: the first, and the one after the last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _layer(found: Composite, i: int, j: int) -> Layer:
    gradient, edges = found.gradient[i:j], found.edges
    strength = float(gradient[np.nanargmax(np.abs(gradient))])
    part = found.each[:, i:j]
    through = part[np.isfinite(part).all(axis=1)]
    # Shown: the largest gradient of the cast in the layer is at least half that of the composite.
    showing = np.abs(through).max(axis=1, initial=0.0) >= abs(strength) / 2
    confidence = float(showing.mean()) if len(through) else 0.0
    return Layer(float(edges[i]), float(edges[j]), strength, confidence)
