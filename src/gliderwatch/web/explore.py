"""Plots to explore: all panels of a glider on one axis of time, to zoom, pan and hover; drawn in the browser.

Bokeh's scripts come from its own installed package, never from another host.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from textwrap import wrap
from typing import Any

import numpy as np
from bokeh.embed import json_item
from bokeh.layouts import column
from bokeh.models import Band, ColumnDataSource, DataRange1d, HoverTool, Range1d, Title, Whisker
from bokeh.plotting import figure

from gliderwatch.figures import dives, health
from gliderwatch.figures.plots import COLOURS, Line, Panel
from gliderwatch.messages.formatting import clean
from gliderwatch.model import Array
from gliderwatch.pages.view import GliderView

TARGET = "plots"
"""The element of the page that the plots are put in."""
HEIGHT, WRAPPED = 280, 120
"""Of a plot in pixels; of the lines of its sentence in characters."""
_DASHES = ("solid", "dashed", "dotted", "dotdash")
_MARKS = (("triangle", COLOURS[1]), ("diamond", COLOURS[4]))


def plots(view: GliderView) -> str:
    """All panels of a glider as JSON for `Bokeh.embed.embed_item`, below one another."""
    ours = health.panels(view.readings, view.battery, view.calls)
    names = {panel.name for panel in ours}
    panels = [panel for panel in dives.panels(view.dives) if panel.name not in names] if view.dives else []
    end = 1000.0 * (view.last_sign if view.is_over and view.last_sign is not None else view.now)
    start = 1000.0 * (view.dives[0].t_dive if view.dives else view.now - 86400.0)
    span = Range1d(start, end)
    shown = [_figure(panel, span) for panel in (*panels, *ours)]
    return json.dumps(json_item(column(shown, sizing_mode="stretch_width"), TARGET))


def _figure(panel: Panel, span: Range1d) -> Any:
    """One panel, with its sentence as its title, on the axis of time of all."""
    made = figure(
        height=HEIGHT,
        sizing_mode="stretch_width",
        x_axis_type="datetime",
        x_range=span,
        y_range=DataRange1d(flipped=panel.down),
        x_axis_label="UTC",
        y_axis_label=panel.unit,
        tools="xpan,xwheel_zoom,xbox_zoom,pan,reset,save",
        active_drag="xpan",
        active_scroll="xwheel_zoom",
    )
    made.toolbar.logo = None
    for line in reversed(wrap(panel.shows, WRAPPED)):
        made.add_layout(Title(text=line, text_font_size="12px", text_font_style="normal"), "above")
    made.add_layout(Title(text=panel.name), "above")
    hovered = [*_lines(made, panel), *_marks(made, panel)]
    made.add_tools(
        HoverTool(
            renderers=hovered,
            tooltips=[("", "@label"), ("UTC", "@t{%F %H:%M}"), (panel.unit, "@v{0.000}")],
            formatters={"@t": "datetime"},
            mode="mouse",
        )
    )
    if made.legend:
        made.legend.click_policy = "hide"
        made.legend.location = "top_left"
        made.legend.orientation = "horizontal"
    return made


def _lines(made: Any, panel: Panel) -> Iterator[Any]:
    if panel.band is not None:
        t, low, high = panel.band
        source = ColumnDataSource({"t": 1000.0 * t, "low": low, "high": high})
        shade = {"fill_color": COLOURS[5], "fill_alpha": 0.25}
        made.add_layout(Band(base="t", lower="low", upper="high", source=source, **shade))
    for k, line in enumerate(panel.lines):
        colour, dash = COLOURS[k % len(COLOURS)], _DASHES[k % len(_DASHES)]
        source = _source(line.label, line.t, line.v)
        label = clean(line.label, 40)
        if line.joined:
            made.line("t", "v", source=source, color=colour, line_dash=dash, legend_label=label)
        if line.sigma is not None:
            _whiskers(made, line, colour)
        yield made.scatter("t", "v", source=source, color=colour, size=4, legend_label=label)


def _whiskers(made: Any, line: Line, colour: str) -> None:
    assert line.sigma is not None
    ends = {"t": 1000.0 * line.t, "low": line.v - line.sigma, "high": line.v + line.sigma}
    made.add_layout(
        Whisker(
            base="t",
            lower="low",
            upper="high",
            source=ColumnDataSource(ends),
            line_color=colour,
            line_alpha=0.5,
            upper_head=None,
            lower_head=None,
        )
    )


def _marks(made: Any, panel: Panel) -> Iterator[Any]:
    for (words, t, v), (marker, colour) in zip(panel.marked, _MARKS, strict=False):
        if not len(t):
            continue
        source = _source(words, t, v)
        yield made.scatter(
            "t", "v", source=source, marker=marker, size=9, color=colour, legend_label=clean(words, 40)
        )


def _source(label: str, t: Array, v: Array) -> ColumnDataSource:
    good = np.isfinite(v)
    names = [clean(label, 40)] * int(good.sum())
    return ColumnDataSource({"t": 1000.0 * t[good], "v": v[good], "label": names})
