"""A glider that crosses the antimeridian: its files, from the simulator and of a glider that counts on."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.flight import Point, displacement, nmea
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.slocum.decode import decode
from missions import feed
from simulated import degrees, samples

LAT = -17.0
EASTWARD = Scenario(
    days=3.0, place=Point(LAT, 179.9), waypoints=(Point(LAT, -179.6),), variation=-0.2, seed=3
)


@pytest.fixture(scope="module")
def crossing():
    return simulate(EASTWARD)


def _counting_on(mission):
    """The same files as of a glider whose longitude grows beyond 180 degrees."""
    segments = []
    for segment in mission.segments:
        names = [sensor.name for sensor in segment.sensors.columns]
        values = segment.values.copy()
        for i in (names.index(name) for name in ("m_gps_lon", "m_lon", "c_wpt_lon")):
            west = (values[:, i] < 0) & (values[:, i] >= -18000)
            values[west, i] = nmea(360.0 + degrees(values[west, i]))
        segments.append(replace(segment, values=values))
    return replace(mission, segments=tuple(segments))


def test_the_simulator_writes_longitudes_of_180_degrees_at_most(crossing):
    for name in ("m_gps_lon", "m_lon", "c_wpt_lon"):
        values = samples(crossing, name)[1]
        assert np.abs(values[np.abs(values) < 1e6]).max() <= 18000.0
    lon = samples(crossing, "m_gps_lon")[1]
    assert (lon > 0).any() and (lon < 0).any()
    steps = [displacement(a.end, b.end).east for a, b in pairwise(crossing.truth)]
    assert max(map(abs, steps)) < 10e3


@pytest.mark.parametrize("written", [lambda mission: mission, _counting_on])
def test_nothing_is_wrong_with_a_glider_that_crosses_it(tmp_path, crossing, written):
    paths = write_mission(tmp_path / "gliders", tmp_path / "cache", written(crossing))
    store = feed([decode(path, [tmp_path / "cache"]) for path in paths])
    dives = store.assessments("sim")
    assert sum(a.flag == 0 for a in dives) >= len(crossing.truth) - 2
    assert not store.incidents("sim")
    assert {a.lon > 0 for a in dives if a.lon is not None} == {True, False}
