"""A page of plots: one HTML file that needs nothing else."""

from __future__ import annotations

import html
import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from gliderwatch.figures.plots import COLOURS, as_svg, library
from gliderwatch.score.measures import FaultScore
from gliderwatch.score.summary import Summary, tables

_COLUMNS = 4
_SIZES = {
    "remora": "drag (times the usual)",
    "fouling": "drag (times the usual)",
    "compass": "compass error (rad)",
    "dac_wrong": "error of the current (m/s)",
    "strong_current": "added current (m/s)",
}
"""What the size of a fault is, of those that are no part of what is lost."""
_HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>gliderwatch score</title><style>
body { font: 15px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem }
svg { width: 100%; height: auto } pre { overflow-x: auto; font-size: 13px; line-height: 1.35 }
</style></head><body><h1>gliderwatch score</h1>
"""


def write_page(path: Path, summary: Summary) -> None:
    """Write the page."""
    parts = [_HEAD, f"<p>{summary.gliders} runs; version {html.escape(summary.version)}.</p>"]
    for is_real, where in ((False, "Simulated gliders"), (True, "Faults grafted onto real missions")):
        some = [s for s in summary.faults if s.is_real == is_real and s.sea == ""]
        if not some:
            continue
        parts += [
            f"<h2>{where}</h2><h3>Delay against the size of the fault</h3>",
            "<p>Hours from the onset to the right message: median and, fainter, 90 %. The number is the "
            "part detected; a cross at the top is a delay without end.</p>",
            _by_fault([s for s in some if s.expected is not None], _draw_delay),
            "<h3>False messages against the size of the fault</h3>",
            "<p>Messages of another flag than the one expected, a glider-month after the onset (95 %).</p>",
            _by_fault(some, _draw_unexpected),
        ]
    if summary.roc:
        parts += [
            "<h2>Other bounds of the normal speed</h2>",
            "<p>Detected losses of speed against false flag 1, as the normal range narrows; the numbers are "
            "the lower bound as part of the usual speed.</p>",
            _roc(summary),
        ]
    parts.append(f"<h2>Tables</h2><pre>{html.escape(_text(summary))}</pre></body></html>\n")
    path.write_text("\n".join(parts), encoding="utf-8")


def _by_fault(scores: Sequence[FaultScore], draw: Any) -> str:
    """One small plot for each fault, all with the same scale of values."""
    faults = list(dict.fromkeys(s.fault for s in scores))
    if not faults:
        return ""
    rows = math.ceil(len(faults) / _COLUMNS)
    figure = library().figure.Figure(figsize=(12, 2.7 * rows), layout="constrained")
    axes = figure.subplots(rows, _COLUMNS, squeeze=False, sharey=True)
    estimators = list(dict.fromkeys(s.estimator for s in scores))
    hours = [h for s in scores for h in (s.hours_median, s.hours_90) if math.isfinite(h)]
    top = 1.15 * max(hours, default=1.0)
    for axis in axes.flat[len(faults) :]:
        axis.set_visible(False)
    for fault, axis in zip(faults, axes.flat, strict=False):
        for i, estimator in enumerate(estimators):
            some = [s for s in scores if (s.fault, s.estimator) == (fault, estimator)]
            draw(axis, some, COLOURS[i % len(COLOURS)], estimator, top)
        axis.set_title(fault, fontsize=10)
        axis.set_xlabel(_SIZES.get(fault, "part lost (1)"))
        axis.margins(x=0.15)
    axes.flat[0].legend(fontsize=7)
    return as_svg(figure)


def _draw_delay(axis: Any, scores: Sequence[FaultScore], colour: str, name: str, top: float) -> None:
    sizes = [s.size for s in scores]
    for hours, alpha, label in (
        ([s.hours_90 for s in scores], 0.35, None),
        ([s.hours_median for s in scores], 1.0, name),
    ):
        finite = [h if math.isfinite(h) else math.nan for h in hours]
        axis.plot(sizes, finite, "o-", color=colour, alpha=alpha, label=label, markersize=4)
        never = [s for s, h in zip(sizes, hours, strict=True) if not math.isfinite(h)]
        axis.plot(never, [top] * len(never), "x", color=colour, alpha=alpha)
    for s in scores:
        if s.detected is not None:
            at = (s.size, min(s.hours_median, top))
            text = f"{100 * s.detected.value:.0f}%"
            axis.annotate(text, at, (3, 3), textcoords="offset points", fontsize=7, color=colour)
    axis.set_ylim(0, 1.15 * top)
    axis.set_ylabel("delay (h)")


def _draw_unexpected(axis: Any, scores: Sequence[FaultScore], colour: str, name: str, _: float) -> None:
    values = [s.unexpected for s in scores]
    below = [v.value - v.low for v in values]
    above = [v.high - v.value for v in values]
    axis.errorbar(
        [s.size for s in scores],
        [v.value for v in values],
        yerr=(below, above),
        fmt="o-",
        color=colour,
        label=name,
        markersize=4,
        capsize=2,
    )
    axis.set_ylim(bottom=0)
    axis.set_ylabel("messages (1/month)")


def _roc(summary: Summary) -> str:
    figure = library().figure.Figure(figsize=(7, 4.5), layout="constrained")
    axis = figure.subplots()
    for i, estimator in enumerate(dict.fromkeys(p.estimator for p in summary.roc)):
        points = [p for p in summary.roc if p.estimator == estimator]
        colour = COLOURS[i % len(COLOURS)]
        axis.plot(
            [p.false for p in points], [p.detected for p in points], "o-", color=colour, label=estimator
        )
        for p in points:
            axis.annotate(f"{p.lower:g}", (p.false, p.detected), fontsize=7, color=colour)
    axis.set_xscale("symlog", linthresh=0.1)
    axis.set_xlim(left=0)
    axis.set_ylim(0, 1.02)
    axis.set_xlabel("false flag 1 (1/month of a glider)")
    axis.set_ylabel("part of losses of speed detected (1)")
    axis.legend()
    return as_svg(figure)


def _text(summary: Summary) -> str:
    console = Console(file=io.StringIO(), width=110, color_system=None)
    _print(console, summary)
    file = console.file
    assert isinstance(file, io.StringIO)
    return file.getvalue()


def _print(console: Console, summary: Summary) -> None:
    every: Iterable[Any] = tables(summary)
    for table in every:
        console.print(table, "")
