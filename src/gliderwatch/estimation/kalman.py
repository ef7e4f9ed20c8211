"""Speed and flow together: an extended Kalman filter, one dive a step. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache, lru_cache

import numpy as np

from gliderwatch.estimation import step_test, surface_drift
from gliderwatch.estimation.constants import (
    FAR,
    FASTEST,
    FIRST_SPEED,
    FIRST_SPEED_ERROR,
    FRONT,
    HEALTHY_BOUND,
    LEAST_SLIP,
    LEAST_TESTED,
    MEASUREMENT_SCALES,
    MOST_SIDE,
    MOST_SLIP,
    NOISE_FEW,
    NOISE_MEMORY,
    OWN_NOISE,
    PROCESS_SCALES,
    RARE,
    REAL_SLIP,
    SIDE_ERROR,
    SLIP_ERROR,
    SLIP_MEMORY,
    SPEED_WANDER,
    WING_SIDE,
)
from gliderwatch.estimation.dive_measurement import (
    OWN,
    SHOWN,
    SIDE,
    SLIP,
    Measured,
    Observation,
    Slipping,
    observe,
    slip_of,
    with_thrust,
)
from gliderwatch.estimation.kinematic_speed import KinematicSpeed
from gliderwatch.estimation.modes import (
    MODES,
    Cause,
    Explained,
    Explanations,
    Mode,
    explain,
    switched,
)
from gliderwatch.estimation.step_test import Bank, Step, Update
from gliderwatch.estimation.surface_drift import Drifts
from gliderwatch.model import Array, Dive, Fix, readonly, replace
from gliderwatch.sea import gauss_markov
from gliderwatch.sea.gauss_markov import FlowParams, Passage

# ----------------------------------------
# How restless the sea and how good the data are, learnt from what the innovations are.


def learn_process_scale(factor: float, square: float | None, share: float, dives: int) -> float:
    """The factor on the variance of the flow's changes after the ``square`` of one more innovation.

    ``square`` is normalised, 1 on average where the factor is right (None: no innovation); ``share`` of the
    innovation's variance depends on the factor: where the tides are not known yet it is small, and little is
    learnt. ``dives`` so far.

    >>> round(learn_process_scale(1.0, 2.0, 0.5, dives=4), 3)
    1.2
    """
    return _within(factor * (1 + 2 * min(2 * share, 1.0) * _part(dives) * _excess(square)), PROCESS_SCALES)


def learn_measurement_scale(factor: float, square: float | None, dives: int) -> float:
    """The factor on the variance of the measurements, likewise."""
    return _within(factor * (1 + _part(dives) * _excess(square)), MEASUREMENT_SCALES)


def _part(dives: int) -> float:
    return 1 / min(dives + NOISE_FEW, NOISE_MEMORY)


def _excess(square: float | None) -> float:
    return 0.0 if square is None else min(square, FAR) - 1


def _within(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])


# ----------------------------------------
# Speed and flow together: a switching Kalman filter, one dive a step. Pure.
#
# State: the flow (see `flow`), and at its end the speed W that the glider reckons with, slip and side (see
# `measurement`). g - c = W h, so W is seen at once in any sea, and with it any drag on the whole body. What
# the glider itself does not know (angle of attack, lost wing, wrong compass) is in c as well: it can be seen
# only where the flow lasts while the heading turns. A test for a step (`estimation.step_test`) looks for it;
# when it speaks, slip and side are opened by as much as the step is uncertain, within what a wing or a
# compass can do.


@dataclass(frozen=True, slots=True)
class JointParams:
    """What is known before any dive.

    ``modes`` are how a dive can be explained; ``speed``, ``speed_sigma`` of W (m/s) and ``speed_wander`` its
    usual change in 3 h; ``slip`` the part of the physical slip that is real (on board some is allowed for: a
    DAC is 5 to 10 % of W off), with ``slip_sigma`` its standard error as part of W, ``side_sigma`` that of
    side (rad), ``slip_memory`` (s) of both; ``own_noise`` the error of W on a dive as part of it; ``front``
    (m/s) by how much the flow may change together with a step; ``alarms_per_month`` of the test for a step.
    """

    flow: FlowParams = FlowParams()
    modes: tuple[Mode, ...] = MODES
    speed: float = FIRST_SPEED
    speed_sigma: float = FIRST_SPEED_ERROR
    speed_wander: float = SPEED_WANDER
    slip: float = REAL_SLIP
    slip_sigma: float = SLIP_ERROR
    side_sigma: float = SIDE_ERROR
    slip_memory: float = SLIP_MEMORY
    own_noise: float = OWN_NOISE
    front: float = FRONT
    alarms_per_month: float = 0.05

    def __hash__(self) -> int:
        """Of some of the numbers: it is asked for several times a dive, and parameters are few."""
        return hash((self.speed, self.slip, self.front, self.alarms_per_month))


@dataclass(frozen=True, slots=True, eq=False)
class JointState:
    """What is known after a dive. A state equals none but itself, so that what follows from it can be kept.

    ``t`` end of the last dive (s), ``x`` ((n,)) and ``cov`` ((n, n)) of the state; ``process_scale`` factor
    on the variance of the flow's changes and ``measurement_scale`` on that of the measurements, both learnt
    (the tests use `tested`); ``dives`` used; ``bank`` of the test for a step; ``end`` the fix that ended the
    last dive and ``way`` W h on it (m/s, (2,)); ``lasting`` how likely each cause that lasts explained it;
    ``drifts`` at the surface.
    """

    t: float
    x: Array
    cov: Array
    process_scale: float = 1.0
    measurement_scale: float = 1.0
    dives: int = 0
    bank: Bank = field(default_factory=Bank)
    end: Fix | None = None
    lasting: dict[Cause, float] = field(default_factory=dict)
    way: Array = field(default_factory=lambda: readonly(np.zeros(2)))
    drifts: Drifts = Drifts()

    @property
    def tested(self) -> float:
        """The factor on the variance of the measurements with which dives are tested."""
        return max(self.measurement_scale, LEAST_TESTED)


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
    None: no current); ``cause`` with the ``odds`` of all; ``kinematic_fits``: there is a kinematic speed, and
    it fits; ``nis`` of the ``dof`` innovations used; ``loss`` and ``turn`` the likeliest steps in slip and
    side, ``proven`` the one that is just now too likely for chance.
    """

    seen: Observation
    estimate: JointEstimate
    single_sigma: float
    across: tuple[float, float] | None
    cause: Cause
    odds: dict[str, float]
    kinematic_fits: bool
    nis: float
    dof: int
    loss: Step | None
    turn: Step | None
    proven: Step | None


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
    hint: Mode | None = None,
    kinematic: KinematicSpeed | None = None,
    roll_stays: bool = False,
) -> tuple[JointState | None, JointInfo | None]:
    """The state after one more dive, and what was found in it; a dive without a track changes nothing.

    ``usual`` is the healthy speed through the water (m/s) where it is known; ``hint`` is a mode that
    something else speaks for just now, that of a wing lost or bent; ``kinematic`` is W as depth rate and
    pitch, or the mean on board, have it; ``roll_stays``: the mean roll is known, and the usual one.
    """
    if dive.track is None or dive.start is None or dive.end is None:
        return state, None
    seen = observe(dive)
    if state is None:
        state = init(params, seen.start)
    passage = _passage(state, seen.start, seen.end, dive.start.lat, params)
    expected = _predicted(state, seen.end, tuple(seen.ground.tolist()), passage, params)
    state = replace(expected, drifts=_drifted(state, dive.start, params))
    believed = seen.own_speed()
    if believed is not None:
        own = believed[0]
    else:
        own = float(state.x[OWN]) if kinematic is None else kinematic.speed
    seen = with_thrust(seen, own)
    noise = math.hypot(math.sqrt(state.tested) * params.own_noise, params.slip * seen.slip_sigma)
    slipping = Slipping(params.slip * seen.slip, noise, usual)
    found = _explained(state, Measured(seen, kinematic, state.tested, slipping), params, hint)
    across = _across(state, seen, believed)
    loss, turn, bank = _tested(state, found, passage, seen.start, params)
    # a loss that the glider does not know of is that of a wing: where the roll stays it is the sea's; and
    # where no heading was measured, what looks like a step is a turn that was not seen
    likely = None if roll_stays else loss
    proven = None if seen.is_free else step_test.proven(likely, turn, params.alarms_per_month)
    mixed = _mixed(state, found.ways, _jumped(params.flow))
    way = readonly(own * seen.heading)
    after = _opened(_learnt(state, mixed, found, passage, across, bank, way, dive.end), proven)
    return after, JointInfo(
        seen=seen,
        estimate=_estimate(after, seen, params, slipping),
        single_sigma=believed[1] * math.sqrt(state.tested) if believed else math.inf,
        across=across,
        cause=found.best.cause,
        odds=found.odds,
        kinematic_fits=found.best.kinematic_fits,
        nis=found.best.square,
        dof=len(found.best.innovation),
        loss=loss,
        turn=turn,
        proven=proven,
    )


