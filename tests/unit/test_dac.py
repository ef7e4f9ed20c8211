"""Which reported current belongs to which dive."""

import numpy as np
import pytest

from gliderwatch.model import Current
from gliderwatch.navigation.constants import CURRENT_EARLY
from gliderwatch.navigation.dac import Report, new_reports, pair, updated
from missions import segment

NONE = (None, None)


def reports(known=NONE, declination=0.0, **pairs):
    """New reports of a segment; each of `pairs` is a list of (t, x, y)."""
    held = {}
    for name, values in pairs.items():
        held[f"{name}_x"] = [(t, x) for t, x, _ in values]
        held[f"{name}_y"] = [(t, y) for t, _, y in values]
    return new_reports(segment("a", 0.0, held), declination, known)


def test_a_value_counts_when_it_changes():
    new, known = reports(current=[(1.0, 0.1, 0.2), (2.0, 0.1, 0.2), (3.0, 0.3, 0.2)])
    assert [(r.t, r.u, r.v, r.final) for r in new] == [(1.0, 0.1, 0.2, False), (3.0, 0.3, 0.2, False)]
    assert known == ((0.3, 0.2), None)


def test_a_stale_value_is_no_news():
    _, known = reports(current=[(1.0, 0.1, 0.2)], current_final=[(1.0, 0.1, 0.2)])
    new, after = reports(known, current=[(9.0, 0.1, 0.2)], current_final=[(9.0, 0.1, 0.2)])
    assert new == [] and after == known


def test_a_stale_value_under_another_declination_is_no_news():
    """A glider that moves reports another magnetic variation at each surfacing."""
    _, known = reports(current=[(1.0, 1.2, 0.6)], declination=-0.2845)
    new, _ = reports(known, current=[(9.0, 1.2, 0.6)], declination=-0.2862)
    assert new == []


def test_a_current_not_computed_yet_is_none():
    new, known = reports(((0.1, 0.2), None), current=[(1.0, 0.0, 0.0), (2.0, 0.1, 0.2)])
    assert new == [] and known == ((0.1, 0.2), None)


def test_currents_are_turned_to_true_north():
    new, _ = reports(current=[(1.0, 0.0, 1.0)], declination=np.radians(90.0))
    assert (new[0].u, new[0].v) == pytest.approx((1.0, 0.0))


def test_of_one_moment_the_corrected_value_comes_last():
    new, _ = reports(current=[(5.0, 0.1, 0.1)], current_final=[(5.0, 0.2, 0.2)])
    assert [r.final for r in new] == [False, True]


def test_the_first_estimate_stands_in_where_nothing_else_is_sent():
    new, _ = reports(current_initial=[(5.0, 0.1, 0.1)])
    assert [(r.u, r.final) for r in new] == [(0.1, False)]


def at(*times: float) -> list[Report]:
    return [Report(t, 0.0, 0.0, False) for t in times]


def test_the_current_belongs_to_the_dive_that_surfaced_last():
    assert pair(at(100.0, 1000.0, 2100.0, 9999.0), [500.0, 2000.0]) == [-1, 0, 1, 1]


def test_it_may_come_a_little_before_the_last_sample_under_water():
    assert pair(at(500.0 - CURRENT_EARLY, 500.0 - CURRENT_EARLY - 1), [500.0]) == [0, -1]


def test_no_dive_no_current():
    assert pair(at(1.0), []) == [-1] and pair([], [1.0]) == []


def test_the_corrected_value_replaces_the_first():
    first = updated(None, Report(30.0, 0.1, 0.0, False), 0.0)
    assert first == Current(0.1, 0.0, final=False)
    assert updated(first, Report(900.0, 0.2, 0.0, True), 0.0) == Current(0.2, 0.0, final=True)


def test_without_a_sensor_for_it_the_second_value_is_the_corrected_one():
    first = updated(None, Report(30.0, 0.1, 0.0, False), 0.0)
    assert updated(first, Report(300.0, 0.2, 0.0, False), 0.0) == Current(0.2, 0.0, final=True)


def test_a_first_value_late_after_the_surfacing_is_the_corrected_one():
    assert updated(None, Report(900.0, 0.2, 0.0, False), 0.0).final
    assert not updated(None, Report(300.0, 0.2, 0.0, False), 0.0).final
