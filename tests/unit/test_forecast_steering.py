import math
from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.forecast.steering import WAYS, Leg, Plan, courses

EAST, NORTH = np.array([1.0, 0.0]), np.array([0.0, 1.0])
STILL = np.zeros(2)
HOUR = 3600.0
AT, AGAINST = WAYS.index("at the waypoint"), WAYS.index("at the waypoint against the current")
BEFORE, BESIDE = WAYS.index("as before"), WAYS.index("beside the waypoint")


def plan(goals=(), heading=EAST, bearing=None, length=1.0, current=STILL, speed=0.25, legs=()):
    return Plan(heading, bearing, length, np.asarray(current), speed, tuple(map(np.asarray, goals)), legs)


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


def flown_to(goal, tides, place=(0.0, 0.0), speed=0.25):
    """Legs of 90 min to a goal (m), each against the tide (m/s) that the glider knew and was carried by, and
    where the last one ended (m)."""
    legs, here = [], np.array(place)
    for tide in map(np.asarray, tides):
        heading = courses(plan([goal - here], current=tide, speed=speed), 1.5 * HOUR)[AGAINST].heading
        angle = math.atan2(heading[1], heading[0])
        legs.append(Leg(tuple(here), angle, tuple(tide), speed, 1.5 * HOUR))
        here = here + 1.5 * HOUR * (speed * heading + tide)
    return legs, here


def from_here(legs, here):
    return tuple(replace(leg, place=tuple(np.array(leg.place) - here)) for leg in legs)


@pytest.mark.parametrize("amplitude", [0.1, 0.2, 0.4])
def test_a_goal_that_is_not_sent_is_found_by_the_headings_whatever_the_tide(amplitude):
    """It aims otherwise on each leg, and from another place, as the tide carries it about."""
    tides = [amplitude * np.array([math.cos(0.8 * k), math.sin(0.8 * k)]) for k in range(17)]
    goal = np.array([1.2e4, 2e4])
    legs, here = flown_to(goal, tides[:16])
    sent = courses(plan([goal - here], current=tides[16]), 1.5 * HOUR)[AGAINST].heading
    made = courses(plan(heading=EAST, current=tides[16], legs=from_here(legs, here)), 1.5 * HOUR)
    assert made[AGAINST].heading == pytest.approx(sent, abs=0.12)
    assert made[BEFORE].heading == pytest.approx(EAST)


def test_after_a_turn_the_new_goal_counts_within_a_dive():
    """12 legs to the east, then a dive (2 legs) to the north."""
    east, here = flown_to(np.array([4e4, 0.0]), [STILL] * 12)
    north, end = flown_to(here + np.array([0.0, 4e4]), [STILL] * 2, here)
    made = courses(plan(heading=NORTH, legs=from_here([*east, *north], end)), 3 * HOUR)
    assert made[AGAINST].heading[1] > 0.8
    assert abs(made[AGAINST].heading[0]) < 0.2


def test_where_it_may_arrive_the_rest_of_the_way_is_not_known():
    """Bearings from two sides show a goal 3 km away; a dive would lead 2.7 km beyond."""
    legs = [
        Leg((x, y), math.atan2(-y, 3e3 - x), (0.0, 0.0), 0.25, 1.5 * HOUR)
        for x, y in 2 * [(0.0, 0.0), (3e3, 3e3), (3e3, -3e3), (6e3, 0.0), (-1e3, 2e3)]
    ]
    near = courses(plan(legs=tuple(legs)), 6 * HOUR)[AGAINST]
    far = courses(plan(legs=tuple(legs)), 1 * HOUR)[AGAINST]
    assert near.unknown > 0.3
    assert far.unknown < 0.05
    assert far.heading[0] > 0.9


def test_without_legs_it_goes_on_as_before():
    made = courses(plan(heading=0.9 * NORTH, legs=()), 3 * HOUR)
    assert made[AGAINST].heading == pytest.approx([0, 0.9])
