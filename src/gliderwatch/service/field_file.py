"""A field and its uncertainty as a CF NetCDF file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from netCDF4 import Dataset

from gliderwatch import __version__
from gliderwatch.errors import GliderwatchError
from gliderwatch.fleet.constants import BIN, SENSORS_OF_FIELDS
from gliderwatch.fleet.scalar_field import at, estimate
from gliderwatch.model import Array
from gliderwatch.service.fields import FleetField
from gliderwatch.store.state_file import Store

ACROSS, DOWN = 31, 21
"""Points of the file from side to side and from top to bottom: five between two Gaussians, and a top and a
bottom."""
_NAMES = {
    "sci_water_temp": ("temperature", "sea_water_temperature"),
    "salinity": ("salinity", "sea_water_practical_salinity"),
    "density": ("density", "sea_water_sigma_theta"),
    "oxygen": ("oxygen", "mole_concentration_of_dissolved_molecular_oxygen_in_sea_water"),
}


def write_field(store: Store, field: FleetField, path: Path, t: float | None = None) -> float:
    """Write what is known of a field at a time (s; None: of its last samples) by the samples until then, to
    the hour; that time.

    Raises GliderwatchError where there are no samples, or the file cannot be written.
    """
    if t is None:
        extent = store.fields.extent(field.name)
        t = extent[2] if extent is not None else None
    checkpoint = None if t is None else store.fields.before(field.name, t + BIN, field.params)
    if t is None or checkpoint is None:
        raise GliderwatchError(
            f"there are no samples for the field {field.name}: do the gliders send science files (tbd, tcd, "
            "ebd), and are their caches there? gliderwatch status says what came"
        )
    known = at(checkpoint, t, field.params)
    box = field.box
    lat = np.linspace(box.south, box.north, ACROSS)
    lon = box.west + np.linspace(0, (box.east - box.west) % 360.0, ACROSS)
    depth = np.linspace(box.top, box.bottom, DOWN)
    z, y, x = np.meshgrid(depth, lat, lon, indexing="ij")
    values = estimate(known, box.place(y.ravel(), x.ravel(), z.ravel()), field.params)
    try:
        with Dataset(path, "w", format="NETCDF4") as file:
            _fill(file, field, t, (depth, lat, lon), values)
    except OSError as error:
        raise GliderwatchError(f"{path} cannot be written: {error.strerror or error}") from None
    return t


def _fill(
    file: Dataset, field: FleetField, t: float, axes: tuple[Array, Array, Array], values: tuple[Array, Array]
) -> None:
    file.setncatts(
        {
            "Conventions": "CF-1.8",
            "title": f"{field.name}: field estimated from the samples of gliders",
            "source": f"gliderwatch {__version__}, estimator {field.params.estimator}",
            "references": "Distributed estimation of 3D fields by underwater gliders, CMRE-PR-2019-095",
        }
    )
    spaces = {
        "time": (np.array([t]), {"units": "seconds since 1970-01-01T00:00:00Z", "standard_name": "time"}),
        "depth": (axes[0], {"units": "m", "standard_name": "depth", "positive": "down"}),
        "latitude": (axes[1], {"units": "degrees_north", "standard_name": "latitude"}),
        "longitude": (axes[2], {"units": "degrees_east", "standard_name": "longitude"}),
    }
    for name, (points, attributes) in spaces.items():
        file.createDimension(name, len(points))
        variable = file.createVariable(name, "f8", (name,))
        variable.setncatts(attributes)
        variable[:] = points
    name, standard = _NAMES[field.sensor]
    unit = SENSORS_OF_FIELDS[field.sensor][3]
    shape = (1, *(len(axis) for axis in axes))
    for each, suffix, modifier in zip(values, ("", "_error"), ("", " standard_error"), strict=True):
        variable = file.createVariable(name + suffix, "f4", tuple(spaces), zlib=True)
        variable.setncatts({"units": unit, "standard_name": standard + modifier})
        if not suffix:
            variable.setncatts({"ancillary_variables": f"{name}_error"})
        variable[:] = each.reshape(shape)
