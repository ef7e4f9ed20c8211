"""Dives as a NetCDF trajectory, one row a dive, and the section of a glider with its layers as profiles: by
the conventions CF 1.8 and ACDD 1.3."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import netCDF4
import numpy as np

from gliderwatch import __version__
from gliderwatch.errors import GliderwatchError
from gliderwatch.export.dives import COLUMNS, Column, iso
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.layers.casts import PROPERTIES
from gliderwatch.layers.section import Section
from gliderwatch.messages.formatting import clean
from gliderwatch.model import Array, Assessment

FLAGS = {-127: "no_judgement", 0: "normal", 1: "speed_out_of_range", 2: "measurements_disagree"}
SINCE = "seconds since 1970-01-01T00:00:00Z"
NOTHING: Mapping[str, str] = MappingProxyType({})
_FILL = -9999.0
_Value = Callable[[Assessment], float | None]
_AXES = (
    ("time", "T", "time", "time of the surfacing, or of the profile", SINCE),
    ("lat", "Y", "latitude", "latitude then", "degrees_north"),
    ("lon", "X", "longitude", "longitude then", "degrees_east"),
)


def write(
    path: Path,
    glider: str,
    dives: Sequence[Assessment],
    now: float,
    attributes: Mapping[str, str] = NOTHING,
) -> None:
    """Write the dives of a glider whose place is known, in order of time, with `attributes` of those whose
    data they are; made at `now` (s).

    Raises GliderwatchError where there is none, or the file cannot be written.
    """
    placed = [d for d in dives if d.lat is not None and d.lon is not None]
    if not placed:
        raise GliderwatchError(
            f"{clean(glider)} has no dive with a position: there is no trajectory to write"
        )
    try:
        with netCDF4.Dataset(path, "w", format="NETCDF4_CLASSIC") as data:
            t, lat, lon = (
                _values(placed, value) for value in (lambda d: d.t_surface, lambda d: d.lat, lambda d: d.lon)
            )
            coordinates(data, clean(glider), "obs", {"time": t, "lat": lat, "lon": lon})
            common = about(clean(glider), t, lat, lon, now) | _depths(data, placed)
            _flags(data, placed)
            for column in COLUMNS:
                _column(data, column, placed)
            data.setncatts(_about(clean(glider), common) | {**attributes})
    except (OSError, RuntimeError) as error:
        raise GliderwatchError(f"{path} cannot be written: {error}") from None


def coordinates(data: netCDF4.Dataset, glider: str, dimension: str, values: dict[str, Array]) -> None:
    """The name of the glider, the sphere, and the `values` (n,) of `time` (s), `lat`, `lon` (degrees)."""
    name = glider.encode() or b"unknown"
    data.createDimension(dimension, len(values["time"]))
    data.createDimension("name_strlen", len(name))
    trajectory = data.createVariable("trajectory", "S1", ("name_strlen",))
    trajectory.setncatts({"long_name": "name of the glider", "cf_role": "trajectory_id"})
    trajectory[:] = np.frombuffer(name, dtype="S1")
    crs = data.createVariable("crs", "i4")
    crs.setncatts(
        {
            "grid_mapping_name": "latitude_longitude",
            "long_name": "WGS 84",
            "semi_major_axis": 6378137.0,
            "inverse_flattening": 298.257223563,
            "epsg_code": "EPSG:4326",
        }
    )
    crs[...] = 0
    for short, axis, standard, long_name, unit in _AXES:
        attributes = {"standard_name": standard, "long_name": long_name, "units": unit, "axis": axis}
        attributes |= {"coverage_content_type": "coordinate"}
        attributes |= {"calendar": "standard"} if short == "time" else {}
        made = data.createVariable(short, "f8", (dimension,))
        made.setncatts(attributes)
        made[:] = values[short]


def _column(data: netCDF4.Dataset, column: Column, dives: Sequence[Assessment]) -> None:
    attributes = {"units": column.unit, "long_name": column.long_name}
    if column.standard_name:
        attributes["standard_name"] = column.standard_name
    if column.unit.startswith("seconds since"):
        attributes |= {"calendar": "standard", "coverage_content_type": "coordinate"}
    if "depth" in data.variables:
        attributes["coordinates"] = "time lat lon depth"
    variable(data, column.name, ("obs",), _values(dives, column.value), attributes)


def _flags(data: netCDF4.Dataset, dives: Sequence[Assessment]) -> None:
    variable = data.createVariable("flag", "i1", ("obs",))
    variable.setncatts(
        {
            "long_name": "flag of the dive",
            "standard_name": "quality_flag",
            "flag_values": np.array(list(FLAGS), dtype="i1"),
            "flag_meanings": " ".join(FLAGS.values()),
            "coordinates": "time lat lon",
            "coverage_content_type": "qualityInformation",
        }
    )
    variable[:] = np.array([-127 if d.flag is None else int(d.flag) for d in dives], dtype="i1")


def variable(
    data: netCDF4.Dataset, name: str, dimensions: tuple[str, ...], values: Array, attributes: dict[str, str]
) -> None:
    """A variable that is made by the program along the track; what is not finite is a fill value."""
    made = data.createVariable(name, "f8", dimensions, fill_value=_FILL)
    made.setncatts(
        {"coordinates": "time lat lon", "coverage_content_type": "modelResult", "grid_mapping": "crs"}
        | attributes
    )
    made[:] = np.where(np.isfinite(values), values, _FILL)


def _values(dives: Sequence[Assessment], value: _Value) -> Array:
    return np.array([np.nan if (x := value(d)) is None else x for d in dives], dtype=float)


def _about(glider: str, common: dict[str, object]) -> dict[str, object]:
    """The global attributes of a trajectory of dives."""
    return common | {
        "featureType": "trajectory",
        "title": f"Speed through the water and current of the underwater glider {glider}",
        "summary": "One row a dive of a Slocum glider: its speed through the water and the mean current as "
        "estimated from satellite fixes, headings and the current that the glider reckons, with standard "
        "errors, and a flag that says whether the speed is out of its normal range.",
        "keywords": "EARTH SCIENCE > OCEANS > OCEAN CIRCULATION > OCEAN CURRENTS",
        "id": f"gliderwatch-{glider}-{str(common['time_coverage_start'])[:10]}",
        "comment": "flag -127: the dive could not be judged; time, lat, lon: of the surfacing; depth_bounds: "
        "the depths that speed and current are means over",
    }


def _depths(data: netCDF4.Dataset, dives: Sequence[Assessment]) -> dict[str, object]:
    """The depths that each row is a mean over, as their middle and its bounds, and the global attributes of
    them."""
    deepest = _values(dives, lambda d: d.evidence.get("depth_max"))
    if not np.isfinite(deepest).any():
        return {}
    data.createDimension("nv", 2)
    depth = data.createVariable("depth", "f8", ("obs",), fill_value=_FILL)
    depth.setncatts(
        {
            "standard_name": "depth",
            "long_name": "middle of the depths of the dive",
            "units": "m",
            "positive": "down",
            "axis": "Z",
            "bounds": "depth_bounds",
            "coverage_content_type": "coordinate",
        }
    )
    depth[:] = np.where(np.isfinite(deepest), deepest / 2, _FILL)
    bounds = data.createVariable("depth_bounds", "f8", ("obs", "nv"))  # its fill value is that of depth
    bounds[:] = np.where(np.isfinite(deepest)[:, None], np.outer(deepest, [0.0, 1.0]), _FILL)
    return vertical(float(np.nanmin(deepest / 2)), float(np.nanmax(deepest / 2)))


def vertical(top: float, bottom: float) -> dict[str, object]:
    """The global attributes of the depths (m) that a file is of."""
    return {
        "geospatial_vertical_min": top,
        "geospatial_vertical_max": bottom,
        "geospatial_vertical_positive": "down",
        "geospatial_vertical_units": "m",
        "geospatial_bounds_vertical_crs": "EPSG:5831",
    }


def about(glider: str, t: Array, lat: Array, lon: Array, now: float) -> dict[str, object]:
    """The global attributes that all files have: who made it, when and where. `glider` may be a fleet.

    `t` (n,) in s, `lat` and `lon` (n,) in degrees.
    """
    made = iso(now)
    south, north, west, east = (float(x) for x in (lat.min(), lat.max(), lon.min(), lon.max()))
    corners = ((south, west), (south, east), (north, east), (north, west), (south, west))
    return {
        "Conventions": "CF-1.8, ACDD-1.3",
        "keywords_vocabulary": "GCMD Science Keywords",
        "naming_authority": "gliderwatch",
        "source": "underwater glider",
        "platform": glider,
        "processing_level": "estimated from real-time data, flagged automatically",
        "history": f"{made} written by gliderwatch {__version__}",
        "standard_name_vocabulary": "CF Standard Name Table v93",
        "date_created": made,
        "date_modified": made,
        "creator_name": "gliderwatch",
        "geospatial_lat_min": south,
        "geospatial_lat_max": north,
        "geospatial_lat_units": "degrees_north",
        "geospatial_lon_min": west,
        "geospatial_lon_max": east,
        "geospatial_lon_units": "degrees_east",
        "geospatial_bounds": f"POLYGON (({', '.join(f'{x:.5f} {y:.5f}' for x, y in corners)}))",
        "geospatial_bounds_crs": "EPSG:4326",
        "time_coverage_start": iso(float(t[0])),
        "time_coverage_end": iso(float(t[-1])),
        "time_coverage_duration": f"PT{round(float(t[-1] - t[0]))}S",
        "time_coverage_resolution": f"PT{round(float(np.median(np.diff(t)))) if len(t) > 1 else 0}S",
    }


def write_section(
    path: Path,
    glider: str,
    found: Section,
    advice: Sequence[LayerAdvice],
    dives: Sequence[Assessment],
    now: float,
    attributes: Mapping[str, str] = NOTHING,
) -> None:
    """Write a section, what was found and advised after each of its profiles, and where they were, with
    `attributes` of those whose data they are; made at `now` (s).

    `advice` (n,) belongs to the profiles of `found`; the places of `dives` are interpolated to them.
    Raises GliderwatchError where there is no profile or no place, or the file cannot be written.
    """
    name = clean(glider)
    placed = [d for d in dives if d.lat is not None and d.lon is not None]
    if not advice or not placed:
        raise GliderwatchError(
            f"{name} has no layers with a position: set gliders.{name}.layers, and see that its science "
            "files (tbd, tcd, ebd) come"
        )
    try:
        with netCDF4.Dataset(path, "w", format="NETCDF4_CLASSIC") as data:
            lat, lon = _places(found.t, placed)
            _coordinates(data, name, found, lat, lon)
            _property(data, found, advice[0].sensor)
            _layers(data, advice)
            _bands(data, advice)
            data.setncatts(_about_section(name, found, lat, lon, now) | {**attributes})
    except (OSError, RuntimeError) as error:
        raise GliderwatchError(f"{path} cannot be written: {error}") from None


def _places(t: Array, placed: Sequence[Assessment]) -> tuple[Array, Array]:
    times = np.array([d.t_surface for d in placed])
    lat = np.interp(t, times, np.array([d.lat for d in placed], dtype=float))
    lon = np.unwrap(np.array([d.lon for d in placed], dtype=float), period=360.0)
    return lat, (np.interp(t, times, lon) + 180.0) % 360.0 - 180.0


def _coordinates(data: netCDF4.Dataset, name: str, found: Section, lat: Array, lon: Array) -> None:
    data.createDimension("z", len(found.edges) - 1)
    data.createDimension("nv", 2)
    coordinates(data, name, "profile", {"time": found.t, "lat": lat, "lon": lon})
    depth = data.createVariable("depth", "f8", ("z",))
    depth.setncatts(
        {
            "standard_name": "depth",
            "long_name": "middle of the bin",
            "units": "m",
            "positive": "down",
            "axis": "Z",
            "bounds": "depth_bounds",
            "coverage_content_type": "coordinate",
        }
    )
    depth[:] = (found.edges[:-1] + found.edges[1:]) / 2
    data.createVariable("depth_bounds", "f8", ("z", "nv"))[:] = np.column_stack(
        (found.edges[:-1], found.edges[1:])
    )
    number = data.createVariable("profile", "i4", ("profile",))
    number.setncatts({"cf_role": "profile_id", "long_name": "number of the profile, one a segment"})
    number[:] = np.arange(1, len(found.t) + 1)


def _property(data: netCDF4.Dataset, found: Section, sensor: str) -> None:
    unit, standard = PROPERTIES.get(sensor, ("1", ""))
    attributes = {"units": unit, "long_name": f"{sensor}, mean of the casts of a segment"}
    attributes |= {"standard_name": standard} if standard else {}
    variable(data, clean(sensor), ("profile", "z"), found.value, attributes)


def _layers(data: netCDF4.Dataset, advice: Sequence[LayerAdvice]) -> None:
    """The layers of each profile, from the surface down."""
    most = max((len(one.layers) for one in advice if one.layers), default=1)
    data.createDimension("layer", most)
    unit = f"{PROPERTIES.get(advice[0].sensor, ('1', ''))[0]} m-1"
    for field, units, words in (
        ("top", "m", "upper limit of the layer"),
        ("bottom", "m", "lower limit of the layer"),
        ("strength", unit, "largest gradient in the layer, down positive"),
        ("confidence", "1", "part of the casts that show the layer"),
    ):
        rows = [[getattr(layer, field) for layer in one.layers] for one in advice]
        values = np.array([row + [np.nan] * (most - len(row)) for row in rows], dtype=float)
        variable(data, f"layer_{field}", ("profile", "layer"), values, {"units": units, "long_name": words})


def _bands(data: netCDF4.Dataset, advice: Sequence[LayerAdvice]) -> None:
    """The band advised after each profile; none where all depths were."""
    for field, words in (("top", "climb to"), ("bottom", "dive to")):
        values = [np.nan if one.band is None else getattr(one.band, field) for one in advice]
        attributes = {"units": "m", "long_name": f"depth to {words}, advised for the next segment"}
        variable(data, f"band_{field}", ("profile",), np.array(values), attributes)


def _about_section(name: str, found: Section, lat: Array, lon: Array, now: float) -> dict[str, object]:
    common = about(name, found.t, lat, lon, now) | vertical(0.0, float(found.edges[-1]))
    return common | {
        "featureType": "profile",
        "title": f"Section and layers along the way of the underwater glider {name}",
        "summary": "One profile a segment of a Slocum glider, the mean of its casts, with the layers in "
        "which the property changes most with depth, and the band of depths advised for the next segment.",
        "keywords": "EARTH SCIENCE > OCEANS > OCEAN TEMPERATURE > THERMOCLINE",
        "id": f"gliderwatch-{name}-layers",
        "comment": "no layer: fill values; no band: all depths were advised",
    }
