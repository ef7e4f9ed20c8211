"""Coast and depths of files that the configuration names, finer than what the package has.

Land as polygons of GeoJSON or of a shapefile, in degrees; height above the sea (m) on a grid of a NetCDF
file, as GEBCO and ETOPO give it, of which the coast and lines of equal depth follow.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gliderwatch.errors import GliderwatchError
from gliderwatch.figures.coast import Box, DepthLine, Land, land_of, world
from gliderwatch.model import Array, readonly

if TYPE_CHECKING:
    from shapely import Geometry

# ruff: noqa: PLC0415
# shapely and pyshp are of the extra `maps`, xarray is slow to load.

Part = tuple[Box, Land, list[DepthLine]]
LARGEST = 300e6
"""Bytes of a file of polygons: the coast of the world in full detail has more, and takes minutes to read."""
CELLS = 1500
"""Of a grid along each side at the most: a larger one is thinned. A map has 480 units across."""
DEPTHS = (20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 3000.0, 4000.0, 5000.0)
"""Metres below the surface of which lines are drawn."""
_GEOJSON, _GRIDS = {".geojson", ".json"}, {".nc", ".grd", ".nc4"}
_CLIP = "What to do: cut it to your part of the sea"


def land_with(files: Sequence[Path]) -> Land:
    """The world's land, in its place that of the files where they have some, and their lines of equal depth.

    Each file counts where it lies: within the box about what it holds. Raises GliderwatchError.
    """
    if not files:
        return world()
    return _combined(tuple((path, *_state(path)) for path in files))


def land_or_world(files: Sequence[str]) -> tuple[Land, str]:
    """The land with what files have, and nothing; or the world's alone, and why one cannot be used."""
    try:
        return land_with([Path(file) for file in files]), ""
    except GliderwatchError as error:
        return world(), str(error)


@lru_cache(maxsize=2)
def _combined(files: tuple[tuple[Path, int, int], ...]) -> Land:
    try:
        import shapely  # noqa: F401
    except ImportError:
        raise GliderwatchError(
            "maps.files needs shapely and pyshp, which are not installed: docs/install.md says how"
        ) from None
    parts = [read(path) for path, *_ in reversed(files)]  # the file that is named first is drawn last
    finer = tuple((box, land) for box, land, _ in parts)
    return replace(world(), finer=finer, depths=tuple(line for *_, lines in parts for line in lines))


def _state(path: Path) -> tuple[int, int]:
    try:
        status = path.stat()
    except OSError as error:
        raise GliderwatchError(f"map file {path} cannot be read: {error.strerror}") from None
    return status.st_size, status.st_mtime_ns


def read(path: Path) -> Part:
    """The box in which a file counts, its land, and lines of equal depth. Raises GliderwatchError."""
    kind = path.suffix.lower()
    try:
        if kind in _GRIDS:
            return _grid(path)
        if kind not in {*_GEOJSON, ".shp"}:
            raise GliderwatchError("it is none of .geojson, .json, .shp, .nc, .grd")
        if path.stat().st_size > LARGEST:
            raise GliderwatchError(f"it has more than {LARGEST / 1e6:g} MB. {_CLIP} (`ogr2ogr -clipsrc`)")
        return _polygons(_geojson(path) if kind in _GEOJSON else _shapefile(path))
    except GliderwatchError as error:
        raise GliderwatchError(f"map file {path} cannot be used: {error}") from None
    except Exception as error:  # a reader of foreign files raises what it likes
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise GliderwatchError(f"map file {path} cannot be used: {reason}") from None


# ----------------------------------------
# Polygons.


def _geojson(path: Path) -> list[Geometry]:
    import shapely

    return [shapely.from_geojson(path.read_bytes())]


def _shapefile(path: Path) -> list[Geometry]:
    import shapefile
    from shapely.geometry import shape

    shapefile.VERBOSE = False  # it would print what it thinks of the order of points
    with shapefile.Reader(str(path)) as reader:
        return [shape(each.__geo_interface__) for each in reader.iterShapes() if each.points]


