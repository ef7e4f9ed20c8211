"""From a segment to the samples of a field, and to bytes and back."""

from dataclasses import replace

import gsw
import numpy as np
import pytest

from gliderwatch.fleet.advice import Box
from gliderwatch.fleet.batches import batch_of, packed, unpacked, whereabouts
from gliderwatch.model import Segment, SegmentId, Series, readonly

T0 = 1.7e9
BOX = Box(49.8, 179.7, 50.2, -179.7, 0.0, 100.0)


def segment(**quantities: tuple[list[float], list[float]]) -> Segment:
    """A glider that goes east over the antimeridian for an hour, down to 80 m."""
    t = T0 + 30.0 * np.arange(121)
    depth = 80 * (1 - np.abs(1 - np.arange(121) / 60))
    pressure = gsw.p_from_z(-depth, 50.0) * 1e4
    temperature = 15 - depth / 20
    conductivity = gsw.C_from_SP(35.0, temperature, pressure / 1e4) / 10
    whole = {
        "fix_lat": ([T0 - 60, T0 + 3660], [50.0, 50.0]),
        "fix_lon": ([T0 - 60, T0 + 3660], [179.99, -179.99]),
        "temperature": (t, temperature),
        "conductivity": (t, conductivity),
        "science_pressure": (t, pressure),
    } | quantities
    series = {name: Series(readonly(a), readonly(b)) for name, (a, b) in whole.items()}
    return Segment(SegmentId(T0, "g", "g-2023-1-1-1"), "m", "sbd", T0 + 3700, (0, 1, ""), series)


def test_samples_lie_where_and_when_they_were_taken():
    batch = batch_of(segment(), "sci_water_temp", BOX)
    assert batch.id == "g-2023-1-1-1@1700000000"
    assert np.diff(batch.t)[1:-1] == pytest.approx(60.0)
    assert batch.t[0] == pytest.approx(T0, abs=30)
    deepest = int(batch.value.argmin())
    assert batch.place[deepest] == pytest.approx([0.5, 0.5, 0.8], abs=0.01)
    assert batch.value[deepest] == pytest.approx(11.0, abs=0.05)
    assert batch.place[0, 0] < 0.5 < batch.place[-1, 0]
    assert batch.stand[1:-1] == pytest.approx(60.0)


def test_salinity_and_density_are_those_of_teos_10():
    assert batch_of(segment(), "salinity", BOX).value == pytest.approx(35.0, abs=1e-4)
    absolute = gsw.SA_from_SP(35.0, 0.0, 180.0, 50.0)
    density = gsw.sigma0(absolute, gsw.CT_from_t(absolute, 15.0, 0.0))
    assert batch_of(segment(), "density", BOX).value[0] == pytest.approx(density, abs=0.02)


def test_what_is_not_measured_or_not_in_the_box_makes_no_batch():
    assert batch_of(segment(), "oxygen", BOX) is None
    assert batch_of(segment(), "sci_water_temp", Box(40.0, 10.0, 41.0, 11.0, 0.0, 100.0)) is None
    assert batch_of(segment(fix_lat=([], []), fix_lon=([], [])), "density", BOX) is None
    assert batch_of(segment(conductivity=([], [])), "salinity", BOX) is None
    shallow = batch_of(segment(), "sci_water_temp", replace(BOX, bottom=40.0))
    assert 0 < len(shallow.t) < 50


def test_after_the_last_fix_dead_reckoning_says_where_it_is():
    reckoned = segment(
        fix_lat=([T0 - 60], [50.0]),
        fix_lon=([T0 - 60], [179.99]),
        dr_lat=([T0 - 120, T0, T0 + 4000], [10.0, 50.0, 50.1]),
        dr_lon=([T0 - 120, T0, T0 + 4000], [10.0, 179.99, 179.99]),
    )
    assert whereabouts(reckoned).lat.tolist() == [10.0, 50.0, 50.0, 50.1]
    assert batch_of(reckoned, "sci_water_temp", BOX).place[-1, 1] > 0.6


def test_bytes_and_back_and_what_is_no_batch():
    batch = batch_of(segment(), "sci_water_temp", BOX)
    data = packed(batch)
    assert len(data) < 121 * 10
    again = unpacked(data, batch.id, batch.glider)
    for name in ("t", "place", "value", "stand"):
        np.testing.assert_array_equal(getattr(again, name), getattr(batch, name))
    for bad in (b"", b"x" * 40, data[:-9]):
        with pytest.raises(ValueError, match="no batch"):
            unpacked(bad, "a", "b")
