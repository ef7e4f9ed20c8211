"""Plots over time as SVG and PNG, drawn by matplotlib: one panel, one message; units on every axis.

The colours are those of Okabe and Ito (2008), which the colour-blind can tell; lines differ in dashes too.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from functools import cache
from html import escape
from typing import Any

import numpy as np

from gliderwatch.model import Array

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
SIZE = (5.4, 2.0)
"""Inches of a panel, of 72 units each in an SVG."""
AREA = (0.13, 0.24, 0.85, 0.62)
"""The axes in it: left, bottom, width, height. Fixed: to find the least margins takes as long as the rest."""
PNG_SIZE, PNG_AREA = (5.4, 2.7), (0.13, 0.19, 0.85, 0.6)
"""The same of a panel as PNG, which has its name above."""
_MARKS = (("^", COLOURS[1]), ("D", COLOURS[4]))
_DASHES = ("-", "--", ":", "-.")
_DIGITS = re.compile(r"(\d+\.\d)\d+")
_WHOLE = re.compile(r"(?<=\d)\.0(?=[\sL\"z)])")
_STYLE = re.compile(r' style="([^"]*)"')
_FONT = re.compile(r"([\d.]+)px")


@dataclass(frozen=True, slots=True)
class Line:
    """Values ``v`` at times ``t`` (s), NaN where there is none; ``sigma``: their standard error, if known.

    Drawn as a line where they are ``joined``, else as dots.
    """

    label: str
    t: Array
    v: Array
    sigma: Array | None = None
    joined: bool = True


@dataclass(frozen=True, slots=True)
class Panel:
    """One plot: ``unit`` is the label of its axis of values, ``shows`` says in a sentence what it shows.

    ``band`` is the normal range: times (s), its lower and upper bounds. ``marked``: times, values and words
    of what is to be seen first, as `flag 1`. ``zero``: the axis begins at 0; ``down``: it grows downwards.
    """

    name: str
    unit: str
    shows: str
    lines: tuple[Line, ...]
    band: tuple[Array, Array, Array] | None = None
    marked: tuple[tuple[str, Array, Array], ...] = ()
    zero: bool = False
    down: bool = False


@cache
def library() -> Any:
    """matplotlib, ready to draw: slow to load, so that it is loaded by who draws.

    Its figures are made without pyplot, which would keep them.
    """
    import matplotlib  # noqa: PLC0415

    matplotlib.use("svg")
    matplotlib.rcParams.update(
        {
            "svg.hashsalt": "gliderwatch",
            "svg.fonttype": "none",
            "xtick.major.size": 0,
            "ytick.major.size": 0,
            "font.size": 9,
            "axes.grid": True,
            "grid.alpha": 0.25,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "path.simplify": False,  # it would drop the dots
        }
    )
    import matplotlib.dates  # noqa: PLC0415
    import matplotlib.figure  # noqa: PLC0415
    import matplotlib.patches  # noqa: PLC0415
    import matplotlib.patheffects  # noqa: PLC0415

    return matplotlib


def svg(panel: Panel) -> str:
    """The panel as an `svg` element for a page: no style of its own, so that a strict page takes it, and the
    colour of the page's text for what is black."""
    return inline(as_svg(_drawn(panel)), f"{panel.name}, {panel.unit}")


def png(panel: Panel) -> bytes:
    """The panel as PNG, on white, with its name: for a mail."""
    figure = _drawn(panel, PNG_SIZE, PNG_AREA, top=0.91, dots=True)
    figure.text(PNG_AREA[0], 0.975, panel.name, va="top", fontsize=10, fontweight="bold")
    return as_png(figure)


