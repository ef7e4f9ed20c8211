"""Properties of the water in the samples of a science file."""

import numpy as np
import pytest

from gliderwatch.slocum.science import sensors_of, water

T = np.arange(0.0, 50.0, 10.0)


def samples(**sensors: list[float]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {name: (T[: len(v)], np.array(v)) for name, v in sensors.items()}


SEA = {"sci_water_temp": [14.9964] * 5, "sci_water_cond": [4.2914] * 5, "sci_water_pressure": [0.0] * 5}


def test_standard_sea_water_has_a_salinity_of_35() -> None:
    """PSS-78: the conductivity of sea water of 35 at 15 degrees (of 1968) and no pressure is 42.914 mS/cm."""
    found = water(samples(**SEA), "salinity")
    assert found["science_salinity"].v == pytest.approx([35.0] * 5, abs=1e-3)
    assert found["science_depth"].v == pytest.approx([0.0] * 5)


def test_density_of_standard_sea_water() -> None:
    """EOS-80 has 25.973 kg/m3 at 15 degrees and 35; TEOS-10 differs by some g/m3."""
    assert water(samples(**SEA), "density")["science_density"].v == pytest.approx([25.973] * 5, abs=0.01)


def test_values_of_a_ctd_in_the_air_are_left_out() -> None:
    found = water(samples(**SEA | {"sci_water_temp": [15.0, -273.0, np.nan, 99.0, 16.0]}), "temperature")
    assert found["science_temperature"].v.tolist() == [15.0, 16.0]
    assert found["science_temperature"].t.tolist() == [0.0, 40.0]


def test_any_sensor_as_it_is_sent() -> None:
    found = water(samples(sci_oxy4_oxygen=[200.0, 201.0], sci_water_pressure=[1.0, 2.0]), "sci_oxy4_oxygen")
    assert found["science_sci_oxy4_oxygen"].v.tolist() == [200.0, 201.0]
    assert sensors_of("sci_oxy4_oxygen") == ("sci_water_pressure", "sci_oxy4_oxygen")


def test_without_the_sensor_there_is_nothing() -> None:
    assert water(samples(sci_water_pressure=[1.0]), "temperature") == {}