@lru_cache(maxsize=64)  # a dive comes again when its current is corrected
def _drifted(state: JointState, start: Fix, params: JointParams) -> Drifts:
    """The drifts at the surface with the one before a dive that begins with a fix."""
    found = surface_drift.drift(state.end, start)
    if found is None or state.end is None or not state.dives:
        return state.drifts
    flow, _ = expected_flow(state, params.flow, np.zeros(2), state.end.t, start.t)
    return surface_drift.added(state.drifts, start.t, found - flow, state.way)


def _weighed(step: Step | None, drifts: Drifts) -> Step | None:
    """A step with what the drifts at the surface say for or against it in its ratio."""
    if step is None:
        return None
    slip, side = step.sizes[:2].tolist()
    said = surface_drift.evidence(drifts, step.begun, slip, side)
    return replace(step, ratio=max(step.ratio + said, 0.0))


def _explained(state: JointState, measured: Measured, params: JointParams, hint: Mode | None) -> Explanations:
    """A dive in all modes; ``hint``: also in this one."""
    jumped, shown = _jumped(params.flow)[-SHOWN:, -SHOWN:], state.cov[-SHOWN:, -SHOWN:]
    modes = (*switched(params.modes, state.lasting, measured.seen.turning), *((hint,) if hint else ()))
    return Explanations.of(explain(state.x[-SHOWN:], shown, jumped, measured, modes))


