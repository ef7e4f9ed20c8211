"""Speed and flow together: an extended Kalman filter, one dive a step. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from gliderwatch.estimation import step_test
from gliderwatch.estimation.dive_measurement import (
    OWN,
    SIDE,
    SLIP,
    Guess,
    Linear,
    Observation,
    are_apart,
    drag_slip,
    measure,
    observe,
)
from gliderwatch.estimation.kinematic_speed import KinematicSpeed
from gliderwatch.estimation.modes import FASTEST, Cause, Surprises, Told, odds, opened
from gliderwatch.estimation.step_test import Bank, Step, Update
from gliderwatch.model import Array, Dive, Fix, readonly
from gliderwatch.sea import gauss_markov
from gliderwatch.sea.gauss_markov import FlowParams

# ----------------------------------------
# How restless the sea and how good the data are, learnt from what the innovations are.

MEMORY, FEW = 40, 6
"""Dives over which noise is learnt, and how many the first guess of it counts for."""
FAR = 4.0
"""A normalised square above this counts as this much, so that a fault does not pass for noise."""
SEA, DOUBT = (0.1, 40.0), (0.25, 9.0)
"""Bounds of the factors on the variance of the flow's changes and of the measurements."""


def learn_process_scale(factor: float, square: float | None, dives: int) -> float:
    """The factor on the variance of the flow's changes after the ``square`` of one more innovation.

    ``square`` is normalised, 1 on average where the factor is right (None: no innovation); ``dives`` so far.
    It counts twice, because part of the innovation's variance does not depend on the factor.

    >>> round(learn_sea(1.0, 2.0, dives=4), 3)
    1.2
    """
    return _within(factor * (1 + 2 * _part(dives) * _excess(square)), SEA)


def learn_measurement_scale(factor: float, square: float | None, dives: int) -> float:
    """The factor on the variance of the measurements, likewise."""
    return _within(factor * (1 + _part(dives) * _excess(square)), DOUBT)


def _part(dives: int) -> float:
    return 1 / min(dives + FEW, MEMORY)


def _excess(square: float | None) -> float:
    return 0.0 if square is None else min(square, FAR) - 1


def _within(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])


# ----------------------------------------
# Speed and flow together: an extended Kalman filter, one dive a step. Pure.
#
# State: the flow (see `flow`), the speed W that the glider itself believes, and how its real way through
# the water differs from that in the frame of its heading, as parts of W: slip along, side across. With h
# the mean heading vector of a dive and h' that vector turned left, a dive measures
#
#     g = F + W ((1 - s) h - d h')        ground velocity     c = F - W (s h + d h')              depth-
# averaged current, so that g - c = W h
#
# with s = slip of physics + slip, d = side. So W is seen at once, and with it any drag on the whole body.
# What the glider itself does not know (angle of attack, lost wing, wrong compass) is in c as well: it can
# be seen only where the flow lasts while the heading turns. A test for a step (`estimation.step_test`)
# looks for it; when it speaks, slip and side are opened by as much as the step is uncertain.

LOST, TURNED = 0.3, 0.1
"""Slip and side (parts of W) that a damaged wing may add: by this they are opened where it is hinted at."""
SLOWEST = 0.02
"""m/s: own speed about which the filter is linear on a glider that seems to stand still."""


@dataclass(frozen=True, slots=True)
class JointParams:
    """What is known before any dive.

    ``speed``, ``speed_sigma`` of W (m/s) and ``speed_wander`` its usual change in 3 h; ``slip`` the part of
    the physical slip that is real (on board some is allowed for: a DAC is 5 to 10 % of W off), with
    ``slip_sigma`` its standard error as part of W, ``side_sigma`` that of side (rad), ``slip_wander`` the
    change of both in a day; ``own_noise`` the error of W on a dive as part of it; ``front`` (m/s) by how
    much the flow may change together with a step; ``alarms_per_month`` of the test for a step.
    """

    flow: FlowParams = FlowParams()
    surprises: Surprises = Surprises()
    speed: float = 0.35
    speed_sigma: float = 0.2
    speed_wander: float = 0.015
    slip: float = 0.75
    slip_sigma: float = 0.025
    side_sigma: float = 0.03
    slip_wander: float = 0.005
    own_noise: float = 0.02
    front: float = 0.25
    alarms_per_month: float = 0.05


