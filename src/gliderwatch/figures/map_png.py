"""A map as PNG, for mails and reports: the same chart as `chart.svg` draws for pages, drawn by matplotlib."""

from __future__ import annotations

from typing import Any

import numpy as np

from gliderwatch.figures.chart import (
    HEIGHT,
    WIDTH,
    Chart,
    Frame,
    Mark,
    arrow_scale,
    covers,
    depth_labels,
    depth_paths,
    frame,
    meridians,
    outline,
    parallels,
    round_number,
)
from gliderwatch.figures.coast import Land, rings_in
from gliderwatch.figures.plots import COLOURS, as_png, library
from gliderwatch.model import Array

SIZE = (5.4, 4.45)
"""Inches of the picture."""
AREA = (0.085, 0.07, 0.9, 0.834)
"""The map in it: left, bottom, width, height; of the proportions of `chart`."""
SEA, LAND, SHORE, INK = "#edf4fa", "#e9e2cf", "#8c836c", "#222222"
VERDICTS = {"ok": COLOURS[0], "warn": COLOURS[4], "bad": COLOURS[1], "quiet": "#5a646e"}
SHAPES = {"circle": "o", "triangle": "^", "square": "s", "diamond": "D", "cross": "X"}
EDGE = 20.0
"""Units of the picture beside its edges in which no line of the graticule is named."""
CLOSE = 14.0
"""Units of the picture between two words, below which they would lie on each other."""
KEYS = {("triangle", "bad"): "speed out of range", ("diamond", "warn"): "measurements disagree"}
"""What marks without a label mean."""


def png(chart: Chart, land: Land) -> bytes:
    """The map as PNG, on white; empty where there is no place to show."""
    places = chart.places()
    if not places:
        return b""
    view = frame(places)
    figure = library().figure.Figure(figsize=SIZE)
    axis = figure.add_axes(AREA, facecolor=SEA)
    axis.set(xlim=(0, WIDTH), ylim=(HEIGHT, 0), aspect="equal")
    axis.grid(visible=False)
    axis.spines[:].set_visible(True)
    _land(axis, view, land)
    _depths(axis, view, land)
    _graticule(axis, view)
    _areas(axis, view, chart)
    _tracks(axis, view, chart)
    _currents(axis, view, chart)
    _marks(axis, view, chart.marks)
    _scale(axis, view)
    figure.text(AREA[0], 0.985, chart.title, va="top", fontsize=10, fontweight="bold", color=INK)
    handles, labels = axis.get_legend_handles_labels()
    if labels:
        figure.legend(
            handles,
            labels,
            loc="upper left",
            bbox_to_anchor=(AREA[0] - 0.015, 0.958),
            ncols=4,
            fontsize=8,
            frameon=False,
            borderaxespad=0,
            handletextpad=0.4,
            columnspacing=1.2,
        )
    return as_png(figure)


def _land(axis: Any, view: Frame, land: Land) -> None:
    """The land, and lakes in it, as one area; then that of files, each in the place of what lay there."""
    rings = [view.straight(ring[:, 1], ring[:, 0]) for ring in rings_in(land, view.box(8.0))]
    _fill(axis, rings, facecolor=LAND, edgecolor=SHORE, linewidth=0.8)
    for box, part in land.finer:
        _fill(axis, list(covers(view, box)), facecolor=SEA, linewidth=0.0)
        _land(axis, view, part)


def _fill(axis: Any, rings: list[Array], **style: object) -> None:
    path, patches = library().path.Path, library().patches
    if not rings:
        return
    codes = [np.r_[path.MOVETO, np.full(len(ring) - 2, path.LINETO), path.CLOSEPOLY] for ring in rings]
    shape = path(np.concatenate(rings), np.concatenate(codes))
    axis.add_patch(patches.PathPatch(shape, zorder=1, **style))


def _depths(axis: Any, view: Frame, land: Land) -> None:
    parts = depth_paths(view, land)
    for lines in parts.values():
        for xy in lines:
            axis.plot(*xy.T, "-", color=SHORE, alpha=0.5, linewidth=0.7, zorder=1.5)
    for (x, y), depth in depth_labels(parts):
        _label(axis, x, y, f"{depth:g} m", "center", "center", size=7)


def _graticule(axis: Any, view: Frame) -> None:
    columns = [(x, label) for x, label in meridians(view) if EDGE < x < WIDTH - EDGE]
    rows = [(y, label) for y, label in parallels(view) if EDGE < y < HEIGHT - EDGE]
    axis.set_xticks([x for x, _ in columns], [label for _, label in columns], fontsize=8)
    axis.set_yticks([y for y, _ in rows], [label for _, label in rows], fontsize=8, rotation=90, va="center")
    axis.vlines([x for x, _ in columns], 0, HEIGHT, color=INK, alpha=0.15, linewidth=0.6, zorder=2)
    axis.hlines([y for y, _ in rows], 0, WIDTH, color=INK, alpha=0.15, linewidth=0.6, zorder=2)