def _polygons(geometries: list[Geometry]) -> Part:
    import shapely

    parts = shapely.get_parts(shapely.get_parts(geometries))
    areas = [part for part in parts if part.geom_type in {"Polygon", "MultiPolygon"}]
    if not areas:
        held = ", ".join(sorted({part.geom_type for part in parts})) or "nothing"
        raise GliderwatchError(f"it holds no polygons of land, but {held}")
    land = shapely.union_all(shapely.make_valid(areas))
    west, south, east, north = land.bounds
    if not (-360 <= west <= east <= 540 and -90 <= south <= north <= 90):
        raise GliderwatchError(
            f"its coordinates ({west:.6g} to {east:.6g}) are no degrees: use `ogr2ogr -t_srs EPSG:4326`"
        )
    return Box(south, north, west, east), land_of(list(_rings(land))), []


def _rings(land: Geometry) -> Iterator[Array]:
    """The rings of areas, clockwise around land, the others around lakes, as those of the world."""
    import shapely

    for part in shapely.get_parts(shapely.orient_polygons(land, exterior_cw=True)):
        if part.geom_type == "Polygon":
            for ring in shapely.get_rings(part):
                yield shapely.get_coordinates(ring)[:-1]


# ----------------------------------------
# Heights on a grid.


def _grid(path: Path) -> Part:
    import shapely
    from contourpy import FillType, LineType, contour_generator

    lon, lat, height = _heights(path)
    contours = contour_generator(
        lon, lat, height, line_type=LineType.Separate, fill_type=FillType.OuterOffset
    )
    lines = [
        DepthLine(depth, readonly(np.asarray(line)))
        for depth in DEPTHS
        for line in contours.lines(-depth)
        if len(line) > 1
    ]
    areas = []
    for points, offsets in zip(*contours.filled(0.0, 1e5), strict=True):
        outer, *inner = (points[a:b] for a, b in pairwise(offsets))
        areas.append(shapely.Polygon(outer, inner))
    land = shapely.union_all(shapely.make_valid(areas)) if areas else shapely.Polygon()
    edges = (float(at) for at in (lat[0], lat[-1], lon[0], lon[-1]))
    return Box(*edges), land_of(list(_rings(land))), lines


def _heights(path: Path) -> tuple[Array, Array, Array]:
    """Longitudes and latitudes (degrees, rising) of a grid, and its heights above the sea (m)."""
    import xarray as xr

    with xr.open_dataset(path, engine="netcdf4", decode_times=False) as data:
        for variable in data.data_vars.values():
            axes = {axis: name for name in variable.dims if (axis := _axis(data, str(name)))}
            if variable.ndim == 2 and len(axes) == 2 and np.issubdtype(variable.dtype, np.number):
                grid = variable.transpose(axes["lat"], axes["lon"])
                grid = grid.isel({name: _every(data.sizes[name]) for name in grid.dims})
                lat, lon = (np.asarray(grid[axes[axis]], dtype=float) for axis in ("lat", "lon"))
                values = np.asarray(grid, dtype=float)
                is_depth = variable.attrs.get("positive") == "down" or "depth" in _named(variable)
                order = np.argsort(lat), np.argsort(lon)
                return lon[order[1]], lat[order[0]], (-values if is_depth else values)[np.ix_(*order)]
    raise GliderwatchError("it has no variable on a grid of latitude and longitude")


def _every(cells: int) -> slice:
    """As many cells of an axis as are wanted at the most."""
    return slice(None, None, -(-cells // CELLS))


def _named(variable: Any) -> str:
    return f"{variable.name} {variable.attrs.get('standard_name', '')}".lower()


def _axis(data: Any, name: str) -> str:
    """Which axis a dimension is, by the units of its coordinate or its name; empty: none."""
    if name not in data.coords:
        return ""
    units, known = str(data[name].attrs.get("units", "")).lower(), name.lower()
    if units.startswith("degrees_n") or known in {"lat", "latitude", "y"}:
        return "lat"
    return "lon" if units.startswith("degrees_e") or known in {"lon", "longitude", "x"} else ""
