"""Maps and plots: the coast is where it is, what is drawn is what was given, and stands in a strict page."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.figures import chart, coast, dives, plots
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.model import Assessment
from gliderwatch.navigation.geodesy import to_plane
from unit.test_pages import dive

BOXES = coast.Box(24.0, 31.0, -88.0, -79.0), coast.Box(60.0, 70.0, 170.0, 200.0)


def is_land(lat: float, lon: float) -> bool:
    """By the even-odd rule over the rings near a place."""
    box = coast.Box(lat - 2, lat + 2, lon - 2, lon + 2)
    crossings = 0
    for ring in coast.rings_in(coast.world(), box):
        (x, y), (x2, y2) = ring.T, np.roll(ring, -1, axis=0).T
        crosses = (y > lat) != (y2 > lat)
        at = x + (lat - y) / np.where(crosses, y2 - y, 1.0) * (x2 - x)
        crossings += int((crosses & (at > lon)).sum())
    return crossings % 2 == 1


@pytest.mark.parametrize(
    ("lat", "lon", "expected"),
    [
        (28.0, -81.5, True),  # Florida
        (27.5, -84.0, False),  # the Gulf of Mexico
        (52.1, 5.2, True),  # Utrecht
        (54.0, 3.0, False),  # the North Sea
        (66.5, -178.0, True),  # Chukotka, east of the date line
        (66.5, 182.0, True),  # the same, counted on
        (-18.0, 178.0, True),  # Fiji
        (-17.0, 175.0, False),
        (-85.0, 10.0, True),  # Antarctica
    ],
)
def test_land_is_where_it_is(lat, lon, expected):
    assert is_land(lat, lon) is expected


@given(
    st.lists(st.tuples(st.floats(-10, 10), st.floats(-10, 10)), min_size=3, max_size=30),
    st.floats(-9, 0),
    st.floats(1, 9),
)
@settings(max_examples=60, deadline=None)
def test_what_is_cut_lies_in_the_box(points, low, high):
    box = coast.Box(low, high, low, high)
    cut = coast.clipped(np.array(points), box)
    assert ((cut >= low - 1e-9) & (cut <= high + 1e-9)).all()


@pytest.mark.parametrize("box", BOXES)
def test_the_part_of_a_box_is_that_of_the_whole(box):
    """The area of land in a box is that of its four quarters together."""

    def area(of: coast.Box) -> float:
        total = 0.0
        for ring in coast.rings_in(coast.world(), of):
            x, y = ring.T
            total += float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
        return abs(total)

    lat, lon = (box.south + box.north) / 2, (box.west + box.east) / 2
    quarters = [
        coast.Box(s, n, w, e)
        for s, n in ((box.south, lat), (lat, box.north))
        for w, e in ((box.west, lon), (lon, box.east))
    ]
    assert area(box) == pytest.approx(sum(map(area, quarters)), rel=1e-9)
    assert area(box) > 1.0


def drawn(*places: tuple[float, float], **more: object) -> ET.Element:
    marks = tuple(chart.Mark(place, f"<g{i}>", "diamond", "bad") for i, place in enumerate(places))
    return ET.fromstring(chart.svg(chart.Chart("a <map>", marks=marks, **more), coast.world()))


def test_every_place_is_in_the_picture_and_every_label_escaped():
    svg = drawn((24.0, -83.0), (24.5, -82.5), (23.9, -83.4))
    at = [m.get("transform", "") for m in svg.iter("path") if "mark" in m.get("class", "")]
    xy = np.array([[float(n) for n in re.findall(r"[\d.]+", text)] for text in at])
    assert len(xy) == 3
    assert ((xy > 0) & (xy < [chart.WIDTH, chart.HEIGHT])).all()
    assert [t.text for t in svg.iter("text") if t.text and t.text.startswith("<g")] == [
        "<g0>",
        "<g1>",
        "<g2>",
    ]


def test_the_scale_bar_is_as_long_as_it_says():
    svg = drawn((60.0, 3.0), (60.9, 3.0))
    (km,) = [t.text for t in svg.iter("text") if (t.text or "").endswith(" km")]
    bar = next(p.get("d", "") for p in svg.iter("path") if p.get("d", "").startswith("M12 "))
    length = float(re.search(r"H([\d.]+)", bar)[1]) - 12
    marks = [m.get("transform", "") for m in svg.iter("path") if "mark" in m.get("class", "")]
    apart = abs(np.diff([float(m.split()[1].rstrip(")")) for m in marks])[0])
    assert length / apart * 0.9 * 111.4 == pytest.approx(float(km.split()[0]), rel=0.02)


def test_a_fleet_about_the_date_line_has_a_small_map():
    view = chart.frame([(60.0, 179.5), (60.5, -179.5)])
    assert abs(abs(view.lon) - 180.0) < 0.01
    assert view.metres * chart.WIDTH < 300_000


@pytest.mark.parametrize("places", [[(24.0, -83.0)], [(70.0, 10.0), (-60.0, 150.0), (24.0, -83.0)]])
def test_no_map_is_long(places):
    marks = tuple(chart.Mark(place) for place in places)
    assert len(chart.svg(chart.Chart("", marks=marks), coast.world())) < 50_000


def test_no_label_of_an_area_stands_on_another():
    """A glider adrift: now, and in some hours."""
    areas = tuple(
        (DriftEllipse(38.7 + 0.002 * k, -62.2, 9e3 + 200.0 * k, 6e3, 60.0), "area", f"+{k} h")
        for k in range(5)
    )
    labels = re.findall(
        r'<text class="halo faint" x="([\d.]+)" y="([\d.]+)"[^>]*>\+',
        chart.svg(chart.Chart("m", areas=areas), coast.world()),
    )
    spots = [(float(x), float(y)) for x, y in labels]
    assert 2 <= len(spots) < len(areas)
    for k, (x, y) in enumerate(spots):
        assert all(abs(x - u) > 30 or abs(y - v) > 12 for u, v in spots[:k])


def test_the_outline_of_an_ellipse_has_its_axes():
    area = DriftEllipse(40.0, -70.0, 9000.0, 3000.0, 30.0)
    x = to_plane(*np.array(chart.outline(area)).T, 40.0, -70.0)
    r = np.hypot(*x.T)
    assert r.max() == pytest.approx(9000.0, rel=1e-3)
    assert r.min() == pytest.approx(3000.0, rel=1e-3)
    assert np.degrees(np.arctan2(*x[np.argmax(r)])) % 180 == pytest.approx(30.0, abs=0.1)


def some_dives() -> list[Assessment]:
    """Two dives at the usual speed, then two that are slow."""
    slow = {"flag": 1, "speed": 0.12}
    return [dive(14.0), dive(10.5), dive(7.0, **slow), dive(3.5, **slow)]


def test_every_panel_has_units_and_a_sentence():
    made = dives.panels(some_dives())
    assert {"Speed", "Roll", "Depth", "Time between surfacings"} <= {p.name for p in made}
    for panel in made:
        assert re.fullmatch(r".+ \(.+\)", panel.unit), panel.name
        assert panel.shows.endswith(".")


def test_what_has_no_value_is_no_panel():
    bare = [replace(d, evidence={}, speed=None, flow_u=None, flow_v=None) for d in some_dives()]
    assert "Roll" not in {p.name for p in dives.panels(bare)}


def test_a_panel_for_a_mail_is_a_png():
    assert plots.png(dives.speed(some_dives())).startswith(b"\x89PNG\r\n")