def _tested(
    state: JointState, found: Explanations, passage: Passage, start: float, params: JointParams
) -> tuple[Step | None, Step | None, Bank]:
    """The likeliest loss and turn, as the drifts at the surface have them too, and the bank with one more
    dive, begun at a time (s).

    Another flow may be what a step looks like, so that such a dive is tested as a usual one.
    """
    way = found.usual if found.usual is not None and found.best.cause is Cause.FLOW else found.best
    update, matrix = _update(state, way, _jumped(params.flow)), passage_matrix(passage)
    jump, dives = _jump(params.flow), state.dives
    loss, turn, bank = step_test.steps(state.bank, matrix, update, jump, params.front, start, dives)
    return _weighed(loss, state.drifts), _weighed(turn, state.drifts), bank


@lru_cache(maxsize=64)  # a dive comes again when its current is corrected
def _passage(state: JointState, start: float, end: float, lat: float, params: JointParams) -> Passage:
    """What the time from the last dive to the end of this one, from ``start`` to ``end`` (s), makes of the
    flow."""
    q = gauss_markov.intensities(state.x[: params.flow.size], state.process_scale, params.flow)
    return gauss_markov.passage(max(start - state.t, 0.0), end - start, lat, q, params.flow)


def passage_matrix(passage: Passage) -> Array:
    """The transition of the whole state."""
    n = len(passage.matrix)
    out = np.eye(n + 3)
    out[:n, :n] = passage.matrix
    return out


@cache
def _jump(params: FlowParams) -> Array:
    """What a step of the flow does to the whole state, (n, 2)."""
    return readonly(np.concatenate([gauss_markov.jump(params), np.zeros((3, 2))]))


@cache
def _jumped(params: FlowParams) -> Array:
    """The covariance of the whole state where the flow steps by 1 m/s, (n, n)."""
    steps = _jump(params)
    return readonly(steps @ steps.T)


