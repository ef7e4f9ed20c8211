"""Properties of the water in a segment, and their casts."""

import numpy as np
import pytest

from gliderwatch.layers.casts import casts_of
from gliderwatch.model import Segment, SegmentId, Series, readonly

T = np.arange(0.0, 400.0, 10.0)
DOWN = np.concatenate([np.arange(0.0, 20.0), np.arange(20.0, 0.0, -1.0)])


def segment(**quantities: list[float] | np.ndarray) -> Segment:
    series = {name: Series(readonly(T[: len(v)]), readonly(v)) for name, v in quantities.items()}
    return Segment(SegmentId(0.0, "electa", "electa-2022-1-1-1"), "", "sbd", 400.0, (0, 1, ""), series)


SEA = {"temperature": [14.9964] * 40, "conductivity": [4.2914] * 40, "science_pressure": 1e4 * DOWN}


def test_depth_is_that_of_the_pressure() -> None:
    down, up = casts_of(segment(**SEA), "temperature")
    assert (down.top, down.bottom) == pytest.approx((0.0, 19.83), abs=0.02)
    assert up.depth[-1] == pytest.approx(0.99, abs=0.02)


def test_standard_sea_water_has_a_salinity_of_35() -> None:
    """PSS-78: the conductivity of sea water of 35 at 15 degrees (of 1968) and no pressure is 42.914 mS/cm."""
    down, _ = casts_of(segment(**SEA), "salinity")
    assert down.value[0] == pytest.approx(35.0, abs=1e-3)


def test_density_of_standard_sea_water() -> None:
    """EOS-80 has 25.973 kg/m3 at 15 degrees and 35; TEOS-10 differs by some g/m3."""
    down, _ = casts_of(segment(**SEA), "density")
    assert down.value[0] == pytest.approx(25.973, abs=0.01)


def test_any_quantity_has_casts() -> None:
    down, _ = casts_of(segment(science_pressure=1e4 * DOWN, sci_any=DOWN), "sci_any")
    assert down.value.tolist() == DOWN[:21].tolist()


@pytest.mark.parametrize("name", ["temperature", "salinity", "density", "oxygen"])
def test_without_the_sensor_there_are_no_casts(name: str) -> None:
    assert casts_of(segment(science_pressure=1e4 * DOWN), name) == ()
    assert casts_of(segment(**{"temperature": [15.0] * 40}), name) == ()