@dataclass(frozen=True, slots=True)
class JointState:
    """What is known after a dive.

    ``t`` middle of the last dive (s), ``x`` ((n,)) and ``cov`` ((n, n)) of the state; ``sea`` factor on the
    variance of the flow's changes and ``doubt`` on that of the measurements, both learnt; ``dives`` used;
    ``bank`` of the test for a step; ``nis`` and ``dof``, sums of the normalised innovations squared and
    of their degrees of freedom on usual dives; ``end`` the fix that ended the last dive.
    """

    t: float
    x: Array
    cov: Array
    sea: float = 1.0
    doubt: float = 1.0
    dives: int = 0
    bank: Bank = field(default_factory=Bank)
    nis: float = 0.0
    dof: int = 0
    end: Fix | None = None


@dataclass(frozen=True, slots=True)
class JointEstimate:
    """What is known of a dive when it is over; speeds in m/s, flows (2,) east, north.

    ``speed`` V through the water with its standard error ``sigma``; ``own_speed`` W, and ``own_sigma``, that
    part of the error of V which is not common to all dives since launch; ``flow`` F with ``flow_cov``;
    ``slip`` and ``side`` (parts of W) with standard errors.
    """

    speed: float
    sigma: float
    own_speed: float
    own_sigma: float
    flow: Array
    flow_cov: Array
    slip: tuple[float, float]
    side: tuple[float, float]


@dataclass(frozen=True, slots=True)
class JointInfo:
    """What was found in a dive.

    ``seen`` of it and the ``estimate`` after it; ``single_sigma`` (m/s) how well this dive alone tells W
    (infinite: not at all); ``across`` what of g - c is across the heading with its standard error (m/s,
    None: no current); ``cause`` with the ``odds`` of all; ``believes``: W as the glider tells it was told and
    fits; ``nis`` of the ``dof`` innovations used; ``loss``
    and ``turn`` the likeliest steps in slip and side, ``told`` the one that the test speaks of just now.
    """

    seen: Observation
    estimate: JointEstimate
    single_sigma: float
    across: tuple[float, float] | None
    cause: Cause
    odds: dict[str, float]
    believes: bool
    nis: float
    dof: int
    loss: Step | None
    turn: Step | None
    told: Step | None


def init(params: JointParams, t: float) -> JointState:
    """The state before any dive, at a time (s)."""
    own = np.square([params.speed_sigma, params.slip_sigma, params.side_sigma])
    cov = np.diag(np.concatenate([gauss_markov.prior(params.flow), own]))
    x = np.zeros(len(cov))
    x[OWN] = params.speed
    return JointState(t, readonly(x), readonly(cov))


def step(
    state: JointState | None,
    dive: Dive,
    params: JointParams,
    usual: float | None = None,
    hint: bool = False,
    tells: KinematicSpeed | None = None,
) -> tuple[JointState | None, JointInfo | None]:
    """The state after one more dive, and what was found in it; a dive without a track changes nothing.

    ``usual`` is the healthy speed through the water (m/s) where it is known; ``hint`` says that something
    else speaks for a wing that was lost or bent just now; ``tells`` is W as the glider tells it
    beside the current.
    """
    if dive.track is None or dive.start is None or dive.end is None:
        return state, None
    seen = observe(dive)
    if state is None or (state.end is not None and are_apart(state.end, dive.start)):
        state = init(params, (seen.start + seen.end) / 2)
    kept, state = _predicted(state, seen, hint, params)
    believed = seen.own_speed()
    about = _about(state, believed)
    as_expected, as_seen = _measured(state, seen, about, params, usual)
    own = believed[0] if believed else None
    told_own = None if tells is None else Told(tells, state.x)
    found = odds(as_expected, as_seen, state.cov, own, params.surprises, told_own)
    cause = max(found, key=lambda each: found[each].chance)
    across = _across(state, seen, about)
    sea, doubt = _learnt(state, as_seen, cause, across)
    linear = as_expected if cause.is_error else as_seen
    after, update = _updated(state, linear, cause, params, found[cause].told)
    tested = update
    if cause is Cause.FLOW:
        # a step that shows at a turn looks like another flow: let the test see it as if it were none
        _, tested = _updated(state, as_seen, Cause.USUAL, params, found[Cause.USUAL].told)
    loss, turn, bank = step_test.steps(state.bank, kept, tested, sea, params.front)
    told = step_test.told(loss, turn, params.alarms_per_month)
    after = _opened(replace(after, sea=sea, doubt=doubt, bank=bank, end=dive.end), told)
    info = JointInfo(
        seen=seen,
        estimate=_estimate(after, seen, params, usual),
        single_sigma=believed[1] * math.sqrt(state.doubt) if believed else math.inf,
        across=across,
        cause=cause,
        odds={str(each): odd.chance for each, odd in found.items()},
        believes=found[cause].told is not None,
        nis=float(update.innovation @ update.weight @ update.innovation),
        dof=len(update.innovation),
        loss=loss,
        turn=turn,
        told=told,
    )
    return after, info


