import math
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.forecast.constants import INTERVALS_KEPT, MOST_STRETCH
from gliderwatch.forecast.state import factor
from gliderwatch.forecast.surfacing import Surfacings, expect, learn
from gliderwatch.forecast.timing import usual
from gliderwatch.model import Dive, Unusable
from gliderwatch.navigation.frame import from_plane
from gliderwatch.store import codec
from joint_support import HOUR, LAT, LON, Way, mission


def numbers(low, high):
    return st.floats(low, high, allow_nan=False)


@st.composite
def watched(draw):
    """Dives of which much may be missing, each with the waypoint told at its end, and hours configured."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    made = []
    for _ in range(draw(st.integers(1, 12))):
        turns = int(rng.choice([1, 1, 4, 12]))
        heading = tuple((rng.uniform(-math.pi, math.pi) + np.cumsum(rng.normal(0, 1.5, turns))).tolist())
        speed = float(abs(rng.normal(0.25, 0.15)))
        wrong = None if rng.random() < 0.2 else (0.0, 0.0)
        made.append(Way(heading, speed, speed, tuple(rng.normal(0, 0.4, 2).tolist()), wrong=wrong))
    dives = [torn(dive, rng) for dive in mission(made, hours=draw(numbers(0.3, 12.0)))]
    places = [None, *(from_plane(rng.normal(0, 5000, 2), LAT, LON) for _ in range(3))]
    told = [places[int(rng.integers(len(places)))] for _ in dives]
    return dives, told, draw(st.none() | numbers(0.5, 24.0))


def torn(dive: Dive, rng: np.random.Generator) -> Dive:
    """The dive, or what is left of it in bad data."""
    luck = rng.random()
    if luck < 0.1:
        return replace(dive, track=None, reason="no heading for 2.0 h")
    if luck < 0.2:
        return replace(dive, track=None, current=None, unusable=Unusable.STALE_FIX)
    if luck < 0.3:
        return replace(dive, start=None, track=None, reason="no fix")
    if luck < 0.4:
        return replace(dive, end=None, track=None, reason="no fix yet")
    return dive


def flow(start, end):
    return np.array([0.1, -0.05]), 0.05**2 * np.eye(2)


def run(dives, told, hours, state=None, expected=None):
    state = state or Surfacings()
    for dive, waypoint in zip(dives, told, strict=True):
        state = learn(state, dive, waypoint, expected)
        expected = expect(state, 0.25, 0.02, flow, hours)
    return state, expected


@given(watched())
@settings(max_examples=60, deadline=None)
def test_whatever_comes_time_goes_on_and_the_ellipse_is_one(case):
    dives, told, hours = case
    state, expected = run(dives, told, hours)
    assert (expected is None) == all(dive.end is None for dive in dives)
    if expected is not None:
        assert expected.after == state.fix.t < expected.t < expected.after + 5 * 86400
        assert 0 < expected.t_sigma < expected.t - expected.after
        cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]])
        assert np.all(np.linalg.eigvalsh(cov) > 0)
        assert abs(expected.lat - state.fix.lat) < 3
        assert min(state.scores) >= 0


@given(watched(), st.integers(0, 12))
@settings(max_examples=40, deadline=None)
def test_written_down_between_any_two_dives_it_goes_on_the_same(case, k):
    dives, told, hours = case
    state, expected = run(dives[:k], told[:k], hours)
    again = codec.decode(codec.encode(state), Surfacings)
    assert again == state
    assert run(dives[k:], told[k:], hours, again, expected) == run(
        dives[k:], told[k:], hours, state, expected
    )


@given(watched(), numbers(-86400 * 365, 86400 * 365))
@settings(max_examples=30, deadline=None)
def test_the_date_does_not_matter(case, shift):
    dives, told, hours = case
    shift = round(shift)

    def later(dive):
        start, end = (fix and replace(fix, t=fix.t + shift) for fix in (dive.start, dive.end))
        track = dive.track and replace(dive.track, t=dive.track.t + shift)
        return replace(
            dive,
            t_dive=dive.t_dive + shift,
            t_surface=dive.t_surface + shift,
            start=start,
            end=end,
            track=track,
        )

    _, one = run(dives, told, hours)
    _, two = run([later(dive) for dive in dives], told, hours)
    if one is not None:
        assert np.allclose([one.lat, one.lon, one.t + shift], [two.lat, two.lon, two.t], rtol=1e-9)
        assert np.allclose(
            [one.east, one.cross, one.north], [two.east, two.cross, two.north], rtol=1e-3, atol=1
        )


@given(st.lists(numbers(600.0, 86400.0), min_size=1, max_size=9))
def test_the_next_interval_is_among_the_last(intervals):
    last = intervals[-INTERVALS_KEPT:]
    assert min(last) <= usual(intervals) <= max(last)


@given(st.lists(numbers(0.0, 50.0), max_size=40), numbers(1.0, 3.0))
def test_greater_misses_never_narrow_the_ellipse(misses, times):
    assert 0.7 <= factor(misses) <= factor([times * miss for miss in misses]) <= MOST_STRETCH


@given(numbers(0.0, 3.0))
@settings(max_examples=20, deadline=None)
def test_a_less_certain_flow_never_narrows_the_ellipse(sigma):
    dives = mission([Way()] * 6, hours=3.0)
    state, _ = run(dives, [None] * 6, None)
    narrow, wide = (
        expect(state, 0.25, 0.02, lambda a, b, s=s: (np.zeros(2), s**2 * np.eye(2)))
        for s in (sigma, sigma + 0.01)
    )
    assert wide.t - wide.after < 4 * HOUR
    assert wide.east + wide.north >= narrow.east + narrow.north - 1
