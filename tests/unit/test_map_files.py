"""Finer coasts and depths: they lie where their files have them, in the place of the world's land there."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shapefile
import xarray as xr

from gliderwatch.config import load
from gliderwatch.config.check import check_maps
from gliderwatch.errors import GliderwatchError
from gliderwatch.figures import chart, map_png
from gliderwatch.figures.coast import Box, Land, depth_lines_in, rings_in
from gliderwatch.figures.map_files import land_or_world, land_with

RING = [[-84.2, 26.9], [-84.2, 27.1], [-83.9, 27.1], [-83.9, 26.9], [-84.2, 26.9]]  # in the Gulf of Mexico
LAKE = [[-84.1, 26.95], [-84.0, 26.95], [-84.0, 27.05], [-84.1, 27.05], [-84.1, 26.95]]
FLORIDA = [[-82.0, 27.5], [-82.0, 28.5], [-81.0, 28.5], [-81.0, 27.5], [-82.0, 27.5]]


def is_land(land: Land, lat: float, lon: float) -> bool:
    """By the winding of the rings about a place, of the last of the parts that count there."""
    part = land
    for box, finer in land.finer:
        if box.south < lat < box.north and box.west < lon < box.east:
            part = finer
    turns = 0.0
    for ring in rings_in(part, Box(lat - 2, lat + 2, lon - 2, lon + 2)):
        x, y = (ring - [lon, lat]).T
        angle = np.unwrap(np.append(np.arctan2(y, x), np.arctan2(y[0], x[0])))
        turns -= float(angle[-1] - angle[0]) / (2 * np.pi)
    return round(turns) == 1  # clockwise is land, the others are lakes in it


def geojson(folder: Path, *rings: list[list[float]], kind: str = "Polygon") -> Path:
    path = folder / "coast.geojson"
    shape = {"type": kind, "coordinates": list(rings)}
    path.write_text(json.dumps({"type": "Feature", "properties": {}, "geometry": shape}))
    return path


def shape(folder: Path, *rings: list[list[float]]) -> Path:
    with shapefile.Writer(str(folder / "coast.shp"), shapeType=shapefile.POLYGON) as file:
        file.field("name", "C")
        file.poly(list(rings))
        file.record("island")
    return folder / "coast.shp"


def grid(folder: Path, name: str = "elevation", sign: float = 1.0) -> Path:
    """The sea bed falls 1000 m a degree to the south of 27.5 degrees north; north of that is land."""
    lat, lon = np.arange(28.0, 25.0, -0.05), np.arange(-85.0, -83.0, 0.05)  # from the north, as some files
    height = np.repeat(1000.0 * (lat - 27.5)[:, None], len(lon), axis=1)
    axes = {"lat": ("lat", lat, {"units": "degrees_north"}), "lon": ("lon", lon, {"units": "degrees_east"})}
    path = folder / f"{name}.nc"
    xr.Dataset({name: (("lat", "lon"), sign * height)}, axes).to_netcdf(path)
    return path


@pytest.mark.parametrize("make", [geojson, shape])
def test_polygons_stand_in_the_place_of_the_worlds_land(make, tmp_path):
    land = land_with([make(tmp_path, RING, LAKE)])
    assert is_land(land, 26.92, -84.15)
    assert not is_land(land, 27.0, -84.05)  # the lake in it
    assert not is_land(land, 27.2, -84.05)
    assert is_land(land, 28.0, -81.5)  # the world goes on elsewhere
    assert is_land(land, 52.1, 5.2)
    hole = land_with([make(tmp_path, FLORIDA, [[-81.9, 27.6], [-81.1, 27.6], [-81.1, 28.4], [-81.9, 27.6]])])
    assert not is_land(hole, 27.7, -81.4) and is_land(hole, 28.3, -81.8) and is_land(hole, 29.0, -82.0)


@pytest.mark.parametrize(("name", "sign"), [("elevation", 1.0), ("depth", -1.0)])
def test_depths_and_the_coast_follow_from_heights(name, sign, tmp_path):
    land = land_with([grid(tmp_path, name, sign)])
    assert is_land(land, 27.6, -84.0) and not is_land(land, 27.4, -84.0)
    at = {line.depth: line.points[:, 1] for line in land.depths}
    assert set(at) == {20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0}
    for depth, lat in at.items():
        assert lat == pytest.approx(27.5 - depth / 1000.0, abs=1e-6)
    near = list(depth_lines_in(land, Box(26.9, 27.1, 275.5, 276.5)))  # longitudes as those of the box
    assert [line.depth for line in near] == [500.0]
    assert ((near[0].points[:, 0] > 275.3) & (near[0].points[:, 0] < 276.7)).all()


def test_lines_of_depth_are_drawn_with_their_depth(tmp_path):
    land = land_with([grid(tmp_path)])
    some = chart.Chart("Map", marks=(chart.Mark((26.3, -84.1), "here"), chart.Mark((27.2, -83.9), "there")))
    text = chart.svg(some, land)
    assert text.count('class="depth"') >= 2 and ">500 m<" in text
    assert 'class="depth"' not in chart.svg(some, land_with([]))
    assert map_png.png(some, land).startswith(b"\x89PNG\r\n")


def test_the_file_that_is_named_first_counts(tmp_path):
    land = land_with([geojson(tmp_path, RING), grid(tmp_path)])
    assert is_land(land, 27.0, -84.0) and is_land(land, 27.6, -84.5)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.shp", None, "No such file"),
        ("coast.txt", "x", "none of .geojson"),
        ("cut.nc", "x", "NetCDF"),
        ("cut.geojson", "{", "parse"),
        ("cut.shp", "x", "cannot be used"),
        ("line.geojson", '{"type": "LineString", "coordinates": [[0, 1], [2, 3]]}', "no polygons of land"),
        (
            "metres.geojson",
            '{"type": "Polygon", "coordinates": [[[5e5, 1], [5e5, 3], [6e5, 1], [5e5, 1]]]}',
            "no degrees",
        ),
    ],
)
def test_a_file_that_cannot_be_used_is_named_with_its_line(name, content, words, tmp_path):
    file = tmp_path / name
    if content is not None:
        file.write_text(content)
    with pytest.raises(GliderwatchError, match=words):
        land_with([file])
    land, reason = land_or_world([str(file)])
    assert words in reason and is_land(land, 28.0, -81.5)
    path = tmp_path / "gliderwatch.yml"
    path.write_text(
        f"dockserver: {{roots: [{tmp_path}]}}\nstate: {{path: {tmp_path}/s.sqlite}}\nmaps:\n  files:\n"
        f"    - {file}\n"
    )
    (found,) = check_maps(load(path), path)
    assert str(found).startswith(f"{path}:5: maps.files.0: map file {file} ")
