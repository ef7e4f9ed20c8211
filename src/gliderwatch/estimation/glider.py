"""The estimator of one glider, dive by dive: the one that its settings choose, with its reference. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gliderwatch.currents import state as currents
from gliderwatch.currents.field import Field
from gliderwatch.currents.state import Currents
from gliderwatch.estimation import jointly, learner
from gliderwatch.estimation.ahead import mean_flow
from gliderwatch.estimation.baseline import Baseline, learn, told
from gliderwatch.estimation.flow import FlowParams
from gliderwatch.estimation.jointly import Joint
from gliderwatch.estimation.learner import Learner
from gliderwatch.estimation.observation import PROVISIONAL, REPORTED, are_apart
from gliderwatch.estimation.reference import Mean, Reference, of_learnt, of_model, of_tides
from gliderwatch.model import Assessment, Dive, Fix, Flag
from gliderwatch.params import GliderParams


@dataclass(frozen=True, slots=True)
class Estimate:
    """State of the estimator of one glider after a dive.

    ``joint`` of the estimator `joint`, ``learner`` of `adaptive`; the one that is not chosen
    stays empty. ``baseline`` of what corroborates, ``currents`` of the dives where the reference is their
    forecast; ``end``, the fix that ended the last dive.
    """

    joint: Joint = Joint()
    learner: Learner = Learner()
    baseline: Baseline = Baseline()
    currents: Currents = Currents()
    end: Fix | None = None


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
    if dive.start is not None and state.end is not None and are_apart(state.end, dive.start):
        state = Estimate()  # another deployment: another sea, and perhaps another trim
    other = _reference(state, dive, params, ocean)
    if params.estimator == "joint":
        joint, assessment = jointly.step(state.joint, dive, params, digest, frozen, other)
        after = state if joint is state.joint else replace(state, joint=joint)
    else:
        learnt, assessment = learner.step(state.learner, dive, params, digest, frozen, other)
        after = state if learnt is state.learner else replace(state, learner=learnt)
    if dive.track is None or dive.start is None or dive.end is None:
        return after, assessment
    evidence = {**assessment.evidence, **told(state.baseline, dive.features)}
    after = _with_currents(replace(after, end=dive.end), dive, params, assessment.flag)
    if assessment.flag == Flag.NORMAL and not frozen:
        after = replace(after, baseline=learn(state.baseline, dive.features))
    return after, replace(assessment, evidence=evidence)


def _reference(state: Estimate, dive: Dive, params: GliderParams, ocean: Field | None) -> Reference | None:
    """What a dive is compared with; None: its own current."""
    if params.reference == "dac" or dive.start is None or dive.end is None:
        return None
    if params.reference == "model":
        return of_model(ocean, dive, dive.start, dive.end)
    if params.reference == "tides":
        return of_tides(state.currents, dive.start, dive.end)
    return of_learnt(_learnt(state, dive, params))


def _learnt(state: Estimate, dive: Dive, params: GliderParams) -> Mean | None:
    """The flow that the estimator expects on a dive."""
    assert dive.start is not None and dive.end is not None
    joint = state.joint.speed.joint
    if joint is not None:
        return mean_flow(joint, FlowParams(), np.zeros(2), dive.start.t, dive.end.t)
    flow = learner.learnt_flow(state.learner, dive, params)
    return None if flow is None else (flow, np.zeros((2, 2)))


def _with_currents(state: Estimate, dive: Dive, params: GliderParams, flag: int | None) -> Estimate:
    """The state that knows the current of one more dive, where its forecast is wanted and it is believed."""
    current = dive.current
    if params.reference != "tides" or current is None or flag == Flag.FALSE_ALARM:
        return state
    assert dive.start is not None and dive.end is not None
    error = REPORTED if current.final else PROVISIONAL
    flow = np.array([current.u, current.v])
    known = currents.learn(state.currents, dive.start.t, dive.end.t, flow, error)
    return replace(state, currents=known)
