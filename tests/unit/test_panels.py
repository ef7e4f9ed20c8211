"""Panels as pages show them: whole SVG of the page's own colours; what health, calls and incidents show."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.figures import dives, health, panel_svg, timeline
from gliderwatch.figures.panel_svg import LEFT, RIGHT, WIDTH
from gliderwatch.figures.plots import Line, Panel
from gliderwatch.figures.timeline import Bar
from gliderwatch.health.battery import End
from gliderwatch.model import Call, Series, readonly
from gliderwatch.pages.facts import call_log
from unit.test_figures import some_dives

DAY = 86400.0


def series(*values: float, step: float = DAY) -> Series:
    return Series(readonly(np.arange(len(values)) * step), readonly(values))


def test_a_panel_has_no_style_of_its_own_and_names_both_axes():
    text = panel_svg.svg(dives.speed(some_dives()))
    svg = ET.fromstring(text)
    assert " style=" not in text and "<style" not in text and " id=" not in text
    words = {t.text for t in svg.iter("text")}
    assert {"speed (m/s)", "UTC", "through water", "normal", "out of range"} <= words
    assert len([p for p in svg.iter("path") if p.get("class") == "m0"]) == 3  # two dives, one in the legend
    hostile = replace(dives.speed(some_dives()), name='"><script>', unit="<b>")
    assert "<script" not in panel_svg.svg(hostile) and "<b>" not in panel_svg.svg(hostile)


def test_values_stand_where_they_belong():
    t = np.array([0.0, 5.0, 10.0]) * DAY
    panel = Panel("x", "v (1)", "", (Line("a", t, np.array([0.0, np.nan, 4.0]), joined=False),), zero=True)
    (path,) = [p for p in ET.fromstring(panel_svg.svg(panel)).iter("path") if "dots" in p.get("class", "")]
    (x0, y0), (x1, y1) = (map(float, xy) for xy in re.findall(r"M([\d.]+) ([\d.]+)h0", path.get("d", "")))
    assert (x0, x1) == (LEFT, WIDTH - RIGHT)
    assert y0 > y1
    down = ET.fromstring(panel_svg.svg(replace(panel, down=True)))
    (path,) = [p for p in down.iter("path") if "dots" in p.get("class", "")]
    (_, y0), (_, y1) = (map(float, xy) for xy in re.findall(r"M([\d.]+) ([\d.]+)h0", path.get("d", "")))
    assert y0 < y1


def test_no_number_of_an_axis_is_cut_off():
    line = Line("x", np.arange(4.0) * DAY, np.array([0.0005, -0.0076, 0.0002, -0.0002]))
    svg = ET.fromstring(panel_svg.svg(Panel("x", "v (1)", "", (line,))))
    numbers = [t for t in svg.iter("text") if re.fullmatch(r"-?[\d.]+", t.text or "")]
    assert "-0.0025" in {t.text for t in numbers}
    assert all(float(t.get("x")) >= 6.0 * len(t.text) for t in numbers)


def test_a_panel_of_another_time_shows_its_axes_alone():
    text = panel_svg.svg(dives.speed(some_dives()), (0.0, DAY))
    assert "M" in text and 'class="dots' not in text.partition("<g")[0]


READINGS = {
    "battery_charge": series(0.9, 0.8, 0.7),
    "battery_voltage": series(15.0, 14.9, 14.8),
    "leak_voltage": series(2.5, 2.5, 2.4),
    "digifin_leak": series(1023.0, 1022.0),
    "vacuum": series(25000.0, 24000.0),
    "gas_density": series(264.0, 265.0),
    "errors:gps": series(0.0, 2.0),
    "errors:all": series(0.0, 0.0),
    "warnings:all": series(1.0, 4.0),
    "battery_position_error": series(0.001, 0.002),
    "fix_age": series(60.0, 120.0),
}


def test_the_panels_of_health_have_units_and_a_sentence():
    calls = [Call("electa", "x", t, t) for t in (0.0, 3600.0, 18000.0)]
    made = {p.name: p for p in health.panels(READINGS, None, calls)}
    assert set(made) >= {
        "Battery",
        "Battery voltage",
        "Leak detectors",
        "Leak detector of the digifin",
        "Vacuum",
        "Devices",
        "Battery position",
        "Age of the fix",
        "Calls",
    }
    for panel in made.values():
        assert re.fullmatch(r".+ \(.+\)", panel.unit), panel.name
        assert panel.shows.endswith("."), panel.name
        ET.fromstring(panel_svg.svg(panel))
    assert [line.label for line in made["Devices"].lines] == ["errors of gps", "warnings"]
    assert made["Calls"].lines[0].v == pytest.approx([1.0, 4.0])
    assert made["Battery position"].lines[0].v == pytest.approx([1.0, 2.0])
    assert health.panels({}) == []


def test_the_projection_of_the_battery_ends_when_it_is_empty():
    end = End(2 * DAY, 7 * DAY, 5 * DAY, 9 * DAY, "battery_charge")
    panel = health.panels(READINGS, end)[0]
    measured, projected = panel.lines
    assert measured.v == pytest.approx([90, 80, 70])
    assert projected.t == pytest.approx([2 * DAY, 9 * DAY])
    assert projected.v == pytest.approx([70.0, 0.0])
    assert "empty in 7 days" in panel.shows and "5 to 9" in panel.shows


def test_what_is_open_reaches_the_end_of_the_timeline():
    bars = [Bar("leak", 0.0, None, "bad", "leak <b>"), Bar("late", -9 * DAY, -8 * DAY, "warn", "gone")]
    svg = ET.fromstring(timeline.svg("of electa", bars, -DAY, DAY))
    (rect,) = svg.iter("rect")
    assert float(rect.get("x", "")) + float(rect.get("width", "")) == pytest.approx(WIDTH - 6)
    assert rect.get("class") == "bad open"
    assert timeline.svg("none", bars[1:], -DAY, DAY) == ""


LOG = """Because:timeout expired [the line's rest]
devices:(t/m/s) errs:   0/  0/  0 warn:   3/  3/  0 odd:  61/ 72/   4
   sensor:m_leakdetect_voltage(volts)=2.49        39.2 secs ago
ABORT HISTORY: total since reset: 0
Hit Control-C to END the mission, i.e. GliderDos
ABORT HISTORY: last abort cause: MS_ABORT_LEAK
GliderDos A 24 >
"""


def test_the_lines_of_a_log_that_matter_come_first():
    call = Call("electa", "x", 0.0, 1.0, announced=("a.sbd", "b.sbd"), sent=("a.sbd",))
    found = call_log(LOG, call)
    assert found.marked == (
        "Because:timeout expired [the line's rest]",
        "ABORT HISTORY: last abort cause: MS_ABORT_LEAK",
        "GliderDos A 24 >",
    )
    assert (found.sent, found.cut) == (("a.sbd",), ("b.sbd",))
    assert len(found.text.splitlines()) == 7
