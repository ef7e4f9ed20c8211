"""What is known of a dive before anything is estimated. Pure."""

from __future__ import annotations

from gliderwatch.model import Assessment, Dive
from gliderwatch.navigation.features import evidence
from gliderwatch.navigation.track import closure
from gliderwatch.params import GliderParams


def blank(dive: Dive, params: GliderParams, digest: str, reason: str) -> Assessment:
    """An assessment of a dive with what navigation knows, without a flag and with the reason for that.

    ``digest`` identifies the parameters.
    """
    place = dive.end if dive.end is not None else dive.start
    # where nothing tells the course there is nothing along it, or across
    known = dive.track is not None and not dive.features.heading_assumed
    closed = closure(dive.track, dive.current) if known and dive.track and dive.current else None
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
