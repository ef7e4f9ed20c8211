"""The assessment of a dive before anything is estimated, and the reference flow F_M where it is another than
the dive's own current. Pure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.estimation.constants import MODEL_ERROR, SHALLOW
from gliderwatch.model import OTHER_REFERENCE, Array, Assessment, Current, Dive, Fix
from gliderwatch.navigation.features import evidence
from gliderwatch.navigation.track import closure
from gliderwatch.params import GliderParams
from gliderwatch.sea.flow_forecast import Currents, predict
from gliderwatch.sea.ocean_field import Field

# ----------------------------------------
# What is known of a dive before anything is estimated.


def unassessed(dive: Dive, params: GliderParams, digest: str, reason: str) -> Assessment:
    """An assessment of a dive with what navigation knows, without a flag and with the reason for that.

    ``digest`` identifies the parameters.
    """
    place = dive.end if dive.end is not None else dive.start
    # where nothing tells the course there is nothing along it, or across
    has_course = dive.track is not None and not dive.features.heading_assumed
    closed = closure(dive.track, dive.current) if has_course and dive.track and dive.current else None
    return Assessment(
        glider=dive.glider,
        segment=dive.segment,
        t_dive=dive.t_dive,
        t_surface=dive.t_surface,
        lat=place.lat if place is not None else None,
        lon=place.lon if place is not None else None,
        flag=None,
        reason=reason,
        speed=None,
        speed_min=params.speed_min,
        speed_max=params.speed_max,
        flow_u=None,
        flow_v=None,
        reference_u=dive.current.u if dive.current else None,
        reference_v=dive.current.v if dive.current else None,
        reference_final=dive.current is not None and dive.current.final,
        p_e=None,
        gamma_f=params.gamma_f,
        clle_max=None,
        excitation=None,
        n_samples=dive.n_samples,
        evidence=evidence(dive.features, closed),
        notes=dive.notes,
        parameters=digest,
        unusable=dive.unusable,
    )


# ----------------------------------------
# The reference flow F_M of a dive, where it is another than the dive's own current.


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
    found = predict(currents, start, end)
    if found is None:
        return _none("no forecast of the current yet")
    return Reference(_current(found.flow), found.cov, (f"{OTHER_REFERENCE} {found.source}", *found.notes))


def of_learnt(flow: Mean | None) -> Reference:
    """What the estimator expected before the dive."""
    if flow is None:
        return _none("no flow learnt yet")
    return Reference(_current(flow[0]), flow[1], (f"{OTHER_REFERENCE} learnt on the dives before",))


def of_model(ocean: Field | None, dive: Dive, start: Fix, end: Fix) -> Reference:
    """The mean of a model along a dive between two fixes; ``ocean`` is None where no file could be read."""
    if ocean is None:
        return _none("the files of the ocean model could not be read")
    depth = dive.features.depth_max
    found = ocean.between(start, end, SHALLOW if depth is None else depth)
    if isinstance(found, str):
        return _none(found)
    note = f"{OTHER_REFERENCE} {ocean.source}"
    if depth is None:
        note += f", mean of the upper {SHALLOW:.0f} m because the depth of the dive is not known"
    return Reference(_current(np.array(found)), MODEL_ERROR**2 * np.eye(2), (note,))


def model_numbers(found: Reference) -> dict[str, float]:
    """The flow of a model and its standard error (m/s), as evidence; empty where there is none."""
    if found.current is None:
        return {}
    sigma = float(np.sqrt(np.trace(found.cov) / 2))
    return {"model_u": found.current.u, "model_v": found.current.v, "model_sigma": sigma}


def _none(why: str) -> Reference:
    return Reference(None, np.zeros((2, 2)), (f"no reference flow: {why}",))


def _current(flow: Array) -> Current:
    return Current(float(flow[0]), float(flow[1]), final=True)
