"""What is foreseen of the current at a glider, by the one model of the sea."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gliderwatch.model import Fix
from gliderwatch.navigation.geodesy import displacement, from_plane
from gliderwatch.sea import gauss_markov
from gliderwatch.sea.constants import SEA_KINDS
from gliderwatch.sea.flow_forecast import Currents, Prediction, learn, predict, unknown_sea, weights
from gliderwatch.sea.gauss_markov import FlowParams
from gliderwatch.sea.tides import HOUR, Constituent
from gliderwatch.store import codec

START = 1_700_000_000.0
DAY = 24 * HOUR
LAT, LON = 41.0, -60.0
Dives = list[tuple[Fix, Fix, np.ndarray]]


def fix(t: float) -> Fix:
    """Of a glider that stays about where it is."""
    return Fix(t, LAT, LON)


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
        mean = flow[k:j].mean(axis=0) + 0.006 * rng.standard_normal(2)
        out.append((fix(START + 60 * k), fix(START + 60 * j), mean))
        k = j + 10
    return out


def learnt(dives: Dives) -> Currents:
    state = Currents()
    for start, end, current in dives:
        state = learn(state, start, end, current, 0.006)
    return state


def foreseen(dives: Dives) -> list[tuple[np.ndarray, Prediction]]:
    state, out = Currents(), []
    for start, end, current in dives:
        found = predict(state, start, end)
        if found is not None:
            out.append((current, found))
        state = learn(state, start, end, current, 0.006)
    return out


def rms(dives: Dives, skip: int = 20) -> float:
    errors = [current - found.flow for current, found in foreseen(dives)[skip - 1 :]]
    return float(np.sqrt(np.mean(np.square(errors))))


def persistence(dives: Dives, skip: int = 20) -> float:
    errors = [b[2] - a[2] for a, b in pairwise(dives)][skip - 1 :]
    return float(np.sqrt(np.mean(np.square(errors))))


def after(state: Currents, start: float, end: float) -> Prediction | None:
    """What is foreseen of a dive that begins and ends so long (s) after the last one."""
    return predict(state, fix(state.end + start), fix(state.end + end))


def test_before_any_dive_nothing_is_foreseen():
    assert predict(Currents(), fix(START), fix(START + HOUR)) is None


def test_after_one_dive_its_current_is_foreseen():
    state = learn(Currents(), fix(START), fix(START + 3 * HOUR), np.array([0.1, -0.2]), 0.006)
    found = after(state, 0.2 * HOUR, 3.2 * HOUR)
    assert found.source == "forecast by the dives before"
    assert found.flow == pytest.approx([0.1, -0.2], abs=0.03)
    assert 0.02 < np.sqrt(found.cov[0, 0]) < 0.5


def test_a_tide_is_found_named_and_foreseen():
    dives = wandering(120, seed=1, tide=0.3)
    assert after(learnt(dives), 600, 3 * HOUR).source == "forecast by the dives before, with tides M2"
    assert rms(dives) < 0.05 and persistence(dives) > 0.2


def test_no_tide_is_named_where_there_is_none():
    for seed in range(4):
        sources = [found.source for _, found in foreseen(wandering(100, seed))]
        assert np.mean(["tides" in source for source in sources]) < 0.1


def test_better_than_persistence_without_tides():
    dives = wandering(200, seed=5, memory=8.0)
    assert rms(dives) < persistence(dives)


@pytest.mark.parametrize(("tide", "memory"), [(0.0, 30.0), (0.0, 8.0), (0.25, 30.0)])
def test_coverage(tide, memory):
    inside = []
    for seed in range(3):
        for current, found in foreseen(wandering(120, seed, tide, memory=memory)):
            e = current - found.flow
            inside.append(e @ np.linalg.solve(found.cov + 0.006**2 * np.eye(2), e) < 5.991)
    assert 0.90 <= np.mean(inside) <= 0.985


def test_uncertainty_grows_into_the_future():
    state = learnt(wandering(60, seed=2, tide=0.3))
    spreads = [np.trace(after(state, h * HOUR, (h + 3) * HOUR).cov) for h in (0, 6, 24, 60)]
    assert spreads == sorted(spreads) and spreads[-1] > 2 * spreads[0]


def test_three_days_of_silence_and_the_sea_is_unknown():
    dives = wandering(60, seed=2, tide=0.3)
    state = learnt(dives)
    start, end, current = dives[-1][0].t, dives[-1][1].t, np.array([0.1, 0.1])
    assert after(state, 3.1 * DAY, 3.2 * DAY) is None
    late = (fix(start + 3.2 * DAY), fix(end + 3.2 * DAY), current, 0.006)
    assert codec.encode(learn(state, *late)) == codec.encode(learn(Currents(), *late))
    soon = learn(state, fix(start + 2.9 * DAY), fix(end + 2.9 * DAY), current, 0.006)
    assert soon.dives == state.dives + 1


def test_a_dive_that_is_over_before_the_last_teaches_nothing():
    dives = wandering(10, seed=2)
    state = learnt(dives)
    assert learn(state, *dives[-2], 0.006) is state
    assert learn(state, *dives[-1], 0.006) is state
    assert predict(state, *dives[-2][:2]) is None


def test_an_overlap_counts_once():
    state = learnt(wandering(10, seed=2))
    current, end = np.array([0.1, 0.0]), fix(state.end + HOUR)
    early = learn(state, fix(state.end - 100), end, current, 0.006)
    assert codec.encode(early) == codec.encode(learn(state, fix(state.end), end, current, 0.006))


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
        learn(Currents(), fix(start), fix(end), np.array(current), sigma)


def test_one_wild_current_is_soon_forgotten():
    dives = wandering(120, seed=3, tide=0.25)
    wild = [(s, e, c if k != 80 else np.add(c, [0.6, -0.6])) for k, (s, e, c) in enumerate(dives)]
    found = [after(learnt(each), 0.0, 3 * HOUR).flow for each in (wild, dives)]
    assert found[0] == pytest.approx(found[1], abs=0.03)


def test_the_interval_that_hides_m2_is_reported_where_it_is_kept():
    def hidden(every: float, lasts: float, uneven: float = 0.0) -> tuple[str, ...]:
        starts = [START + k * every * HOUR + uneven * (-1) ** k for k in range(12)]
        return after(learnt([(fix(t), fix(t + lasts * HOUR), np.zeros(2)) for t in starts]), 0.0, HOUR).notes

    assert any("only one half of the M2" in note for note in hidden(6.2, 5.9))
    assert hidden(6.2, 5.9, uneven=2500.0) == ()
    assert hidden(3.2, 3.0) == ()


def test_kinds_of_sea_that_differ_make_the_forecast_less_certain():
    state = learnt(wandering(20, seed=2))
    kinds = len(state.sea.fit)
    mean, fit = np.zeros_like(state.sea.mean), np.full(kinds, -99.0)
    mean[0, 0], fit[:2] = [0.5, 0.0], 0.0  # two count alike, and one of them has a current that lasts
    split = after(replace(state, sea=replace(state.sea, mean=mean, fit=fit)), 0.0, HOUR)
    assert split.flow == pytest.approx([0.25, 0.0], abs=0.01)
    assert split.cov[0, 0] - split.cov[1, 1] == pytest.approx(0.25**2, rel=0.1)


@pytest.mark.parametrize(
    ("size", "memory", "tide", "met"),
    [
        (0.02, 100.0, 0.0, lambda lasts, _, memory, __, tides: lasts == 0.3 and tides == 0.001),
        (0.12, 4.0, 0.0, lambda _, __, memory, ___, tides: memory == 10 * HOUR),
        (0.05, 30.0, 0.4, lambda lasts, _, memory, __, tides: tides == 0.3),
    ],
)
def test_the_likeliest_kind_of_sea_is_the_one_that_is_met(size, memory, tide, met):
    sea = learnt(wandering(80, seed=4, tide=tide, size=size, memory=memory)).sea
    assert met(*SEA_KINDS[int(np.argmax(sea.fit))])


def test_before_any_dive_all_kinds_of_sea_are_as_likely():
    assert weights(unknown_sea()) == pytest.approx(1 / len(SEA_KINDS))


@pytest.mark.parametrize("kind", [7, 10])
def test_each_kind_is_a_filter_by_the_model_of_the_sea(kind):
    """The same as the real state of `gauss_markov`, filtered dive by dive in this kind of sea."""
    lasting, passing, memory, inertial, tides = SEA_KINDS[kind]
    usual, kinds = FlowParams(), len(SEA_KINDS)
    params = replace(
        usual,
        lasting=usual.lasting * np.sqrt(lasting),
        passing=usual.passing * np.sqrt(passing * memory / usual.memory),
        memory=memory,
        inertial=usual.inertial * inertial * np.sqrt(passing),
        tides=tuple(replace(each, size=tides * each.size) for each in usual.tides),
    )
    variances = gauss_markov.prior(params)
    variances[0:2] = usual.lasting**2
    x, cov, at = np.zeros(params.size), np.diag(variances), params.mean
    state, before, place = Currents(), START, (LAT, LON)
    for start, end, current in wandering(12, seed=7, tide=0.2):
        there = from_plane([4e3, 1e3], *place)
        a, b = Fix(start.t, *place), Fix(end.t, *there)
        gap, lasts = start.t - before, end.t - start.t
        q = gauss_markov.intensities(x, 1.0, params)
        passage = gauss_markov.passage(gap, lasts, a.lat, q, params)
        ground = displacement(b.lat, b.lon, a.lat, a.lon) / lasts
        crossed = gauss_markov.crossing(x[0:2] + x[2:4], ground, gap + lasts, params)
        jump = gauss_markov.jump(params)
        x = passage.matrix @ x
        cov = passage.matrix @ cov @ passage.matrix.T + passage.noise + lasting * crossed**2 * jump @ jump.T
        if state.sea is not None:
            fit = np.full(kinds, -1e3)
            fit[kind] = 0.0
            alone = replace(state, sea=replace(state.sea, fit=fit, scale=np.ones(kinds)))
            found = predict(alone, a, b)
            assert found.flow == pytest.approx(x[at], abs=1e-9)
            assert found.cov == pytest.approx(cov[at, at], abs=1e-9)
        gain = cov[:, at] @ np.linalg.inv(cov[at, at] + 0.006**2 * np.eye(2))
        x, cov = x + gain @ (current - x[at]), cov - gain @ cov[at]
        state = learn(state, a, b, current, 0.006)
        before, place = end.t, there


def test_a_checkpoint_stays_small():
    assert len(codec.encode(learnt(wandering(40, seed=1, tide=0.2)))) < 20000
