"""Ocean models and radar files as they come: read, or refused with the file and a cure."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from gliderwatch.config import load
from gliderwatch.errors import GliderwatchError, Quarantine, Retry
from gliderwatch.sea.ocean_field import Field
from gliderwatch.sea.ocean_files import Box, read_field
from gliderwatch.service.runtime import OceanCache

HOUR = 3600.0
T0 = 1_714_521_600.0  # 2024-05-01
LAT, LON, HOURS = np.arange(26.0, 29.5, 0.5), np.arange(-86.0, -82.5, 0.5), np.arange(0.0, 24.0, 6.0)


def east(hours, depth, lat, lon):
    return 0.3 + 0.005 * hours - 0.002 * depth + 0.04 * (lat - 27) + 0.03 * (lon + 84)


def dataset(hours=HOURS, depth=None, lat=LAT, lon=LON, names=("uo", "vo"), standard=None) -> xr.Dataset:
    """A file of a model: the current is linear in everything."""
    levels = np.zeros(1) if depth is None else np.asarray(depth, dtype=float)
    degrees = (np.asarray(lon) + 180) % 360 - 180
    values = east(*np.meshgrid(hours, levels, lat, degrees, indexing="ij"))
    dims = ("time", "depth", "lat", "lon")
    if depth is None:
        values, dims = values[:, 0], ("time", "lat", "lon")
    standards = standard or ("eastward_sea_water_velocity", "northward_sea_water_velocity")
    variables = {
        name: (dims, sign * values, {"units": "m s-1", "standard_name": each})
        for name, each, sign in zip(names, standards, (1, -1), strict=True)
    }
    coords = {
        "time": ("time", hours, {"units": "hours since 2024-05-01 00:00:00", "standard_name": "time"}),
        "lat": ("lat", lat, {"units": "degrees_north", "standard_name": "latitude"}),
        "lon": ("lon", lon, {"units": "degrees_east", "standard_name": "longitude"}),
    }
    if depth is not None:
        coords["depth"] = ("depth", levels, {"units": "m", "positive": "down", "standard_name": "depth"})
    return xr.Dataset(variables, coords)


def written(folder: Path, data: xr.Dataset, name="model.nc", **encoding) -> str:
    data.to_netcdf(folder / name, encoding=encoding)
    return str(folder / name)


def is_right(field: Field, hours=9.0, lat=27.3, lon=-84.2, depth=0.0, level=0.0) -> None:
    expected = float(east(hours, level, lat, lon))
    assert field.at(T0 + hours * HOUR, lat, lon, depth) == pytest.approx((expected, -expected), abs=1e-6)


def test_a_model_with_depths(tmp_path):
    field = read_field([written(tmp_path, dataset(depth=(0, 10, 50)))])
    is_right(field, depth=40.0, level=20.0)
    assert field.source == "model.nc" and not field.u.flags.writeable


@pytest.mark.parametrize("kind", ["surface_{}_sea_water_velocity", "barotropic_{}_sea_water_velocity"])
def test_other_standard_names(tmp_path, kind):
    names = (kind.format("eastward"), kind.format("northward"))
    is_right(read_field([written(tmp_path, dataset(names=("a", "b"), standard=names))]))


@pytest.mark.parametrize("names", [("u", "v"), ("water_u", "water_v"), ("uo", "vo")])
def test_common_names_where_no_standard_name_helps(tmp_path, names):
    data = dataset(names=names, standard=("x", "y"))
    data["wind_u"] = data[names[0]] * 40
    is_right(read_field([written(tmp_path, data)]))


def test_longitudes_from_0_to_360_and_latitudes_from_the_north(tmp_path):
    is_right(read_field([written(tmp_path, dataset(lat=LAT[::-1], lon=LON + 360))]))


def test_depths_from_the_bottom_up_and_negative(tmp_path):
    data = dataset(depth=(0.0, 10.0, 50.0)).isel(depth=slice(None, None, -1))
    data = data.assign_coords(depth=("depth", -data.depth.values, {"units": "m", "standard_name": "depth"}))
    is_right(read_field([written(tmp_path, data)]), depth=40.0, level=20.0)


def test_a_globe_is_closed(tmp_path):
    lon = np.arange(0.0, 360.0, 10.0)
    data = dataset(lon=lon)
    field = read_field([written(tmp_path, data)])
    u = data["uo"].values[0]
    found = field.at(T0, 27.0, -5.0, 0.0)
    row = int(np.argwhere(LAT == 27.0)[0, 0])
    assert found[0] == pytest.approx((u[row, -1] + u[row, 0]) / 2)
    assert field.at(T0, 27.0, 175.0, 0.0)[0] == pytest.approx((u[row, 17] + u[row, 18]) / 2)


def test_an_area_cuts_what_is_read_and_leaves_a_margin(tmp_path):
    path = written(tmp_path, dataset(lon=LON + 360))
    field = read_field([path], Box(27.1, 27.4, -84.3, -84.1))
    assert field.u.shape[2:] == (2, 2)
    is_right(field)
    globe = written(tmp_path, dataset(lon=np.arange(-180.0, 180.0, 10.0)), "globe.nc")
    across = read_field([globe], Box(26.5, 28.0, 172.0, -172.0))
    assert len(across.lon) == 3 and not isinstance(across.at(T0, 27.0, 179.0, 0.0), str)
    with pytest.raises(Quarantine, match=r"model\.nc covers 26 to 29 degrees only, the area is 40 to 41"):
        read_field([path], Box(40.0, 41.0, -84.3, -84.1))


def test_a_grid_over_the_date_line(tmp_path):
    lon = np.array([178.0, 179.0, -180.0, -179.0])
    data = dataset(lon=lon)
    field = read_field([written(tmp_path, data)])
    u = data["uo"].values[0]
    assert field.at(T0, 26.0, 179.5, 0.0)[0] == pytest.approx((u[0, 1] + u[0, 2]) / 2)
    assert "outside" in field.at(T0, 26.0, 0.0, 0.0)


def test_times_in_any_order(tmp_path):
    is_right(read_field([written(tmp_path, dataset(hours=HOURS[::-1]))]))


def test_packed_values_and_fill_values(tmp_path):
    data = dataset()
    data["uo"][:, 0, 0] = np.nan
    packed = {"dtype": "int16", "scale_factor": 1e-4, "_FillValue": -32768}
    field = read_field([written(tmp_path, data, uo=packed)])
    assert "land or a gap" in field.at(T0, 26.0, -86.0, 0.0)
    expected = east(9, 0, 27.3, -84.2)
    assert field.at(T0 + 9 * HOUR, 27.3, -84.2, 0.0)[0] == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(("value", "current"), [(-9999.0, False), (11.0, False), (9.0, True)])
def test_a_fill_value_that_nobody_calls_one(tmp_path, value, current):
    data = dataset()
    data["uo"][:, 0, 0] = value
    data["vo"][:, 0, 0] = value
    field = read_field([written(tmp_path, data, uo={"_FillValue": None}, vo={"_FillValue": None})])
    assert ("land or a gap" in field.at(T0, 26.0, -86.0, 0.0)) != current


@pytest.mark.parametrize("units", ["cm s-1", "cm/s", "cm sec^-1"])
def test_centimetres(tmp_path, units):
    data = dataset()
    for name in ("uo", "vo"):
        data[name] = data[name] * 100
        data[name].attrs = {
            "units": units,
            "standard_name": ("eastward" if name == "uo" else "northward") + "_sea_water_velocity",
        }
    is_right(read_field([written(tmp_path, data)]))


@pytest.mark.parametrize("calendar", ["julian", "noleap", "proleptic_gregorian"])
def test_calendars(tmp_path, calendar):
    data = dataset()
    data["time"] = ("time", HOURS, {"units": "hours since 2024-05-01", "calendar": calendar})
    is_right(read_field([written(tmp_path, data)]))


def test_a_forecast_with_a_time_that_is_none(tmp_path):
    data = dataset()
    data["tau"] = ("time", HOURS, {"units": "hours since analysis"})
    is_right(read_field([written(tmp_path, data)]))


def test_a_single_time_and_a_single_depth_without_axes(tmp_path):
    data = dataset(hours=np.array([9.0]), depth=(0.0,)).isel(time=0, depth=0)
    is_right(read_field([written(tmp_path, data)]))


def test_axes_in_any_order_and_one_of_length_one(tmp_path):
    data = (
        dataset(depth=(0, 10, 50))
        .expand_dims(ensemble=1)
        .transpose("lon", "depth", "ensemble", "time", "lat")
    )
    is_right(read_field([written(tmp_path, data)]), depth=40.0, level=20.0)


def test_many_files_are_one_field_and_the_newest_run_counts(tmp_path):
    (tmp_path / "runs" / "b").mkdir(parents=True)
    written(tmp_path / "runs", dataset(hours=np.array([0.0, 6.0])), "run_01.nc")
    newer = dataset(hours=np.array([6.0, 12.0])) + 0.1
    for name, each in dataset().data_vars.items():
        newer[name].attrs = each.attrs
    newer["time"].attrs = dataset()["time"].attrs
    written(tmp_path / "runs" / "b", newer, "run_02.nc")
    field = read_field([str(tmp_path / "runs" / "**" / "*.nc"), str(tmp_path / "runs" / "run_01.nc")])
    assert field.source == "run_01.nc to run_02.nc"
    assert len(field.t) == 3
    found = [field.at(T0 + h * HOUR, 27.0, -84.0, 0.0)[0] for h in (0, 6, 12)]
    expected = [0.3 + 0.005 * h + more for h, more in ((0, 0.0), (6, 0.1), (12, 0.1))]
    assert found == pytest.approx(expected)


def test_a_radar_file(tmp_path):
    standard = ("surface_eastward_sea_water_velocity", "surface_northward_sea_water_velocity")
    data = dataset(hours=np.arange(24.0), names=("u", "v"), standard=standard)
    data["u"][5, 2:4, 2:4] = np.nan
    data["v"][5, 2:4, 2:4] = np.nan
    field = read_field([written(tmp_path, data)])
    assert "land or a gap" in field.at(T0 + 5 * HOUR, 27.2, -84.8, 30.0)
    is_right(field, hours=7.0, lat=27.2, lon=-84.8, depth=30.0)


# --------------------------------------------------------------------------- refused


def no_current(data):
    return data.drop_vars("vo")


def curvilinear(data):
    lat, lon = np.meshgrid(LAT, LON, indexing="ij")
    data = data.rename(lat="y", lon="x").drop_vars(["y", "x"])
    return data.assign_coords(
        lat=(("y", "x"), lat, {"units": "degrees_north"}), lon=(("y", "x"), lon, {"units": "degrees_east"})
    )


def no_units_of_time(data):
    data["time"] = ("time", HOURS, {"standard_name": "time"})
    return data


def no_time(data):
    return data.isel(time=0).drop_vars("time")


def knots(data):
    data["uo"].attrs["units"] = "knots"
    return data


def ensemble(data):
    return xr.concat([data, data], "member")


def pressure(data):
    data = data.expand_dims(depth=[0.0, 10.0])
    data["depth"].attrs = {"units": "dbar", "standard_name": "depth"}
    return data


def days_that_are_none(data):
    data["time"] = ("time", HOURS / 6 + 58, {"units": "days since 2024-01-01", "calendar": "360_day"})
    return data


def staggered(data):
    data["vo"] = data["vo"].rename(lat="lat_v")
    return data


def one_row(data):
    return data.isel(lat=slice(0, 1))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (no_current, r"no eastward and northward current \(variables: uo\): give .* standard_name"),
        (curvilinear, "latitude and longitude are not the axes of the grid .*cdo remapbil"),
        (no_units_of_time, "its times have no units: say"),
        (no_time, "uo has no coordinate of time: add one"),
        (knots, "uo is in 'knots': convert it to m s-1"),
        (ensemble, "uo has an axis member .*choose one"),
        (pressure, "depths are in 'dbar', not in m"),
        (days_that_are_none, "is not a date of the usual calendar"),
        (staggered, "uo and vo are on different grids"),
        (one_row, "needs 2 latitudes and 2 longitudes"),
    ],
)
def test_what_cannot_be_used_is_refused_with_the_file_and_a_cure(tmp_path, change, words):
    path = written(tmp_path, change(dataset()))
    with pytest.raises(Quarantine, match=words) as refused:
        read_field([path])
    assert path in str(refused.value)


def test_no_file_may_come_later(tmp_path):
    with pytest.raises(Retry, match=r"no file matches .*nothing.*check the pattern"):
        read_field([str(tmp_path / "nothing*.nc")])


def test_two_models_are_not_one(tmp_path):
    written(tmp_path, dataset(), "a.nc")
    written(tmp_path, dataset(lat=LAT + 0.1), "b.nc")
    with pytest.raises(Quarantine, match=r"b\.nc has another grid than .*a\.nc"):
        read_field([str(tmp_path / "*.nc")])


@pytest.mark.parametrize("keep", [0, 10, 500, 4000])
def test_a_broken_file_is_a_word_and_not_a_crash(tmp_path, keep):
    path = Path(written(tmp_path, dataset()))
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(GliderwatchError, match=r"model\.nc cannot be"):
        read_field([str(path)])


def test_too_much_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr("gliderwatch.sea.ocean_files.MOST", 100)
    with pytest.raises(Quarantine, match="too large to be held in memory: set an area"):
        read_field([written(tmp_path, dataset())])


def test_garbage_is_a_word(tmp_path):
    (tmp_path / "notes.nc").write_text("not a NetCDF file")
    with pytest.raises(GliderwatchError, match=r"notes\.nc cannot be"):
        read_field([str(tmp_path / "notes.nc")])


def test_the_daemon_reads_the_files_again_when_they_change(tmp_path: Path) -> None:
    config = tmp_path / "gliderwatch.yml"
    config.write_text(
        "dockserver: {roots: [.]}\nocean: {files: [model/*.nc]}\n"
        "gliders: {with: {reference: model}, without: }\n",
        encoding="utf-8",
    )
    ocean = OceanCache(load(config))
    assert ocean.field("with") is None  # no file yet: the dive goes without, and a warning says so
    (tmp_path / "model").mkdir()
    written(tmp_path / "model", dataset(), "a.nc")
    first = ocean.field("with")
    assert first is not None and first.source == "a.nc"
    assert ocean.field("with") is first and ocean.field("without") is None
    (tmp_path / "model" / "a.nc").rename(tmp_path / "model" / "b.nc")
    again = ocean.field("with")
    assert again is not None and again.source == "b.nc"
