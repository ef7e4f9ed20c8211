"""The section of a glider and the layers in it as a NetCDF file of profiles, by CF 1.8 and ACDD 1.3."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import netCDF4
import numpy as np

from gliderwatch.errors import GliderwatchError
from gliderwatch.export import netcdf
from gliderwatch.export.properties import PROPERTIES
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.layers.section import Section
from gliderwatch.messages.formatting import clean
from gliderwatch.model import Array, Assessment


def write(
    path: Path,
    glider: str,
    found: Section,
    advice: Sequence[LayerAdvice],
    dives: Sequence[Assessment],
    now: float,
    attributes: Mapping[str, str] = netcdf.NOTHING,
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
            data.setncatts(_about(name, found, lat, lon, now) | {**attributes})
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
    netcdf.coordinates(data, name, "profile", {"time": found.t, "lat": lat, "lon": lon})
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
    netcdf.variable(data, clean(sensor), ("profile", "z"), found.value, attributes)


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
        netcdf.variable(
            data, f"layer_{field}", ("profile", "layer"), values, {"units": units, "long_name": words}
        )


def _bands(data: netCDF4.Dataset, advice: Sequence[LayerAdvice]) -> None:
    """The band advised after each profile; none where all depths were."""
    for field, words in (("top", "climb to"), ("bottom", "dive to")):
        values = [np.nan if one.band is None else getattr(one.band, field) for one in advice]
        attributes = {"units": "m", "long_name": f"depth to {words}, advised for the next segment"}
        netcdf.variable(data, f"band_{field}", ("profile",), np.array(values), attributes)


def _about(name: str, found: Section, lat: Array, lon: Array, now: float) -> dict[str, object]:
    common = netcdf.about(name, found.t, lat, lon, now) | netcdf.vertical(0.0, float(found.edges[-1]))
    return common | {
        "featureType": "profile",
        "title": f"Section and layers along the way of the underwater glider {name}",
        "summary": "One profile a segment of a Slocum glider, the mean of its casts, with the layers in "
        "which the property changes most with depth, and the band of depths advised for the next segment.",
        "keywords": "EARTH SCIENCE > OCEANS > OCEAN TEMPERATURE > THERMOCLINE",
        "id": f"gliderwatch-{name}-layers",
        "comment": "no layer: fill values; no band: all depths were advised",
    }
