"""A field of the sea as inline SVG: its values on a map or in a section, in cells of colour, with the coast,
gliders, and where each should look next. Pure but for the coast, which is given."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from math import cos, radians

import numpy as np

from gliderwatch.figures.coast import Box, Land, rings_in
from gliderwatch.figures.panel_svg import text, ticks
from gliderwatch.figures.section_svg import COLOURS
from gliderwatch.model import Array

WIDTH = 340.0
LEFT, RIGHT, TOP, BOTTOM = 44.0, 10.0, 24.0, 20.0
TALLEST, LOWEST = 1.2, 0.5
"""Of the values, as parts of their width."""
LETTER, LINE = 6.5, 12.0
"""Width of a letter of a name, and height of a line, in units of the picture."""
STYLE = """\
.field{width:100%;background:var(--card);border-radius:6px;font:11px system-ui,sans-serif}
.field text{fill:var(--ink)}.field .land{fill:var(--land);stroke:var(--shore);stroke-width:.8}
.field .way{fill:none;stroke:#fff;stroke-width:3.6}
.field .way.thin{stroke:#000;stroke-width:1.4;stroke-dasharray:4 2}
.field .glider{fill:#fff;stroke:#000;stroke-width:1.2}.field .next{fill:none;stroke:#000;stroke-width:1.6}
.field .ring{fill:none;stroke:#fff;stroke-width:4}
.field .name{fill:#000;paint-order:stroke;stroke:#fff;stroke-width:3px;font-weight:600}
"""


@dataclass(frozen=True, slots=True)
class Spot:
    """A glider at ``x``, ``y`` of a panel, and where it should look next (``to``), if that is advised."""

    name: str
    x: float
    y: float
    to: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class FieldPanel:
    """Values ((n, m): from the bottom up, or from the top down where ``is_section``) between the limits of
    both axes: longitude and latitude (degrees), or longitude and depth (m). NaN is left free."""

    title: str
    unit: str
    values: Array
    across: tuple[float, float]
    along: tuple[float, float]
    is_section: bool = False
    spots: tuple[Spot, ...] = ()


@dataclass(frozen=True, slots=True)
class _Frame:
    """Where values lie in the picture."""

    panel: FieldPanel
    height: float

    def x(self, value: float) -> float:
        west, east = self.panel.across
        return LEFT + (value - west) / (east - west) * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        first, last = self.panel.along
        part = (value - first) / (last - first)
        return TOP + self.height * (part if self.panel.is_section else 1 - part)


def svg(panel: FieldPanel, land: Land) -> str:
    """The picture; empty where there is no value."""
    finite = panel.values[np.isfinite(panel.values)]
    if not len(finite):
        return ""
    low, high = float(finite.min()), float(finite.max())
    frame = _Frame(panel, _height(panel))
    whole = TOP + frame.height + BOTTOM
    box, label = f"0 0 {WIDTH:g} {whole:.0f}", escape(panel.title)
    parts = [
        f'<svg class="field" viewBox="{box}" role="img" aria-label="{label}">',
        *_cells(frame, low, max(high, low + 1e-9)),
        *([] if panel.is_section else _coast(frame, land)),
        *_spots(frame),
        *_axes(frame, whole),
        *_key(panel, low, high),
        "</svg>",
    ]
    return "\n".join(parts)


def _height(panel: FieldPanel) -> float:
    """Of the values: a map is true to the earth in its middle, where that is not too flat or too tall."""
    if panel.is_section:
        return LOWEST * (WIDTH - LEFT - RIGHT)
    (west, east), (south, north) = panel.across, panel.along
    true = (north - south) / ((east - west) * cos(radians((south + north) / 2)))
    return float(np.clip(true, LOWEST, TALLEST)) * (WIDTH - LEFT - RIGHT)


def _cells(frame: _Frame, low: float, high: float) -> Iterator[str]:
    """One path a colour: neighbours in a row that have one colour are one box."""
    panel = frame.panel
    part = (panel.values - low) / (high - low)
    level = np.where(np.isfinite(part), np.clip(np.nan_to_num(part) * len(COLOURS), 0, len(COLOURS) - 1), -1)
    rows, columns = panel.values.shape
    x = np.linspace(frame.x(panel.across[0]), frame.x(panel.across[1]), columns + 1)
    y = np.linspace(frame.y(panel.along[0]), frame.y(panel.along[1]), rows + 1)
    ways: dict[int, list[str]] = {}
    for row, (top, low_edge) in zip(level.astype(int), pairwise(y), strict=True):
        cuts = [0, *(np.flatnonzero(np.diff(row)) + 1).tolist(), len(row)]
        for i, j in pairwise(cuts):
            if row[i] >= 0:
                box = f"M{x[i]:.1f} {top:.1f}H{x[j]:.1f}V{low_edge:.1f}H{x[i]:.1f}z"
                ways.setdefault(int(row[i]), []).append(box)
    for colour, boxes in sorted(ways.items()):
        yield f'<path fill="{COLOURS[colour]}" d="{"".join(boxes)}"/>'


def _coast(frame: _Frame, land: Land) -> Iterator[str]:
    (west, east), (south, north) = frame.panel.across, frame.panel.along
    for ring in rings_in(land, Box(south, north, west, east), (north - south) / 100):
        points = "L".join(f"{frame.x(lon):.1f} {frame.y(lat):.1f}" for lon, lat in ring)
        yield f'<path class="land" d="M{points}z"/>'


def _spots(frame: _Frame) -> Iterator[str]:
    """Gliders as dots, what is advised as a dashed line to a ring; light and dark, to be seen on any
    colour."""
    for spot in frame.panel.spots:
        x, y = frame.x(spot.x), frame.y(spot.y)
        if spot.to is not None:
            u, v = frame.x(spot.to[0]), frame.y(spot.to[1])
            for kind in ("way", "way thin"):
                yield f'<path class="{kind}" d="M{x:.1f} {y:.1f}L{u:.1f} {v:.1f}"/>'
            for kind in ("ring", "next"):
                yield f'<circle class="{kind}" cx="{u:.1f}" cy="{v:.1f}" r="5"/>'
        yield f'<circle class="glider" cx="{x:.1f}" cy="{y:.1f}" r="4"/>'
    yield from _names(frame)


def _names(frame: _Frame) -> Iterator[str]:
    """The names of the gliders: beside their dots, or a line above or below where another's is there."""
    placed = list[tuple[float, float]]()
    for spot in frame.panel.spots:
        x, y = frame.x(spot.x), max(frame.y(spot.y) + 4, TOP + 9)
        is_right = x < WIDTH * 0.7 and (spot.to is None or spot.to[0] <= spot.x or x < WIDTH * 0.3)
        long = LETTER * len(spot.name)
        sides = [(x + 7, "start", x + 7 + long / 2), (x - 7, "end", x - 7 - long / 2)]
        tried = [
            (at, anchor, middle, y + off)
            for off in (0.0, LINE, -LINE)
            for at, anchor, middle in (sides if is_right else sides[::-1])
        ]
        free = (
            each
            for each in tried
            if abs(each[2] - WIDTH / 2) + long / 2 < WIDTH / 2
            and all(abs(each[2] - u) > long or abs(each[3] - v) >= LINE for u, v in placed)
        )
        at, anchor, middle, line = next(free, tried[0])
        placed.append((middle, line))
        yield text(at, line, spot.name, anchor, "name")


def _axes(frame: _Frame, whole: float) -> Iterator[str]:
    panel = frame.panel
    ends = sorted(panel.along)
    for value in ticks(ends[0], ends[1]):
        label = f"{value:g}" if panel.is_section else _degrees(value, "NS")
        yield text(LEFT - 4, frame.y(value) + 4, label, "end")
    for value in ticks(*panel.across, most=3):
        x = frame.x(value)
        yield text(
            x,
            whole - 6,
            _degrees((value + 180.0) % 360.0 - 180.0, "EW"),
            "end" if x > WIDTH - 30 else "middle",
        )
    if panel.is_section:
        yield text(2, 13, "depth (m)", "start")


def _degrees(value: float, letters: str) -> str:
    return f"{abs(value):g}°{letters[value < 0]}"


def _key(panel: FieldPanel, low: float, high: float) -> Iterator[str]:
    """The colours with the least and the greatest value."""
    x = WIDTH - RIGHT - 90 - 8.0 * len(COLOURS)
    yield text(x - 4, 13, f"{low:.3g}", "end")
    for k, colour in enumerate(COLOURS):
        yield f'<rect x="{x + 8 * k:.0f}" y="5" width="8" height="9" fill="{colour}"/>'
    yield text(x + 8 * len(COLOURS) + 4, 13, f"{high:.3g} {panel.unit}", "start")