@lru_cache(maxsize=64)
def _predicted(
    state: JointState, end: float, ground: tuple[float, ...], passage: Passage, params: JointParams
) -> JointState:
    """The state at the ``end`` (s) of a dive with a velocity over ``ground`` (m/s), before what it
    measures.

    Slip and side that a healthy glider may have wander about none. What is beyond that is lost, bent or grown
    on: it does not come back by itself, however long a leg shows nothing of it.
    """
    dt = max(end - state.t, 0.0)
    matrix, n = passage_matrix(passage), params.flow.size
    fades, healthy = math.exp(-dt / params.slip_memory), np.array([params.slip_sigma, params.side_sigma])
    matrix[[SLIP, SIDE], [SLIP, SIDE]] = np.where(
        np.abs(state.x[[SLIP, SIDE]]) > HEALTHY_BOUND * healthy, 1.0, fades
    )
    noise = np.zeros_like(state.cov)
    noise[:n, :n] = passage.noise
    noise[[OWN, SLIP, SIDE], [OWN, SLIP, SIDE]] = [
        params.speed_wander**2 * dt / (3 * gauss_markov.HOUR),
        *np.square(healthy) * (1 - fades**2),
    ]
    before = state.x[: params.flow.size]
    crossed = gauss_markov.crossing(before[0:2] + before[2:4], ground, dt, params.flow)
    jumped = _jumped(params.flow)
    cov = matrix @ state.cov @ matrix.T + noise + state.process_scale * crossed**2 * jumped
    return replace(state, t=end, x=readonly(matrix @ state.x), cov=readonly((cov + cov.T) / 2))


def _update(state: JointState, way: Explained, jumped: Array) -> Update:
    """The update of the whole state that one explanation of a dive makes."""
    return _update_of(_cov(state, way, jumped), way)


def _update_of(cov: Array, way: Explained) -> Update:
    """The same, of a state with the covariance ``cov`` ((n, n)), with what the explanation opens."""
    turned = cov[:, -SHOWN:] @ way.rows.T
    rows = np.zeros((len(way.rows), len(cov)))
    rows[:, -SHOWN:] = way.rows
    return Update(rows, turned @ way.weight_matrix, way.weight_matrix, way.innovation)


def _cov(state: JointState, way: Explained, jumped: Array) -> Array:
    """The covariance of the whole state with what an explanation opens."""
    if way.cause is Cause.FLOW:
        return state.cov + way.mode.size**2 * jumped
    if way.cause is Cause.SPEED:
        cov = state.cov.copy()
        cov[OWN, OWN] += way.mode.size**2
        return cov
    if way.cause is Cause.WING:
        cov = state.cov.copy()
        cov[[SLIP, SIDE], [SLIP, SIDE]] += np.square([way.mode.size, WING_SIDE])
        return cov
    return state.cov


def _mixed(state: JointState, ways: list[Explained], jumped: Array) -> tuple[Array, Array]:
    """The state after a dive and its covariance: the mixture of what they are under each explanation."""
    kept = [way for way in ways if way.weight > RARE]
    total = sum(way.weight for way in kept)
    means, covs = [], []
    for way in kept:
        cov = _cov(state, way, jumped)
        update = _update_of(cov, way)
        mean = state.x + update.gain @ way.innovation
        mean[SLIP] += way.mode.loss
        means.append(mean)
        covs.append(cov - update.gain @ (update.rows @ cov))
    weights = np.array([way.weight / total for way in kept])
    x = weights @ np.array(means)
    cov = sum(w * (c + np.outer(m - x, m - x)) for w, c, m in zip(weights.tolist(), covs, means, strict=True))
    cov = np.asarray(cov)
    return readonly(_bounded(x)), readonly((cov + cov.T) / 2)


def _bounded(x: Array) -> Array:
    """The state within what speed, slip and side can be."""
    x = x.copy()
    x[OWN] = min(max(x[OWN], 0.0), FASTEST)
    x[SLIP] = min(max(x[SLIP], LEAST_SLIP), MOST_SLIP)
    x[SIDE] = min(max(x[SIDE], -MOST_SIDE), MOST_SIDE)
    return x


