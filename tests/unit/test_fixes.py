"""Which positions are new fixes: old ones repeated, wild ones, suspect ones."""

import pytest

from gliderwatch.model import Fix
from gliderwatch.navigation.constants import SURFACE_STAY
from gliderwatch.navigation.fixes import distance, new_fixes
from missions import LAT, LON, series

KM = 1 / 111.195
"""Degrees of latitude in a kilometre."""
LAST = Fix(0.0, LAT, LON)
DIVE = 3 * 3600.0


def reported(*fixes: tuple[float, float], lon: float = LON):
    """Samples of positions: (time, kilometres north of `LAT`)."""
    places = [(t, LAT + km * KM) for t, km in fixes]
    return {"fix_lat": series(places), "fix_lon": series([(t, lon) for t, _ in places])}


def found(*fixes: tuple[float, float], last: Fix | None = LAST) -> list[tuple[float, float]]:
    return [(f.t, pytest.approx((f.lat - LAT) / KM, abs=1e-6)) for f in new_fixes(reported(*fixes), last)]


def test_all_fixes_of_a_healthy_surfacing():
    stay = [(DIVE, 3.0), (DIVE + 30, 3.02), (DIVE + 60, 3.04)]
    assert found(*stay) == stay


def test_the_old_fix_repeated_is_not_new():
    assert found((DIVE, 0.0), (DIVE + 30, 0.0)) == []
    assert found((DIVE, 0.0), (DIVE + 60, 3.0)) == [(DIVE + 60, 3.0)]


def test_a_fix_reported_again_and_again_counts_once():
    assert found((DIVE, 3.0), (DIVE + 4, 3.0), (DIVE + 8, 3.0)) == [(DIVE, 3.0)]


def test_an_old_fix_that_was_never_sent_is_contradicted_by_the_next():
    """The glider had one more fix before it dived, after the file was closed, and reports it first."""
    assert found((DIVE, 0.2), (DIVE + 60, 3.0)) == [(DIVE + 60, 3.0)]


@pytest.mark.parametrize("at", [0, 1, 2, 3, 4])
def test_one_wild_fix_is_dropped_wherever_it_stands(at):
    stay = [(DIVE + 30.0 * i, 3.0 + 0.01 * i) for i in range(5)]
    wild = list(stay)
    wild[at] = (stay[at][0], 9.0)
    assert found(*wild) == stay[:at] + stay[at + 1 :]


def test_a_receiver_that_settles_is_believed_at_the_end():
    settling = [(DIVE, 8.0), (DIVE + 10, 8.0), (DIVE + 20, 8.01), (DIVE + 30, 3.0), (DIVE + 40, 3.01)]
    assert found(*settling) == [(DIVE + 30, 3.0), (DIVE + 40, 3.01)]


def test_fast_drift_is_not_wild():
    """2.5 m/s in a boundary current."""
    drift = [(DIVE + 60.0 * i, 3.0 + 0.15 * i) for i in range(8)]
    assert found(*drift) == drift


def test_fixes_before_and_after_a_dive_cannot_contradict_each_other():
    assert len(found((10.0, 0.01), (SURFACE_STAY + 11, 5.0))) == 2


def test_a_single_fix_where_the_dive_began_is_suspect():
    assert found((DIVE, 0.02)) == []


def test_a_suspect_fix_that_is_confirmed_counts():
    assert found((DIVE, 0.02), (DIVE + 60, 0.03)) == [(DIVE, 0.02), (DIVE + 60, 0.03)]


def test_a_single_fix_soon_after_the_last_one_is_a_drifting_glider():
    assert found((60.0, 0.01)) == [(60.0, 0.01)]


def test_the_first_fix_of_a_glider_is_believed():
    assert found((DIVE, 0.0), last=None) == [(DIVE, 0.0)]


def test_fixes_of_the_past_are_not_new():
    assert found((-60.0, 4.0), (DIVE, 3.0)) == [(DIVE, 3.0)]


def test_no_fixes():
    assert new_fixes({}, LAST) == [] and new_fixes({}, None) == []


def test_distance_across_the_date_line():
    assert distance(Fix(0, 0.0, 179.999), Fix(1, 0.0, -179.999)) == pytest.approx(222.4, abs=0.5)
    assert distance(Fix(0, 60.0, 10.0), Fix(1, 60.0, 10.01)) == pytest.approx(558.0, rel=5e-3)
