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
    n, lat = params.size, 0.0 if state.end is None else state.end.lat
    q = flow.intensities(state.x[:n], state.sea, params)
    passage = flow.passage(max(start - state.t, 0.0), max(end - start, 1.0), lat, q, params)
    mean = passage.matrix @ state.x[:n]
    cov = passage.matrix @ state.cov[:n, :n] @ passage.matrix.T + passage.noise
    now = state.x[0:2] + state.x[2:4]
    crossed = flow.crossing(now, ground, max((start + end) / 2 - state.t, 0.0), params)
    return mean[params.mean], np.asarray(cov[params.mean, params.mean] + state.sea * crossed**2 * np.eye(2))