def _predicted(
    state: JointState, seen: Observation, hint: bool, params: JointParams
) -> tuple[Array, JointState]:
    """The diagonal transition to the middle of a dive, and the state there."""
    t = (seen.start + seen.end) / 2
    dt = max(t - state.t, 0.0)
    kept = np.concatenate([gauss_markov.transition(dt, params.flow), np.ones(3)])
    before = gauss_markov.mean_flow(state.t, state.t, params.flow) @ state.x[: params.flow.size]
    added = np.concatenate(
        [
            gauss_markov.noise(
                dt, state.sea, gauss_markov.crossing(before, seen.ground, dt, params.flow), params.flow
            ),
            [params.speed_wander**2 * dt / (3 * gauss_markov.HOUR)],
            np.square([params.slip_wander] * 2) * dt / gauss_markov.DAY + np.square([LOST, TURNED]) * hint,
        ]
    )
    cov = kept[:, None] * state.cov * kept + np.diag(added)
    return kept, replace(state, t=t, x=kept * state.x, cov=cov)


def _about(state: JointState, believed: tuple[float, float] | None) -> float:
    """The own speed (m/s) about which the filter is linear: as seen on the dive, where that can be."""
    if believed is not None and SLOWEST < believed[0] < FASTEST:
        return believed[0]
    return max(float(state.x[OWN]), SLOWEST)


def _measured(
    state: JointState, seen: Observation, about: float, params: JointParams, usual: float | None
) -> tuple[Linear, Linear]:
    """The measurements of a dive, linear about the own speed that was expected, and about the one seen."""
    as_expected, as_seen = (
        measure(seen, state.x, _guess(state, seen, own, params, usual), state.doubt, params.flow)
        for own in (max(float(state.x[OWN]), SLOWEST), about)
    )
    return as_expected, as_seen


def _guess(
    state: JointState, seen: Observation, own: float, params: JointParams, usual: float | None
) -> Guess:
    """What is known of slip at an own speed (m/s), but for the state's part."""
    physical = params.slip * seen.slip
    drag, sigma = drag_slip(own * (1 - physical - float(state.x[SLIP])), usual)
    return Guess(own, physical + drag, math.hypot(sigma, math.sqrt(state.doubt) * params.own_noise))


def _updated(
    state: JointState, linear: Linear, cause: Cause, params: JointParams, told: Told | None
) -> tuple[JointState, Update]:
    """The state after the measurements of a dive, and W as ``told``, explained by a cause."""
    size = params.surprises.by_cause()[cause].size
    if cause is Cause.CURRENT:
        linear = linear.first(2)  # a current that is wrong is left out, be it as near as it may
    linear, cov = opened(linear, state.cov, cause, size)
    if told is not None:
        linear = linear.with_own(told.x, told.tells)
    rows, e = linear.rows, linear.innovation
    weight = np.asarray(np.linalg.inv(rows @ cov @ rows.T + linear.noise), dtype=np.float64)
    gain = cov @ rows.T @ weight
    left = np.eye(len(cov)) - gain @ rows
    after = left @ cov @ left.T + gain @ linear.noise @ gain.T
    counts = cause is Cause.USUAL
    state = replace(
        state,
        x=readonly(state.x + gain @ e),
        cov=readonly((after + after.T) / 2),
        dives=state.dives + 1,
        nis=state.nis + counts * float(e @ weight @ e),
        dof=state.dof + counts * len(e),
    )
    return state, Update(rows, gain, weight, e)


