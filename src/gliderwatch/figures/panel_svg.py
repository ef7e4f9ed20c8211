"""A panel as inline SVG for a page: light and dark by the page's own colours, some 1 ms of processor. Pure.

matplotlib needs some 60 ms for a panel (`benchmarks/pages.py`), and a glider has twenty: its pages are
written after each file. What is drawn is the same `Panel` that matplotlib draws for mails and reports.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape
from math import ceil, floor, log10

import numpy as np

from gliderwatch.figures.plots import DENSE, Line, Panel
from gliderwatch.model import Array

WIDTH, HEIGHT = 340.0, 156.0
"""Of a panel in its own units: the width of a phone, so that text there is as large as it says."""
LEFT, RIGHT, TOP, BOTTOM = 40.0, 8.0, 30.0, 20.0
CHAR, DIGIT = 5.9, 6.4
"""Units that a character of the legend takes, about, and one of a number at the most."""
HOUR, DAY = 3600.0, 86400.0
TIME_STEPS = tuple(x * HOUR for x in (1, 2, 3, 6, 12, 24, 48, 120, 240, 480, 720, 1440, 2880, 8760))
"""Seconds between two times on the axis."""
STYLE = """\
.plot{width:100%;background:var(--card);border-radius:6px;font:11px system-ui,sans-serif}
.plot text{fill:var(--ink)}.plot .faint{fill:var(--soft)}.plot .grid{stroke:var(--line);fill:none}
.plot .band{fill:var(--s0);fill-opacity:.16}.plot .s{fill:none;stroke-width:1.6;stroke-linejoin:round}
.plot .fine{stroke-width:.4}.plot .dots{fill:none;stroke-width:4.4;stroke-linecap:round}
.plot .error{fill:none;stroke-width:1;stroke-opacity:.45}
.s0{stroke:var(--s0)}.s1{stroke:var(--s1);stroke-dasharray:6 3}.s2{stroke:var(--s2);stroke-dasharray:2 3}
.s3{stroke:var(--s3);stroke-dasharray:8 3 2 3}.dots.s1,.dots.s2,.dots.s3,.error.s1,.error.s2,.error.s3{
stroke-dasharray:none}.plot .m0{fill:var(--bad)}.plot .m1{fill:var(--warn)}
"""
"""How the parts of a panel look, by the colours of its page: those of Okabe and Ito (2008)."""
_SHAPES = ("M0-5L5 4L-5 4z", "M0-5L5 0L0 5L-5 0z")
"""Of what is marked: triangle, diamond."""


@dataclass(frozen=True, slots=True)
class _Scale:
    """From times (s) and values to the picture: the box of both that it shows; ``down``: values grow down.
    ``left``: where it begins, behind the numbers of the axis."""

    start: float
    end: float
    low: float
    high: float
    down: bool
    left: float

    def x(self, t: Array | float) -> Array:
        part: Array = (np.asarray(t, float) - self.start) / (self.end - self.start)
        return self.left + part * (WIDTH - self.left - RIGHT)

    def y(self, v: Array | float) -> Array:
        part: Array = (np.clip(np.asarray(v, float), self.low, self.high) - self.low) / (self.high - self.low)
        part = part if self.down else 1.0 - part
        return TOP + part * (HEIGHT - TOP - BOTTOM)


def svg(panel: Panel, span: tuple[float, float] | None = None) -> str:
    """The panel as an `svg` element of the classes of `STYLE`; every label is escaped.

    `span` are the first and the last time (s) of its axis; None: those of its values.
    """
    scale = _scale(panel, span)
    label = escape(f"{panel.name}, {panel.unit}")
    parts = [
        f'<svg class="plot" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{label}">',
        *_axes(panel, scale),
        *_band(panel, scale),
        *(part for k, line in enumerate(panel.lines) for part in _line(line, k % 4, scale)),
        *(part for k, one in enumerate(panel.marked) for part in _marks(*one[1:], k % 2, scale)),
        *_legend(panel),
        "</svg>",
    ]
    return "\n".join(parts)


def _scale(panel: Panel, span: tuple[float, float] | None) -> _Scale:
    times = np.concatenate([line.t[np.isfinite(line.v)] for line in panel.lines])
    start, end = span if span is not None else (float(times.min()), float(times.max()))
    bounds = panel.bounds(0.1)
    if bounds is None:
        raise ValueError(f"{panel.name} has no value to show")
    longest = max(len(f"{v:g}") for v in ticks(*bounds))
    return _Scale(start, max(end, start + HOUR), *bounds, panel.down, max(LEFT, 8 + DIGIT * longest))


# ----------------------------------------
# Axes.


def ticks(low: float, high: float, most: int = 4) -> list[float]:
    """Round values from `low` to `high`, at most so many and one more.

    >>> ticks(0.03, 0.31), ticks(-30.0, 30.0)
    ([0.1, 0.2, 0.3], [-20.0, 0.0, 20.0])
    """
    ten = 10.0 ** floor(log10((high - low) / most))
    step = next(k * ten for k in (1, 2, 2.5, 5, 10) if (high - low) / (k * ten) <= most)
    return [float(f"{k * step:.10g}") for k in range(ceil(low / step), floor(high / step) + 1)]


def times(start: float, end: float, most: int = 5) -> list[tuple[float, str]]:
    """Times (s) for an axis, each with what is written there: the date, or the hour where days are long.

    >>> times(0.0, 3 * 86400.0)
    [(0.0, '1 Jan'), (86400.0, '2 Jan'), (172800.0, '3 Jan'), (259200.0, '4 Jan')]
    >>> times(1000.0, 30000.0)
    [(7200.0, '02:00'), (14400.0, '04:00'), (21600.0, '06:00'), (28800.0, '08:00')]
    """
    step = next((s for s in TIME_STEPS if (end - start) / s <= most), TIME_STEPS[-1])
    found = [k * step for k in range(ceil(start / step), floor(end / step) + 1)]
    return [(t, _when(t, step)) for t in found]


def _when(t: float, step: float) -> str:
    at = datetime.fromtimestamp(t, UTC)
    return f"{at.day} {at:%b}" if step >= DAY or t % DAY == 0 else f"{at:%H:%M}"


def _axes(panel: Panel, scale: _Scale) -> Iterator[str]:
    bottom = HEIGHT - BOTTOM
    for v in ticks(scale.low, scale.high):
        y = float(scale.y(v))
        yield f'<path class="grid" d="M{scale.left:g} {y:.1f}H{WIDTH - RIGHT:g}"/>'
        yield text(scale.left - 4, y + 4, f"{v:g}", "end")
    for t, label in times(scale.start, scale.end):
        x = float(scale.x(t))
        yield f'<path class="grid" d="M{x:.1f} {TOP:g}V{bottom:g}"/>'
        if scale.left - 2 <= x <= WIDTH - RIGHT - 24 - CHAR * len(label) / 2:  # `UTC` stands at the end
            yield text(x, HEIGHT - 6, label, "middle")
    yield text(WIDTH - RIGHT, HEIGHT - 6, "UTC", "end", "faint")
    yield text(2, 11, panel.unit, "start", "faint")


def _legend(panel: Panel) -> Iterator[str]:
    """What each line is, in a row from the right; nothing where there is one line alone."""
    entries: list[tuple[str, str]] = []
    for k, line in enumerate(panel.lines):
        way = "h14" if line.joined else "m7 0h0"
        entries.append(
            (line.label, f'<path class="{"s" if line.joined else "dots"} s{k % 4}" d="M0 0{way}"/>')
        )
    entries += [
        (words, f'<path class="m{k % 2}" transform="translate(7 0)" d="{_SHAPES[k % 2]}"/>')
        for k, (words, t, _) in enumerate(panel.marked)
        if len(t)
    ]
    if panel.band is not None:
        entries.append(("normal", '<path class="band" d="M0-5h14v10H0z"/>'))
    if len(entries) < 2:
        return
    x, y = 2.0, 22
    for label, mark in entries:
        width = 26 + CHAR * len(label)
        if x + width > WIDTH + 6 and y == 22:  # the rest stands beside the name of the axis
            x, y = 14 + CHAR * len(panel.unit), 8
        yield f'<g transform="translate({x:.0f} {y})">{mark}{text(18, 4, label, "start")}</g>'
        x += width


def text(x: float, y: float, label: str, anchor: str, kind: str = "") -> str:
    """A label, escaped, that begins, ends or has its middle (`anchor`) at a place."""
    of_class = f' class="{kind}"' if kind else ""
    return f'<text{of_class} x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(label)}</text>'


# ----------------------------------------
# Values.


def _band(panel: Panel, scale: _Scale) -> Iterator[str]:
    if panel.band is None:
        return
    t, low, high = panel.band
    good = np.isfinite(low) & np.isfinite(high) & (t >= scale.start) & (t <= scale.end)
    if good.sum() < 2:
        return
    x = scale.x(t[good])
    upper, lower = _points(x, scale.y(high[good])), _points(x[::-1], scale.y(low[good])[::-1])
    yield f'<path class="band" d="M{"L".join((*upper, *lower))}z"/>'


def _line(line: Line, k: int, scale: _Scale) -> Iterator[str]:
    good = np.isfinite(line.v) & (line.t >= scale.start) & (line.t <= scale.end)
    if not good.any():
        return
    x, y = scale.x(line.t), scale.y(line.v)
    if line.sigma is not None:
        low, high = scale.y(line.v - line.sigma), scale.y(line.v + line.sigma)
        some = good & np.isfinite(line.sigma)
        bars = zip(x[some].tolist(), low[some].tolist(), high[some].tolist(), strict=True)
        way = "".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in bars)
        yield f'<path class="error s{k}" d="{way}"/>'
    if line.joined:
        cuts = np.flatnonzero(np.diff(good.astype(int)) != 0) + 1
        runs = [run for run in np.split(np.arange(len(good)), cuts) if good[run[0]]]
        way = "".join(f"M{'L'.join(_points(x[run], y[run]))}" for run in runs)
        kind = "s" if len(x) < DENSE else "s fine"
        yield f'<path class="{kind} s{k}" d="{way}"/>'
    else:
        way = "".join(f"M{point}h0" for point in _points(x[good], y[good]))
        yield f'<path class="dots s{k}" d="{way}"/>'


def _marks(t: Array, v: Array, k: int, scale: _Scale) -> Iterator[str]:
    inside = (t >= scale.start) & (t <= scale.end)
    for point in _points(scale.x(t[inside]), scale.y(v[inside])):
        yield f'<path class="m{k}" transform="translate({point})" d="{_SHAPES[k]}"/>'


def _points(x: Array, y: Array) -> Sequence[str]:
    return [f"{a:.1f} {b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True)]
