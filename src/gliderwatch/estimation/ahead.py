"""The flow that the joint estimator expects after its last dive. Pure."""

from __future__ import annotations

import numpy as np

from gliderwatch.estimation import flow
from gliderwatch.estimation.flow import FlowParams
from gliderwatch.estimation.joint import JointState
from gliderwatch.model import Array


def mean_flow(
    state: JointState, params: FlowParams, ground: Array, start: float, end: float
) -> tuple[Array, Array]:
    """Mean flow (m/s, (2,)) between two times (s) and its covariance (m2/s2, (2, 2)).

    ``ground`` (m/s, (2,)) is about how fast the glider goes over ground: a strong current differs along it.
    """
    n, dt = params.size, max((start + end) / 2 - state.t, 0.0)
    now = flow.mean_flow(state.t, state.t, params) @ state.x[:n]
    kept = flow.transition(dt, params)
    added = flow.noise(dt, state.sea, flow.crossing(now, ground, dt, params), params)
    cov = kept[:, None] * state.cov[:n, :n] * kept + np.diag(added)
    rows = flow.mean_flow(start, end, params)
    return rows @ (kept * state.x[:n]), np.asarray(rows @ cov @ rows.T)
