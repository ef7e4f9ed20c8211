"""The estimator of one glider, dive by dive: the one that its settings choose, with its reference. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import hypot, sqrt

import numpy as np

from gliderwatch.estimation import adaptive
from gliderwatch.estimation.adaptive import Learner
from gliderwatch.estimation.constants import APART, PROVISIONAL, REPORTED
from gliderwatch.estimation.healthy_baseline import Baseline, evidence_of, learn
from gliderwatch.estimation.kalman import JointEstimate, JointInfo, JointParams, expected_flow
from gliderwatch.estimation.speed_range import RangeParams
from gliderwatch.estimation.unassessed import (
    Mean,
    Reference,
    model_numbers,
    of_learnt,
    of_model,
    of_tides,
    unassessed,
)
from gliderwatch.estimation.verdict import SpeedParams, SpeedState, Verdict
from gliderwatch.estimation.verdict import step as step_speed
from gliderwatch.model import Assessment, Current, Dive, Flag, replace
from gliderwatch.papers.flags import FlowMaxima, p_e, update
from gliderwatch.params import GliderParams
from gliderwatch.sea import flow_forecast as currents
from gliderwatch.sea.flow_forecast import Currents
from gliderwatch.sea.gauss_markov import FlowParams
from gliderwatch.sea.ocean_field import Field

# ----------------------------------------
# What the joint estimator says of a dive, as an assessment.


@dataclass(frozen=True, slots=True)
class Estimate:
    """State of the estimator of one glider after a dive.

    ``speed`` (with its filter) and ``maxima`` (of Algorithm 2) of the estimator `joint`, ``learner`` of
    `adaptive`; the one that is not chosen stays empty. ``baseline`` of what corroborates, ``currents`` of the
    dives where the reference is their forecast.
    """

    speed: SpeedState = SpeedState()
    maxima: FlowMaxima = FlowMaxima()
    learner: Learner = Learner()
    baseline: Baseline = Baseline()
    currents: Currents = Currents()


@lru_cache(maxsize=64)
def speed_params(params: GliderParams) -> SpeedParams:
    """The parameters of the joint estimator and of its tests among those of a glider."""
    return SpeedParams(
        joint=JointParams(alarms_per_month=params.alarms_per_month),
        low=params.speed_min,
        high=params.speed_max,
        learning=RangeParams() if params.speed_learnt else None,
    )


def joint_step(
    state: Estimate,
    dive: Dive,
    params: GliderParams,
    digest: str,
    frozen: bool = False,
    other: Reference | None = None,
) -> tuple[Estimate, Assessment]:
    """The state after one more dive, and what it says of the dive.

    ``digest`` identifies the parameters; while ``frozen`` nothing is learnt of what is normal. ``other``
    takes the place of the dive's current as the reference; the estimate itself does not rest on it.
    """
    after, verdict = step_speed(state.speed, dive, speed_params(params), frozen)
    if verdict.info is None:
        return state, _without_speed(unassessed(dive, params, digest, verdict.reason), verdict)
    found, current = verdict.info.estimate, dive.current if other is None else other.current
    flow = (float(found.flow[0]), float(found.flow[1]))
    size = hypot(current.u, current.v) if current is not None else 0.0
    maxima = update(state.maxima, hypot(*flow), size)
    error = None if current is None else p_e(flow, (current.u, current.v), maxima)
    flag, reason = verdict.flag, verdict.reason
    if other is not None and flag == Flag.NORMAL and (error or 0.0) > params.gamma_f and _apart(found, other):
        flag, reason = Flag.FALSE_ALARM, "the flow does not fit the reference"
    plain = unassessed(dive, params, digest, reason)
    assessment = replace(
        plain,
        flag=None if flag is None else int(flag),
        speed=found.speed if verdict.by_reckoning is None else verdict.by_reckoning[0],
        speed_min=verdict.normal.low,
        speed_max=verdict.normal.high,
        flow_u=flow[0],
        flow_v=flow[1],
        reference_u=None if current is None else current.u,
        reference_v=None if current is None else current.v,
        reference_final=current is not None and current.final,
        p_e=error,
        evidence={**plain.evidence, **_numbers(verdict, verdict.info)},
        notes=_notes(dive, current, other),
    )
    return replace(state, speed=after, maxima=maxima), assessment


def _without_speed(plain: Assessment, verdict: Verdict) -> Assessment:
    """Of a dive without a track: what is normal is known all the same."""
    return replace(
        plain,
        flag=None if verdict.flag is None else int(verdict.flag),
        speed_min=verdict.normal.low,
        speed_max=verdict.normal.high,
        evidence={**plain.evidence, **_usual(verdict)},
    )


def _apart(found: JointEstimate, other: Reference) -> bool:
    """Whether flow and reference differ by more than the errors of both."""
    assert other.current is not None
    miss = found.flow - np.array([other.current.u, other.current.v])
    return float(miss @ np.linalg.solve(found.flow_cov + other.cov, miss)) > APART


def _notes(dive: Dive, current: Current | None, other: Reference | None) -> tuple[str, ...]:
    if other is not None:
        return (*dive.notes, *other.notes)
    if current is None:
        return (*dive.notes, "no depth-averaged current: a wrong flow cannot be told")
    return dive.notes if current.final else (*dive.notes, "depth-averaged current is provisional")


def _numbers(verdict: Verdict, info: JointInfo) -> dict[str, float]:
    """What the joint estimator knows beside speed and flow, for people and rules."""
    found = info.estimate
    out = {
        "speed_sigma": found.sigma if verdict.by_reckoning is None else verdict.by_reckoning[1],
        "own_speed": found.own_speed,
        "slip": found.slip[0],
        "slip_sigma": found.slip[1],
        "side": found.side[0],
        "side_sigma": found.side[1],
        "flow_sigma": sqrt(float(found.flow_cov[0, 0] + found.flow_cov[1, 1]) / 2),
        "nis": info.nis / info.dof,
    }
    out |= _usual(verdict)
    if verdict.before is not None:
        out["usual_before"] = verdict.before
    if info.loss is not None:
        out["loss_ratio"] = info.loss.ratio
    if info.across is not None:
        out["across_misfit"], out["across_sigma"] = info.across
    return out


def _usual(verdict: Verdict) -> dict[str, float]:
    """The usual speed, where it is learnt."""
    normal = verdict.normal
    return {"usual_speed": normal.usual, "usual_dives": float(normal.dives)} if normal.dives else {}


# ----------------------------------------
# The estimator of one glider, dive by dive: the one that its settings choose, with its reference.


def step(
    state: Estimate,
    dive: Dive,
    params: GliderParams,
    digest: str,
    frozen: bool = False,
    ocean: Field | None = None,
) -> tuple[Estimate, Assessment]:
    """The estimate after one more dive, and what it says of the dive.

    ``digest`` identifies the parameters; ``frozen`` says that an incident is open, so that nothing is learnt
    of what is normal; ``ocean`` is the field of a model (None: not read). A dive that cannot be used
    leaves the estimate as it is and gets an assessment with the reason.
    """
    other = _reference(state, dive, params, ocean)
    if params.estimator == "joint":
        after, assessment = joint_step(state, dive, params, digest, frozen, other)
    else:
        learnt, assessment = adaptive.step(state.learner, dive, params, digest, frozen, other)
        after = state if learnt is state.learner else replace(state, learner=learnt)
    if dive.track is None or dive.start is None or dive.end is None:
        return after, assessment
    modelled = of_model(ocean, dive, dive.start, dive.end) if params.reference == "fleet" else None
    evidence = {
        **assessment.evidence,
        **evidence_of(state.baseline, dive.features),
        **({} if modelled is None else model_numbers(modelled)),
    }
    after = _with_currents(after, dive, params, assessment.flag)
    if assessment.flag == Flag.NORMAL and not frozen:
        after = replace(after, baseline=learn(state.baseline, dive.features))
    return after, replace(assessment, evidence=evidence)


def _reference(state: Estimate, dive: Dive, params: GliderParams, ocean: Field | None) -> Reference | None:
    """What a dive is compared with; None: its own current."""
    if params.compares_own_current or dive.start is None or dive.end is None:
        return None
    if params.reference == "model":
        return of_model(ocean, dive, dive.start, dive.end)
    if params.reference == "tides":
        return of_tides(state.currents, dive.start, dive.end)
    return of_learnt(_learnt(state, dive, params))


def _learnt(state: Estimate, dive: Dive, params: GliderParams) -> Mean | None:
    """The flow that the estimator expects on a dive."""
    assert dive.start is not None and dive.end is not None
    if (filter_ := state.speed.filter) is not None:
        return expected_flow(filter_, FlowParams(), np.zeros(2), dive.start.t, dive.end.t)
    flow = adaptive.learnt_flow(state.learner, dive, params)
    return None if flow is None else (flow, np.zeros((2, 2)))


def _with_currents(state: Estimate, dive: Dive, params: GliderParams, flag: int | None) -> Estimate:
    """The state that knows the current of one more dive, where its forecast is wanted and it is believed."""
    current = dive.current
    if params.reference != "tides" or current is None or flag == Flag.FALSE_ALARM:
        return state
    assert dive.start is not None and dive.end is not None
    error = REPORTED if current.final else PROVISIONAL
    flow = np.array([current.u, current.v])
    learnt = currents.learn(state.currents, dive.start, dive.end, flow, error)
    return replace(state, currents=learnt)
