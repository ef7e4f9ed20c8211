import math
from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.forecast.surfacing import Surfacings, expect, learn
from gliderwatch.model import Fix, NextSurfacing, Unusable
from gliderwatch.navigation.geodesy import from_plane, to_plane
from joint_support import HOUR, LAT, LON, START, Way, dive, mission

SPEED, SIGMA = 0.25, 0.005
PERIOD = 3 * HOUR + 600
"""From surfacing to surfacing in `mission`: 10 min of them before the dive, without any drift."""


FAR_NORTH = from_plane([0.0, 1e6], LAT, LON)


def steady(flow=(0.0, 0.0), sigma=0.01):
    return lambda start, end: (np.array(flow), sigma**2 * np.eye(2))


def after(dives, waypoint=None):
    state = Surfacings()
    for each in dives:
        state = learn(state, each, waypoint)
    return state


def way(expected: NextSurfacing, fix: Fix) -> np.ndarray:
    return to_plane(expected.lat, expected.lon, fix.lat, fix.lon)


def axes(expected: NextSurfacing) -> np.ndarray:
    cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]])
    return np.sqrt(np.linalg.eigvalsh(cov))


def test_nothing_is_said_before_the_first_surfacing():
    assert expect(Surfacings(), SPEED, SIGMA, steady(), 3.0) is None
    assert learn(Surfacings(), replace(dive(0, Way()), end=None), None) == Surfacings()


def test_the_way_is_that_of_the_flow_and_of_the_dive():
    """10 min at the surface with the flow, 3 h to the north with it at 0.25 m/s."""
    dives = mission([Way(heading=math.pi / 2, speed=SPEED, own=SPEED, flow=(0.1, 0.0))] * 8)
    expected = expect(after(dives), SPEED, SIGMA, steady((0.1, 0.0)))
    assert expected.after == dives[-1].end.t
    assert expected.t - expected.after == pytest.approx(PERIOD)
    # the glider stood still at the surface before: it drifts a little slower than the flow
    assert way(expected, dives[-1].end) == pytest.approx([0.1 * PERIOD, SPEED * 3 * HOUR], abs=60)


def test_drift_at_the_surface_beside_the_current_is_learnt():
    dives = []
    for k in range(20):
        begin = dives[-1].end if dives else Fix(START, LAT, LON)
        drifted = from_plane([0.2 * 600, 0.0], begin.lat, begin.lon)
        north = Way(heading=math.pi / 2, speed=SPEED, own=SPEED, flow=(0.0, 0.0))
        dives.append(dive(k, north, start=Fix(0.0, *drifted)))
    state = after([replace(d, current=replace(d.current, u=0.0, v=0.0)) for d in dives], FAR_NORTH)
    assert state.drift == pytest.approx((0.2, 0.0), abs=0.04)
    assert way(expect(state, SPEED, SIGMA, steady()), dives[-1].end)[0] == pytest.approx(120, abs=25)


def test_configured_interval_gives_way_to_those_seen():
    dives = mission([Way()] * 6)
    one, few, many = (expect(after(dives[:n]), SPEED, SIGMA, steady(), 6.0) for n in (1, 2, 6))
    assert one.t - one.after == pytest.approx(6 * HOUR)
    assert "configured" in one.source
    assert PERIOD < few.t - few.after < 6 * HOUR
    assert many.t - many.after == pytest.approx(PERIOD)
    assert "configured" not in many.source


def test_without_any_interval_as_long_as_the_first_dive():
    expected = expect(after([dive(0, Way())]), SPEED, SIGMA, steady())
    assert 3 * HOUR < expected.t - expected.after < 4 * HOUR


def test_hours_without_data_are_no_interval():
    dives = mission([Way()] * 6)
    late = replace(
        dives[5],
        end=replace(dives[5].end, t=dives[5].end.t + 6 * HOUR),
        features=replace(dives[5].features, unobserved=6.0 * HOUR),
    )
    expected = expect(after([*dives[:5], late]), SPEED, SIGMA, steady())
    assert expected.after == late.end.t
    assert expected.t - expected.after == pytest.approx(PERIOD)


