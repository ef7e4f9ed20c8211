"""Currents of a model on a grid: interpolated, averaged over depth, and refused in words."""

import numpy as np
import pytest

from gliderwatch.model import Fix, readonly
from gliderwatch.sea.ocean_field import Field

HOUR = 3600.0
T0 = 1_714_521_600.0  # 2024-05-01
LAT, LON = np.array([27.0, 27.5, 28.5]), np.array([-85.0, -84.0, -83.5])


def linear(t, depth, lat, lon):
    """A current that is linear in everything, so that interpolation is exact."""
    u = 0.1 + 1e-6 * (t - T0) + 0.02 * (lat - 27) - 0.03 * (lon + 85) - 1e-3 * depth
    return u, -2 * u


def field(depth=(), times=(0, 3, 6, 9), stale=24.0, lon=LON, u=None) -> Field:
    t = T0 + HOUR * np.array(times, dtype=float)
    levels = np.array(depth) if len(depth) else np.zeros(1)
    grid = np.meshgrid(t, levels, LAT, np.asarray(lon), indexing="ij")
    east, north = linear(*grid)
    if u is not None:
        east, north = u(east), u(north)
    return Field(
        readonly(t), readonly(depth), readonly(LAT), readonly(lon), readonly(east), readonly(north),
        "model.nc", stale * HOUR,
    )  # fmt: skip


@pytest.mark.parametrize("hours", [0.0, 1.5, 4.0, 9.0])
@pytest.mark.parametrize(("lat", "lon"), [(27.0, -85.0), (27.2, -84.7), (28.5, -83.5), (28.0, -84.0)])
def test_linear_in_time_and_space(hours, lat, lon):
    found = field().at(T0 + hours * HOUR, lat, lon, 50.0)
    assert found == pytest.approx(linear(T0 + hours * HOUR, 0.0, lat, lon))


@pytest.mark.parametrize("deepest", [5.0, 20.0, 37.0, 100.0])
def test_mean_from_the_surface_to_the_depth_of_the_dive(deepest):
    found = field(depth=(0.0, 10.0, 40.0, 100.0)).at(T0, 27.2, -84.7, deepest)
    assert found == pytest.approx(linear(T0, deepest / 2, 27.2, -84.7))


def test_a_model_that_ends_above_the_dive_is_averaged_to_its_own_end():
    found = field(depth=(0.0, 10.0, 40.0)).at(T0, 27.2, -84.7, 500.0)
    assert found == pytest.approx(linear(T0, 20.0, 27.2, -84.7))


def test_above_the_first_level_the_current_is_that_of_the_first_level():
    found = field(depth=(5.0, 15.0)).at(T0, 27.2, -84.7, 15.0)
    assert found == pytest.approx(linear(T0, (5 * 5 + 10 * 10) / 15, 27.2, -84.7))
    assert field(depth=(5.0, 15.0)).at(T0, 27.2, -84.7, 3.0) == pytest.approx(linear(T0, 5.0, 27.2, -84.7))


def test_below_the_bottom_there_is_nothing_to_average():
    def shallow(u):
        u = u.copy()
        u[:, 2:] = np.nan
        return u

    found = field(depth=(0.0, 20.0, 40.0, 60.0), u=shallow).at(T0, 27.2, -84.7, 60.0)
    top = [linear(T0, z, 27.2, -84.7)[0] for z in (0.0, 20.0)]
    assert found[0] == pytest.approx((10 * top[0] + 20 * top[1]) / 30)


def test_on_land_there_is_no_current():
    def land(u):
        u = u.copy()
        u[:, :, 1:, 1:] = np.nan
        return u

    one = field(u=land)
    assert one.at(T0, 28.2, -83.7, 50.0) == "model.nc has no current at 28.200, -83.700: land or a gap"
    assert isinstance(one.at(T0, 27.4, -84.1, 50.0), str)
    near = one.at(T0, 27.1, -84.9, 50.0)
    assert near[0] == pytest.approx(linear(T0, 0, 27.1, -84.9)[0], abs=0.01)
    assert one.at(T0, 27.0, -83.5, 50.0) == pytest.approx(linear(T0, 0, 27.0, -83.5))