def _areas(axis: Any, view: Frame, chart: Chart) -> None:
    """Where it is or will be, each with its words; those whose words would lie on each other share them."""
    words: list[tuple[Array, str]] = []
    for area, kind, label in chart.areas:
        colour, dashes = (VERDICTS["ok"], "-") if kind == "next" else (COLOURS[3], "--")
        xy = view.xy(*np.array(outline(area)).T)
        is_first = not words
        axis.fill(*xy.T, color=colour, alpha=0.12, linewidth=0, zorder=3)
        key = "with 95 %" if is_first else None
        axis.plot(*np.vstack([xy, xy[:1]]).T, dashes, color=colour, linewidth=1.3, zorder=3, label=key)
        top = xy[np.argmin(xy[:, 1])]
        if words and np.abs(top - words[-1][0]).max() < CLOSE:
            words[-1] = (top, f"{words[-1][1]}, {label}")
        else:
            words.append((top, label))
    for (x, y), label in words:
        _label(axis, x, y - 4, label, "center")


def _tracks(axis: Any, view: Frame, chart: Chart) -> None:
    """Tracks in their colours; what is not judged is dashed."""
    colours = chart.track_colours or ("quiet",) * len(chart.tracks)
    for track, colour in zip(chart.tracks, colours, strict=True):
        xy = view.xy(*np.array(track).T)
        jumps = np.abs(np.diff(xy[:, 0])) > WIDTH  # to the other side of the date line
        xy = np.insert(xy, np.flatnonzero(jumps) + 1, np.nan, axis=0)
        dashes = "--" if chart.track_colours and colour == "quiet" else "-"
        axis.plot(*xy.T, dashes, color=VERDICTS[colour], linewidth=2.2 if colour == "bad" else 1.5, zorder=4)


def _currents(axis: Any, view: Frame, chart: Chart) -> None:
    """An arrow for each current, all of one scale, with the scale below."""
    per, shown = arrow_scale(chart.arrows)
    if not per:
        return
    x, y = np.array([view.xy(*arrow.place) for arrow in chart.arrows]).T
    u, v = np.array([(arrow.u, -arrow.v) for arrow in chart.arrows]).T * per
    style = {"angles": "xy", "scale_units": "xy", "scale": 1, "color": COLOURS[2], "width": 0.005}
    style |= {"edgecolor": SEA, "linewidth": 0.6}  # they stand out from the track
    axis.quiver(x, y, u, v, zorder=5, **style)
    axis.quiver([WIDTH - 12 - shown * per], [HEIGHT - 14], [shown * per], [0.0], zorder=5, **style)
    _label(axis, WIDTH - 12, HEIGHT - 22, f"current {shown:g} m/s", "right")


def _marks(axis: Any, view: Frame, marks: tuple[Mark, ...]) -> None:
    """Places by shape and colour; what has no label is explained once above the map."""
    explained = set()
    for mark in marks:
        x, y = view.xy(*mark.place)
        kind = (mark.shape, mark.colour)
        key = KEYS.get(kind) if not mark.label and kind not in explained else None
        explained.add(kind)
        size = 8 if mark.label else 5.5
        axis.plot(
            [x],
            [y],
            SHAPES[mark.shape],
            color=VERDICTS[mark.colour],
            markersize=size,
            zorder=6,
            markeredgecolor="white",
            markeredgewidth=0.8,
            linestyle="none",
            label=key,
        )
        if mark.label:
            is_right = x > 0.7 * WIDTH
            _label(axis, x + (-7 if is_right else 7), y - 7, mark.label, "right" if is_right else "left")


def _scale(axis: Any, view: Frame) -> None:
    """A bar of a round number of kilometres, and which way is north."""
    km = round_number(WIDTH / 4 * view.metres / 1000)
    length, y = km * 1000 / view.metres, HEIGHT - 12
    axis.plot([12, 12, 12 + length, 12 + length], [y - 5, y, y, y - 5], color=INK, linewidth=1.2, zorder=7)
    _label(axis, 16 + length, y, f"{km:g} km", "left")
    axis.annotate(
        "N",
        (WIDTH - 16, 12),
        (WIDTH - 16, 38),
        ha="center",
        va="center",
        fontsize=8,
        zorder=7,
        arrowprops={"arrowstyle": "-|>", "color": INK},
    )


def _label(
    axis: Any, x: float, y: float, label: str, side: str, height: str = "baseline", size: float = 8.5
) -> None:
    """Words with an edge of the colour of the sea, so that they can be read on lines."""
    edge = library().patheffects.withStroke(linewidth=2.5, foreground=SEA)
    axis.text(
        x,
        y,
        label,
        ha=side,
        va=height,
        fontsize=size,
        color=INK,
        zorder=8,
        path_effects=[edge],
        parse_math=False,
        clip_on=True,
    )