def _learnt(
    state: JointState, linear: Linear, cause: Cause, across: tuple[float, float] | None
) -> tuple[float, float]:
    """The factors on the flow's changes and on the noise of measurements after one more dive."""
    at = slice(-2, None)  # the current, else the ground velocity: both show the flow
    square = None
    if cause in (Cause.USUAL, Cause.FLOW) and state.dives:
        rows, e = linear.rows[at], linear.innovation[at]
        s = rows @ state.cov @ rows.T + linear.noise[at, at]
        square = float(e @ np.linalg.solve(s, e)) / 2
    aside = None if cause.is_error or across is None else (across[0] / across[1]) ** 2
    return learn_process_scale(state.sea, square, state.dives), learn_measurement_scale(
        state.doubt, aside, state.dives
    )


def _across(state: JointState, seen: Observation, about: float) -> tuple[float, float] | None:
    found = seen.across(about)
    return None if found is None else (found[0], found[1] * math.sqrt(state.doubt))


def _opened(state: JointState, told: Step | None) -> JointState:
    """The state moved by a step that was told; the test begins anew.

    Long innovations were cut for the test, so that the step may well be half as large again.
    """
    if told is None:
        return state
    shift = told.shift
    cov = state.cov + told.cov + np.outer(shift, shift) / 4
    return replace(state, x=readonly(state.x + shift), cov=readonly(cov), bank=Bank())


def _estimate(
    state: JointState, seen: Observation, params: JointParams, usual: float | None
) -> JointEstimate:
    """What the state says of the speed and of the flow on a dive."""
    x, cov, n = state.x, state.cov, params.flow.size
    own = float(x[OWN])
    guess = _guess(state, seen, own, params, usual)
    slip, side = guess.slip + float(x[SLIP]), float(x[SIDE])
    slope = np.zeros(n + 3)
    slope[[OWN, SLIP]] = 1 - slip, -own
    new = max(0.0, float(cov[SLIP, SLIP]) - params.slip_sigma**2)
    rows = gauss_markov.mean_flow(seen.start, seen.end, params.flow)
    return JointEstimate(
        speed=math.hypot(own * (1 - slip), own * side),
        sigma=math.sqrt(float(slope @ cov @ slope) + (own * guess.slip_sigma) ** 2),
        own_speed=own,
        own_sigma=math.sqrt(float(cov[OWN, OWN]) + own**2 * new),
        flow=readonly(rows @ x[:n]),
        flow_cov=readonly(rows @ cov[:n, :n] @ rows.T),
        slip=(slip, math.sqrt(float(cov[SLIP, SLIP]))),
        side=(side, math.sqrt(float(cov[SIDE, SIDE]))),
    )


# ----------------------------------------
# The flow that the joint estimator expects after its last dive.


def expected_flow(
    state: JointState, params: FlowParams, ground: Array, start: float, end: float
) -> tuple[Array, Array]:
    """Mean flow (m/s, (2,)) between two times (s) and its covariance (m2/s2, (2, 2)).

    ``ground`` (m/s, (2,)) is about how fast the glider goes over ground: a strong current differs along it.
    """
    n, dt = params.size, max((start + end) / 2 - state.t, 0.0)
    now = gauss_markov.mean_flow(state.t, state.t, params) @ state.x[:n]
    kept = gauss_markov.transition(dt, params)
    added = gauss_markov.noise(dt, state.sea, gauss_markov.crossing(now, ground, dt, params), params)
    cov = kept[:, None] * state.cov[:n, :n] * kept + np.diag(added)
    rows = gauss_markov.mean_flow(start, end, params)
    return rows @ (kept * state.x[:n]), np.asarray(rows @ cov @ rows.T)
