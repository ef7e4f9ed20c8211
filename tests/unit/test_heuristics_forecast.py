"""The heuristics of the next surfacing do what their page says: a case lies just on one side of a bound."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.estimation.adaptive import Learner
from gliderwatch.estimation.glider import Estimate
from gliderwatch.forecast import timing
from gliderwatch.forecast.outlook import look_ahead
from gliderwatch.forecast.steering import Leg, Plan, courses
from gliderwatch.forecast.surfacing import (
    Surfacings,
    active_waypoint,
    expect,
    factor,
    is_same,
    is_unseen,
    learn,
    read_waypoints,
)
from gliderwatch.model import Current, Fix, NextSurfacing
from gliderwatch.navigation.geodesy import from_plane, to_plane
from gliderwatch.papers.learner import AdaptiveState
from joint_support import DAY, HOUR, LAT, LON, START, Way, dive, mission
from missions import segment

SPEED = 0.25
FIX = Fix(START, LAT, LON)
NORTH = Surfacings(fix=FIX, duration=3 * HOUR, heading=(0.0, 1.0))
"""After one dive to the north, in a sea of which nothing is known."""


def still(sigma=0.0, flow=(0.0, 0.0)):
    return lambda start, end: (np.array(flow), sigma**2 * np.eye(2))


def way(expected: NextSurfacing) -> np.ndarray:
    return to_plane(expected.lat, expected.lon, LAT, LON)


class TestMemory:
    def test_five_dives_show_a_habit_and_thirty_the_errors(self):
        state = Surfacings()
        for each in mission([Way()] * 40):
            state = learn(state, each, None)
        assert (len(state.surface), len(state.lengths), len(state.errors)) == (5, 5, 30)

    def test_a_round_of_sixteen_waypoints_is_remembered(self):
        state = Surfacings()
        for k, each in enumerate(mission([Way()] * 20)):
            state = learn(state, each, (LAT, LON + k))
        assert [lon - LON for _, lon in state.waypoints] == list(range(4, 20))

    def test_thirty_two_reports_of_waypoints_are_remembered(self):
        lat = [(float(t), 20.0 + t) for t in range(40)]
        known = read_waypoints((), segment("a", 0.0, {"waypoint_lat": lat, "waypoint_lon": lat}))
        assert [t for t, _, _ in known] == list(range(8, 40))

    def test_a_waypoint_within_five_minutes_of_the_fix_is_that_of_its_dive(self):
        known = ((0.0, 1.0, 1.0), (1000.0, 2.0, 2.0))
        assert [active_waypoint(known, 1000.0 - early) for early in (280.0, 320.0)] == [
            (2.0, 2.0),
            (1.0, 1.0),
        ]

    def test_waypoints_two_hundred_metres_apart_are_two(self):
        here = (LAT, LON)
        assert is_same(here, from_plane((0.0, 180.0), *here))
        assert not is_same(here, from_plane((0.0, 220.0), *here))

    def test_a_glider_may_have_been_up_in_half_an_hour(self):
        one = dive(0, Way())
        hidden = [is_unseen(replace(one, features=replace(one.features, unobserved=t))) for t in (1700, 1900)]
        assert hidden == [False, True]


class TestWhen:
    def test_the_last_four_intervals_count_and_the_latest_three_times(self):
        assert timing.usual([9.0] * 5 + [5.0, 5.0, 5.0, 1.0]) == 3.0

    def test_the_first_interval_is_known_to_a_third(self):
        assert timing.spread(()) == pytest.approx(0.337, rel=0.01)

    def test_after_four_like_intervals_a_mission_is_no_longer_as_odd_as_missions_in_general(self):
        assert timing.spread((0.0,) * 3) == timing.spread(())
        assert timing.spread((0.0,) * 4) < 0.3 * timing.spread(())

    def test_odd_intervals_are_forgotten_after_two_dozen_dives(self):
        odd, usual = (0.5,) * 3, (0.01,)
        assert timing.spread(odd + usual * 15) > 0.25
        assert timing.spread(odd + usual * 28) < 0.1

    def test_an_interval_of_another_kind_counts_as_a_factor_of_e(self):
        assert timing.error(1.0, 10.0) == 1.0
        assert timing.error(1.0, 2.5) < 1.0

    def test_a_call_takes_a_quarter_of_an_hour_until_calls_are_known(self):
        found = expect(NORTH, SPEED, 0.0, still())
        assert found.t - found.after == 3 * HOUR + 900.0

    def test_at_least_half_of_an_interval_is_a_dive(self):
        """A pilot held the glider at the surface: the next interval is not all drift."""
        held = replace(NORTH, surface=(1e5,) * 5, intervals=(4 * HOUR,) * 4)
        assert way(expect(held, SPEED, 0.0, still()))[1] == pytest.approx(SPEED * 2 * HOUR, rel=1e-3)


class TestWhere:
    def test_two_fixes_are_no_better_than_ten_metres(self):
        """Nothing moves and nothing is unsure; the ellipse of missions in general is 1.2 times as long."""
        found = expect(NORTH, 0.0, 0.0, still())
        assert math.sqrt(found.east) == pytest.approx(1.2 * 10.0)

    def test_before_any_dive_a_course_is_known_to_a_third_of_a_radian(self):
        """The mean square of 0.1 is that of both components."""
        found = expect(NORTH, SPEED, 0.0, still())
        across = (SPEED * 3 * HOUR) ** 2 * 0.1 / 2
        assert found.east == pytest.approx(1.2**2 * (across + 100.0), rel=1e-3)

    @pytest.mark.parametrize("own, believed", [(-0.3, 0.05), (0.25, 0.25), (2.5, 1.5)])
    def test_a_glider_believes_a_speed_that_gliders_have(self, own, believed):
        one = dive(0, Way(heading=0.0, speed=own, own=own, flow=(0.0, 0.0)))
        assert learn(
            Surfacings(), replace(one, current=Current(0.0, 0.0, True)), None
        ).speed == pytest.approx(believed, rel=1e-3)

    @pytest.mark.parametrize("length, shows", [(0.25, False), (0.35, True)])
    def test_a_glider_that_turned_shows_no_speed(self, length, shows):
        angle = math.acos(length)
        state = learn(Surfacings(), dive(0, Way(heading=(angle, -angle))), None)
        assert (state.speed is not None) == shows

    @pytest.mark.parametrize("sigma, share", [(0.06, 0.5), (0.06 / math.sqrt(2), 0.8146)])
    def test_the_first_current_is_as_good_as_a_forecast_of_6_cm_s(self, sigma, share):
        """Both miss half of the same: with half of the variance the forecast counts for four fifths."""
        state = replace(NORTH, heading=(0.0, 0.0), current=(0.0, 0.0))
        found = expect(state, SPEED, 0.0, still(sigma, (0.2, 0.0)))
        assert way(found)[0] == pytest.approx(share * 0.2 * (3 * HOUR + 900), rel=0.01)

    def test_a_wild_change_of_the_current_counts_as_three_standard_deviations(self):
        state = replace(NORTH, current=(0.0, 0.0))
        wild = replace(dive(1, Way(), start=FIX), current=Current(2.0, 0.0, True))
        assert learn(state, wild, None).change == pytest.approx((0.8 + 0.2 * 9) * state.change)


class TestOutlook:
    """Of the learner, which gives no errors of its own: speed 0.3 m/s, a current of 0.1 m/s to the east."""

    LOOK = look_ahead(
        Estimate(
            learner=Learner(
                learner=AdaptiveState(np.zeros(2), np.zeros(2), np.zeros((2, 1)), 0.3, np.zeros((3, 3)), 1.0),
                current=Current(0.1, 0.0, True),
                current_t=START,
            )
        ),
        None,
    )

    def test_its_speed_is_good_to_a_tenth(self):
        assert self.LOOK[:2] == pytest.approx((0.3, 0.03))

    def test_the_current_lasts_and_after_days_it_has_changed_by_its_usual_size(self):
        mean, soon = self.LOOK[2](START, START + 60.0)
        _, late = self.LOOK[2](START + 30 * DAY, START + 30 * DAY)
        assert mean.tolist() == [0.1, 0.0]
        assert soon[0, 0] < 1e-5 and late[0, 0] == pytest.approx(0.08**2)


class TestDrift:
    def after(self, speed: float, seconds: float = 600.0) -> tuple[float, float]:
        """The drift learnt from one stay at the surface, to the east, in a sea without current."""
        state = replace(NORTH, current=(0.0, 0.0))
        there = Fix(START + seconds, *from_plane((speed * seconds, 0.0), LAT, LON))
        return learn(state, replace(dive(1, Way()), start=there), None).drift

    def test_the_latest_one_counts_for_a_tenth(self):
        assert self.after(0.5) == pytest.approx((0.05, 0.0), abs=1e-4)

    def test_it_is_at_most_two_knots_beside_the_current(self):
        assert self.after(2.5) == pytest.approx((0.1, 0.0), abs=1e-4)

    def test_in_less_than_five_minutes_errors_of_fixes_hide_it(self):
        assert self.after(0.5, 280.0) == (0.0, 0.0)
        assert self.after(0.5, 320.0) != (0.0, 0.0)


class TestSteering:
    def test_a_course_the_other_way_counts_as_one_at_a_right_angle(self):
        """And a dive counts for a fifth beside those before."""
        state = replace(NORTH, heading=(1.0, 0.0), speed=SPEED, current=(0.0, 0.0))
        west = dive(1, Way(heading=math.pi, speed=SPEED, own=SPEED, flow=(0.0, 0.0)), start=FIX)
        assert learn(state, west, None).scores[0] == pytest.approx(0.8 * 0.1 + 0.2 * 2.0)

    def test_allowance_for_a_current_is_at_most_53_degrees(self):
        """A current that is faster than the glider."""
        plan = Plan(np.array([0.0, 1.0]), None, 1.0, np.array([0.3, 0.0]), 0.2, (np.array([0.0, 1e5]),))
        assert courses(plan, 1000.0)[3].heading == pytest.approx([-0.8, 0.6])

    def test_eight_dives_show_where_a_glider_heads_that_sends_no_waypoint(self):
        """Two legs each, of which every one is longer than the glider circled."""
        state = replace(NORTH, heading=(0.0, 1.0), speed=SPEED, current=(0.0, 0.0))
        for k in range(1, 11):
            state = learn(state, dive(k, Way(heading=0.5, flow=(0.0, 0.0)), start=state.fix), None)
        assert len(state.legs) == 16
        assert [leg.heading for leg in state.legs] == pytest.approx([0.5] * 16)
        assert sum(leg.time for leg in state.legs[-2:]) == pytest.approx(3 * HOUR, rel=0.01)
        assert learn(state, dive(11, Way(), start=state.fix), (LAT, LON)).legs == ()

    def unsent(self, off: float, legs: int = 2) -> float:
        """The heading (rad) made of legs to the east of which the last is `off` (rad)."""
        flown = (Leg((0.0, 0.0), off if k == legs - 1 else 0.0, (0.0, 0.0), SPEED, HOUR) for k in range(legs))
        course = courses(Plan(np.array([1.0, 0.0]), None, 1.0, np.zeros(2), SPEED, legs=tuple(flown)), HOUR)
        return math.atan2(course[3].heading[1], course[3].heading[0])

    def test_a_heading_is_good_to_a_tenth_of_a_radian(self):
        """Headings of 0 and 0.3 rad are of one goal between them, those of 0 and 0.8 of two."""
        assert self.unsent(0.3) == pytest.approx(0.15, abs=0.02)
        assert self.unsent(0.8) > 0.45

    def test_one_heading_aside_after_many_is_no_new_goal_yet(self):
        assert self.unsent(1.5, legs=8) == pytest.approx(0.39, abs=0.05)

    def test_a_goal_is_thought_of_at_each_seven_and_a_half_degrees(self):
        """So one at 2.5 degrees is taken for that at 0, but for a tenth; with twice as many it is found."""
        flown = tuple(Leg((0.0, 0.0), math.radians(2.5), (0.0, 0.0), SPEED, HOUR) for _ in range(12))
        course = courses(Plan(np.array([1.0, 0.0]), None, 1.0, np.zeros(2), SPEED, legs=flown), HOUR)
        made = math.degrees(math.atan2(course[3].heading[1], course[3].heading[0]))
        assert made == pytest.approx(0.26, abs=0.1)

    def past(self, distance: float) -> float:
        """The part of 8 h after a goal so far to the north (m) is reached, to which nine legs by it led."""
        legs = tuple(
            Leg((float(x), 0.0), math.atan2(distance, -x), (0.0, 0.0), SPEED, HOUR)
            for x in np.linspace(-4e3, 4e3, 9)
        )
        plan = Plan(np.array([0.0, 1.0]), None, 1.0, np.zeros(2), SPEED, legs=legs)
        return courses(plan, 8 * HOUR)[3].unknown

    def test_a_goal_is_thought_of_on_eight_rings_and_the_way_to_it_in_two_steps(self):
        """One 3 km off is reached in the second half, one at 6 km is taken for one on a ring that is not.
        With four rings or one step none is reached, with more steps that at 6 km is."""
        assert self.past(3e3) == pytest.approx(0.5, abs=0.02)
        assert self.past(2.5e3) == pytest.approx(0.09, abs=0.03)
        assert self.past(6e3) < 0.01

    def test_where_all_ways_were_alike_the_waypoint_is_followed_rather(self):
        """Two of the ways go on to the east as before, two go to the waypoint in the north."""
        state = replace(NORTH, heading=(1.0, 0.0), scores=(0.01,) * 4)
        state = replace(state, waypoints=(from_plane((0.0, 1e5), LAT, LON),))
        weights = np.array([0.04, 0.02, 0.02, 0.02]) ** -2
        east = weights[:2].sum() / weights.sum()
        found = way(expect(state, SPEED, 0.0, still()))
        assert found[0] == pytest.approx(east * SPEED * 3 * HOUR, rel=0.01)


class TestEllipse:
    def test_a_place_on_the_edge_of_the_ellipse_is_a_miss_of_one(self):
        """Of the ellipse as reckoned, before it was stretched to 1.2 times the size."""
        one = dive(1, Way(), start=FIX)
        off = from_plane((2.4477 * 500.0, 0.0), one.end.lat, one.end.lon)
        said = NextSurfacing(FIX.t, FIX.t + HOUR, 60.0, *off, 500.0**2, 0.0, 500.0**2, "")
        assert learn(NORTH, one, None, said).misses == pytest.approx((1.2,), rel=1e-3)

    def test_seven_good_places_begin_to_narrow_it(self):
        assert [factor((0.1,) * n) for n in (0, 6, 7)] == [1.2, 1.2, 0.9]

    def test_three_misses_are_forgotten_after_two_dozen_dives(self):
        misses, hits = (3.0,) * 3, (0.5,)
        assert [factor(misses + hits * n) for n in (10, 27)] == [3.0, 1.2]

    def test_it_is_stretched_to_four_times_its_size_at_most(self):
        assert factor((100.0,) * 30) == 4.0