def as_png(figure: Any) -> bytes:
    """A figure of matplotlib as PNG: readable on a phone, some 50 kB."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=150, metadata={"Software": None})
    return out.getvalue()


def as_svg(figure: Any) -> str:
    """A figure of matplotlib as an `svg` element; the same figure gives the same text."""
    out = io.StringIO()
    figure.savefig(out, format="svg", transparent=True, metadata={"Date": None})
    return out.getvalue()[out.getvalue().index("<svg") :]


def _drawn(
    panel: Panel,
    size: tuple[float, float] = SIZE,
    area: tuple[float, float, float, float] = AREA,
    *,
    top: float = 1.0,
    dots: bool = False,
) -> Any:
    """The figure of a panel, its key at the height ``top``; ``dots``: of a kind that every format has."""
    figure = library().figure.Figure(figsize=size)
    axis = figure.add_axes(area)
    axis.patch.set_visible(False)
    if panel.band is not None:
        t, low, high = panel.band
        axis.fill_between(_dates(t), low, high, color=COLOURS[5], alpha=0.25, linewidth=0, label="normal")
    for i, line in enumerate(panel.lines):
        if np.isfinite(line.v).any():
            _line(axis, line, COLOURS[i % len(COLOURS)], _DASHES[i % len(_DASHES)], dots)
    for (words, t, v), (shape, colour) in zip(panel.marked, _MARKS, strict=False):
        if len(t):
            axis.plot(_dates(t), v, shape, color=colour, markersize=6, label=words, zorder=4)
    axis.set_ylabel(panel.unit)
    _bounds(axis, panel)
    dates = library().dates
    locator = dates.AutoDateLocator(minticks=3, maxticks=6)
    axis.xaxis.set_major_locator(locator)
    axis.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator))
    axis.xaxis.get_offset_text().set_fontsize(8)
    axis.set_xlabel("time (UTC)", fontsize=8)
    if len(axis.get_legend_handles_labels()[1]) > 1:
        place = {"loc": "upper left", "bbox_to_anchor": (0.0 if top == 1.0 else area[0] - 0.02, top)}
        spaces = {"borderaxespad": 0.1, "handlelength": 1.4, "handletextpad": 0.4, "columnspacing": 1.0}
        figure.legend(**place, **spaces, ncols=5, fontsize=8, frameon=False)
    return figure


def _line(axis: Any, line: Line, colour: str, dashes: str, dots: bool) -> None:
    t = _dates(line.t)
    if line.sigma is not None:
        low, high = line.v - line.sigma, line.v + line.sigma
        bars = np.stack([t, t, t], axis=1).ravel()
        ends = np.stack([low, high, np.full(len(t), np.nan)], axis=1).ravel()
        axis.plot(bars, ends, color=colour, alpha=0.4, linewidth=1.2)
    if line.joined:
        axis.plot(t, line.v, dashes, color=colour, linewidth=1.2, label=line.label)
    elif dots:
        axis.plot(t, line.v, "o", color=colour, markersize=3.5, label=line.label)
    else:  # a dot is a line without length with round ends: in an SVG a tenth of the characters of a marker
        doubled = np.stack([t, t, t], axis=1).ravel()
        v = np.stack([line.v, line.v, np.full(len(t), np.nan)], axis=1).ravel()
        axis.plot(doubled, v, color=colour, linewidth=3.5, solid_capstyle="round", label=line.label)


def _bounds(axis: Any, panel: Panel) -> None:
    """The axis holds all values, but not the far ends of large errors."""
    values = [line.v for line in panel.lines] + [v for _, _, v in panel.marked]
    values += [np.concatenate(panel.band[1:])] if panel.band is not None else []
    known = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.array([])
    if not len(known):
        return
    low, high = float(known.min()), float(known.max())
    low = min(low, 0.0) if panel.zero else low
    room = 0.12 * (high - low) or 0.1 * abs(high) or 1.0
    bottom = low if panel.zero and low == 0.0 else low - room
    axis.set_ylim((high + room, bottom) if panel.down else (bottom, high + room))


def _dates(t: Array) -> Array:
    """Days since 1970, as matplotlib counts."""
    return np.asarray(t, dtype=float) / 86400.0


def inline(text: str, label: str) -> str:
    """An `svg` element of matplotlib as it stands in a page with a strict policy.

    Styles become attributes, numbers lose digits that nobody sees, ids that two pictures would share go.
    """
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<style[^>]*>.*?</style>|<!--.*?-->", "", text, flags=re.DOTALL)
    head = rf'<svg class="plot" viewBox="\1" role="img" aria-label="{escape(label)}">'
    text = re.sub(r'<svg [^>]*viewBox="([^"]*)"[^>]*>', head, text)
    text = re.sub(r' id="[A-Za-z][\dA-Za-z.]*_\d+"|<defs>\s*</defs>', "", text)
    text = re.sub(r"\n([LMCQz])", r"\1", text)
    text = _STYLE.sub(lambda found: _attributes(found[1]), text)
    text = re.sub(r' xml:space="preserve"| xmlns:xlink="[^"]*"', "", text).replace("xlink:href", "href")
    text = _WHOLE.sub("", _DIGITS.sub(r"\1", text))
    text = text.replace('"#000000"', '"currentColor"').replace('"#262626"', '"currentColor"')
    return re.sub(r"\s*\n\s*", "\n", text).strip()


def _attributes(style: str) -> str:
    """The declarations of a style as attributes; of a font its size alone: the family is the page's."""
    out = []
    for declaration in style.split(";"):
        name, _, value = declaration.partition(":")
        name, value = name.strip(), value.strip()
        if name == "font":
            size = _FONT.search(value)
            name, value = "font-size", size[1] if size else ""
        if name and value:
            out.append(f' {name}="{value}"')
    return "".join(out)
