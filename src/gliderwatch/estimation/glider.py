"""The persistent estimator of one glider: Algorithms 1 and 2 advanced dive by dive. Pure.

The learner is advanced over the track of each new dive and over nothing else: what the glider drifts at the
surface between two dives is no flight. Basis functions are placed as the glider goes, or at
the planned centres of the configuration.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np
from numpy.typing import NDArray

from gliderwatch.detection.flags import FlowMaxima, flag, p_e, update
from gliderwatch.estimation.adaptive import (
    AdaptiveInfo,
    AdaptiveParams,
    AdaptiveState,
    advance,
    init,
    with_basis,
)
from gliderwatch.estimation.basis import new_centres, phi
from gliderwatch.model import Array, Assessment, Current, Dive, Fix, Track, readonly
from gliderwatch.navigation.frame import from_plane, to_plane
from gliderwatch.navigation.track import closure
from gliderwatch.params import GliderParams

DEPLOYMENT_GAP = 3 * 86400.0
"""Seconds without a dive after which the sea and the glider are taken for unknown again."""
MOVED = 3.0
"""m/s between two dives: faster than any drift, so the glider was carried."""
WARM_UP = 3.0
"""Time constants K/gamma of the speed law: by then 95 % of an error of the first guess is gone."""
STALE = 12 * 3600.0
"""Seconds without a usable dive after which the sea may be another: the learner warms up anew."""
LATEST = 12 * 3600.0
"""Seconds for which the current of an earlier dive stands in for one that has not come yet."""
FORGOTTEN = 6.0
"""Widths sigma behind the glider at which a basis function that was placed on the way is let go."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """State of the estimator of one glider after a dive.

    ``learner`` the state of Algorithm 1 (None: no dive yet), ``centres`` of its basis functions (degrees,
    shape (N, 2): latitude, longitude), ``maxima`` of Algorithm 2, ``begun`` the start of the deployment (s),
    ``end`` the fix that ended the last dive used, ``warm`` how much was flown since the last long gap (s),
    ``current`` the last depth-averaged current and ``current_t`` when its dive surfaced (s).
    """

    learner: AdaptiveState | None = None
    centres: Array = field(default_factory=lambda: readonly(np.empty((0, 2))))
    maxima: FlowMaxima = FlowMaxima()
    begun: float = 0.0
    end: Fix | None = None
    warm: float = 0.0
    current: Current | None = None
    current_t: float = 0.0


def learner_params(params: GliderParams) -> AdaptiveParams:
    """The parameters of Algorithm 1 among those of a glider."""
    p = params.estimator
    return AdaptiveParams(p.sigma, p.kernel, p.omega, p.nu, p.k, p.gamma, p.speed_gain, p.max_speed)


def step(state: Estimate, dive: Dive, params: GliderParams, digest: str) -> tuple[Estimate, Assessment]:
    """The estimate after one more dive, and what it says of the dive.

    `digest` identifies the parameters. A dive that cannot be used leaves the estimate as it is and gets
    an assessment without a flag, with the reason.
    """
    if dive.track is None or dive.start is None or dive.end is None:
        return state, _assessment(dive, params, digest, dive.reason)
    gains = learner_params(params)
    state = _begin(state, dive, dive.start, params)
    learner, places, centres = _covering(state, dive.track, dive.start, params)
    t, basis = dive.track.t - state.begun, gains.basis(centres)
    if not learner.flown and dive.current is not None:
        learner = _with_flow(learner, dive.current, phi(dive.track.x[0], t[0], basis))
    before = learner
    learner, info = advance(learner, t, dive.track.x, dive.track.heading, basis, gains)
    reference, earlier = _reference(state, dive)
    maxima = update(state.maxima, info.flow_speed_max, hypot(reference.u, reference.v) if reference else 0.0)
    state = replace(
        state,
        learner=learner,
        centres=places,
        maxima=maxima,
        end=dive.end,
        warm=state.warm + learner.flown - before.flown,
        current=dive.current or state.current,
        current_t=dive.t_surface if dive.current is not None else state.current_t,
    )
    judged = _judged(dive, params, digest, info, state, reference, earlier)
    return state, replace(judged, evidence={**judged.evidence, **_past(before)})


def _past(learner: AdaptiveState) -> dict[str, float]:
    """What the learner knew before the dive, once it had learnt anything."""
    return {"speed_before": learner.speed} if learner.flown else {}


def _reference(state: Estimate, dive: Dive) -> tuple[Current | None, bool]:
    """The current to compare with, and whether it is that of an earlier dive, for want of its own."""
    if dive.current is not None:
        return dive.current, False
    recent = state.current is not None and dive.t_surface - state.current_t < LATEST
    return (state.current, True) if recent else (None, False)


def _begin(state: Estimate, dive: Dive, start: Fix, params: GliderParams) -> Estimate:
    """A new estimate at the start of a deployment, else the state as it is."""
    if state.learner is not None and state.end is not None:
        gap = dive.t_dive - state.end.t
        moved = np.hypot(*to_plane(start.lat, start.lon, state.end.lat, state.end.lon))
        if gap < DEPLOYMENT_GAP and moved < MOVED * max(gap, 600.0):
            return state if gap < STALE else replace(state, warm=0.0)
    believed = closure(dive.track, dive.current) if dive.track and dive.current else {}
    speed = believed.get("along_speed", dive.evidence.get("onboard_speed"))
    if speed is None or not 0.0 < speed < 2 * params.speed_max:
        speed = (params.speed_min + params.speed_max) / 2
    planned = np.array(params.estimator.centres, dtype=np.float64).reshape(-1, 2)
    return Estimate(init(speed, len(planned)), readonly(planned), begun=dive.t_dive)


def _covering(
    state: Estimate, track: Track, start: Fix, params: GliderParams
) -> tuple[AdaptiveState, Array, Array]:
    """The learner with functions that cover the track; their centres in degrees, and in its plane (m)."""
    assert state.learner is not None
    sigma, planned = params.estimator.sigma, len(params.estimator.centres)
    centres = to_plane(state.centres[:, 0], state.centres[:, 1], start.lat, start.lon)
    near = np.hypot(*(centres - track.x[-1]).T) < FORGOTTEN * sigma
    near[:planned] = True
    added = new_centres(centres[near], track.x, sigma)
    learner = with_basis(_with_only(state.learner, near), len(added))
    places = np.array([from_plane(c, start.lat, start.lon) for c in added]).reshape(-1, 2)
    return (
        learner,
        readonly(np.concatenate([state.centres[near], places])),
        np.concatenate([centres[near], added]),
    )


def _with_only(learner: AdaptiveState, kept: NDArray[np.bool_]) -> AdaptiveState:
    """The learner with only those functions of its basis that are `kept`."""
    rows = np.concatenate([[True, True], kept])  # the two of the heading come first
    return replace(learner, xi=readonly(learner.xi[:, kept]), gram=readonly(learner.gram[rows][:, rows]))


def _with_flow(learner: AdaptiveState, current: Current, values: Array) -> AdaptiveState:
    """The first guess xi(0) that gives the current of the first dive where the functions have `values`."""
    xi = np.outer([current.u, current.v], values) / max(float(values @ values), 1e-9)
    return replace(learner, xi=readonly(xi))


def _judged(
    dive: Dive,
    params: GliderParams,
    digest: str,
    info: AdaptiveInfo,
    state: Estimate,
    reference: Current | None,
    earlier: bool,
) -> Assessment:
    """Algorithm 2 on what the learner found, or the reason why it does not judge yet."""
    flow = (float(info.flow[0]), float(info.flow[1]))
    error = p_e(flow, (reference.u, reference.v), state.maxima) if reference is not None else None
    notes = list(dive.notes)
    reason, verdict = "", None
    if state.warm < warm_up(params):
        reason = "warming up"
    elif reference is None and state.maxima.reference > 0.0:
        reason = "no depth-averaged current"
    else:
        if reference is None:
            notes.append("no depth-averaged current in the files: a wrong flow cannot be told")
        verdict = int(
            flag(error or 0.0, params.estimator.gamma_f, info.speed, params.speed_min, params.speed_max)
        )
    if earlier:
        notes.append("depth-averaged current has not come: that of an earlier dive stands in")
    elif reference is not None and not reference.final:
        notes.append("depth-averaged current is provisional")
    return replace(
        _assessment(dive, params, digest, reason),
        flag=verdict,
        speed=info.speed,
        flow_u=flow[0],
        flow_v=flow[1],
        reference_u=reference.u if reference else None,
        reference_v=reference.v if reference else None,
        reference_final=reference is not None and reference.final and not earlier,
        p_e=error,
        clle_max=info.clle_max,
        excitation=info.excitation,
        notes=tuple(notes),
    )


def warm_up(params: GliderParams) -> float:
    """Seconds of flight after which the first guess of the speed no longer matters."""
    p = learner_params(params)
    return WARM_UP * p.k / p.rate_of_speed if p.rate_of_speed > 0 else 0.0


def _assessment(dive: Dive, params: GliderParams, digest: str, reason: str) -> Assessment:
    """An assessment of a dive with what navigation knows, and nothing estimated."""
    place = dive.end if dive.end is not None else dive.start
    numbers = dict(dive.evidence)
    if dive.track is not None and dive.current is not None:
        numbers |= closure(dive.track, dive.current)
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
        gamma_f=params.estimator.gamma_f,
        clle_max=None,
        excitation=None,
        n_samples=dive.n_samples,
        evidence=numbers,
        notes=dive.notes,
        parameters=digest,
    )
