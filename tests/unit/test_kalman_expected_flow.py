import numpy as np
import pytest

from gliderwatch.estimation import kalman
from gliderwatch.estimation.kalman import JointParams, expected_flow
from joint_support import HOUR, Way, mission

PARAMS = JointParams()


@pytest.fixture
def state():
    found = None
    for dive in mission([Way(flow=(0.2, -0.1))] * 30):
        found, _ = kalman.step(found, dive, PARAMS)
    return found


def test_a_steady_flow_goes_on(state):
    mean, _ = expected_flow(state, PARAMS.flow, np.zeros(2), state.t, state.t + 3 * HOUR)
    assert mean == pytest.approx([0.2, -0.1], abs=0.03)


def test_the_further_ahead_the_less_is_known(state):
    ahead = [
        expected_flow(state, PARAMS.flow, np.zeros(2), state.t + h * HOUR, state.t + (h + 3) * HOUR)[1]
        for h in (0, 6, 24)
    ]
    widths = [np.trace(cov) for cov in ahead]
    assert widths[0] < widths[1] < widths[2]


def test_a_strong_current_is_less_known_where_the_glider_is_carried_on(state):
    still, carried = (
        expected_flow(state, PARAMS.flow, np.array([east, 0.0]), state.t, state.t + 6 * HOUR)[1]
        for east in (0.0, 1.0)
    )
    assert np.trace(carried) > np.trace(still)


def test_forecast_errors_are_as_large_as_said():
    """The mean flow of the next dive, of a sea as the estimator takes it to be."""
    rng = np.random.default_rng(5)
    left = np.exp(-3.17 / 30)
    flow, ways = np.zeros(2), []
    for _ in range(300):
        flow = left * flow + 0.08 * np.sqrt(1 - left**2) * rng.standard_normal(2)
        ways.append(Way(flow=tuple(flow.tolist())))
    found, squares = None, []
    for dive, way in zip(mission(ways), ways, strict=True):
        if found is not None and found.dives > 20:
            mean, cov = expected_flow(found, PARAMS.flow, np.zeros(2), dive.t_dive, dive.t_surface)
            off = np.array(way.flow) - mean
            squares.append(off @ np.linalg.solve(cov, off) / 2)
        found, _ = kalman.step(found, dive, PARAMS)
    assert 0.5 < np.mean(squares) < 1.5