def test_a_dive_taken_again_is_a_fold():
    dives = mission([Way()] * 6)
    settled = after(dives[:5])
    kept = settled
    learn(settled, replace(dives[5], current=None), None)
    assert settled == kept
    assert learn(settled, dives[5], None) == after(dives)


def to(goal, n, heading_of):
    """Dives towards a goal (m from the start), each at the heading (rad) that holds for its bearing."""
    dives, place = [], Fix(START, LAT, LON)
    for k in range(n):
        ahead = np.array(goal) - to_plane(place.lat, place.lon, LAT, LON)
        heading = heading_of(math.atan2(ahead[1], ahead[0]), k)
        dives.append(dive(k, Way(heading=heading, speed=SPEED, own=SPEED, flow=(0.0, 0.0)), start=place))
        place = dives[-1].end
    return dives


def test_one_that_steers_for_the_waypoint_turns_with_it():
    dives = to((0.0, 6e4), 10, lambda bearing, _: bearing)
    north = from_plane([0.0, 6e4], LAT, LON)
    state = after(dives, north)
    east = from_plane([6e4, 0.0], dives[-1].end.lat, dives[-1].end.lon)
    turned = replace(state, waypoints=(*state.waypoints, east))
    expected = expect(turned, SPEED, SIGMA, steady())
    ahead = way(expected, dives[-1].end)
    assert ahead[0] > 6 * abs(ahead[1])
    assert "waypoint" in expected.source


def test_one_that_flies_its_own_way_is_not_drawn_to_the_waypoint():
    dives = to((0.0, 6e4), 12, lambda bearing, k: 0.4 * (-1) ** k)
    north = from_plane([0.0, 6e4], LAT, LON)
    ahead = way(expect(after(dives, north), SPEED, SIGMA, steady()), dives[-1].end)
    assert ahead[0] > 2 * abs(ahead[1])


def test_beyond_the_waypoint_the_ellipse_is_wide_until_the_way_on_is_known():
    dives = to((0.0, 6e4), 10, lambda bearing, _: bearing)
    state = after(dives, from_plane([0.0, 6e4], LAT, LON))
    end = dives[-1].end
    near = from_plane([0.0, 500.0], end.lat, end.lon)
    beyond = from_plane([-6e4, 500.0], end.lat, end.lon)
    passing = replace(state, waypoints=(near,))
    known = replace(state, waypoints=(near, beyond, near))
    wide, narrow = (expect(s, SPEED, SIGMA, steady()) for s in (passing, known))
    assert axes(wide)[0] > 1.5 * axes(expect(state, SPEED, SIGMA, steady()))[0]
    assert axes(narrow)[0] < axes(wide)[0]
    assert way(narrow, end)[0] < -1000


def test_forecast_of_the_flow_counts_by_how_sure_it_is():
    """The last current was zero; another is forecast."""
    dives = mission([Way(heading=math.pi / 2, speed=SPEED, own=SPEED, flow=(0.0, 0.0))] * 8)
    state = after(dives)
    sure, vague = (
        way(expect(state, SPEED, SIGMA, steady((0.2, 0.0), sigma)), dives[-1].end)[0]
        for sigma in (0.005, 0.5)
    )
    assert sure == pytest.approx(0.2 * PERIOD, rel=0.1)
    assert abs(vague) < 0.2 * sure


def test_errors_widen_the_ellipse_and_hits_narrow_it():
    dives = mission([Way(flow=(0.0, 0.0))] * 20)

    def followed(off):
        state, expected = Surfacings(), None
        for each in dives:
            if expected is not None:
                lat, lon = from_plane([off, 0.0], each.end.lat, each.end.lon)
                expected = replace(expected, lat=lat, lon=lon)
            state = learn(state, each, None, expected)
            expected = expect(state, SPEED, SIGMA, steady())
        return axes(expected)

    assert followed(8000.0)[0] > 2 * followed(0.0)[0]


def test_what_was_expected_after_another_surfacing_is_no_miss():
    dives = mission([Way()] * 6)
    state = after(dives[:5])
    expected = expect(state, SPEED, SIGMA, steady())
    late = learn(state, dives[5], None, replace(expected, after=expected.after - 1))
    assert late == learn(state, dives[5], None)
    assert learn(state, dives[5], None, expected) != late


