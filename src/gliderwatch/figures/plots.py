"""Plots over time, units on every axis: panels; `panel_svg` draws them for pages, matplotlib here for mails.

The colours are those of Okabe and Ito (2008), which the colour-blind can tell; lines differ in dashes too.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gliderwatch.model import Array

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
SIZE = (5.4, 2.7)
"""Inches of a panel, which has its name above."""
AREA = (0.13, 0.19, 0.85, 0.6)
"""The axes in it: left, bottom, width, height. Fixed: to find the least margins takes as long as the rest."""
TOP = 0.91
"""Height of its key."""
DENSE = 500
"""Values of a line from which on it is drawn thin: one of yos would else be a block of colour."""
_MARKS = (("^", COLOURS[1]), ("D", COLOURS[4]))
_ABOUT = ("Date", "Creator", "Format", "Type")
"""What matplotlib would say of itself in an SVG, with the addresses of vocabularies: nothing is."""
_DASHES = ("-", "--", ":", "-.")


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

    def bounds(self, room: float) -> tuple[float, float] | None:
        """The ends of the axis of values, with a part `room` of their range beside them; None where none is.

        It holds all values, but not the far ends of large errors.
        """
        values = [line.v for line in self.lines] + [v for _, _, v in self.marked]
        values += [np.concatenate(self.band[1:])] if self.band is not None else []
        finite = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.array([])
        if not len(finite):
            return None
        low, high = float(finite.min()), float(finite.max())
        low = min(low, 0.0) if self.zero else low
        beside = room * (high - low) or 0.1 * abs(high) or 1.0
        return (low if self.zero and low == 0.0 else low - beside), high + beside


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


def png(panel: Panel) -> bytes:
    """The panel as PNG, on white, with its name: for a mail."""
    return as_png(page_figure(panel))


def page_figure(panel: Panel) -> Any:
    """The panel with its name as a figure of matplotlib, for a page of paper."""
    figure = _drawn(panel)
    figure.text(AREA[0], 0.975, panel.name, va="top", fontsize=10, fontweight="bold")
    return figure


def write_pdf(path: Path, title: str, figures: Iterable[Any]) -> None:
    """Write figures of matplotlib as PDF, a page each; the same figures give the same bytes."""
    library()
    from matplotlib.backends.backend_pdf import PdfPages  # noqa: PLC0415

    with PdfPages(path, metadata={"Title": title, "CreationDate": None}) as paper:
        for figure in figures:
            paper.savefig(figure)


def as_png(figure: Any) -> bytes:
    """A figure of matplotlib as PNG: readable on a phone, some 50 kB."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=150, metadata={"Software": None})
    return out.getvalue()


def as_svg(figure: Any) -> str:
    """A figure of matplotlib as an `svg` element; the same figure gives the same text."""
    out = io.StringIO()
    figure.savefig(out, format="svg", transparent=True, metadata=dict.fromkeys(_ABOUT))
    return out.getvalue()[out.getvalue().index("<svg") :]


def _drawn(panel: Panel) -> Any:
    """The figure of a panel."""
    figure = library().figure.Figure(figsize=SIZE)
    axis = figure.add_axes(AREA)
    axis.patch.set_visible(False)
    if panel.band is not None:
        t, low, high = panel.band
        axis.fill_between(_dates(t), low, high, color=COLOURS[5], alpha=0.25, linewidth=0, label="normal")
    for i, line in enumerate(panel.lines):
        if np.isfinite(line.v).any():
            _line(axis, line, COLOURS[i % len(COLOURS)], _DASHES[i % len(_DASHES)])
    for (words, t, v), (shape, colour) in zip(panel.marked, _MARKS, strict=False):
        if len(t):
            axis.plot(_dates(t), v, shape, color=colour, markersize=6, label=words, zorder=4)
    axis.set_ylabel(panel.unit)
    bounds = panel.bounds(0.12)
    if bounds is not None:
        axis.set_ylim(bounds[::-1] if panel.down else bounds)
    dates = library().dates
    locator = dates.AutoDateLocator(minticks=3, maxticks=6)
    axis.xaxis.set_major_locator(locator)
    axis.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator))
    axis.xaxis.get_offset_text().set_fontsize(8)
    axis.set_xlabel("time (UTC)", fontsize=8)
    if len(axis.get_legend_handles_labels()[1]) > 1:
        place = {"loc": "upper left", "bbox_to_anchor": (AREA[0] - 0.02, TOP)}
        spaces = {"borderaxespad": 0.1, "handlelength": 1.4, "handletextpad": 0.4, "columnspacing": 1.0}
        figure.legend(**place, **spaces, ncols=5, fontsize=8, frameon=False)
    return figure


def _line(axis: Any, line: Line, colour: str, dashes: str) -> None:
    t = _dates(line.t)
    if line.sigma is not None:
        low, high = line.v - line.sigma, line.v + line.sigma
        bars = np.stack([t, t, t], axis=1).ravel()
        ends = np.stack([low, high, np.full(len(t), np.nan)], axis=1).ravel()
        axis.plot(bars, ends, color=colour, alpha=0.4, linewidth=1.2)
    if line.joined:
        width = 1.2 if len(t) < DENSE else 0.4
        axis.plot(t, line.v, dashes, color=colour, linewidth=width, label=line.label)
    else:
        axis.plot(t, line.v, "o", color=colour, markersize=3.5, label=line.label)


def _dates(t: Array) -> Array:
    """Days since 1970, as matplotlib counts."""
    return np.asarray(t, dtype=float) / 86400.0
