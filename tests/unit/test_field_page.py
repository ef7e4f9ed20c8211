"""The page of a field: what it says is what the values are, wherever they are."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gliderwatch.figures.coast import world
from gliderwatch.figures.field_svg import FieldPanel, Spot, svg
from gliderwatch.figures.section_svg import COLOURS
from gliderwatch.fleet.advice import Box
from gliderwatch.pages.fields import FieldView, panels, sentence
from gliderwatch.pages.render import Frame, field_page
from unit.test_pages import HOSTILE, NOW

RAMP = np.arange(12.0).reshape(3, 4)


def view(**other: object) -> FieldView:
    values: dict[str, object] = {
        "name": "upper", "sensor": "temperature", "box": Box(20.0, 179.0, 22.0, -178.0, 0.0, 100.0),
        "now": NOW, "last": NOW - 3600.0, "depth": 40.0, "north": 21.0, "map": (RAMP, RAMP / 10),
        "section": (RAMP, RAMP / 10), "spots": (Spot(HOSTILE, 180.5, 21.0, (181.0, 21.5)),),
    }  # fmt: skip
    return FieldView(**(values | other))  # type: ignore[arg-type]


def test_sentences_say_least_greatest_and_where_it_is_worst() -> None:
    (_, of_map), (_, of_errors), (_, of_section), (_, deep) = panels(view())
    assert of_map == "Temperature at 40 m, where it differs most from place to place: 0 to 11 °C."
    assert of_errors == "How well that is known: to 0 °C at best, to 1.1 in the north east."
    assert of_section.startswith("Temperature at 21.00°N, in the middle of its gliders: 0 to 11 °C")
    assert deep.endswith("to 1.1 in the lower east.")
    middle = np.zeros((3, 3))
    middle[1, 1] = 1.0
    assert panels(view(map=(RAMP, middle)))[1][1].endswith("in the middle.")
    assert "1 glider in it now" in sentence(view())
    assert "no glider is in it now" in sentence(view(spots=()))


@pytest.mark.parametrize(("is_section", "lowest"), [(False, 1.0), (True, 0.0)])
def test_cells_lie_where_their_values_are(is_section: bool, lowest: float) -> None:
    """The first row of a map is its south, at the bottom; that of a section is its top."""
    drawn = svg(FieldPanel("t", "m", RAMP, (0.0, 4.0), (0.0, 3.0), is_section), world())
    boxes = {
        colour: re.findall(r"M([\d.]+) ([\d.]+)H([\d.]+)V([\d.]+)", way)
        for colour, way in re.findall(r'<path fill="(#\w+)" d="([^"]+)"', drawn)
    }
    (first,) = ([float(x) for x in box] for box in boxes[COLOURS[0]])
    last = [float(x) for x in boxes[COLOURS[-1]][-1]]
    assert first[0] < last[0]  # the least value is in the west, the greatest in the east
    assert (first[1] > last[1]) == (lowest == 1.0)


def test_what_is_not_known_is_left_free() -> None:
    values = RAMP.copy()
    values[0, 0] = np.nan
    drawn = svg(FieldPanel("t", "m", values, (0.0, 4.0), (0.0, 3.0)), world())
    assert ">1<" in drawn and ">0<" not in drawn.replace(">0°", "")
    assert svg(FieldPanel("t", "m", RAMP * np.nan, (0.0, 4.0), (0.0, 3.0)), world()) == ""


def test_a_page_is_escaped_and_goes_across_the_date_line() -> None:
    page = field_page(view(name=HOSTILE), Frame(NOW, NOW + 900.0), world())
    assert "<script>alert" not in page
    assert ">180°W<" in page and ">179°W<" in page
    assert page.count('<circle class="next"') == 2


def test_names_of_gliders_that_are_close_do_not_cover_each_other() -> None:
    spots = tuple(Spot(f"sim-0{k}", 2.0, 1.5) for k in range(4))
    drawn = svg(FieldPanel("t", "m", RAMP, (0.0, 4.0), (0.0, 3.0), spots=spots), world())
    places = re.findall(r'<text[^>]*x="([\d.]+)" y="([\d.]+)"[^>]*>sim-0', drawn)
    assert len(places) == len(set(places)) == 4
