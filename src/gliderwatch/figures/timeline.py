"""What went on when, as bars over time: a row a glider or a kind of trouble; inline SVG. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

from gliderwatch.figures.panel_svg import times

WIDTH, ROW, LABEL, BOTTOM = 340.0, 18.0, 84.0, 20.0
LEAST = 3.0
"""Units that a bar is wide at least, so that it is seen."""
STYLE = """\
.timeline{width:100%;background:var(--card);border-radius:6px;font:11px system-ui,sans-serif}
.timeline text{fill:var(--ink)}.timeline .grid{stroke:var(--line)}
.timeline .open{stroke:var(--ink);stroke-width:1.2}
"""
_HEIGHTS = {"bad": 12.0, "warn": 8.0, "ok": 4.0, "quiet": 4.0}
"""The worse, the higher: no meaning is in the colour alone."""


@dataclass(frozen=True, slots=True)
class Bar:
    """A ``row`` of a timeline went on from ``start`` to ``end`` (s; None: still) and was ``colour`` (bad,
    warn, ok, quiet); ``words`` say what it was."""

    row: str
    start: float
    end: float | None
    colour: str
    words: str


def svg(title: str, bars: Sequence[Bar], start: float, end: float) -> str:
    """Bars between two times (s) as an `svg` element; empty where there is none. Every label is escaped."""
    shown = [bar for bar in bars if bar.start <= end and (bar.end is None or bar.end >= start)]
    if not shown:
        return ""
    rows = {row: k for k, row in enumerate(dict.fromkeys(bar.row for bar in shown))}
    height = ROW * len(rows) + BOTTOM + 4
    parts = [
        f'<svg class="timeline" viewBox="0 0 {WIDTH:g} {height:g}" role="img" aria-label="{escape(title)}">',
        *_axis(start, end, height),
        *(_row(row, k) for row, k in rows.items()),
        *(_bar(bar, rows[bar.row], start, end) for bar in shown),
        "</svg>",
    ]
    return "\n".join(parts)


def _x(t: float, start: float, end: float) -> float:
    part = (min(max(t, start), end) - start) / (end - start)
    return LABEL + part * (WIDTH - LABEL - 6)


def _axis(start: float, end: float, height: float) -> Iterator[str]:
    for t, label in times(start, end, 4):
        x = _x(t, start, end)
        yield f'<path class="grid" d="M{x:.1f} 0V{height - BOTTOM:g}"/>'
        if x < WIDTH - 36:
            yield f'<text x="{x:.1f}" y="{height - 6:g}" text-anchor="middle">{label}</text>'
    yield f'<text x="{WIDTH - 6:g}" y="{height - 6:g}" text-anchor="end">UTC</text>'


def _row(label: str, k: int) -> str:
    cut = label if len(label) <= 14 else f"{label[:13]}…"
    return f'<text x="2" y="{ROW * k + 14:g}">{escape(cut)}</text>'


def _bar(bar: Bar, k: int, start: float, end: float) -> str:
    x, right = _x(bar.start, start, end), _x(end if bar.end is None else bar.end, start, end)
    width, height = max(right - x, LEAST), _HEIGHTS[bar.colour]
    y = ROW * k + 10 - height / 2
    kind = f"{bar.colour} open" if bar.end is None else bar.colour
    box = f'<rect class="{kind}" x="{min(x, WIDTH - 6 - LEAST):.1f}" y="{y:.1f}" width="{width:.1f}" '
    return f'{box}height="{height:g}"><title>{escape(bar.words)}</title></rect>'
