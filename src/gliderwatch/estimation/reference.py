"""The reference flow F_M of a dive, where it is another than the dive's own current. Pure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.currents.field import Field
from gliderwatch.currents.state import Currents, predict
from gliderwatch.model import Array, Current, Dive, Fix

MODEL_ERROR = 0.1
"""m/s, a component: usual error of an ocean model or a radar beside a glider's mean current."""
SHALLOW = 30.0
"""Metres to which a model is averaged where the depth of the dive is not known."""


@dataclass(frozen=True, slots=True)
class Reference:
    """``current`` is F_M (None: there is none), ``cov`` its covariance (m2/s2, (2, 2)), ``notes`` on it."""

    current: Current | None
    cov: Array
    notes: tuple[str, ...] = ()


Mean = tuple[Array, Array]
"""A flow (m/s, (2,)) and its covariance (m2/s2, (2, 2))."""


def of_tides(currents: Currents, start: Fix, end: Fix) -> Reference:
    """The forecast from the currents of the dives before, of a dive between two fixes."""
    found = predict(currents, start.t, end.t)
    if found is None:
        return _none("no forecast of the current yet")
    return Reference(_current(found.flow), found.cov, (f"reference flow: {found.source}", *found.notes))


def of_learnt(flow: Mean | None) -> Reference:
    """What the estimator expected before the dive."""
    if flow is None:
        return _none("no flow learnt yet")
    return Reference(_current(flow[0]), flow[1], ("reference flow: learnt on the dives before",))


def of_model(ocean: Field | None, dive: Dive, start: Fix, end: Fix) -> Reference:
    """The mean of a model along a dive between two fixes; ``ocean`` is None where no file could be read."""
    if ocean is None:
        return _none("the files of the ocean model could not be read")
    depth = dive.features.depth_max
    found = ocean.between(start, end, SHALLOW if depth is None else depth)
    if isinstance(found, str):
        return _none(found)
    note = f"reference flow: {ocean.source}"
    if depth is None:
        note += f", mean of the upper {SHALLOW:.0f} m because the depth of the dive is not known"
    return Reference(_current(np.array(found)), MODEL_ERROR**2 * np.eye(2), (note,))


def _none(why: str) -> Reference:
    return Reference(None, np.zeros((2, 2)), (f"no reference flow: {why}",))


def _current(flow: Array) -> Current:
    return Current(float(flow[0]), float(flow[1]), final=True)
