"""Tidal constituents, and what a surfacing interval hides of them."""

import numpy as np
import pytest

from gliderwatch.sea.tides import HOUR, Constituent, aliasing, smoothing
from gliderwatch.simulate import ocean


def said(each: Constituent, hours: float, dive: float | None = None) -> str:
    return " ".join(aliasing([each], hours * HOUR, (dive or hours - 0.3) * HOUR))


def test_periods():
    hours = {each: each.period / HOUR for each in Constituent}
    assert hours["M2"] == pytest.approx(12.4206, abs=1e-4)
    assert hours["K1"] == pytest.approx(23.9345, abs=1e-4)
    assert hours["O1"] == pytest.approx(25.8193, abs=1e-4)
    assert hours["M4"] == pytest.approx(hours["M2"] / 2, rel=1e-9)
    for each in Constituent:
        assert each.omega * each.period == pytest.approx(2 * np.pi)


def test_the_simulator_has_the_same_tides():
    assert all(Constituent(each).omega == each.frequency for each in ocean.Constituent)


@pytest.mark.parametrize("hours", [6.0, 6.2, 6.4])
def test_at_half_a_period_one_half_of_m2_is_unseen(hours):
    assert "only one half of the M2 tide" in said(Constituent.M2, hours)


def test_at_12_4_hours_m2_is_hidden():
    assert "only one half of the M2 tide" in said(Constituent.M2, 12.4, dive=6.0)
    assert "averages the M2 tide away" in said(Constituent.M2, 12.4)


@pytest.mark.parametrize("hours", [3.3, 4.0, 5.0])
def test_m4_is_aliased_above_3_1_hours(hours):
    assert "M4 tide look like a slower current" in said(Constituent.M4, hours)


def test_a_usual_interval_hides_nothing_of_the_usual_tides():
    assert all(not said(each, 3.2) for each in Constituent if each is not Constituent.M4)
    assert not said(Constituent.M4, 2.5)


def test_the_cure_cures():
    for each in Constituent:
        for hours in np.arange(1.0, 26.0, 0.1):
            note = said(each, float(hours))
            if note:
                better = float(note.split("surface every ")[1].split(" h")[0])
                assert better < hours and not said(each, better)


def test_tides_of_one_trouble_share_a_note():
    (note,) = aliasing([Constituent.M2, Constituent.S2, Constituent.N2, Constituent.K1], 8 * HOUR, 6 * HOUR)
    assert note.startswith("surfacing every 8.0 h makes the M2, S2 and N2 tide look like a slower current")
    assert "surface every 5.0 h or more often, or at uneven intervals" in note


def test_smoothing_is_the_mean_of_a_cosine():
    t = (np.arange(10_000) + 0.5) / 10_000 * 5 * HOUR - 2.5 * HOUR
    assert smoothing(Constituent.M2.omega, 5 * HOUR) == pytest.approx(
        np.cos(Constituent.M2.omega * t).mean(), abs=1e-7
    )
