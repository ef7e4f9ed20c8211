"""Which section of `docs/pilots.md` says what to do about a kind of message. Pure."""

from __future__ import annotations

import re
from dataclasses import replace
from html import escape

from gliderwatch.model import Alert, Kind

PAGE = "pilots.html"
"""The guide beside the pages of gliders."""
SECTIONS = {
    Kind.ANOMALY: "SLOW, FAST",
    Kind.FALSE_ALARM: "MEASUREMENTS DISAGREE",
    Kind.UNKNOWN: "CANNOT BE JUDGED",
    Kind.OVERDUE: "OVERDUE",
    Kind.ABORT: "ABORTED, WAITS AT GLIDERDOS, ...",
    Kind.CALL: "CALLS WITHOUT A FILE",
    Kind.NEIGHBOURS: "LOSES SPEED, COMPASS OFF, say its neighbours",
    Kind.REGIME: "NEW NORMAL",
    Kind.HEALTH: "LEAK, SLOW LEAK, BATTERY END, DEVICES, ...",
    Kind.ALL_CLEAR: "ALL CLEAR",
    Kind.CORRECTION: "CORRECTION",
    Kind.REMINDER: "STILL ...",
    Kind.ACKNOWLEDGED: "Ann is on it",
    Kind.SURFACING: "surfaced",
    Kind.OPERATOR: "GLIDERWATCH",
}
"""The headings of the guide."""


def anchor(heading: str) -> str:
    """A heading as the fragment of an address, as GitHub makes it.

    >>> anchor("SLOW, FAST"), anchor("STILL ...")
    ('slow-fast', 'still-')
    """
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def with_help(alert: Alert) -> Alert:
    """A message that ends with where the guide speaks of its kind."""
    line = _line(alert.kind)
    html = alert.html.replace("</body>", f"<p>{escape(line)}</p>\n</body>")
    return replace(alert, body=f"{alert.body}\n{line}\n", html=html)


def with_help_link(alert: Alert, public: str) -> Alert:
    """The same with a link to the guide, beside the pages at a URL."""
    line, url = _line(alert.kind), f"{public}/{PAGE}#{anchor(SECTIONS[alert.kind])}"
    link = f'<a href="{escape(url)}">Help</a>'
    html = alert.html.replace(f"<p>{escape(line)}</p>", f"<p>{link}</p>")
    return replace(alert, body=alert.body.replace(f"\n{line}\n", f"\nHelp: {url}\n"), html=html)


def _line(kind: Kind) -> str:
    return f"Help: docs/pilots.md, {SECTIONS[kind]}"
