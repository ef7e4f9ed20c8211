"""What holds of the forecast of the current on any mission: finite, honest, and a function of the dives."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.model import Fix, readonly
from gliderwatch.sea.flow_forecast import Currents, learn, predict
from gliderwatch.sea.tides import HOUR
from gliderwatch.store import codec

speeds = st.floats(-2.5, 2.5)
dive = st.tuples(
    st.floats(0, 80 * HOUR),  # since the last one
    st.floats(30, 20 * HOUR),  # lasts
    st.tuples(speeds, speeds),
    st.floats(1e-4, 0.3),
)
missions = st.lists(dive, min_size=1, max_size=25)


def fix(t):
    return Fix(t, 30.0, -80.0)


def in_time(mission):
    t = 1.7e9
    for gap, lasts, current, sigma in mission:
        yield fix(t + gap), fix(t + gap + lasts), readonly(current), sigma
        t += gap + lasts


@given(missions, st.floats(0, 70 * HOUR), st.floats(30, 20 * HOUR))
@settings(max_examples=60)
def test_forecasts_are_finite_and_their_covariances_are_covariances(mission, ahead, lasts):
    state = Currents()
    for each in in_time(mission):
        state = learn(state, *each)
    found = predict(state, fix(state.end + ahead), fix(state.end + ahead + lasts))
    assert np.isfinite(found.flow).all()
    assert np.linalg.eigvalsh(found.cov).min() > 0
    assert np.abs(found.cov - found.cov.T).max() < 1e-12
    sea = state.sea
    assert all(np.isfinite(x).all() for x in (sea.mean, sea.cov, sea.fit, sea.scale))


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
    coming = fix(t), fix(t + HOUR)
    assert codec.encode(predict(through, *coming)) == codec.encode(predict(straight, *coming))


@given(missions, st.floats(-np.pi, np.pi))
@settings(max_examples=30)
def test_the_compass_does_not_matter(mission, angle):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    plain, turned = Currents(), Currents()
    for start, end, current, sigma in in_time(mission):
        plain = learn(plain, start, end, current, sigma)
        turned = learn(turned, start, end, readonly(turn @ current), sigma)
    coming = fix(plain.end), fix(plain.end + HOUR)
    found, other = predict(plain, *coming), predict(turned, *coming)
    assert np.allclose(other.flow, turn @ found.flow, atol=1e-6)
    assert np.allclose(other.cov, turn @ found.cov @ turn.T, atol=1e-6)
