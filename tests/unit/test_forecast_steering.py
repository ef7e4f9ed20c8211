import math

import numpy as np
import pytest

from gliderwatch.forecast.steering import WAYS, Plan, courses, steered

EAST, NORTH = np.array([1.0, 0.0]), np.array([0.0, 1.0])
STILL = np.zeros(2)
HOUR = 3600.0
AT, AGAINST = WAYS.index("at the waypoint"), WAYS.index("at the waypoint against the current")
BEFORE, BESIDE = WAYS.index("as before"), WAYS.index("beside the waypoint")


def plan(goals=(), heading=EAST, bearing=None, length=1.0, current=STILL, speed=0.25):
    return Plan(heading, bearing, length, np.asarray(current), speed, tuple(map(np.asarray, goals)))


def test_without_a_waypoint_all_goes_on_as_before():
    made = courses(plan(heading=0.9 * NORTH), 3 * HOUR)
    assert len(made) == len(WAYS)
    assert all(np.allclose(c.heading, [0, 0.9]) and c.unknown == 0 for c in made)


def test_at_the_waypoint_with_the_length_of_straight_ways():
    made = courses(plan([(0.0, 5e4)], length=0.95), 3 * HOUR)
    assert made[AT].heading == pytest.approx([0, 0.95])


def test_against_the_current_the_way_over_ground_leads_to_the_waypoint():
    current = np.array([0.1, 0.02])
    course = courses(plan([(0.0, 5e4)], current=current), 3 * HOUR)[AGAINST]
    over_ground = 0.25 * course.heading + current
    assert over_ground[0] == pytest.approx(0, abs=1e-12)
    assert over_ground[1] > 0


def test_a_current_too_strong_to_hold_against_is_met_as_far_as_can_be():
    course = courses(plan([(0.0, 5e4)], current=(0.6, 0.0)), 3 * HOUR)[AGAINST]
    assert course.heading == pytest.approx([-0.8, 0.6])


def test_beside_the_waypoint_by_as_much_as_before():
    """It steered 20 degrees to the left of a waypoint in the north; now the waypoint is in the east."""
    angle = math.radians(110)
    last = np.array([math.cos(angle), math.sin(angle)])
    course = courses(plan([(5e4, 0.0)], heading=last, bearing=math.pi / 2), 3 * HOUR)[BESIDE]
    assert math.degrees(math.atan2(course.heading[1], course.heading[0])) == pytest.approx(20)


def test_beyond_the_last_waypoint_the_heading_is_not_known():
    half = 0.25 * 1.5 * HOUR
    made = courses(plan([(0.0, half)]), 3 * HOUR)
    assert made[AT].unknown == pytest.approx(0.5)
    assert made[AT].heading == pytest.approx([0, 0.5])
    assert made[BEFORE].unknown == 0


def test_it_goes_on_to_the_waypoint_after():
    quarter = 0.25 * 0.75 * HOUR
    course = courses(plan([(0.0, quarter), (5e4, quarter)]), 3 * HOUR)[AT]
    assert course.unknown == 0
    assert course.heading == pytest.approx([0.75, 0.25])


def test_a_glider_carried_backwards_never_arrives():
    course = courses(plan([(0.0, 500.0)], current=(0.0, -0.4)), 3 * HOUR)[AT]
    assert course.unknown == 0
    assert course.heading == pytest.approx([0, 1])


@pytest.mark.parametrize("hours", range(0, 24, 3))
def test_a_course_is_found_again_whatever_the_tide_was(hours):
    """No waypoint is sent: the glider holds 60 degrees in a tide of 0.15 m/s, and will on the next dive."""
    tide = [0.15 * np.array([math.cos(k), math.sin(k)]) for k in (0.5 * hours, 0.5 * hours + 1.5)]
    goal = 1e7 * np.array([math.cos(1.05), math.sin(1.05)])
    flown, next_ = (courses(plan([goal], current=c), 3 * HOUR)[AGAINST].heading for c in tide)
    course = steered(0.9 * flown, 0.25, tide[0], None)
    assert course == pytest.approx(1.05, abs=0.02)
    made = courses(plan(heading=flown, bearing=course, current=tide[1]), 3 * HOUR)
    assert made[AGAINST].heading == pytest.approx(next_, abs=0.03)
    assert made[BEFORE].heading == pytest.approx(flown)


@pytest.mark.parametrize("angle", range(0, 360, 45))
def test_in_a_current_stronger_than_the_glider_the_course_before_tells_which(angle):
    current = 0.4 * np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
    goal = 1e7 * np.array([math.cos(1.05), math.sin(1.05)])
    flown = courses(plan([goal], current=current), 3 * HOUR)[AGAINST].heading
    assert steered(flown, 0.25, current, 1.1) == pytest.approx(1.05, abs=0.05)


def test_a_circle_has_no_course():
    assert steered(0.1 * EAST, 0.25, STILL, None) is None