def test_a_stale_fix_says_nothing_of_the_way():
    dives = mission([Way()] * 6)
    state = after(dives[:5])
    stale = replace(dives[5], track=None, current=None, unusable=Unusable.STALE_FIX)
    seen = learn(state, stale, None, expect(state, SPEED, SIGMA, steady()))
    assert (seen.scores, seen.misses, seen.drift) == (state.scores, state.misses, state.drift)
    assert seen.fix == stale.end


def test_without_a_current_the_forecast_alone_counts():
    dives = mission([Way(heading=0.0, wrong=None)] * 4)
    expected = expect(after(dives), SPEED, SIGMA, steady((0.0, 0.3)))
    assert way(expected, dives[-1].end)[1] == pytest.approx(0.3 * PERIOD, rel=0.01)


def test_places_are_in_the_ellipse_as_often_as_said():
    """A sea that changes by 8 cm/s from dive to dive, and a pilot who turns the glider every now and then."""
    rng = np.random.default_rng(11)
    heading, ways = 0.0, []
    for _ in range(400):
        heading += float(rng.normal(0, 0.1) + (rng.random() < 0.03) * rng.uniform(-2, 2))
        ways.append(Way(heading=heading, speed=SPEED, own=SPEED, flow=tuple(rng.normal(0, 0.08, 2).tolist())))
    state, expected, inside = Surfacings(), None, []
    for each in mission(ways):
        if expected is not None:
            off = to_plane(each.end.lat, each.end.lon, expected.lat, expected.lon)
            cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]])
            inside.append(off @ np.linalg.solve(cov, off) < 5.991)
        state = learn(state, each, None, expected)
        # a forecast twice as sure as it should be
        expected = expect(state, SPEED, SIGMA, steady((0.0, 0.0), 0.04))
    assert 0.90 <= np.mean(inside) <= 0.98


def test_a_surfacing_whose_time_is_not_known_is_not_known_along_the_way():
    """Three knots of current to the east, and a glider that comes up when it likes."""
    dives = mission([Way(heading=math.pi / 2, speed=SPEED, own=SPEED, flow=(1.5, 0.0))] * 8)
    state = after(dives)
    regular, unruly = (
        expect(replace(state, errors=errors), SPEED, SIGMA, steady((1.5, 0.0)))
        for errors in ((0.01,) * 20, (0.5,) * 20)
    )
    assert unruly.t_sigma > 10 * regular.t_sigma
    more = math.sqrt((unruly.east - regular.east) / (unruly.t_sigma**2 - regular.t_sigma**2))
    # the factor on the ellipse is that of no forecasts yet
    assert more == pytest.approx(1.2 * 1.5, rel=0.01)


def test_a_speed_that_is_not_known_widens_along_the_heading():
    dives = mission([Way(heading=math.pi / 2, speed=SPEED, own=SPEED, flow=(0.0, 0.0))] * 8)
    known, vague = (expect(after(dives, FAR_NORTH), SPEED, sigma, steady()) for sigma in (0.0, 0.1))
    assert vague.north - known.north == pytest.approx((1.2 * 0.1 * 3 * HOUR) ** 2, rel=0.01)
    assert vague.east == pytest.approx(known.east, rel=1e-6)


def test_a_turn_beyond_the_last_waypoint_does_not_count_against_a_way_of_steering():
    dives = to((0.0, 6e4), 9, lambda bearing, k: bearing if k < 8 else 0.0)
    state = after(dives[:8], from_plane([0.0, 6e4], LAT, LON))
    fix = dives[7].end
    near, far = (from_plane([0.0, off], fix.lat, fix.lon) for off in (1.0, 6e4))
    excused, blamed = (learn(replace(state, waypoints=(goal,)), dives[8], None) for goal in (near, far))
    assert excused.scores[2] < state.scores[2] + 0.01
    assert blamed.scores[2] > state.scores[2] + 0.1


def test_one_current_that_is_nonsense_does_not_spoil_the_last_one_for_long():
    dives = mission([Way(flow=(0.1, 0.0))] * 20)
    state = after(dives)
    wrong = replace(dives[5], current=replace(dives[5].current, u=3.0))
    assert after([*dives[:5], wrong, *dives[6:]]).change < state.change + 0.002
