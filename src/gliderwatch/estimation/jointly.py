"""What the joint estimator says of a dive, as an assessment. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np

from gliderwatch.detection.flags import FlowMaxima, p_e, update
from gliderwatch.estimation import speed
from gliderwatch.estimation.blank import blank
from gliderwatch.estimation.joint import Estimate, JointInfo, JointParams
from gliderwatch.estimation.range import RangeParams
from gliderwatch.estimation.reference import Reference
from gliderwatch.estimation.speed import SpeedParams, SpeedState, Verdict
from gliderwatch.model import Assessment, Current, Dive, Flag
from gliderwatch.params import GliderParams

APART = 16.0
"""Squared misfit of flow and reference, in standard errors, that is no chance."""


@dataclass(frozen=True, slots=True)
class Joint:
    """State after a dive: of the estimator with its tests, and ``maxima`` of Algorithm 2."""

    speed: SpeedState = SpeedState()
    maxima: FlowMaxima = FlowMaxima()


def speed_params(params: GliderParams) -> SpeedParams:
    """The parameters of the joint estimator and of its tests among those of a glider."""
    return SpeedParams(
        joint=JointParams(alarms_per_month=params.alarms_per_month),
        low=params.speed_min,
        high=params.speed_max,
        learning=RangeParams() if params.speed_learnt else None,
    )


def step(
    state: Joint,
    dive: Dive,
    params: GliderParams,
    digest: str,
    frozen: bool = False,
    other: Reference | None = None,
) -> tuple[Joint, Assessment]:
    """The state after one more dive, and what it says of the dive.

    ``digest`` identifies the parameters; while ``frozen`` nothing is learnt of what is normal. ``other``
    takes the place of the dive's current as the reference; the estimate itself does not rest on it.
    """
    after, verdict = speed.step(state.speed, dive, speed_params(params), frozen)
    if verdict.info is None:
        told = None if verdict.flag is None else int(verdict.flag)
        return state, replace(blank(dive, params, digest, verdict.reason), flag=told)
    found, current = verdict.info.estimate, dive.current if other is None else other.current
    flow = (float(found.flow[0]), float(found.flow[1]))
    size = hypot(current.u, current.v) if current is not None else 0.0
    maxima = update(state.maxima, hypot(*flow), size)
    error = None if current is None else p_e(flow, (current.u, current.v), maxima)
    flag, reason = verdict.flag, verdict.reason
    if other is not None and flag == Flag.NORMAL and (error or 0.0) > params.gamma_f and _apart(found, other):
        flag, reason = Flag.FALSE_ALARM, "the flow does not fit the reference"
    plain = blank(dive, params, digest, reason)
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
    return Joint(after, maxima), assessment


def _apart(found: Estimate, other: Reference) -> bool:
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
        "flow_sigma": sqrt(float(np.trace(found.flow_cov)) / 2),
        "nis": info.nis / info.dof,
    }
    if verdict.normal.dives:
        out |= {"usual_speed": verdict.normal.usual, "usual_dives": float(verdict.normal.dives)}
    if info.loss is not None:
        out["loss_ratio"] = info.loss.ratio
    if info.across is not None:
        out["across_misfit"], out["across_sigma"] = info.across
    return out
