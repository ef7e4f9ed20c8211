"""The section of a page: each profile in its place, with its layers and the band that was advised."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np

from gliderwatch.figures import section_svg
from gliderwatch.figures.section_svg import COLOURS, HEIGHT, TOP
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.layers.band import Band, Mode
from gliderwatch.layers.composite import Layer
from gliderwatch.layers.section import Section
from gliderwatch.model import readonly

HOUR = 3600.0


def advice(t: float, band: Band | None, *layers: Layer) -> LayerAdvice:
    return LayerAdvice(t, "temperature", Mode.TRACK, Band(0.0, 100.0), band, 2, 15.0, layers)


def found(n: int = 40) -> tuple[Section, tuple[LayerAdvice, ...]]:
    """Warm above 50 m, cold below; the second profile lacks its lower half."""
    profile = np.where(np.arange(n) < n / 2, 20.0, 10.0)
    second = np.where(np.arange(n) < n / 2, 20.0, np.nan)
    edges = readonly(np.linspace(0.0, 100.0, n + 1))
    section = Section(readonly([2 * HOUR, 5 * HOUR]), edges, readonly(np.stack([profile, second])))
    return section, (advice(2 * HOUR, None, Layer(45.0, 55.0, -1.0, 1.0)), advice(5 * HOUR, Band(40.0, 60.0)))


def test_values_layers_and_bands_stand_at_their_depth() -> None:
    svg = ET.fromstring(section_svg.svg(*found(), 0.0, 10 * HOUR))
    cells = {p.get("fill"): p.get("d", "") for p in svg.iter("path") if p.get("fill")}
    assert set(cells) == {COLOURS[0], COLOURS[-1]}
    assert cells[COLOURS[0]].count("z") == 1 and cells[COLOURS[-1]].count("z") == 2  # one box each
    (top, bottom) = (float(x) for x in re.findall(r"M[\d.]+ ([\d.]+)H[\d.]+V([\d.]+)", cells[COLOURS[0]])[0])
    middle = TOP + (HEIGHT - TOP - 20.0) / 2
    assert abs(top - middle) < 3.0 and abs(bottom - (HEIGHT - 20.0)) < 0.1
    ways = {p.get("class"): p.get("d", "") for p in svg.iter("path") if p.get("class")}
    for kind in ("layer", "band"):
        depths = [float(x) for x in re.findall(r"M[\d.]+ ([\d.]+)H", ways[kind])]
        assert len(depths) == 2 and abs(sum(depths) / 2 - middle) < 1.0, kind
    words = {t.text for t in svg.iter("text")}
    assert {"temperature (°C)", "depth (m)", "UTC", "10", "20"} <= words


def test_what_is_not_in_its_time_is_no_picture() -> None:
    assert section_svg.svg(*found(), 20 * HOUR, 30 * HOUR) == ""


def test_a_deep_section_stays_small() -> None:
    t = readonly(3 * HOUR * np.arange(40.0))
    value = readonly(np.random.default_rng(1).normal(size=(40, 300)))
    deep = Section(t, readonly(np.linspace(0.0, 1000.0, 301)), value)
    text = section_svg.svg(deep, tuple(advice(x, None) for x in t), 0.0, float(t[-1]))
    assert len(text) < 50_000
