"""What holds of the forecast of the current on any mission: finite, honest, and a function of the dives."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.model import readonly
from gliderwatch.sea import flow_forecast
from gliderwatch.sea.flow_forecast import Currents, Parameters, learn, predict
from gliderwatch.sea.tides import HOUR, Constituent
from gliderwatch.store import codec

speeds = st.floats(-2.5, 2.5)
dive = st.tuples(
    st.floats(0, 80 * HOUR),  # since the last one
    st.floats(30, 20 * HOUR),  # lasts
    st.tuples(speeds, speeds),
    st.floats(1e-4, 0.3),
)
missions = st.lists(dive, min_size=1, max_size=25)


def in_time(mission):
    t = 1.7e9
    for gap, lasts, current, sigma in mission:
        yield t + gap, t + gap + lasts, readonly(current), sigma
        t += gap + lasts


@given(missions, st.floats(0, 70 * HOUR), st.floats(30, 20 * HOUR))
@settings(max_examples=60)
def test_forecasts_are_finite_and_their_covariances_are_covariances(mission, ahead, lasts):
    state = Currents()
    for each in in_time(mission):
        state = learn(state, *each)
    told = predict(state, state.end + ahead, state.end + ahead + lasts)
    assert np.isfinite(told.flow).all()
    assert np.linalg.eigvalsh(told.cov).min() > 0
    assert (told.cov == told.cov.T).all() or np.abs(told.cov - told.cov.T).max() < 1e-12
    for bank in (state.filters.plain, state.filters.tidal):
        assert all(np.isfinite(x).all() for x in (bank.mean, bank.cov, bank.fit, bank.scale))


@given(missions)
@settings(max_examples=40)
def test_written_and_read_between_any_two_dives_it_goes_on_to_the_last_bit(mission):
    straight = through = Currents()
    for each in in_time(mission):
        before = codec.encode(straight)
        after = learn(straight, *each)
        assert codec.encode(straight) == before
        straight, through = after, learn(through, *each)
        through = codec.decode(codec.encode(through), Currents)
        assert codec.encode(through) == codec.encode(straight)
    t = straight.end
    assert codec.encode(predict(through, t, t + HOUR)) == codec.encode(predict(straight, t, t + HOUR))


@given(missions, st.floats(-np.pi, np.pi))
@settings(max_examples=30)
def test_the_compass_does_not_matter(mission, angle):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    plain, turned = Currents(), Currents()
    for start, end, current, sigma in in_time(mission):
        plain = learn(plain, start, end, current, sigma)
        turned = learn(turned, start, end, readonly(turn @ current), sigma)
    told = predict(plain, plain.end, plain.end + HOUR)
    other = predict(turned, plain.end, plain.end + HOUR)
    if told.source == other.source:  # a tie may fall either way
        assert np.allclose(other.flow, turn @ told.flow, atol=1e-6)
        assert np.allclose(other.cov, turn @ told.cov @ turn.T, atol=1e-6)


@given(st.floats(1, 2e5), st.floats(1, 2e5), st.floats(600, 1e7))
@settings(max_examples=60)
def test_time_passes_the_same_in_one_step_or_two(first, second, tau):
    params = Parameters(
        *(readonly([x]) for x in (0.1, tau)),
        *(readonly([[x, x]]) for x in (1e-9, 0.04)),
        readonly([Constituent.M2.omega, Constituent.K1.omega]),
    )
    start = flow_forecast.init_belief(0.0, params)
    start, _ = flow_forecast.learn_belief(start, 0.0, 1e4, np.array([0.3, 0.1]), 0.01, params)
    once = flow_forecast.at(start, 1e4 + first + second, params)
    twice = flow_forecast.at(flow_forecast.at(start, 1e4 + first, params), 1e4 + first + second, params)
    assert np.allclose(once.mean, twice.mean, atol=1e-9)
    assert np.allclose(once.cov, twice.cov, atol=1e-9)
