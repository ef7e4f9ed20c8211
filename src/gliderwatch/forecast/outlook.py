"""What a glider is expected to do after a dive: its speed, the flow, and the next surfacing by them. Pure."""

from __future__ import annotations

from math import expm1

import numpy as np

from gliderwatch.estimation.constants import USUAL_PITCH
from gliderwatch.estimation.dive_measurement import OWN, SLIP, are_apart, slip_at
from gliderwatch.estimation.glider import Estimate
from gliderwatch.estimation.kalman import JointParams, JointState, expected_flow
from gliderwatch.forecast.constants import VAGUE
from gliderwatch.forecast.surfacing import (
    Flow,
    Place,
    Surfacings,
    WaypointLog,
    active_waypoint,
    called,
    expect,
    ground,
    learn,
)
from gliderwatch.model import Array, Dive, Fix, NextSurfacing
from gliderwatch.navigation.constants import SHORTEST_DIVE
from gliderwatch.navigation.geodesy import velocity
from gliderwatch.sea.gauss_markov import FlowParams

Outlook = tuple[float, float, Flow]
"""Speed through the water and its standard error (m/s), and the forecast of the flow."""
PHYSICAL = JointParams().slip * slip_at(USUAL_PITCH)
"""Part of the own speed that the angle of attack takes at the usual pitch, beside the slip of the state."""


def after_dive(
    before: Surfacings,
    dive: Dive,
    waypoints: WaypointLog,
    estimate: Estimate,
    expected: NextSurfacing | None,
    hours: float | None,
) -> tuple[Surfacings, NextSurfacing | None]:
    """What is learnt of how a glider surfaces from a dive that ended, and the next surfacing by it.

    ``waypoints`` are those read so far, ``estimate`` is that after the dive, ``expected`` the surfacing that
    was expected of it; ``hours`` between surfacings, where the settings say so.
    """
    waypoint = None if dive.end is None else active_waypoint(waypoints, dive.end.t)
    surfacings = learn(before, dive, waypoint, expected)
    outlook = look_ahead(estimate, ground(dive))
    return surfacings, None if outlook is None else expect(surfacings, *outlook, hours)


def after_call(
    before: Surfacings, fix: Fix, waypoint: Place | None, estimate: Estimate, hours: float | None
) -> NextSurfacing | None:
    """The next surfacing after one of which nothing but a call is known (yet): its `fix`, its `waypoint`.

    ``before`` and ``estimate`` are of the last file. None where that has this surfacing, or is of another
    deployment, or nothing can be expected yet.
    """
    if before.fix is None or fix.t - before.fix.t < SHORTEST_DIVE or are_apart(before.fix, fix):
        return None
    outlook = look_ahead(estimate, velocity(before.fix, fix))
    return None if outlook is None else expect(called(before, fix, waypoint), *outlook, hours)


def look_ahead(estimate: Estimate, over_ground: Array | None) -> Outlook | None:
    """Speed and flow to be expected after the last dive used; None before the first.

    ``over_ground`` (m/s, (2,)) is how it went then: a strong current differs along the way.
    """
    joint, learner = estimate.speed.filter, estimate.learner
    if joint is not None:
        return _of_joint(joint, np.zeros(2) if over_ground is None else over_ground)
    if learner.learner is None or learner.current is None:
        return None
    params = FlowParams()
    current, t = np.array([learner.current.u, learner.current.v]), learner.current_t

    def flow(start: float, end: float) -> tuple[Array, Array]:
        left = max((start + end) / 2 - t, 0.0) / params.memory
        return current, -(params.passing**2) * expm1(-2 * left) * np.eye(2)

    speed = learner.learner.speed
    return speed, VAGUE * abs(speed), flow


def _of_joint(joint: JointState, over_ground: Array) -> Outlook:
    own, params = float(joint.x[OWN]), FlowParams()
    left = 1 - PHYSICAL - float(joint.x[SLIP])
    slope = np.zeros(len(joint.x))
    slope[[OWN, SLIP]] = left, -own

    def flow(start: float, end: float) -> tuple[Array, Array]:
        return expected_flow(joint, params, over_ground, start, end)

    return own * left, float(slope @ joint.cov @ slope) ** 0.5, flow
