import math
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.estimation.verdict import SpeedParams, SpeedState, step
from gliderwatch.model import Current, Dive, readonly
from gliderwatch.navigation.geodesy import displacement, from_plane
from gliderwatch.store import codec
from joint_support import Way, mission

PARAMS = SpeedParams()


def numbers(low, high):
    return st.floats(low, high, allow_nan=False)


@st.composite
def dives(draw, most=14):
    """Missions in which anything happens: turns, circles, wrong currents or none, faults, short dives."""
    n = draw(st.integers(1, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    made = []
    for _ in range(n):
        turns = int(rng.choice([1, 1, 1, 4, 12]))
        heading = tuple((rng.uniform(-math.pi, math.pi) + np.cumsum(rng.normal(0, 1.5, turns))).tolist())
        speed = float(abs(rng.normal(0.25, 0.15)))
        wrong = None if rng.random() < 0.1 else tuple((rng.normal(0, 0.4, 2) * (rng.random() < 0.2)).tolist())
        made.append(
            Way(
                heading=heading,
                speed=speed,
                own=speed * float(rng.uniform(0.7, 1.6)),
                flow=tuple(rng.normal(0, 0.4, 2).tolist()),
                turned=float(rng.normal(0, 0.3)),
                wrong=wrong,
                roll=float(rng.choice([0.0, 0.5])),
                thruster=float(rng.choice([0.0, 0.3])),
            )
        )
    return mission(made, hours=draw(numbers(0.3, 12.0)))


def run(all_dives, state=None, params=PARAMS):
    state, verdicts = state or SpeedState(), []
    for dive in all_dives:
        state, verdict = step(state, dive, params)
        verdicts.append(verdict)
    return state, verdicts


def turned(all_dives: list[Dive], angle: float) -> list[Dive]:
    """The same mission with the whole sea turned by an angle."""
    c, s = math.cos(angle), math.sin(angle)
    matrix = np.array([[c, -s], [s, c]])
    out: list[Dive] = []
    for dive in all_dives:
        x = readonly(dive.track.x @ matrix.T)
        track = replace(dive.track, x=x, heading=readonly(dive.track.heading @ matrix.T))
        current = dive.current
        if current is not None:
            current = Current(*(matrix @ [current.u, current.v]).tolist(), final=current.final)
        at = dive.start
        if out:
            before, turned_before = all_dives[len(out) - 1].end, out[-1].end
            drift = matrix @ displacement(at.lat, at.lon, before.lat, before.lon)
            lat, lon = from_plane(drift, turned_before.lat, turned_before.lon)
            at = replace(at, lat=lat, lon=lon)
        lat, lon = from_plane(x[-1], at.lat, at.lon)
        start, end = at, replace(dive.end, lat=lat, lon=lon)
        out.append(replace(dive, track=track, current=current, start=start, end=end))
    return out


@settings(max_examples=60)
@given(dives())
def test_all_numbers_are_finite_and_covariances_are_ones(all_dives):
    state, verdicts = run(all_dives)
    assert np.isfinite(state.filter.x).all()
    assert np.array_equal(state.filter.cov, state.filter.cov.T)
    assert np.linalg.eigvalsh(state.filter.cov).min() > -1e-12
    for verdict in verdicts:
        found = verdict.info.estimate
        assert math.isfinite(found.speed)
        assert found.speed >= 0.0
        assert 0.0 < found.sigma < 2.0
        assert 0.0 < found.own_sigma < 2.0
        assert np.linalg.eigvalsh(found.flow_cov).min() > 0.0
        assert math.isclose(sum(verdict.info.odds.values()), 1.0, rel_tol=1e-9)
        assert verdict.flag is not None or verdict.reason


@settings(max_examples=40)
@given(dives(), st.data())
def test_state_can_be_written_down_between_any_two_dives(all_dives, data):
    k = data.draw(st.integers(0, len(all_dives)))
    state, _ = run(all_dives[:k])
    restored = codec.decode(codec.encode(state), SpeedState)
    whole, first = run(all_dives)
    after, second = run(all_dives[k:], restored)
    assert codec.encode(after) == codec.encode(whole)
    assert [(v.flag, v.reason) for v in second] == [(v.flag, v.reason) for v in first[k:]]


@settings(max_examples=40)
@given(dives(most=10), numbers(-math.pi, math.pi))
def test_no_direction_is_special(all_dives, angle):
    """The sea and the glider turned together: the same speeds and flags, flows turned with them."""
    _, plain = run(all_dives)
    _, others = run(turned(all_dives, angle))
    c, s = math.cos(angle), math.sin(angle)
    for a, b in zip(plain, others, strict=True):
        assert a.flag == b.flag
        assert a.info.cause == b.info.cause
        # the way leads to other latitudes, where inertial motion has another period
        assert math.isclose(a.info.estimate.speed, b.info.estimate.speed, abs_tol=2e-3)
        assert math.isclose(a.info.estimate.sigma, b.info.estimate.sigma, abs_tol=2e-3)
        expected = np.array([[c, -s], [s, c]]) @ a.info.estimate.flow
        assert np.allclose(b.info.estimate.flow, expected, atol=2e-3)


@settings(max_examples=40)
@given(dives(most=10), numbers(0.0, 30 * 86400.0))
def test_no_moment_is_special(all_dives, later):
    """Tides have no known phase: the same mission at another time is estimated alike."""

    def shifted(dive):
        return replace(
            dive,
            t_dive=dive.t_dive + later,
            t_surface=dive.t_surface + later,
            start=replace(dive.start, t=dive.start.t + later),
            end=replace(dive.end, t=dive.end.t + later),
            track=replace(dive.track, t=readonly(dive.track.t + later)),
        )

    _, plain = run(all_dives)
    _, others = run([shifted(dive) for dive in all_dives])
    for a, b in zip(plain, others, strict=True):
        assert math.isclose(a.info.estimate.speed, b.info.estimate.speed, abs_tol=1e-4)
        assert math.isclose(a.info.estimate.sigma, b.info.estimate.sigma, abs_tol=1e-4)


@settings(max_examples=30)
@given(numbers(0.15, 0.7), numbers(-math.pi, math.pi), numbers(0.0, 0.6), st.integers(0, 2**32 - 1))
def test_steady_healthy_glider_is_normal_at_any_speed_and_in_any_current(speed, heading, current, seed):
    rng = np.random.default_rng(seed)
    flow = current * np.array([math.cos(seed), math.sin(seed)])
    made = [
        Way(
            heading=heading + 0.4 * k,
            speed=speed,
            own=1.08 * speed,
            flow=tuple(flow + rng.normal(0, 0.02, 2)),
        )
        for k in range(14)
    ]
    _, verdicts = run(mission(made), params=replace(PARAMS, low=0.1))
    assert {int(v.flag) for v in verdicts} == {0}
    assert math.isclose(verdicts[-1].info.estimate.speed, speed, rel_tol=0.1)
