import numpy as np

from gliderwatch.forecast.constants import WAYPOINTS_HEARD
from gliderwatch.forecast.waypoints import bound_for, heard
from gliderwatch.model import Segment, SegmentId, Series, readonly


def segment(*reports):
    t, lat, lon = np.array(reports).T if reports else np.zeros((3, 0))
    quantities = {
        "waypoint_lat": Series(readonly(t), readonly(lat)),
        "waypoint_lon": Series(readonly(t), readonly(lon)),
    }
    return Segment(SegmentId(0.0, "unit", "unit-0"), "unit.mi", "sbd", 0.0, (0, 0, ""), quantities)


def test_waypoint_at_a_fix_is_not_one_told_on_the_dive_after_it():
    known = heard((), segment((0.0, 27.0, -84.0), (20000.0, 28.0, -84.0)))
    assert bound_for(known, 10000.0) == (27.0, -84.0)
    assert bound_for(known, 20000.0) == (28.0, -84.0)


def test_none_before_any_is_told():
    assert bound_for(heard((), segment()), 1e9) is None
    assert bound_for(((5000.0, 27.0, -84.0),), 0.0) is None


def test_any_order_of_segments_tells_the_same():
    one, two = segment((0.0, 27.0, -84.0), (50.0, 27.0, -84.0)), segment((100.0, 28.0, -84.0))
    assert heard(heard((), one), two) == heard(heard((), two), one)


def test_repeated_reports_are_left_out_and_old_ones_forgotten():
    known = ()
    for k in range(3 * WAYPOINTS_HEARD):
        known = heard(known, segment((float(k), 27.0 + k // 2, -84.0)))
    assert len(known) == WAYPOINTS_HEARD
    assert len({report[1:] for report in known}) == WAYPOINTS_HEARD


def test_a_latitude_without_its_longitude_is_not_a_waypoint():
    whole = segment((0.0, 27.0, -84.0))
    half = {"waypoint_lat": whole.get("waypoint_lat")}
    assert heard((), Segment(whole.id, "unit.mi", "sbd", 0.0, (0, 0, ""), half)) == ()
