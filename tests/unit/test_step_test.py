import math

import numpy as np
import pytest

from gliderwatch.estimation import step_test
from gliderwatch.estimation.constants import OLDER_EVERY, WINDOW
from gliderwatch.estimation.step_test import (
    Bank,
    Update,
    advance,
    cusum,
    cusum_bound,
    likeliest,
    ratio_bound,
)

N, M, Q = 3, 2, 2
SHAPE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
NOISE, PROCESS = np.diag([0.04, 0.09]), np.diag([0.02, 0.0, 0.0])
KEPT = np.array([0.9, 1.0, 1.0])


def rows(k: int) -> np.ndarray:
    return np.array([[1.0, math.cos(k), 0.3], [0.5, math.sin(k), -0.2 * k % 1]])


def filtered(z, step=None, at=-1):
    """The end of a plain Kalman filter and its updates; ``step`` moves the state just before dive ``at``."""
    x, p = np.zeros(N), np.diag([1.0, 0.05, 0.05])
    updates = []
    for k, measured in enumerate(z):
        x, p = KEPT * x, KEPT[:, None] * p * KEPT + PROCESS
        if k == at:
            x = x + SHAPE @ step
        h = rows(k)
        s = h @ p @ h.T + NOISE
        gain = p @ h.T @ np.linalg.inv(s)
        e = measured - h @ x
        updates.append(Update(h, gain, np.linalg.inv(s), e))
        x, p = x + gain @ e, (np.eye(N) - gain @ h) @ p
    return x, updates


def misfit(updates):
    """Minus twice the log likelihood, but for a constant."""
    return sum(float(u.innovation @ u.weight @ u.innovation) for u in updates)


def banked(updates, precision):
    bank = Bank()
    for dives, update in enumerate(updates):
        bank = advance(bank, SHAPE, precision, np.diag(KEPT), update, 10800.0 * dives, dives)
    return bank


@pytest.fixture
def z():
    rng = np.random.default_rng(5)
    return rng.normal(0.0, 0.4, (12, M))


@pytest.mark.parametrize("at", [0, 4, 9, 11])
def test_bank_is_the_filter_run_again_with_a_step(z, at):
    """The ratio of a hypothesis is what the likelihood gains when the filter itself is told of the step."""
    tight = np.diag([1e-9, 1e12])  # the second number is held at zero
    x, updates = filtered(z)
    bank = banked(updates, tight)
    size = float(bank.score[at, 0] / bank.info[at, 0, 0])
    moved, again = filtered(z, np.array([size, 0.0]), at)
    gained = misfit(updates) - misfit(again)
    assert bank.score[at, 0] ** 2 / bank.info[at, 0, 0] == pytest.approx(gained, rel=1e-6)
    assert moved - x == pytest.approx(bank.shift[at] @ [size, 0.0], abs=1e-9)
    # and no other size gains more
    for other in (0.8 * size, 1.2 * size):
        assert misfit(filtered(z, np.array([other, 0.0]), at)[1]) > misfit(again)


def test_likeliest_finds_dive_and_size_of_a_step():
    rng = np.random.default_rng(1)
    truth, z = np.array([0.0, 0.0, 0.0]), []
    for k in range(16):
        truth = KEPT * truth + [math.sqrt(0.02) * rng.standard_normal(), 0.0, 0.0]
        if k == 9:
            truth[1] += 2.0
        z.append(rows(k) @ truth + rng.multivariate_normal([0.0, 0.0], NOISE))
    x, updates = filtered(z)
    bank = banked(updates, np.eye(2) * 0.1)
    found = likeliest(bank, 0)
    (at,) = np.flatnonzero((bank.score == found.score).all(axis=1))
    assert at in (8, 9, 10)  # just before the tenth of sixteen
    assert found.size == pytest.approx(2.0, abs=3 * found.sigma)
    assert found.begun == 10800.0 * at
    assert found.ratio > 50
    # the filter has found part of it by itself: the shift is what is left
    assert x[1] + found.shift[1] == pytest.approx(2.0, abs=3 * found.sigma)
    assert likeliest(banked(updates, np.eye(2) * 0.1), 0, sign=-1).ratio < 20


def test_bank_holds_each_recent_dive_and_some_older_ones(z):
    updates = filtered(np.tile(z, (20, 1)))[1]
    assert len(banked(updates[:WINDOW], np.eye(2)).score) == WINDOW
    # of the dives before the window one in `OLDER_EVERY` is held: here the one that left it at dive 24
    assert len(banked(updates[: WINDOW + OLDER_EVERY - 1], np.eye(2)).score) == WINDOW + 1
    assert len(banked(updates, np.eye(2)).score) == WINDOW + 8
    assert likeliest(Bank(), 0) is None


def test_an_older_hypothesis_has_seen_all_dives_since(z, monkeypatch):
    updates = filtered(np.tile(z, (5, 1)))[1]
    found = banked(updates, np.eye(2))
    monkeypatch.setattr(step_test, "WINDOW", 100)
    every = banked(updates, np.eye(2))
    held = [0, 12, 24, *range(36, 60)]
    assert found.score == pytest.approx(every.score[held], abs=1e-9)
    assert found.shift == pytest.approx(every.shift[held], abs=1e-9)


def test_free_numbers_take_what_they_can():
    """What the other number explains as well, is no evidence."""
    rng = np.random.default_rng(2)
    z = [rows(k) @ np.array([0.0, 0.0, 1.5 * (k >= 5)]) + 0.05 * rng.standard_normal(2) for k in range(12)]
    updates = filtered(z)[1]
    free, held = (likeliest(banked(updates, np.diag([0.1, p])), 0) for p in (1e-6, 1e12))
    assert free.ratio < held.ratio


def test_ratio_bound_follows_the_calibration():
    rates = [0.5, 0.2, 0.1, 0.05, 0.01]
    bounds = [ratio_bound(rate) for rate in rates]
    assert bounds == sorted(bounds)
    # 48 glider-months in the worst seas: 7 gliders above 14, 3 above 18
    assert ratio_bound(7 / 48) == pytest.approx(14, abs=1)
    assert ratio_bound(3 / 48) == pytest.approx(18, abs=1)
    assert ratio_bound(3.0) == ratio_bound(0.5)  # more was not measured


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan])
def test_ratio_bound_needs_a_rate(rate):
    with pytest.raises(ValueError, match="alarms a month"):
        ratio_bound(rate)


def test_cusum_adds_up_losses_and_forgets_gains():
    total = 0.0
    for departure in (1.5, 1.5, -4.0, 2.0):
        total = cusum(total, departure, 1.0)
    assert total == pytest.approx(1.0)


@pytest.mark.parametrize(("slack", "length"), [(0.5, 100.0), (1.0, 300.0)])
def test_cusum_bound_has_the_run_length_asked_for(slack, length):
    """By simulation: how long white noise takes to reach the bound."""
    bound, rng = cusum_bound(slack, length), np.random.default_rng(0)
    total, alarms = np.zeros(2000), 0
    for _ in range(3000):
        total = np.maximum(0.0, total + rng.standard_normal(2000) - slack)
        alarms += int((total > bound).sum())
        total[total > bound] = 0.0
    assert 2000 * 3000 / alarms == pytest.approx(length, rel=0.1)


@pytest.mark.parametrize(("slack", "dives"), [(0.0, 100.0), (0.5, 0.0), (-1.0, 10.0)])
def test_cusum_bound_needs_positive_numbers(slack, dives):
    with pytest.raises(ValueError, match="above 0"):
        cusum_bound(slack, dives)
