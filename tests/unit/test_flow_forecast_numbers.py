"""The augmented filter: its reference numbers, and its matrices against integration by small steps."""

import numpy as np
import pytest

from gliderwatch.sea import flow_forecast
from gliderwatch.sea.flow_forecast import Belief, Parameters
from gliderwatch.sea.tides import HOUR, Constituent

M2 = Constituent.M2.omega


def one(sigma=0.08, tau=30 * HOUR, q=1e-6 / HOUR, prior=0.25, omega=(M2,)) -> Parameters:
    n = len(omega)
    return Parameters(
        np.array([sigma]), np.array([tau]), np.full((1, n), q), np.full((1, n), prior), np.array(omega)
    )


def reference() -> tuple[Belief, list[float]]:
    params, innovations = one(), []
    belief = flow_forecast.init_belief(0.0, params)
    for start, end, z in [(0, 3, 0.30), (3.2, 6.2, -0.10), (6.4, 9.4, -0.35)]:
        belief, expected = flow_forecast.learn_belief(
            belief, start * HOUR, end * HOUR, np.array([z, 0.0]), 0.01, params
        )
        innovations.append(z - expected.mean[0, 0])
    return belief, innovations


def test_innovations():
    assert reference()[1] == pytest.approx([0.3, -0.0941918574, -0.0711185996], abs=5e-11)


def test_forecast_of_the_displacement():
    told = flow_forecast.forecast_belief(reference()[0], 9.6 * HOUR, 12.6 * HOUR, one())
    assert told.mean[0] * 3 * HOUR == pytest.approx([813.4671, 0.0], abs=5e-5)
    assert np.sqrt(told.var[0]) * 3 * HOUR == pytest.approx(472.2680, abs=5e-5)


def by_small_steps(dt: float, params: Parameters, steps: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    """The same matrices from the differential equations alone, by the midpoint rule."""
    sigma, tau, q, omega = params.sigma[0], params.tau[0], params.q[0, 0], params.omega[0]
    a = np.array([[-1 / tau, 0, 0, 0], [0, 0, -omega, 0], [0, omega, 0, 0], [1, 1, 0, 0]])
    noise = np.diag([2 * sigma**2 / tau, q, q, 0.0])
    h = dt / steps
    half = np.eye(4) + a * h / 2 + a @ a * h**2 / 8
    f, cov = np.eye(4), np.zeros((4, 4))
    for _ in range(steps):
        cov = half @ (half @ cov @ half.T + noise * h) @ half.T
        f = half @ half @ f
    return f, cov


def test_matrices_are_those_of_the_differential_equations():
    params = one(q=3e-6 / HOUR)
    f, q = flow_forecast.transition(7 * HOUR, params)
    f_small, q_small = by_small_steps(7 * HOUR, params)
    scale = np.sqrt(np.outer(np.diag(q[0]), np.diag(q[0])))
    assert f[0] == pytest.approx(f_small, rel=1e-6, abs=1e-9)
    assert np.abs(q[0] - q_small).max() < np.inf
    assert (q[0] - q_small) / scale == pytest.approx(np.zeros((4, 4)), abs=1e-6)


@pytest.mark.parametrize("tau", [1e3, 1e5, 1e8, 1e11])
def test_two_steps_do_what_one_does(tau):
    params = one(tau=tau)
    (f1, q1), (f2, q2) = flow_forecast.transition(1e3, params), flow_forecast.transition(9e3, params)
    f, q = flow_forecast.transition(1e4, params)
    assert (f2 @ f1)[0] == pytest.approx(f[0], rel=1e-9, abs=1e-12)
    both = f2 @ q1 @ f2.transpose(0, 2, 1) + q2
    scale = np.sqrt(np.outer(np.diag(q[0]), np.diag(q[0])))
    assert (both - q)[0] / scale == pytest.approx(np.zeros((4, 4)), abs=1e-7)


def test_sets_do_not_know_of_each_other():
    sets = [(0.08, 30 * HOUR, 1e-6 / HOUR, 0.25), (0.2, 300 * HOUR, 1e-9, 0.01)]
    together = Parameters(
        *(np.array([s[k] for s in sets]) for k in (0, 1)),
        *(np.array([[s[k]] for s in sets]) for k in (2, 3)),
        np.array([M2]),
    )
    belief = flow_forecast.init_belief(0.0, together)
    belief, _ = flow_forecast.learn_belief(belief, 10.0, 1e4, np.array([0.2, 0.1]), 0.01, together)
    for k, each in enumerate(sets):
        params = one(*each)
        alone, _ = flow_forecast.learn_belief(
            flow_forecast.init_belief(0.0, params), 10.0, 1e4, np.array([0.2, 0.1]), 0.01, params
        )
        assert belief.mean[k] == pytest.approx(alone.mean[0], rel=1e-12)
        assert belief.cov[k] == pytest.approx(alone.cov[0], rel=1e-12)


def test_without_tides_a_forecast_fades_to_nothing_with_the_sea_s_own_variance():
    params = one(omega=(), tau=10 * HOUR)
    belief = flow_forecast.init_belief(0.0, params)
    belief, _ = flow_forecast.learn_belief(belief, 0.0, HOUR, np.array([0.3, -0.1]), 0.001, params)
    soon = flow_forecast.forecast_belief(belief, HOUR, HOUR + 60, params)
    late = flow_forecast.forecast_belief(belief, 1000 * HOUR, 1000 * HOUR + 60, params)
    assert soon.mean[0] == pytest.approx([0.3, -0.1], abs=0.03)
    assert late.mean[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert soon.var[0] < 0.08**2 / 5 and late.var[0] == pytest.approx(0.08**2, rel=1e-2)


def test_a_mean_over_the_whole_period_tells_nothing_of_a_tide():
    params = one(sigma=1e-6, q=1e-12)
    belief = flow_forecast.init_belief(0.0, params)
    period = 2 * np.pi / M2
    after, _ = flow_forecast.learn_belief(belief, 0.0, period, np.array([0.0, 0.0]), 0.01, params)
    assert np.diag(after.cov[0])[1:] == pytest.approx([0.25, 0.25], rel=1e-5)
