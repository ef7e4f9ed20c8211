"""Files for other programs: what other programs' readers find in them is what was known."""

from __future__ import annotations

import csv
import io
import json
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from compliance_checker.runner import CheckSuite, ComplianceChecker
from pyais import decode

from gliderwatch.errors import GliderwatchError
from gliderwatch.export import ais, dives, maps, netcdf
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.layers.band import Band, Mode
from gliderwatch.layers.composite import Layer
from gliderwatch.layers.section import Section
from gliderwatch.params import Attention
from unit.test_pages import HOSTILE, LATE, NOW, dive, view

KML = "{http://www.opengis.net/kml/2.2}"


def test_geojson_has_track_dives_and_where_it_is():
    found = json.loads(maps.as_geojson((view(), view(name="other", attention=Attention(recovered=True)))))
    first = [f for f in found["features"] if f["properties"]["glider"] == "electa"]
    kinds = [f["properties"]["what"] for f in first]
    assert kinds == ["track", *["dive"] * 6, "last_fix", "now", "next_surfacing"]
    assert "now" not in [f["properties"]["what"] for f in found["features"] if f not in first]
    ring = np.array(first[-1]["geometry"]["coordinates"][0])
    assert (ring[0] == ring[-1]).all()
    x, y = ring.T
    assert (x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0  # counter-clockwise, RFC 7946 3.1.6
    expected = view().expected
    assert expected is not None
    assert ring[:-1].mean(axis=0) == pytest.approx([expected.lon, expected.lat], abs=1e-4)


def test_no_line_crosses_the_date_line():
    lons = (179.8, 179.9, -179.9, -179.8)
    track = tuple(replace(d, lon=lon) for d, lon in zip(view().dives, lons, strict=False))
    (line, *_) = json.loads(maps.as_geojson((view(dives=track),)))["features"]
    parts = [np.array(part) for part in line["geometry"]["coordinates"]]
    assert len(parts) == 2
    assert all(np.abs(np.diff(part[:, 0])).max() < 1.0 for part in parts)


def test_kml_is_read_back_and_its_link_looks_again():
    root = ET.fromstring(maps.as_kml((view(name=HOSTILE), view(awaited=LATE))))
    names = [name.text for name in root.iter(f"{KML}name")]
    assert {"track", "now", "next surfacing", "electa"} <= set(names)
    assert any(name and name.startswith("<script>") for name in names)
    styles = {style.get("id") for style in root.iter(f"{KML}Style")}
    assert {url.text[1:] for url in root.iter(f"{KML}styleUrl") if url.text} <= styles
    link = ET.fromstring(maps.as_kml_link(["a&b.kml"]))
    assert [href.text for href in link.iter(f"{KML}href")] == ["a&b.kml"]
    assert [mode.text for mode in link.iter(f"{KML}refreshMode")] == ["onInterval"]


def test_a_table_is_read_back_and_runs_nothing():
    some = [dive(1.0), dive(0.0, reason="=cmd()", speed=None, flag=None, lat=None)]
    rows = list(csv.DictReader(io.StringIO(dives.as_csv(some))))
    assert float(rows[0]["speed"]) == 0.25
    assert rows[0]["t_surface"] == "2023-11-14T21:13:20Z"
    assert (rows[1]["speed"], rows[1]["flag"], rows[1]["lat"]) == ("", "", "")
    assert rows[1]["reason"] == "'=cmd()"


def test_netcdf_is_read_back(tmp_path):
    some = [dive(2.0), dive(1.0, speed=None, flag=None), dive(0.5, lat=None), dive(0.0, flag=1)]
    netcdf.write(tmp_path / "x.nc", "electa", some, NOW)
    with xr.open_dataset(tmp_path / "x.nc") as data:
        assert data.sizes["obs"] == 3  # one has no place
        assert data.speed.values[0] == 0.25
        assert np.isnan(data.speed.values[1])
        assert data.flag.values.tolist() == [0, -127, 1]
        assert str(data.trajectory.values.astype(str)) == "electa"
        assert data.time.values[0] == np.datetime64(round((NOW - 7200) * 1e9), "ns")
        values, meanings = data.flag.attrs["flag_values"].tolist(), data.flag.attrs["flag_meanings"].split()
        assert dict(zip(values, meanings, strict=True))[1] == "speed_out_of_range"


def remarks(path, name):
    """What the checker misses in a file by a convention, by how much it matters."""
    report = path.with_name("report.json")
    ComplianceChecker.run_checker(
        str(path), [name], 0, "strict", output_filename=str(report), output_format="json"
    )
    found = json.loads(report.read_text())[name]
    return {
        weight: [m for each in found[f"{weight}_priorities"] for m in each["msgs"]]
        for weight in ("high", "medium", "low")
    }


OURS = {
    "institution": "Institute of the Sea",
    "license": "CC-BY-4.0",
    "project": "Boundary current",
    "acknowledgement": "The crew",
    **{
        f"{who}_{what}": f"https://example.org/{what}"
        for who in ("creator", "publisher")
        for what in ("url", "email")
    },
    "publisher_name": "Institute of the Sea",
}
"""What only those whose data they are can say: `export.attributes`."""
NAMELESS = {"t_dive", "depth_max", "speed_min", "speed_max", "p_e", "across_misfit"}
"""Variables for which CF has no standard name, or one that only a coordinate should have."""


def without_name(path):
    with xr.open_dataset(path) as data:
        return {
            str(name) for name, variable in data.variables.items() if "standard_name" not in variable.attrs
        }


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_netcdf_passes_the_checker_of_its_conventions(tmp_path):
    netcdf.write(tmp_path / "x.nc", "electa", view().dives, NOW, OURS)
    CheckSuite.load_all_available_checkers()
    assert remarks(tmp_path / "x.nc", "cf:1.8") == {"high": [], "medium": [], "low": []}
    found = remarks(tmp_path / "x.nc", "acdd:1.3")
    assert set(found["high"]) == {"standard_name"}
    assert without_name(tmp_path / "x.nc") == NAMELESS | {"trajectory", "crs", "depth_bounds"}
    assert found["medium"] == []
    with xr.open_dataset(tmp_path / "x.nc") as data:
        deepest = [d.evidence["depth_max"] for d in view().dives]
        assert data.depth_bounds.values.tolist() == [[0.0, depth] for depth in deepest]
        assert data.geospatial_vertical_max == max(deepest) / 2
        assert data.institution == "Institute of the Sea"
    netcdf.write(tmp_path / "y.nc", "electa", view().dives, NOW)  # nobody has said whose it is
    open_still = {m.split()[0].split("/")[0] for m in remarks(tmp_path / "y.nc", "acdd:1.3")["medium"]}
    assert {name.replace("acknowledgment", "acknowledgement") for name in open_still} == set(OURS)


def advised(band):
    layer = Layer(5.0, 8.0, -0.4, 1.0)
    return LayerAdvice(
        NOW, "temperature", Mode.TRACK, Band(2.0, 90.0), band, 2, 10.0, (layer,) if band else ()
    )


def test_a_section_with_its_layers_is_read_back_and_passes_the_checker(tmp_path):
    dives = view().dives
    edges = np.arange(0.0, 12.0, 1.0)
    value = np.tile(20.0 - edges[:-1], (2, 1))
    value[1, -1] = np.nan
    t = np.array([dives[0].t_surface, dives[-1].t_surface])
    advice = [advised(Band(3.0, 10.0)), advised(None)]
    netcdf.write_section(tmp_path / "x.nc", "electa", Section(t, edges, value), advice, dives, NOW)
    with xr.open_dataset(tmp_path / "x.nc") as data:
        assert np.isnan(data.temperature.values[1, -1])
        assert data.temperature.values[0] == pytest.approx(value[0])
        assert (data.layer_top.values[0, 0], data.band_bottom.values[0]) == (5.0, 10.0)
        assert np.isnan([data.layer_top.values[1, 0], data.band_top.values[1]]).all()
        assert float(data.lat[0]) == pytest.approx(dives[0].lat)
    assert remarks(tmp_path / "x.nc", "cf:1.8") == {"high": [], "medium": [], "low": []}
    with pytest.raises(GliderwatchError, match="no layers with a position"):
        netcdf.write_section(tmp_path / "x.nc", "electa", Section(t[:0], edges, value[:0]), [], dives, NOW)


def test_a_glider_without_a_place_has_no_trajectory(tmp_path):
    with pytest.raises(GliderwatchError, match="no dive with a position"):
        netcdf.write(tmp_path / "x.nc", "electa", [dive(lat=None)], NOW)
    with pytest.raises(GliderwatchError, match="cannot be written"):
        netcdf.write(tmp_path / "none" / "x.nc", "electa", [dive()], NOW)


def test_virtual_aid_is_read_back():
    (line,) = ais.lines("unit_1033", DriftEllipse(-61.25, 179.5, 340.0, 120.0, 30.0), 992441234, NOW)
    found = decode(line).asdict()
    assert line.startswith("!AIVDM,1,1,")
    assert (found["msg_type"], found["mmsi"], found["virtual_aid"]) == (21, 992441234, True)
    assert (found["lat"], found["lon"]) == pytest.approx((-61.25, 179.5), abs=2e-6)
    assert found["name"].strip() == "GLIDER UNIT 1033"
    assert found["to_bow"] == 340
    area = DriftEllipse(24.25, -83.5, 5.0, 5.0, 0.0)
    (line,) = ais.lines("unit_1033", area, 244123456, NOW)
    found = decode(line).asdict()
    assert (found["msg_type"], found["mmsi"], found["accuracy"]) == (1, 244123456, True)
    assert (found["lat"], found["lon"]) == pytest.approx((24.25, -83.5), abs=2e-6)
    assert (found["heading"], found["course"], found["speed"]) == (511, 360.0, 102.3)  # not known
    with pytest.raises(GliderwatchError, match="nine digits"):
        ais.lines("x", area, 99, NOW)
