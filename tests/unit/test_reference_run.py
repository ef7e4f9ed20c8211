"""The simulation of 001 (Table 1, Figs. 2 and 3): Algorithms 1 and 2 together, to the digits."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from euler import euler_step
from gliderwatch.detection.flags import FlowMaxima, flag, p_e, update
from gliderwatch.estimation.adaptive import AdaptiveParams, AdaptiveState, advance, init
from gliderwatch.estimation.basis import Basis, phi
from gliderwatch.model import Flag, readonly

THETA = np.array([[0.9, 0.5, 0.7], [0.8, 0.5, 0.9]])
CENTRES = readonly([[0, 0], [10, 10], [5, 5]])
OMEGA = readonly(2 * math.pi / (3600 * np.array([12.42, 12.66, 12.0])))


def paper_basis(kernel):
    return Basis(CENTRES, readonly([5.0] * 3), OMEGA, readonly([0.0] * 3), kernel)


def paper_params(kernel):
    return AdaptiveParams(sigma=5.0, kernel=kernel, omega=0.0, nu=0.0, k=1.0, gamma=0.8)


def paper_state():
    return replace(init(1.0, 3), xi=readonly([[0.17, 0.2, 0.05], [0.07, 0.1, 0.1]]))


def euler(state, t, x, psi, basis, params):
    return euler_step(state, t[0], t[1] - t[0], x[0], x[1], heading=psi, basis=basis, params=params)


def exact(state, t, x, psi, basis, params):
    return advance(state, t, x, psi[None], basis, params)[0]


@dataclass
class Run:
    states: list[AdaptiveState]
    changes: list[tuple[float, Flag]]

    def error(self, second):
        return float(np.hypot(*self.states[second * 10].e))

    def speed(self, second):
        return self.states[second * 10].speed


def simulate(step, kernel, seconds=300):
    """0.1 s steps; the truth moves by the same rule as the paper's learner."""
    basis, params, state, x = paper_basis(kernel), paper_params(kernel), paper_state(), np.zeros(2)
    maxima, run = FlowMaxima(), Run([], [])
    for i in range(seconds * 10 + 1):
        t = np.array([i, i + 1]) / 10
        learnt, true = state.xi @ phi(x - state.e, t[0], basis), THETA @ phi(x, t[0], basis)
        maxima = update(maxima, float(np.hypot(*learnt)), float(np.hypot(*true)))
        now = flag(p_e(learnt, true, maxima), 0.07, state.speed, speed_min=0.8, speed_max=1.2)
        if not run.changes or run.changes[-1][1] is not now:
            run.changes.append((i / 10, now))
        run.states.append(state)
        angle = (i // 200) * math.pi / 2
        psi = np.array([math.cos(angle), math.sin(angle)])
        x_next = x + (true + (1.0 if i < 2000 else 0.5) * psi) * 0.1
        state = step(state, t, np.array([x, x_next]), psi, basis, params)
        x = x_next
    return run


@pytest.fixture(scope="module")
def exponential():
    return simulate(euler, "exponential")


def test_flags_exponential(exponential):
    assert exponential.changes == [
        (0.0, Flag.FALSE_ALARM),
        (9.2, Flag.ANOMALY),
        (12.9, Flag.NORMAL),
        (201.3, Flag.ANOMALY),
    ]


def test_flags_gaussian():
    assert simulate(euler, "gaussian").changes == [
        (0.0, Flag.FALSE_ALARM),
        (8.1, Flag.ANOMALY),
        (10.4, Flag.NORMAL),
        (201.3, Flag.ANOMALY),
    ]


def test_errors(exponential):
    assert exponential.error(20) == pytest.approx(0.0121, abs=5e-5)
    assert exponential.error(100) == pytest.approx(0.0016, abs=5e-5)


def test_speeds(exponential):
    assert exponential.speed(210) == pytest.approx(0.5010, abs=5e-5)
    assert exponential.speed(250) == pytest.approx(0.5040, abs=5e-5)


def test_weights_do_not_converge(exponential):
    assert np.abs(exponential.states[-1].xi - THETA).max() == pytest.approx(0.29, abs=5e-3)


@pytest.mark.parametrize("kernel", ["exponential", "gaussian"])
def test_exact_steps_tell_the_same_story(kernel):
    """At 0.1 s, K dt = 0.1, Euler's rule is off by some percent: times within 0.1 s, not each digit."""
    paper, ours = simulate(euler, kernel).changes, simulate(exact, kernel).changes
    assert [f for _, f in ours] == [f for _, f in paper]
    assert [t for t, _ in ours] == pytest.approx([t for t, _ in paper], abs=0.11)


def test_euler_converges_to_advance_with_the_step():
    """On one track, cut ever finer, the distance to `advance` halves with the step."""
    basis, params = paper_basis("exponential"), paper_params("exponential")
    t = np.linspace(0.0, 40.0, 401)
    psi = np.where(t[:-1, None] < 20.0, [[1.0, 0.0]], [[0.0, 1.0]])
    x = np.vstack([[0.0, 0.0], np.cumsum(0.1 * (psi + np.array([0.3, 0.2])), axis=0)])
    want, _ = advance(paper_state(), t, x, psi, basis, params)
    distances = []
    for parts in (1, 2, 4, 8):
        state, dt = paper_state(), 0.1 / parts
        for i in range(400):
            line = [x[i] + (x[i + 1] - x[i]) * j / parts for j in range(parts + 1)]
            for j in range(parts):
                at = t[i] + j * dt
                state = euler(state, [at, at + dt], line[j : j + 2], psi[i], basis, params)
        distances.append(max(np.abs(state.xi - want.xi).max(), abs(state.speed - want.speed)))
    ratios = np.array(distances[:-1]) / distances[1:]
    assert distances[-1] < 2e-3
    assert ratios == pytest.approx(2.0, abs=0.25)
