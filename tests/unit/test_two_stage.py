"""The two-stage filter of paper 002: its reference numbers, and what it makes of a tide."""

import numpy as np
import pytest

from gliderwatch.papers import two_stage
from gliderwatch.papers.two_stage import TwoStageParams
from gliderwatch.sea.tides import HOUR, Constituent

T = np.array([0.0, 3.0, 6.2, 9.2, 12.5]) * HOUR
X = np.array([0.0, 1.0, 1.0, 1.0, 0.0])
CUTOFF = 1 / (40 * HOUR)
M2 = (Constituent.M2,)


def test_the_low_pass_at_irregular_times():
    passed = two_stage.low_pass(T, X, CUTOFF)
    assert passed == pytest.approx([0, 0.193599606, 0.523096136, 0.707752937, 0.620672508], abs=5e-10)


def test_the_low_pass_both_ways():
    passed = two_stage.low_pass_both_ways(T, X, CUTOFF)
    # The second is handed down as 0.518898789. That cannot be: of it and its neighbour the rule would make
    # 0.355462394 of the first, which is handed down as it is here. So a digit was misprinted (4 as 7).
    expected = [0.355462210, 0.518898489, 0.629824140, 0.638922553, 0.620672508]
    assert passed == pytest.approx(expected, abs=5e-10)


def test_components_are_filtered_alike():
    both = two_stage.low_pass(T, np.column_stack([X, -2 * X]), CUTOFF)
    assert both[:, 0] == pytest.approx(two_stage.low_pass(T, X, CUTOFF))
    assert both[:, 1] == pytest.approx(-2 * both[:, 0])


def test_power_gain_of_one_percent_at_12_h():
    t = np.arange(0, 60 * 24 * HOUR, HOUR / 4)
    x = np.sin(2 * np.pi * t / (12 * HOUR))
    passed = two_stage.low_pass(t, x, 1 / (119.4 * HOUR))[-30 * 96 :]
    assert np.mean(passed**2) / np.mean(x[-30 * 96 :] ** 2) == pytest.approx(0.01, rel=0.03)


def test_after_a_long_silence_nothing_is_left_of_what_was_before():
    after = two_stage.low_pass_step(np.array(9.0), np.array(0.1), np.array(0.3), 1e6, CUTOFF)
    assert after == pytest.approx(0.2)


def test_the_exact_mean_of_m2_over_three_hours():
    row = two_stage.mean_tide(0.0, 3 * HOUR, M2)
    assert row == pytest.approx([0.6580013843, 0.6238997846], abs=5e-11)


def test_amplitudes():
    mean, cov, q = np.zeros((2, 2)), 0.25 * np.eye(2), 1e-5 / HOUR
    innovations, last = [], 1.5 * HOUR
    for start, end, z in [(0, 3, 0.30), (3.2, 6.2, -0.10), (6.4, 9.4, -0.35)]:
        middle = (start + end) / 2 * HOUR
        cov = cov + q * (middle - last) * np.eye(2)
        row = two_stage.mean_tide(start * HOUR, end * HOUR, M2)
        mean, cov, error = two_stage.learn_tide(mean, cov, row, np.array([z, 0.0]), 0.01)
        innovations.append(error[0])
        last = middle
    assert innovations == pytest.approx([0.3, -0.0856180902, -0.0597319513], abs=5e-11)
    assert mean[:, 0] == pytest.approx([0.3304766048, 0.1896550368], abs=5e-11)


def test_amplitudes_are_less_certain_after_a_silence():
    params, current = TwoStageParams(), np.array([0.2, 0.1])
    state = two_stage.init(0.0, 3 * HOUR, current, params)
    state = two_stage.learn(state, 3 * HOUR, 6 * HOUR, current, 0.01, params)
    soon, late = (
        two_stage.learn(state, t * HOUR, (t + 3) * HOUR, current, 1e3, params).cov - state.cov
        for t in (6.2, 16.2)
    )
    # measurements with an error of 1 km/s change nothing: what is left is q times the time
    assert np.diag(soon) == pytest.approx([params.q * 3.2 * HOUR] * 2, rel=0.05)
    assert np.diag(late) == pytest.approx([params.q * 13.2 * HOUR] * 2, rel=0.05)


def test_a_pure_tide_is_foretold():
    params = TwoStageParams(cutoff=1 / (119.4 * HOUR))
    east, north = np.array([0.3, 0.1]), np.array([-0.1, 0.2])
    state, errors = None, []
    for k in range(60):
        start, end = k * 3.2 * HOUR, (k * 3.2 + 3) * HOUR
        row = two_stage.mean_tide(start, end, M2)
        current = np.array([row @ east, row @ north])
        if state is None:
            state = two_stage.init(start, end, current, params)
            continue
        errors.append(current - two_stage.forecast(state, start, end, params))
        state = two_stage.learn(state, start, end, current, 0.01, params)
    assert np.abs(errors[-10:]).max() < 0.05
    assert np.abs(errors[:3]).max() > 0.15
