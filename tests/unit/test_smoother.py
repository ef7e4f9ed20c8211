"""Currents of a mission that is over: against a dense solution, and against the truth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.model import readonly
from gliderwatch.sea import smoother
from gliderwatch.sea.gauss_markov import FlowParams, Tide
from gliderwatch.sea.smoother import MeanCurrent, smooth
from gliderwatch.sea.tides import Constituent

HOUR = 3600.0
M2 = Constituent.M2.omega
SMALL = FlowParams(tides=(Tide(M2, 0.3),))


def current(t: np.ndarray) -> np.ndarray:
    """A rotary tide over a residual that turns within five days (m/s, (n, 2))."""
    slow = 0.06 * np.stack([np.cos(2 * np.pi * t / (120 * HOUR)), np.sin(2 * np.pi * t / (120 * HOUR))], -1)
    return slow + np.stack([0.3 * np.cos(M2 * t), 0.2 * np.sin(M2 * t)], -1)


def dives(n: int, sigma: float = 0.02) -> list[MeanCurrent]:
    """`n` dives of 3 h with 20 min between them, and their depth-averaged currents."""
    chance, out = np.random.default_rng(4), []
    for start in 1.7e9 + 200 * 60 * np.arange(n):
        mean = current(np.linspace(start, start + 3 * HOUR, 200)).mean(axis=0)
        seen = readonly(mean + chance.normal(0.0, sigma, 2))
        out.append(MeanCurrent(float(start), float(start + 3 * HOUR), seen, sigma, 54.0))
    return out


def test_it_is_the_dense_solution() -> None:
    """All states at once are jointly Gaussian: conditioned on all currents they are what the passes find."""
    measured = dives(5)
    steps, _ = smoother._forward(measured, SMALL, 1.0, HOUR)
    n, place = SMALL.size, SMALL.mean
    joint = np.zeros((n * len(steps), n * len(steps)))
    joint[:n, :n] = steps[0].predicted_cov
    for k in range(1, len(steps)):
        # What chance adds is what the filter's prediction has more than it carried on.
        noise = steps[k].predicted_cov - steps[k].matrix @ steps[k - 1].cov @ steps[k].matrix.T
        rows = slice(n * k, n * (k + 1))
        joint[rows, : n * k] = steps[k].matrix @ joint[n * (k - 1) : n * k, : n * k]
        joint[: n * k, rows] = joint[rows, : n * k].T
        before = joint[n * (k - 1) : n * k, n * (k - 1) : n * k]
        joint[rows, rows] = steps[k].matrix @ before @ steps[k].matrix.T + noise
    ends = [k for k, one in enumerate(steps) if one.ends]
    h = np.zeros((2 * len(ends), len(joint)))
    for i, k in enumerate(ends):
        h[2 * i : 2 * i + 2, n * k + place.start : n * k + place.stop] = np.eye(2)
    y = np.concatenate([d.current * (d.end - d.start) for d in measured])
    r = np.diag(np.repeat([(d.sigma * (d.end - d.start)) ** 2 for d in measured], 2))
    dense = joint @ h.T @ np.linalg.solve(h @ joint @ h.T + r, y)
    left = joint - joint @ h.T @ np.linalg.solve(h @ joint @ h.T + r, h @ joint)
    found = smoother._backward(steps)
    for k, (mean, cov) in enumerate(found):
        parts = slice(n * k, n * k + n - 2)
        assert mean[:-2] == pytest.approx(dense[parts], abs=2e-6)
        assert cov[:-2, :-2] == pytest.approx(left[parts, parts], abs=2e-6)


def test_delayed_is_better_than_near_real_time_and_both_are_honest() -> None:
    found = smooth(dives(60), FlowParams())
    settled = found.delayed.t > 1.7e9 + 48 * HOUR
    rms = {}
    for name, one in (("near", found.near_real_time), ("delayed", found.delayed)):
        error = (one.total - current(one.t))[settled]
        rms[name] = math.sqrt(float(np.mean(error**2)))
        assert np.mean(np.abs(error) < 1.96 * one.sigma[settled]) > 0.9
    assert rms["delayed"] < 0.9 * rms["near"] < 0.03


def test_tide_and_residual_are_told_apart() -> None:
    found = smooth(dives(60), FlowParams()).delayed
    tide = np.stack([0.3 * np.cos(M2 * found.t), 0.2 * np.sin(M2 * found.t)], -1)
    middle = (found.t > 1.7e9 + 48 * HOUR) & (found.t < 1.7e9 + 152 * HOUR)
    assert np.abs(found.tide - tide)[middle].max() < 0.05


def test_currents_are_given_every_half_hour_from_a_metre_of_error() -> None:
    found = smooth(dives(2), SMALL).delayed
    assert np.diff(found.t[:7]) == pytest.approx(1800.0)
    steps, _ = smoother._forward(dives(1), SMALL, 1.0, HOUR)
    assert np.diag(steps[0].predicted_cov)[SMALL.mean] == pytest.approx(1.0)


@pytest.mark.parametrize(("size", "scale"), [(0.0, 0.1), (0.5, 10.0)])
def test_how_restless_a_sea_is_is_learnt(size: float, scale: float) -> None:
    chance = np.random.default_rng(2)
    wild = [replace(d, current=readonly(chance.normal(0.0, size, 2))) for d in dives(40)]
    assert smooth(wild, SMALL, HOUR * 3).scale == scale


@pytest.mark.parametrize(("tide", "factor"), [(0.0, 0.03), (0.035, 0.1), (0.1, 0.3), (0.4, 1.0)])
def test_how_strong_the_tides_are_is_learnt(tide: float, factor: float) -> None:
    chance, out = np.random.default_rng(3), list[MeanCurrent]()
    for start in 1.7e9 + 200 * 60 * np.arange(40):
        t = np.linspace(start, start + 3 * HOUR, 50)
        mean = tide * np.stack([np.cos(M2 * t), np.sin(M2 * t)], -1).mean(axis=0)
        seen = readonly(mean + chance.normal(0.0, 0.01, 2))
        out.append(MeanCurrent(float(start), float(start + 3 * HOUR), seen, 0.01, 54.0))
    assert smooth(out, SMALL, HOUR * 3).tides == factor


def test_what_it_cannot_take_is_refused() -> None:
    with pytest.raises(ValueError, match="no dive"):
        smooth([], SMALL)
    one = dives(1)[0]
    with pytest.raises(ValueError, match="overlap"):
        smooth([one, one], SMALL)
