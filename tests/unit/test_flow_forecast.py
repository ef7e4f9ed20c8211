"""What is foretold of the current at a glider, and when tides are believed."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.sea import flow_forecast
from gliderwatch.sea.flow_forecast import (
    ENOUGH,
    TIDAL_GRID,
    Currents,
    Prediction,
    Score,
    choice,
    forecasts,
    learn,
    predict,
)
from gliderwatch.sea.tides import HOUR, Constituent
from gliderwatch.store import codec

START = 1_700_000_000.0
DAY = 24 * HOUR
Dives = list[tuple[float, float, np.ndarray]]


def wandering(
    n: int, seed: int, tide: float = 0.0, hours: float = 3.0, size: float = 0.06, memory: float = 30.0
) -> Dives:
    """Means over dives of an Ornstein-Uhlenbeck current and an M2 tide, at steps of a minute, with noise."""
    rng = np.random.default_rng(seed)
    minutes = int(n * (hours + 0.4) * 60)
    left = np.exp(-1 / 60 / memory)
    flow = np.empty((minutes, 2))
    flow[0] = size * rng.standard_normal(2)
    kicks = size * np.sqrt(1 - left**2) * rng.standard_normal((minutes, 2))
    for k in range(1, minutes):
        flow[k] = left * flow[k - 1] + kicks[k]
    angle = Constituent.M2.omega * (START + 60 * np.arange(minutes))
    flow += tide * np.column_stack([np.cos(angle), 0.5 * np.sin(angle)])
    out, k = [], 0
    for _ in range(n):
        j = k + int(60 * hours * rng.uniform(0.9, 1.1))
        if j >= minutes:
            break
        out.append((START + 60 * k, START + 60 * j, flow[k:j].mean(axis=0) + 0.006 * rng.standard_normal(2)))
        k = j + 10
    return out


def learnt(dives: Dives) -> Currents:
    state = Currents()
    for start, end, current in dives:
        state = learn(state, start, end, current, 0.006)
    return state


def foretold(dives: Dives) -> list[tuple[np.ndarray, Prediction]]:
    state, out = Currents(), []
    for start, end, current in dives:
        told = predict(state, start, end)
        if told is not None:
            out.append((current, told))
        state = learn(state, start, end, current, 0.006)
    return out


def rms(dives: Dives, of: Callable[[Currents, float, float], np.ndarray], skip: int = 20) -> float:
    state, errors = Currents(), []
    for k, (start, end, current) in enumerate(dives):
        if k >= skip:
            errors.append(current - of(state, start, end))
        state = learn(state, start, end, current, 0.006)
    return float(np.sqrt(np.mean(np.square(errors))))


def test_before_any_dive_nothing_is_told():
    assert predict(Currents(), START, START + HOUR) is None


def test_after_one_dive_its_current_is_told_as_persistence():
    state = learn(Currents(), START, START + 3 * HOUR, np.array([0.1, -0.2]), 0.006)
    told = predict(state, START + 3.2 * HOUR, START + 6.2 * HOUR)
    assert told.source == "persistence" and told.flow.tolist() == [0.1, -0.2]
    assert 0.02 < np.sqrt(told.cov[0, 0]) < 0.5


def test_a_tide_is_found_named_and_foretold():
    dives = wandering(120, seed=1, tide=0.3)
    state = learnt(dives)
    assert choice(state) == "tides"
    told = predict(state, dives[-1][1] + 600, dives[-1][1] + 3 * HOUR)
    assert told.source == "tides M2 + residual"
    tides = rms(dives, lambda *x: predict(*x).flow)
    last = rms(dives, lambda *x: forecasts(*x)["persistence"].mean)
    assert tides < 0.05 and last > 0.2


def test_tides_stay_off_where_there_are_none():
    for seed in range(4):
        dives = wandering(100, seed)
        assert all(told.source in ("residual", "persistence") for _, told in foretold(dives))


def test_no_worse_than_persistence_without_tides():
    dives = wandering(200, seed=5, memory=8.0)
    assert rms(dives, lambda *x: predict(*x).flow) < rms(dives, lambda *x: forecasts(*x)["persistence"].mean)


@pytest.mark.parametrize(("tide", "memory"), [(0.0, 30.0), (0.0, 8.0), (0.25, 30.0)])
def test_coverage(tide, memory):
    inside = []
    for seed in range(3):
        for current, told in foretold(wandering(120, seed, tide, memory=memory)):
            e = current - told.flow
            inside.append(e @ np.linalg.solve(told.cov + 0.006**2 * np.eye(2), e) < 5.991)
    assert 0.90 <= np.mean(inside) <= 0.985


def test_uncertainty_grows_into_the_future():
    state = learnt(wandering(60, seed=2, tide=0.3))
    spreads = [
        np.trace(predict(state, state.end + h * HOUR, state.end + (h + 3) * HOUR).cov) for h in (0, 6, 24, 60)
    ]
    assert spreads == sorted(spreads) and spreads[-1] > 2 * spreads[0]


def test_three_days_of_silence_and_the_sea_is_unknown():
    dives = wandering(60, seed=2, tide=0.3)
    state = learnt(dives)
    last = dives[-1]
    assert predict(state, last[1] + 3.1 * DAY, last[1] + 3.2 * DAY) is None
    late = (last[0] + 3.2 * DAY, last[1] + 3.2 * DAY, np.array([0.1, 0.1]))
    anew = learn(state, *late, 0.006)
    assert codec.encode(anew) == codec.encode(learn(Currents(), *late, 0.006))
    soon = learn(state, last[0] + 2.9 * DAY, last[1] + 2.9 * DAY, np.array([0.1, 0.1]), 0.006)
    assert soon.dives == state.dives + 1


def test_a_dive_that_is_over_before_the_last_teaches_nothing():
    dives = wandering(10, seed=2)
    state = learnt(dives)
    assert learn(state, *dives[-2], 0.006) is state
    assert learn(state, *dives[-1], 0.006) is state
    assert predict(state, *dives[-2][:2]) is None


def test_an_overlap_counts_once():
    dives = wandering(10, seed=2)
    state = learnt(dives)
    end = dives[-1][1]
    early = learn(state, end - 100, end + HOUR, np.array([0.1, 0.0]), 0.006)
    assert codec.encode(early) == codec.encode(learn(state, end, end + HOUR, np.array([0.1, 0.0]), 0.006))


@pytest.mark.parametrize(
    "bad",
    [
        (0.0, 1.0, [np.nan, 0.0], 0.01),
        (0.0, np.inf, [0.0, 0.0], 0.01),
        (0.0, 1.0, [0.0, 0.0], 0.0),
        (0.0, 1.0, [0.0, 0.0], np.nan),
    ],
)
def test_no_number_no_lesson(bad):
    start, end, current, sigma = bad
    with pytest.raises(ValueError, match="no current to learn from"):
        learn(Currents(), start, end, np.array(current), sigma)


def test_one_wild_current_is_soon_forgotten():
    dives = wandering(120, seed=3, tide=0.25)
    wild = [(s, e, c if k != 80 else np.add(c, [0.6, -0.6])) for k, (s, e, c) in enumerate(dives)]
    state, clean = learnt(wild), learnt(dives)
    assert choice(state) == "tides"
    start, end = dives[-1][1], dives[-1][1] + 3 * HOUR
    assert predict(state, start, end).flow == pytest.approx(predict(clean, start, end).flow, abs=0.03)


def test_the_interval_that_hides_m2_is_told_where_it_is_kept():
    even = [(START + k * 6.2 * HOUR, START + (k * 6.2 + 5.9) * HOUR, np.zeros(2)) for k in range(12)]
    told = predict(learnt(even), even[-1][1], even[-1][1] + HOUR)
    assert any("only one half of the M2" in note for note in told.notes)
    uneven = [(s + 2500 * (-1) ** k, e + 2500 * (-1) ** k, c) for k, (s, e, c) in enumerate(even)]
    assert predict(learnt(uneven), uneven[-1][1], uneven[-1][1] + HOUR).notes == ()
    often = [(START + k * 3.2 * HOUR, START + (k * 3.2 + 3) * HOUR, np.zeros(2)) for k in range(12)]
    assert predict(learnt(often), often[-1][1], often[-1][1] + HOUR).notes == ()


@pytest.mark.parametrize(
    ("score", "expected"),
    [
        (Score(), "persistence"),
        (Score(20, persistence=1.0, residual=0.9, tides=0.3, gain=0.7, gain_squared=0.05), "tides"),
        (Score(20, persistence=1.0, residual=0.2, tides=0.3, gain=0.7, gain_squared=0.05), "residual"),
        (Score(20, persistence=1.0, residual=0.9, tides=0.8, gain=0.2, gain_squared=0.05), "residual"),
        (Score(20, persistence=1.0, residual=1.1, tides=0.8, gain=0.2, gain_squared=0.05), "persistence"),
        (
            Score(ENOUGH - 1, persistence=1.0, residual=0.9, tides=0.1, gain=0.9, gain_squared=0.1),
            "persistence",
        ),
    ],
)
def test_what_the_past_speaks_for(score, expected):
    assert choice(replace(learnt(wandering(5, seed=1)), score=score)) == expected


def test_persistence_is_less_certain_where_the_residual_differs_from_it():
    dives = wandering(60, seed=2, size=0.03)
    before = learnt(dives)
    after = learn(before, before.end + 600, before.end + 3 * HOUR, np.array([0.4, 0.0]), 0.1)
    spread = forecasts(after, after.end, after.end + HOUR)
    last, residual = spread["persistence"], spread["residual"]
    assert residual.mean[0] < 0.3
    assert last.cov[0, 0] > residual.cov[0, 0] + 0.009
    assert last.cov[1, 1] < residual.cov[1, 1] + 0.002


def test_sets_that_differ_make_the_forecast_less_certain():
    grid = flow_forecast.grid([0.02], [HOUR, 1e4 * HOUR], ((0.0, 0.0),), ())
    one = flow_forecast.init_bank(START, grid)
    for k in range(3):
        start = START + 3 * k * HOUR
        one, _ = flow_forecast.learn_bank(one, start, start + 3 * HOUR, np.array([0.5, 0.0]), 0.006, k, grid)
    one = replace(one, fit=np.zeros(2))
    told = flow_forecast.forecast_bank(one, one.t + 12 * HOUR, one.t + 13 * HOUR, grid)
    assert told.mean[0] == pytest.approx(0.25, abs=0.03)  # one says 0.5, the other nothing
    assert told.cov[0, 0] - told.cov[1, 1] == pytest.approx(0.25**2, rel=0.2)


def test_no_dive_however_wild_decides_alone():
    grid = flow_forecast.grid([0.02], [30 * HOUR], ((0.0, 0.0),), ())
    one = flow_forecast.init_bank(START, grid)
    usual, _ = flow_forecast.learn_bank(one, START, START + 3 * HOUR, np.zeros(2), 0.006, 0, grid)
    wild, _ = flow_forecast.learn_bank(one, START, START + 3 * HOUR, np.array([2.0, 2.0]), 0.006, 0, grid)
    assert 5 < usual.fit[0] - wild.fit[0] < 40


def test_the_scale_of_the_sea_is_learnt():
    """Of a set that changes by 2 cm/s in 3 h: 1 where the sea does so, 4 where it is twice as restless."""
    grid = flow_forecast.grid([0.02], [30 * HOUR], ((0.0, 0.0),), ())
    for size, expected in ((0.0454, 1.0), (0.0907, 4.0)):
        state = None
        for dives, (start, end, current) in enumerate(wandering(200, seed=4, size=size)):
            state = state if state is not None else flow_forecast.init_bank(start, grid)
            state, _ = flow_forecast.learn_bank(state, start, end, current, 0.006, dives, grid)
        assert state.scale[0] == pytest.approx(expected, rel=0.4)


def test_the_likeliest_set_is_the_one_that_made_the_sea():
    grid = flow_forecast.grid([0.02], [30 * HOUR], ((0.02, 0.1), (0.3, 0.1)), [Constituent.M2])
    for tide, expected in ((0.0, 0), (0.4, 1)):
        state = None
        for dives, (start, end, current) in enumerate(wandering(60, seed=4, tide=tide, size=0.045)):
            state = state if state is not None else flow_forecast.init_bank(start, grid)
            state, _ = flow_forecast.learn_bank(state, start, end, current, 0.006, dives, grid)
        assert np.argmax(flow_forecast.weights(state)) == expected
        assert flow_forecast.weights(state).sum() == pytest.approx(1.0)


def test_a_checkpoint_stays_small():
    assert len(codec.encode(learnt(wandering(40, seed=1, tide=0.2)))) < 8000
    assert TIDAL_GRID.size == 9