@pytest.mark.parametrize(("lat", "lon"), [(26.9, -84.0), (28.6, -84.0), (27.5, -85.1), (27.5, -83.4)])
def test_outside_the_area(lat, lon):
    told = field().at(T0, lat, lon, 50.0)
    assert told.endswith(
        "is outside the area of model.nc (latitude 27.00 to 28.50, longitude -85.00 to -83.50)"
    )


def test_longitudes_of_either_kind():
    east = field(lon=LON + 360)
    shifted = linear(T0, 0.0, 27.2, -84.7 + 360)
    assert east.at(T0, 27.2, -84.7, 50.0) == pytest.approx(shifted)
    assert east.at(T0, 27.2, 275.3, 50.0) == pytest.approx(shifted)
    across = field(lon=np.array([179.0, 180.0, 181.0]))
    assert across.at(T0, 27.2, -179.5, 50.0) == pytest.approx(linear(T0, 0.0, 27.2, 180.5))


def test_after_the_end_it_holds_for_a_day_and_is_stale_then():
    last = linear(T0 + 9 * HOUR, 0.0, 27.2, -84.7)
    assert field().at(T0 + 32.9 * HOUR, 27.2, -84.7, 50.0) == pytest.approx(last)
    told = field().at(T0 + 33.1 * HOUR, 27.2, -84.7, 50.0)
    assert told == "model.nc is stale: it ends at 2024-05-01 09:00 UTC, 24 h before; bring newer files"
    assert isinstance(field(stale=1).at(T0 + 10.1 * HOUR, 27.2, -84.7, 50.0), str)


def test_before_the_beginning_it_holds_for_a_step():
    assert field().at(T0 - 2.9 * HOUR, 27.2, -84.7, 50.0) == pytest.approx(linear(T0, 0.0, 27.2, -84.7))
    assert "begins at 2024-05-01 00:00 UTC only" in field().at(T0 - 3.1 * HOUR, 27.2, -84.7, 50.0)


def test_no_bridge_over_a_gap_of_days():
    one = field(times=(0, 3, 50, 53))
    assert one.at(T0 + 20 * HOUR, 27.2, -84.7, 50.0).startswith("model.nc has a gap from 2024-05-01 03:00")
    assert not isinstance(one.at(T0 + 51 * HOUR, 27.2, -84.7, 50.0), str)


def test_the_mean_along_a_dive():
    start, end = Fix(T0 + HOUR, 27.1, -84.9), Fix(T0 + 4 * HOUR, 27.4, -84.2)
    middle = linear(T0 + 2.5 * HOUR, 0.0, 27.25, -84.55)
    assert field().between(start, end, 50.0) == pytest.approx(middle)
    assert "outside" in field().between(start, Fix(T0 + 4 * HOUR, 27.4, -83.0), 50.0)


def test_the_mean_along_a_dive_over_the_date_line():
    one = field(lon=np.array([179.0, 180.0, 181.0]))
    found = one.between(Fix(T0, 27.2, 179.5), Fix(T0, 27.2, -179.5), 50.0)
    assert found == pytest.approx(linear(T0, 0.0, 27.2, 180.0))


def test_a_single_time_holds_within_its_limit():
    one = field(times=(0,))
    assert one.at(T0 + HOUR, 27.2, -84.7, 5.0) == pytest.approx(linear(T0, 0.0, 27.2, -84.7))
    assert isinstance(one.at(T0 - 60, 27.2, -84.7, 5.0), str)


def test_a_grid_that_is_none_is_refused():
    good = field()
    with pytest.raises(ValueError, match="must increase"):
        Field(good.t, good.depth, good.lat[::-1], good.lon, good.u, good.v, "model.nc")
    with pytest.raises(ValueError, match="shapes"):
        Field(good.t, good.depth, good.lat[:2], good.lon, good.u, good.v, "model.nc")
    with pytest.raises(ValueError, match="too small"):
        Field(good.t, good.depth, good.lat[:1], good.lon, good.u[:, :, :1], good.v[:, :, :1], "model.nc")