def _learnt(
    state: JointState,
    mixed: tuple[Array, Array],
    found: Explanations,
    passage: Passage,
    across: tuple[float, float] | None,
    bank: Bank,
    way: Array,
    end: Fix | None,
) -> JointState:
    """The state of which ``mixed`` is the mixture, with what a dive adds to the noise learnt in ``state`` and
    to what lasts."""
    square, share = _surprise(state, found, passage)
    aside = None
    if not found.best.cause.is_error and across is not None:
        aside = (across[0] / across[1]) ** 2 * state.tested / state.measurement_scale
    return JointState(
        state.t,
        *mixed,
        process_scale=learn_process_scale(state.process_scale, square, share, state.dives),
        measurement_scale=learn_measurement_scale(state.measurement_scale, aside, state.dives),
        dives=state.dives + 1,
        bank=bank,
        end=end,
        lasting={each: found.odds[str(each)] for each in Cause if each.lasts and str(each) in found.odds},
        way=way,
        drifts=state.drifts,
    )


def _surprise(state: JointState, found: Explanations, passage: Passage) -> tuple[float | None, float]:
    """The normalised square of what the flow does on a dive, and the share of its variance that is no tide;
    (None, 0.0) where it does not tell."""
    usual = found.usual
    if usual is None or found.best.cause not in (Cause.USUAL, Cause.FLOW) or not state.dives:
        return None, 0.0
    at = slice(2, 4) if len(usual.innovation) > 3 else slice(0, 2)  # the current, else the ground velocity
    rows, e = usual.rows[at], usual.innovation[at]
    inverse = np.linalg.inv(rows @ state.cov[-SHOWN:, -SHOWN:] @ rows.T + usual.noise[at, at])
    return float(e @ inverse @ e) / 2, float(inverse[0, 0] + inverse[1, 1]) / 2 * passage.restless


def _across(
    state: JointState, seen: Observation, believed: tuple[float, float] | None
) -> tuple[float, float] | None:
    about = believed[0] if believed is not None and 0 < believed[0] < FASTEST else float(state.x[OWN])
    found = seen.across(about)
    return None if found is None else (found[0], found[1] * math.sqrt(state.tested))


def _opened(state: JointState, proven: Step | None) -> JointState:
    """The state moved by a step that is proven; the test begins anew.

    Long innovations were cut for the test, so that the step may well be half as large again.
    """
    if proven is None:
        return state
    shift = proven.shift
    cov = state.cov + proven.cov + np.outer(shift, shift) / 4
    x = readonly(_bounded(state.x + shift))
    return replace(state, x=x, cov=readonly(cov), bank=Bank(), drifts=Drifts())


def _estimate(state: JointState, seen: Observation, params: JointParams, slipping: Slipping) -> JointEstimate:
    """What the state says of the speed and of the flow on a dive."""
    x, own = state.x, float(state.x[OWN])
    cov, calm = state.cov.copy(), math.sqrt(state.measurement_scale / state.tested)
    cov[OWN] *= calm  # the filter ran with what the tests take the noise for
    cov[:, OWN] *= calm
    slipping = replace(slipping, noise=slipping.noise * calm)
    slips, slip_sigmas = slip_of(x[None, -SHOWN:], slipping)
    slip, slip_sigma, side = float(slips[0]), float(slip_sigmas[0]), float(x[SIDE])
    slope = np.zeros(len(x))
    slope[[OWN, SLIP]] = 1 - slip, -own
    new = max(0.0, float(cov[SLIP, SLIP]) - params.slip_sigma**2)
    mean = params.flow.mean
    return JointEstimate(
        speed=min(math.hypot(own * (1 - slip), own * side), own),
        sigma=math.sqrt(float(slope @ cov @ slope) + (own * slip_sigma) ** 2),
        own_speed=own,
        own_sigma=math.sqrt(float(cov[OWN, OWN]) + own**2 * new),
        flow=readonly(x[mean]),
        flow_cov=readonly(cov[mean, mean]),
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
    n, lat = params.size, 0.0 if state.end is None else state.end.lat
    q = gauss_markov.intensities(state.x[:n], state.process_scale, params)
    gap, time = max(start - state.t, 0.0), max(end - start, 1.0)
    rows, noise = gauss_markov.mean_passage(gap, time, lat, q, params)
    cov = rows @ state.cov[:n, :n] @ rows.T + noise * np.eye(2)
    now = state.x[0:2] + state.x[2:4]
    crossed = gauss_markov.crossing(now, ground, max((start + end) / 2 - state.t, 0.0), params)
    return rows @ state.x[:n], np.asarray(cov + state.process_scale * crossed**2 * np.eye(2))
