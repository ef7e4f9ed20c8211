"""Five real missions: the numbers they come to, and the closure test that proves the frames.

After a change that is meant to change them: `python tests/golden/regenerate.py`, and read the diff.
"""

import pytest
from ruamel.yaml import YAML

from golden_statistics import golden_file, median_misfit, statistics
from missions import REAL, real

pytestmark = pytest.mark.real

TOLERANCE = {"nis": 0.1, "hours_under_water": 0.2}
"""Metres and hours; all else 5 mm/s or 0.005."""


@pytest.fixture(scope="module", params=REAL)
def mission(request, shared_data):
    expected = YAML(typ="safe").load(golden_file(request.param).read_text(encoding="utf-8"))
    return statistics(shared_data, request.param), expected


def test_the_same_things_are_counted(mission):
    found, expected = mission
    assert set(found) == set(expected)


@pytest.mark.parametrize(
    "key", ["segments", "dives", "usable", "flags", "reasons", "final_currents", "incidents"]
)
def test_counts(mission, key):
    found, expected = mission
    assert found[key] == expected[key]


@pytest.mark.parametrize(
    "key", ["hours_under_water", "along_speed", "across_misfit", "speed", "p_e", "speed_sigma", "nis"]
)
def test_numbers(mission, key):
    found, expected = mission
    assert found[key] == pytest.approx(expected[key], abs=TOLERANCE.get(key, 0.005))


def test_the_triangle_closes_only_when_headings_and_currents_are_both_rotated(shared_data):
    """Electa, 16.3 degrees west. On board the glider knows its heading all the time, we every 12 min."""
    segments = real(shared_data, "electa-2022")
    both = median_misfit(segments, rotate_heading=True, rotate_current=True)
    neither = median_misfit(segments, rotate_heading=False, rotate_current=False)
    heading = median_misfit(segments, rotate_heading=True, rotate_current=False)
    current = median_misfit(segments, rotate_heading=False, rotate_current=True)
    assert both < 0.035
    assert 2 * both < neither < 0.1
    assert 0.18 < heading < 0.26 and 0.1 < current < 0.2


def test_without_a_variation_in_the_files_the_model_closes_it(shared_data):
    """USF-Sam, 6.6 degrees west by the World Magnetic Model."""
    segments = real(shared_data, "usf-sam-2019")
    assert not any("magnetic_variation" in s.quantities for s in segments)
    both = median_misfit(segments, rotate_heading=True, rotate_current=True)
    neither = median_misfit(segments, rotate_heading=False, rotate_current=False)
    assert both < 0.012 and neither > 2.5 * both
