"""The loop of paper 004: its filter by numbers and by filterpy, its cost, its runs on the water of Fig. 5."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from gliderwatch.model import Array
from gliderwatch.papers import extremum_seeking as seeking
from gliderwatch.papers.extremum_seeking import Cost, Estimate, Mode, SeekingParams
from gliderwatch.papers.seeking_vehicle import PRESETS, Run, coverage, fly, outside


def noise(params: SeekingParams, seconds: float, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(0.0, 0.002, round(seconds / params.dt))


GAIN, Q, R = 1.5e-4, 3e-5, 3e-5


def bell(steps: int) -> list[tuple[float, float, float]]:
    """Depth (m), perturbation (m) and measured cost of each step above a bell at 10 m."""
    z, out = 11.3, []
    for i in range(steps):
        d = seeking.perturbation(0.05 * i, 0.0135, 91.0)
        y = math.exp(-((z - 10.0) ** 2) / 2)
        z += d
        out.append((z, d, y))
    return out


def filtered(rows: list[tuple[float, float, float]]) -> list[Estimate]:
    out, estimate = [], seeking.begin(Q, R)
    for _, d, y in rows:
        estimate = seeking.step(estimate, d, GAIN, y, Q, R)
        out.append(estimate)
    return out


def test_filter_has_the_printed_numbers() -> None:
    rows = bell(100)
    estimates = filtered(rows)
    for n, z, g, j, p_gg in (
        (1, 11.3135, 0.002899247944, 0.214798251283, 5.9997506650e-05),
        (10, 11.434977073, 0.053303397742, 0.363790158130, 3.1212504112e-04),
        (100, 12.623739963, -0.119902369316, 0.030164053490, 3.7622329723e-04),
    ):
        found = estimates[n - 1]
        assert rows[n - 1][0] == pytest.approx(z, abs=1e-9)
        assert (found.gradient, found.cost) == pytest.approx((g, j), abs=1e-10)
        # The printed variance of step 1 is 4e-6 of itself above ours and filterpy's; the others agree.
        assert found.p_gg == pytest.approx(p_gg, rel=5e-6 if n == 1 else 1e-9)


def test_filter_agrees_with_filterpy() -> None:
    points = MerweScaledSigmaPoints(2, alpha=1.0, beta=0.0, kappa=0.0)

    def move(x: np.ndarray, dt: float, d: float = 0.0) -> np.ndarray:
        return np.array([x[0], x[1] + (d + GAIN * x[0]) * x[0]])

    other = UnscentedKalmanFilter(2, 1, 0.05, lambda x: x[1:], move, points)
    other.x, other.P = np.zeros(2), np.diag([Q, R])
    other.Q, other.R = np.diag([Q, 0.0]), np.array([[R]])
    rows = bell(600)
    for (_, d, y), ours in zip(rows, filtered(rows), strict=True):
        other.predict(d=d)
        other.update(y)
        assert (ours.gradient, ours.cost) == pytest.approx(tuple(other.x), rel=1e-9, abs=1e-12)
        found = np.array([[ours.p_gg, ours.p_gj], [ours.p_gj, ours.p_jj]])
        assert found == pytest.approx(other.P, rel=1e-9, abs=1e-15)


def test_filter_says_where_the_covariance_is_none() -> None:
    with pytest.raises(ValueError, match="R and Q"):
        seeking.step(Estimate(0.0, 0.0, 0.0, 0.0, 1.0), 0.01, GAIN, 1.0, Q, R)


def test_cost_of_a_straight_profile_is_its_slope() -> None:
    cost = Cost(5, 0.05)
    found = [cost.add(0.1 * i, 20.0 - 0.3 * i) for i in range(20)]
    assert found[:9] == [0.0] * 9
    assert found[9:] == pytest.approx([3.0] * 11)


def test_cost_at_a_turn_is_zero() -> None:
    cost = Cost(4, 0.15)
    depths = [0.1 * min(i, 30 - i) for i in range(30)]
    found = [cost.add(z, z) for z in depths]
    assert found[18] == 0.0  # averages of both sides of the turn at step 15: the same depth
    assert found[29] == pytest.approx(1.0)


def test_band_of_the_perturbation_of_table_1() -> None:
    assert seeking.reach(SeekingParams()) == pytest.approx(7.5, abs=0.4)


def test_run_of_figures_7_and_8() -> None:
    preset = PRESETS["simulation"]
    run = fly(preset.params, preset.water, noise(preset.params, preset.seconds))
    start = float(run.t[run.tracking > 0][0])
    assert start == pytest.approx(77.0, abs=5.0)  # Fig. 8
    assert run.depth[run.t == start][0] == pytest.approx(11.3, abs=0.4)
    settled = start + 4 * preset.params.period
    covered = coverage(run, preset.water.layers, settled)
    assert min(covered) > 0.99
    assert len(covered) >= 10
    assert outside(run, preset.water.layers, settled) == pytest.approx(0.41, abs=0.02)
    assert run.resets == 0


def test_two_runs_of_one_seed_are_one_run() -> None:
    preset = PRESETS["simulation"]
    one, other = (fly(preset.params, preset.water, noise(preset.params, 100.0, 3)) for _ in range(2))
    assert np.array_equal(one.measured, other.measured)


def test_run_of_table_2_is_that_of_figure_10() -> None:
    """It begins in the upper layer, covers that alone in its first period, and sinks to the lower one."""
    preset = PRESETS["field"]
    run = fly(preset.params, preset.water, noise(preset.params, 800.0))
    start = float(run.t[run.tracking > 0][0])
    assert start == pytest.approx(175.0, abs=6.0)
    assert run.depth[run.t == start][0] == pytest.approx(5.5, abs=1.0)
    first = run.depth[(run.t >= start) & (run.t < start + preset.params.period)]
    assert (first.min(), first.max()) == pytest.approx((1.8, 11.0), abs=0.2)
    later = run.depth[run.t > 630.0]
    assert later.max() > 14.5  # into the lower layer, from 13.5 m on
    assert 4.5 < later.min() < 6.5  # of the upper one the steepest part alone


FAST = replace(SeekingParams(), dt=0.1, amplitude=0.027, gain=3e-4)
"""Table 1 at half its steps."""


def jumping(by: float, seconds: float) -> Run:
    """A run in which both layers jump down by so many m at 450 s."""
    water = replace(PRESETS["simulation"].water, bottom=20.0 + max(by, 0.0))
    return fly(FAST, water, noise(FAST, seconds), shift=lambda t: by if t > 450.0 else 0.0)


def test_layers_that_jump_out_of_the_band_are_found_again_after_a_reset() -> None:
    run, layers = jumping(10.0, 1500.0), PRESETS["simulation"].water.layers
    assert run.resets == 1
    assert Mode.SURFACING in run.mode
    assert min(coverage(run.until(450.0), layers, 300.0)) > 0.95
    moved = tuple((top + 10.0, bottom + 10.0) for top, bottom in layers)
    assert min(coverage(run, moved, 1250.0)) > 0.95


def test_a_layer_that_stays_in_the_band_is_no_reset() -> None:
    """Where both rise by 4 m, the lower one is left in the band, 0.57 as steep as the upper: above 0.5."""
    assert jumping(-4.0, 800.0).resets == 0
