"""Algorithms 1 and 2 advanced dive by dive: the estimator `adaptive`. Pure.

The learner is advanced over the track of each new dive and over nothing else: what the glider drifts at the
surface between two dives is no flight. Basis functions are placed as the glider goes, or at
the planned centres of the configuration.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np
from numpy.typing import NDArray

from gliderwatch.estimation.constants import FORGOTTEN, STALE, WARM_UP
from gliderwatch.estimation.speed_range import Normal, RangeParams, drive, learn, speed_range
from gliderwatch.estimation.unassessed import Reference, unassessed
from gliderwatch.model import Array, Assessment, Current, Dive, Fix, Flag, Track, readonly
from gliderwatch.navigation.geodesy import from_plane, to_plane
from gliderwatch.navigation.track import closure
from gliderwatch.papers.basis import Basis, new_centres, phi
from gliderwatch.papers.flags import FlowMaxima, flag, p_e, update
from gliderwatch.papers.learner import AdaptiveInfo, AdaptiveParams, AdaptiveState, advance, init, with_basis
from gliderwatch.params import GliderParams


@dataclass(frozen=True, slots=True)
class Learner:
    """State of the trajectory learner of one glider after a dive.

    ``learner`` the state of Algorithm 1 (None: no dive yet), ``centres`` of its basis functions (degrees,
    shape (N, 2): latitude, longitude), ``maxima`` of Algorithm 2, ``begun`` the start of the deployment (s),
    ``end`` the fix that ended the last dive used, ``warm`` how much was flown since the last long gap (s),
    ``current`` the last depth-averaged current and ``current_t`` when its dive surfaced (s), ``normal`` the
    speeds of healthy dives.
    """

    learner: AdaptiveState | None = None
    centres: Array = field(default_factory=lambda: readonly(np.empty((0, 2))))
    maxima: FlowMaxima = FlowMaxima()
    begun: float = 0.0
    end: Fix | None = None
    warm: float = 0.0
    current: Current | None = None
    current_t: float = 0.0
    normal: Normal = Normal()


def learner_params(params: GliderParams) -> AdaptiveParams:
    """The parameters of Algorithm 1 among those of a glider."""
    p = params.learner
    return AdaptiveParams(p.sigma, p.kernel, p.omega, p.nu, p.k, p.gamma, p.speed_gain, p.max_speed)


def step(
    state: Learner,
    dive: Dive,
    params: GliderParams,
    digest: str,
    frozen: bool = False,
    other: Reference | None = None,
) -> tuple[Learner, Assessment]:
    """The estimate after one more dive, and what it says of the dive.

    ``digest`` identifies the parameters; while ``frozen`` nothing is learnt of what is normal. ``other``
    takes the place of the dive's current as the reference. A dive that cannot be used leaves the estimate
    as it is and gets an assessment without a flag, with the reason.
    """
    ready = prepared(state, dive, params)
    if ready is None:
        return state, unassessed(dive, params, digest, dive.reason)
    state, params, before = ready.state, ready.params, ready.learner
    assert dive.track is not None
    learner, info = advance(
        before, ready.t, dive.track.x, dive.track.heading, ready.basis, learner_params(params)
    )
    reference, earlier = (other.current, False) if other is not None else _reference(state, dive)
    maxima = update(state.maxima, info.flow_speed_max, hypot(reference.u, reference.v) if reference else 0.0)
    state = replace(
        state,
        learner=learner,
        centres=ready.centres,
        maxima=maxima,
        end=dive.end,
        warm=state.warm + learner.flown - before.flown,
        current=dive.current or state.current,
        current_t=dive.t_surface if dive.current is not None else state.current_t,
    )
    judged = _judged(dive, params, digest, info, state, reference, earlier)
    if other is not None:
        judged = replace(judged, notes=(*judged.notes, *other.notes))
    if params.speed_learnt and judged.flag == Flag.NORMAL and not frozen:
        duration = dive.features.duration
        normal = learn(state.normal, info.speed, drive(dive.features), duration, RangeParams())
        state = replace(state, normal=normal)
    return state, replace(judged, evidence={**judged.evidence, **_past(before)})


@dataclass(frozen=True, slots=True)
class Prepared:
    """All that the learner needs for a dive: the ``state`` and the ``params`` (with the range of speed that
    was learnt) before it, its ``learner`` with functions that cover the track, their ``centres`` (degrees,
    (N, 2)) and the ``basis`` in the plane of the dive, and times ``t`` (s) of the track since the state
    began."""

    state: Learner
    params: GliderParams
    learner: AdaptiveState
    centres: Array
    basis: Basis
    t: Array


def prepared(state: Learner, dive: Dive, params: GliderParams) -> Prepared | None:
    """What the learner goes through a dive with; None where the dive has no track."""
    if dive.track is None or dive.start is None or dive.end is None:
        return None
    state = _begin(state, dive, dive.start, params)
    params = _with_range(state, dive, params)
    learner, places, centres = _covering(state, dive.track, dive.start, params)
    t, basis = dive.track.t - state.begun, learner_params(params).basis(centres)
    if not learner.flown and dive.current is not None:
        learner = _with_flow(learner, dive.current, phi(dive.track.x[0], t[0], basis))
    return Prepared(state, params, learner, places, basis, t)


def learnt_flow(state: Learner, dive: Dive, params: GliderParams) -> Array | None:
    """The flow (m/s, (2,)) that was learnt before a dive, where the dive ends; None before the first."""
    if state.learner is None or dive.track is None or dive.start is None or not len(state.centres):
        return None
    centres = to_plane(state.centres[:, 0], state.centres[:, 1], dive.start.lat, dive.start.lon)
    basis = learner_params(params).basis(centres)
    t = float(dive.track.t[-1]) - state.begun
    return np.asarray(state.learner.xi @ phi(dive.track.x[-1], t, basis))


def _with_range(state: Learner, dive: Dive, params: GliderParams) -> GliderParams:
    """The parameters with the range of speed that was learnt, once there is one."""
    if not params.speed_learnt:
        return params
    found = speed_range(state.normal, drive(dive.features), RangeParams())
    return params if found is None else replace(params, speed_min=found.low, speed_max=found.high)


def _past(learner: AdaptiveState) -> dict[str, float]:
    """What the learner knew before the dive, once it had learnt anything."""
    return {"speed_before": learner.speed} if learner.flown else {}


def _reference(state: Learner, dive: Dive) -> tuple[Current | None, bool]:
    """The current to compare with, and whether it is that of an earlier dive, for want of its own."""
    if dive.current is not None:
        return dive.current, False
    recent = state.current is not None and dive.t_surface - state.current_t < STALE
    return (state.current, True) if recent else (None, False)


def _begin(state: Learner, dive: Dive, start: Fix, params: GliderParams) -> Learner:
    """A new estimate at the start of a deployment, else the state as it is."""
    if state.learner is not None and state.end is not None:
        return state if dive.t_dive - state.end.t < STALE else replace(state, warm=0.0)
    closed = closure(dive.track, dive.current) if dive.track and dive.current else None
    speed = closed.along_speed if closed is not None else dive.features.onboard_speed
    if speed is None or not 0.0 < speed < 2 * params.speed_max:
        speed = (params.speed_min + params.speed_max) / 2
    planned = np.array(params.learner.centres, dtype=np.float64).reshape(-1, 2)
    return Learner(init(speed, len(planned)), readonly(planned), begun=dive.t_dive)


def _covering(
    state: Learner, track: Track, start: Fix, params: GliderParams
) -> tuple[AdaptiveState, Array, Array]:
    """The learner with functions that cover the track; their centres in degrees, and in its plane (m)."""
    assert state.learner is not None
    sigma, planned = params.learner.sigma, len(params.learner.centres)
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
    state: Learner,
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
    elif reference is None and state.maxima.reference > 0.0 and params.compares_own_current:
        reason = "no depth-averaged current"
    else:
        if reference is None and params.compares_own_current:
            notes.append("no depth-averaged current in the files: a wrong flow cannot be told")
        verdict = flag(error or 0.0, params.gamma_f, info.speed, params.speed_min, params.speed_max)
        reason = _why(verdict, info.speed, params)
    if earlier:
        notes.append("depth-averaged current has not come: that of an earlier dive stands in")
    elif reference is not None and not reference.final:
        notes.append("depth-averaged current is provisional")
    return replace(
        unassessed(dive, params, digest, reason),
        flag=None if verdict is None else int(verdict),
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


def _why(verdict: Flag, speed: float, params: GliderParams) -> str:
    """What a flag says, in words."""
    if verdict == Flag.FALSE_ALARM:
        return "the learnt flow does not fit the reference"
    if verdict == Flag.NORMAL:
        return ""
    return "slower than normal" if speed < params.speed_min else "faster than normal"


def warm_up(params: GliderParams) -> float:
    """Seconds of flight after which the first guess of the speed no longer matters."""
    p = learner_params(params)
    return WARM_UP * p.k / p.rate_of_speed if p.rate_of_speed > 0 else 0.0
