"""Missions without some of their sensors."""

from __future__ import annotations

import pytest

from gliderwatch.ingest.segment import QUANTITIES, model_declination
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.score.sensors import LEFT_OUT, cadence_without, is_sent, left_out
from gliderwatch.simulate.sensors import CADENCE
from missions import Leg, mission

SEGMENTS = mission([Leg(speed=0.3, heading=1.0, current=(0.1, -0.05))] * 4)


def test_each_name_leaves_out_quantities_that_there_are():
    known = {row.name for row in QUANTITIES}
    assert all(set(gone) <= known for gone in LEFT_OUT.values())


@pytest.mark.parametrize("name", LEFT_OUT)
def test_what_is_left_out_is_gone_and_the_rest_as_it_was(name):
    for before, after in zip(SEGMENTS, left_out(SEGMENTS, LEFT_OUT[name]), strict=True):
        assert before.quantities.keys() - after.quantities.keys() <= set(LEFT_OUT[name])
        assert not after.quantities.keys() & set(LEFT_OUT[name])
        assert all(after.quantities[q] is before.quantities[q] for q in after.quantities)
        assert after.id == before.id


def test_without_the_variation_the_declination_is_that_of_the_model():
    for before, after in zip(SEGMENTS, left_out(SEGMENTS, LEFT_OUT["variation"]), strict=True):
        lat, lon = before.get("fix_lat"), before.get("fix_lon")
        if len(lat):
            model, source = model_declination(float(lat.v[0]), float(lon.v[0]), float(lat.t[0]))
            assert (after.declination, after.declination_source) == (model, source)


def test_a_mission_without_its_current_has_dives_without_one():
    state, dives = Navigation(), []
    for segment in left_out(SEGMENTS, LEFT_OUT["current"]):
        state, told = extend(state, segment)
        dives += told
    assert dives and all(dive.current is None for dive in dives)


def test_what_was_never_sent_is_known():
    assert not is_sent(SEGMENTS, LEFT_OUT["thruster"])
    assert is_sent(SEGMENTS, LEFT_OUT["heading"])
    assert is_sent(SEGMENTS, LEFT_OUT["all sensors"])


def test_a_list_of_sensors_without_some():
    assert set(CADENCE) - set(cadence_without(CADENCE, LEFT_OUT["both headings"])) == {
        "m_heading",
        "c_heading",
    }
    assert cadence_without(CADENCE, ()) == CADENCE
