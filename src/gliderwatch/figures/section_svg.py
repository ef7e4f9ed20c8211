"""A section along the way of a glider as inline SVG: a property by time and depth, with the layers in it
and the bands that were advised. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from itertools import pairwise

import numpy as np

from gliderwatch.figures.panel_svg import text, ticks, times
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.layers.section import Section
from gliderwatch.model import Array

WIDTH, HEIGHT = 340.0, 220.0
LEFT, RIGHT, TOP, BOTTOM = 40.0, 8.0, 34.0, 20.0
ROWS = 40
"""Depths that are drawn at the most: a page stays small."""
COLOURS = (
    "#440154",
    "#482878",
    "#3e4989",
    "#31688e",
    "#26828e",
    "#1f9e89",
    "#35b779",
    "#6ece58",
    "#b5de2b",
    "#fde725",
)
"""Of low to high values: viridis, which the colour-blind can tell and which gets lighter all the way."""
UNITS = {"temperature": "°C", "salinity": "1", "density": "kg/m³ less 1000", "oxygen": "µmol/l"}
STYLE = """\
.section{width:100%;background:var(--card);border-radius:6px;font:11px system-ui,sans-serif}
.section text{fill:var(--ink)}.section .layer{fill:none;stroke:#fff;stroke-width:2.6}
.section .edge{fill:none;stroke:#000;stroke-width:1.2}
.section .band{fill:none;stroke:#d55e00;stroke-width:2;stroke-dasharray:5 3}
"""


def svg(found: Section, advice: Sequence[LayerAdvice], start: float, end: float) -> str:
    """The profiles of a section between two times (s), `advice` one a profile; empty where there is none."""
    shown = [k for k, t in enumerate(found.t) if start <= t <= end]
    if not shown or not np.isfinite(found.value[shown]).any():
        return ""
    sensor = advice[shown[0]].sensor
    label = f"Section of {sensor} by time and depth"
    values, edges = _coarse(found)
    finite = values[shown][np.isfinite(values[shown])]
    low, high = (float(x) for x in np.quantile(finite, [0.01, 0.99]))
    bottom = float(edges[-1])
    parts = [
        f'<svg class="section" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{escape(label)}">',
        *_cells(found.t, values, edges, shown, (low, max(high, low + 1e-9)), (start, end)),
        *_layers(found.t, advice, shown, bottom, (start, end)),
        *_axes(start, end, bottom),
        *_key(sensor, low, high),
        "</svg>",
    ]
    return "\n".join(parts)


def _coarse(found: Section) -> tuple[Array, Array]:
    """Values in at most `ROWS` bins of depth, and their edges."""
    n = len(found.edges) - 1
    by = -(-n // ROWS)
    if by == 1:
        return found.value, found.edges
    starts = np.arange(0, n, by)
    known = np.isfinite(found.value)
    sums = np.add.reduceat(np.where(known, found.value, 0.0), starts, axis=1)
    counts = np.add.reduceat(known.astype(float), starts, axis=1)
    edges = np.append(found.edges[starts], found.edges[-1])
    return np.where(counts > 0, sums / np.maximum(counts, 1.0), np.nan), edges


def _x(t: float, span: tuple[float, float]) -> float:
    return LEFT + (t - span[0]) / (span[1] - span[0]) * (WIDTH - LEFT - RIGHT)


def _y(depth: float, bottom: float) -> float:
    return TOP + min(depth / bottom, 1.0) * (HEIGHT - TOP - BOTTOM)


def _sides(t: Array, k: int, span: tuple[float, float]) -> tuple[float, float]:
    """Where a profile begins and ends: half way to its neighbours, but six hours at the most."""
    reach = 6 * 3600.0
    before = min((t[k] - t[k - 1]) / 2, reach) if k else reach / 4
    after = min((t[k + 1] - t[k]) / 2, reach) if k + 1 < len(t) else reach / 4
    return _x(max(t[k] - before, span[0]), span), _x(min(t[k] + after, span[1]), span)


def _cells(
    t: Array,
    values: Array,
    edges: Array,
    shown: Sequence[int],
    limits: tuple[float, float],
    span: tuple[float, float],
) -> Iterator[str]:
    """One path a colour: of a profile, neighbours of one colour are one box."""
    ways: dict[int, list[str]] = {}
    bottom = float(edges[-1])
    for k in shown:
        left, right = _sides(t, k, span)
        part = (values[k] - limits[0]) / (limits[1] - limits[0])
        known = np.isfinite(part)
        level = np.where(known, np.clip(np.nan_to_num(part) * len(COLOURS), 0, len(COLOURS) - 1), -1).astype(
            int
        )
        cuts = [0, *(np.flatnonzero(np.diff(level)) + 1).tolist(), len(level)]
        for i, j in pairwise(cuts):
            if level[i] >= 0:
                top, low = _y(float(edges[i]), bottom), _y(float(edges[j]), bottom)
                ways.setdefault(int(level[i]), []).append(
                    f"M{left:.1f} {top:.1f}H{right:.1f}V{low:.1f}H{left:.1f}z"
                )
    for colour, boxes in sorted(ways.items()):
        yield f'<path fill="{COLOURS[colour]}" d="{"".join(boxes)}"/>'


def _layers(
    t: Array, advice: Sequence[LayerAdvice], shown: Sequence[int], bottom: float, span: tuple[float, float]
) -> Iterator[str]:
    """The limits of each layer, white with a black edge, and of the band that was advised after, dashed."""
    layers, bands = [], []
    for k in shown:
        left, right = _sides(t, k, span)
        for layer in advice[k].layers:
            layers += [
                f"M{left:.1f} {_y(depth, bottom):.1f}H{right:.1f}" for depth in (layer.top, layer.bottom)
            ]
        band = advice[k].band
        if band is not None:
            bands += [f"M{left:.1f} {_y(depth, bottom):.1f}H{right:.1f}" for depth in (band.top, band.bottom)]
    if layers:
        yield f'<path class="layer" d="{"".join(layers)}"/><path class="edge" d="{"".join(layers)}"/>'
    if bands:
        yield f'<path class="band" d="{"".join(bands)}"/>'


def _axes(start: float, end: float, bottom: float) -> Iterator[str]:
    for depth in ticks(0.0, bottom):
        yield text(LEFT - 4, _y(depth, bottom) + 4, f"{depth:g}", "end")
    for t, label in times(start, end):
        x = _x(t, (start, end))
        if LEFT - 2 <= x <= WIDTH - RIGHT - 34:
            yield text(x, HEIGHT - 6, label, "middle")
    yield text(WIDTH - RIGHT, HEIGHT - 6, "UTC", "end")
    yield text(2, TOP - 4, "depth (m)", "start")


def _key(sensor: str, low: float, high: float) -> Iterator[str]:
    """The colours with the values of the first and the last."""
    unit = UNITS.get(sensor, "")
    yield text(2, 11, f"{sensor} ({unit})" if unit else sensor, "start")
    x = WIDTH - RIGHT - 40 - 10.0 * len(COLOURS)
    yield text(x - 4, 11, f"{low:.4g}", "end")
    for k, colour in enumerate(COLOURS):
        yield f'<rect x="{x + 10 * k:.0f}" y="3" width="10" height="9" fill="{colour}"/>'
    yield text(x + 10 * len(COLOURS) + 4, 11, f"{high:.4g}", "start")
