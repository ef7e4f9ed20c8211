"""Currents of an ocean model or of an HF radar from CF NetCDF files. The one place that knows xarray."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from gliderwatch.errors import GliderwatchError, Quarantine, Retry
from gliderwatch.model import Array, readonly
from gliderwatch.sea.constants import FASTEST_CURRENT, STALE
from gliderwatch.sea.ocean_field import Field

STANDARD = (
    ("eastward_sea_water_velocity", "northward_sea_water_velocity"),
    ("surface_eastward_sea_water_velocity", "surface_northward_sea_water_velocity"),
    ("barotropic_eastward_sea_water_velocity", "barotropic_northward_sea_water_velocity"),
)
"""CF standard names of the eastward and northward current, in the order in which they are tried."""
COMMON = (("uo", "vo"), ("water_u", "water_v"), ("u", "v"))
"""Names of variables that are tried where no standard name helps."""
TO_SI = {"m/s": 1.0, "cm/s": 0.01}
MOST = 250e6
"""Numbers in a component that are read (1 GB would be half of it)."""
AXES = {
    "time": ({"time"}, {"time", "ocean_time", "time_counter"}, " since "),
    "lat": ({"latitude"}, {"lat", "latitude", "nav_lat"}, "degrees_north"),
    "lon": ({"longitude"}, {"lon", "longitude", "nav_lon"}, "degrees_east"),
    "depth": ({"depth"}, {"depth", "lev", "level", "z"}, ""),
}
"""Standard names by which an axis is known; where it has none, names, and a part of its units."""
Places = NDArray[np.intp]
EPOCH = np.datetime64("1970-01-01T00:00:00", "ns")


@dataclass(frozen=True, slots=True)
class Box:
    """Part of the earth (degrees); ``west`` may be greater than ``east``: then it holds the date line."""

    south: float
    north: float
    west: float
    east: float


@dataclass(frozen=True, slots=True)
class _Piece:
    """What one file holds: axes as in `Field`, and currents (m/s, (T, Z, Y, X))."""

    path: Path
    t: Array
    depth: Array
    lat: Array
    lon: Array
    u: Array
    v: Array


def read_field(patterns: Sequence[str], area: Box | None = None, stale: float = STALE) -> Field:
    """The field of all files that match any of the shell ``patterns`` (``**``: folders of any depth).

    Files of several times are joined; of a time that several hold, the file whose name sorts last counts (the
    newest run of a forecast). ``area`` limits what is read. Raises Retry where no file is there or one cannot
    be opened just now, Quarantine where one is not what it should be: both with the file and a cure.
    """
    found = {path for pattern in patterns for path in _matching(pattern)}
    paths = sorted(found, key=lambda path: (path.name, path))
    if not paths:
        names = ", ".join(repr(pattern) for pattern in patterns)
        raise Retry(f"no file matches {names}: check the pattern, and that the folder is mounted")
    pieces = [_read(path, area) for path in paths]
    first, frames = pieces[0], dict[float, tuple[Array, Array]]()
    for piece in pieces:
        if not all(
            np.array_equal(getattr(piece, axis), getattr(first, axis)) for axis in ("depth", "lat", "lon")
        ):
            raise Quarantine(
                f"{piece.path} has another grid than {first.path}: name files of one model only, "
                "or set an area that all of them hold"
            )
        frames |= {t: (piece.u[k], piece.v[k]) for k, t in enumerate(piece.t.tolist())}
    times = sorted(frames)
    u, v = (readonly([frames[t][k] for t in times]) for k in (0, 1))
    name = first.path.name if len(pieces) == 1 else f"{first.path.name} to {pieces[-1].path.name}"
    try:
        return Field(readonly(times), first.depth, first.lat, first.lon, u, v, name, stale)
    except ValueError as error:
        raise Quarantine(
            f"{first.path}: {error}; a file needs 2 latitudes and 2 longitudes at least"
        ) from error


def _matching(pattern: str) -> list[Path]:
    whole = Path(pattern).expanduser()
    return list(Path(whole.anchor).glob(str(whole.relative_to(whole.anchor))))


def _read(path: Path, area: Box | None) -> _Piece:
    try:
        with xr.open_dataset(path, decode_times=False) as data:
            return _piece(path, data, area)
    except GliderwatchError:
        raise
    except OSError as error:
        raise Retry(f"{path} cannot be read ({error}): is it complete? `ncdump -h` should list it") from error
    except Exception as error:  # a broken file makes the libraries below raise nearly anything
        raise Quarantine(
            f"{path} cannot be understood as CF NetCDF ({type(error).__name__}: {error}): "
            f"see `ncdump -h {path}`"
        ) from error


def _piece(path: Path, data: xr.Dataset, area: Box | None) -> _Piece:
    east, north = _components(path, data)
    axes = _axes(path, data, east)
    if sorted(map(str, north.dims)) != sorted(map(str, east.dims)):
        raise Quarantine(
            f"{path}: {east.name} and {north.name} are on different grids; put both on one "
            "(e.g. `cdo remapbil`) and name that file"
        )
    lat, rows = _latitudes(path, axes["lat"], area)
    lon, columns = _longitudes(path, axes["lon"], area)
    depth, levels = _depths(path, axes.get("depth"))
    t = _times(path, axes["time"])
    if len(t) * max(len(levels), 1) * len(lat) * len(lon) > MOST:
        raise Quarantine(f"{path} is too large to be held in memory: set an area around the glider")
    cut = {axes["lat"].dims[0]: rows, axes["lon"].dims[0]: columns}
    if "depth" in axes and axes["depth"].ndim:
        cut[axes["depth"].dims[0]] = levels
    order = [
        axes[name].dims[0] for name in ("time", "depth", "lat", "lon") if name in axes and axes[name].ndim
    ]
    shape = (len(t), max(len(depth), 1), len(lat), len(lon))
    u, v = (
        _values(path, each.squeeze(_single(each, order)).isel(cut), order).reshape(shape)
        for each in (east, north)
    )
    return _Piece(path, readonly(t), depth, lat, lon, readonly(u), readonly(v))


def _components(path: Path, data: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray]:
    """The eastward and the northward current."""
    named = {str(each.attrs.get("standard_name", "")): each for each in data.data_vars.values()}
    for pairs, found in ((STANDARD, named), (COMMON, {str(k): each for k, each in data.data_vars.items()})):
        for east, north in pairs:
            if east in found and north in found:
                return found[east], found[north]
    held = ", ".join(map(str, data.data_vars)) or "none"
    raise Quarantine(
        f"{path} has no eastward and northward current (variables: {held}): give two of them the "
        "standard_name eastward_sea_water_velocity and northward_sea_water_velocity, e.g. with `ncatted`"
    )


def _axes(path: Path, data: xr.Dataset, current: xr.DataArray) -> dict[str, xr.DataArray]:
    """Coordinates of a current by kind: time, lat, lon and, where there is one, depth."""
    found: dict[str, xr.DataArray] = {}
    for name, each in current.coords.items():
        for kind in AXES:
            if kind not in found and _is(kind, str(name), each):
                found[kind] = each
    for kind, words in (("time", "time"), ("lat", "latitude"), ("lon", "longitude")):
        if kind not in found:
            raise Quarantine(
                f"{path}: {current.name} has no coordinate of {words}: add one with that standard_name"
            )
    if found["lat"].ndim != 1 or found["lon"].ndim != 1:
        raise Quarantine(
            f"{path}: latitude and longitude are not the axes of the grid (a curvilinear or unstructured "
            "model): put it on a regular one first, e.g. `cdo remapbil,r3600x1800`"
        )
    axes = {each.dims[0] for each in found.values() if each.ndim}
    more = [str(dim) for dim in current.dims if dim not in axes and current.sizes[dim] > 1]
    if more:
        raise Quarantine(
            f"{path}: {current.name} has an axis {more[0]} that is not time, depth (m), latitude or "
            "longitude: choose one of it first (`ncks -d`), or put levels that follow the bottom on depths"
        )
    return found


def _is(kind: str, name: str, axis: xr.DataArray) -> bool:
    standards, names, units = AXES[kind]
    standard, unit = (str(axis.attrs.get(each, "")) for each in ("standard_name", "units"))
    if standard:
        return standard in standards
    return name.lower() in names or (bool(units) and units in unit)


def _single(current: xr.DataArray, order: Sequence[Any]) -> list[Any]:
    return [dim for dim in current.dims if dim not in order]


def _latitudes(path: Path, axis: xr.DataArray, area: Box | None) -> tuple[Array, Places]:
    """Increasing latitudes within an area, one more on each side, and their places."""
    values = np.asarray(axis.values, dtype=np.float64)
    order = np.argsort(values, kind="stable")
    if area is not None:
        order = _within(path, values[order], order, area.south, area.north)
    return readonly(values[order]), order


def _longitudes(path: Path, axis: xr.DataArray, area: Box | None) -> tuple[Array, Places]:
    """Increasing longitudes likewise; a grid around the earth gets its first one again at the end."""
    values = np.asarray(axis.values, dtype=np.float64)
    if area is not None:
        width = (area.east - area.west) % 360.0
        west = area.west + width / 2 - 180.0
        values = west + (values - west) % 360.0
    else:
        values = np.unwrap(values, period=360.0)
    order = np.argsort(values, kind="stable")
    sorted_ = values[order]
    if len(order) > 2 and 0 < sorted_[0] + 360.0 - sorted_[-1] < 1.5 * np.diff(sorted_).max():
        order, sorted_ = np.append(order, order[0]), np.append(sorted_, sorted_[0] + 360.0)
    if area is not None:
        places = _within(path, sorted_, np.arange(len(order)), area.west, area.west + width)
        order, sorted_ = order[places], sorted_[places]
    return readonly(sorted_), order


def _within(path: Path, values: Array, order: Places, least: float, most: float) -> Places:
    """Those of ``order`` whose increasing ``values`` are between two, and one more on each side."""
    i = max(int(np.searchsorted(values, least, "right")) - 1, 0)
    j = int(np.searchsorted(values, most, "left")) + 1
    if values[-1] < least or values[0] > most:
        raise Quarantine(
            f"{path} covers {values[0]:g} to {values[-1]:g} degrees only, the area is {least:g} to {most:g}: "
            "bring files of the glider's area"
        )
    return order[i:j]


def _depths(path: Path, axis: xr.DataArray | None) -> tuple[Array, Places]:
    """Increasing depths (m, downward) and their places; empty where the file has no depths."""
    if axis is None or axis.ndim == 0:
        return readonly([]), np.arange(0)
    units = str(axis.attrs.get("units", "m")).lower().rstrip(".")
    if units not in {"m", "meter", "meters", "metre", "metres"}:
        raise Quarantine(f"{path}: depths are in {units!r}, not in m: convert them first, e.g. with `ncap2`")
    values = np.abs(np.asarray(axis.values, dtype=np.float64))
    order = np.argsort(values, kind="stable")
    return readonly(values[order]), order


def _times(path: Path, axis: xr.DataArray) -> Array:
    """Times (s since 1970, UTC), in the order of the file."""
    # alone, because files of forecasts hold other times whose units are none ("hours since analysis")
    bare = xr.Dataset({"t": ("n", np.atleast_1d(axis.values), axis.attrs)})
    values = xr.decode_cf(bare)["t"].values
    if np.issubdtype(values.dtype, np.datetime64):
        if np.isnat(values).any():
            raise Quarantine(f"{path}: some of its times are missing: is it complete?")
        return np.asarray((values.astype("datetime64[ns]") - EPOCH) / np.timedelta64(1, "s"))
    if values.dtype == object:  # dates of another calendar
        return np.array([_seconds(path, each) for each in values])
    raise Quarantine(f"{path}: its times have no units: say `units: seconds since 1970-01-01` of {axis.name}")


def _seconds(path: Path, date: Any) -> float:
    try:
        parts = (date.year, date.month, date.day, date.hour, date.minute, date.second)
        return datetime(*parts, tzinfo=UTC).timestamp()
    except ValueError as error:
        raise Quarantine(
            f"{path}: {date} is not a date of the usual calendar: bring files of a model of real days"
        ) from error


def _values(path: Path, current: xr.DataArray, order: Sequence[Any]) -> Array:
    """The values (m/s), axes in an order, NaN where there are none."""
    units = str(current.attrs.get("units", "m/s")).lower()
    short = units.replace("meters", "m").replace("meter", "m").replace("second", "s").replace("sec", "s")
    short = (
        short.replace(" ", "")
        .replace("s-1", "/s")
        .replace("s^-1", "/s")
        .replace("s**-1", "/s")
        .replace(".", "")
    )
    if short not in TO_SI:
        raise Quarantine(f"{path}: {current.name} is in {units!r}: convert it to m s-1, e.g. with `ncap2`")
    values = np.asarray(current.transpose(*order).values, dtype=np.float64) * TO_SI[short]
    return np.where(np.abs(values) <= FASTEST_CURRENT, values, np.nan)
