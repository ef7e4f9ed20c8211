"""One structure of a message, rendered as text, as HTML and in brief, so that these cannot differ. Pure."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape

from jinja2 import BaseLoader, Environment, StrictUndefined

from gliderwatch.messages.formatting import clean, duration
from gliderwatch.model import Alert, Kind

TITLE = 60
"""Characters of a title at most: a phone shows no more of it."""
DO = "What to do"


def environment(loader: BaseLoader | None = None) -> Environment:
    """What renders HTML: every value is escaped, and one that is missing is an error."""
    return Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, loader=loader
    )


_ENVIRONMENT = environment()
_HTML = _ENVIRONMENT.from_string(
    """\
<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"></head>
<body style="font-family: sans-serif; font-size: 16px; line-height: 1.4; overflow-wrap: anywhere">
<p style="font-size: 18px"><b>{{ title }}</b></p>
{% for line in page.lead %}
<p>{{ line }}</p>
{% endfor %}
{% macro items(heading, lines) %}
{% if lines %}
<p style="margin-bottom: 0"><b>{{ heading }}</b></p>
<ul style="margin-top: 4px">
{% for line in lines %}
<li>{{ line }}</li>
{% endfor %}
</ul>
{% endif %}
{% endmacro %}
{% macro facts(pairs) %}
{% if pairs %}
<p>
{% for label, value in pairs %}
{% if label == "Map" %}
<b>Map:</b> <a href="{{ value }}">OpenStreetMap</a><br>
{% else %}
<b>{{ label }}:</b> {{ value }}<br>
{% endif %}
{% endfor %}
</p>
{% endif %}
{% endmacro %}
{{ items(do, page.do) }}
{{ facts(page.links) }}
{% if page.facts or page.lists or page.data or page.symbols %}
<hr>
{% endif %}
{{ facts(page.facts) }}
{% for heading, lines in page.lists %}
{{ items(heading, lines) }}
{% endfor %}
{{ items("Data", page.data) }}
{{ items("In symbols", page.symbols) }}
</body>
</html>
"""
)


@dataclass(frozen=True, slots=True)
class Page:
    """A message before it has a form, in the order of reading.

    ``lead`` are the lines that stand alone (they are a whole SMS), ``do`` what to do, three lines each at
    most. ``links`` and ``facts`` are labelled; ``lists`` stand under headings; ``data`` are remarks on the
    quality of the data, ``symbols`` numbers for who knows the papers. A fact or link labelled ``Map`` is an
    address, made by `formatting.map_link` and of numbers only.
    """

    lead: tuple[str, ...]
    facts: tuple[tuple[str, str], ...] = ()
    lists: tuple[tuple[str, tuple[str, ...]], ...] = ()
    do: tuple[str, ...] = ()
    links: tuple[tuple[str, str], ...] = ()
    data: tuple[str, ...] = ()
    symbols: tuple[str, ...] = ()

    def text(self) -> str:
        """The page as plain text."""
        lists = (*self.lists, ("Data", self.data), ("In symbols", self.symbols))
        blocks = [_pairs(self.facts), *(_items(heading, lines) for heading, lines in lists)]
        return self.brief() + "".join(f"\n{block}\n" for block in blocks if block)

    def brief(self) -> str:
        """What a chat shows: the lines that stand alone, what to do, and the links."""
        blocks = ("\n".join(self.lead), _items(DO, self.do), _pairs(self.links))
        return "\n\n".join(block for block in blocks if block) + "\n"

    def html(self, title: str) -> str:
        """The page as HTML without tables, every value escaped."""
        lines = _HTML.render(title=title, page=self, do=DO).splitlines()
        return "\n".join(line for line in lines if line.strip()) + "\n"


Text = tuple[str, Page]
"""A message's title and what it says."""


def _items(heading: str, lines: tuple[str, ...]) -> str:
    return "\n".join([heading, *(f"- {line}" for line in lines)]) if lines else ""


def _pairs(pairs: tuple[tuple[str, str], ...]) -> str:
    return "\n".join(f"{label}: {value}" for label, value in pairs)


def titled(glider: str, what: str, *more: str) -> str:
    """A title: the glider, what it is, and of what is ``more`` as much as there is room for.

    >>> titled("electa", "SLOW 0.11 m/s", " (normal 0.22-0.30)", ": lost wing?")
    'electa SLOW 0.11 m/s (normal 0.22-0.30): lost wing?'
    """
    title = f"{clean(glider, TITLE // 2)} {clean(what)}" if glider else clean(what)
    for part in more:
        if len(title) + len(part) > TITLE:
            break
        title += part
    return clean(title, TITLE)


_TODO = "What to do: "


def sentence(text: str) -> str:
    """Words with a capital at their beginning."""
    return text[:1].upper() + text[1:]


def lead_and_actions(text: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Paragraphs, one a line, and of those that begin so what to do, each made one printable line."""
    lines = [line for line in (clean(raw, 500) for raw in text.splitlines()) if line]
    todo = tuple(sentence(line.removeprefix(_TODO)) for line in lines if line.startswith(_TODO))
    return tuple(line for line in lines if not line.startswith(_TODO)), todo


_LINK = re.compile(r"(?P<label>[A-Z][a-z ]*): (?P<address>https://\S+)")


def chat_html(brief: str) -> str:
    """What a chat is to show, as HTML, of which each service is given its own markup.

    >>> chat_html("electa: slow\\n\\nWhat to do\\n- look\\n\\nMap: https://e.org/?a=1")
    'electa: slow<br><br><b>What to do</b><br>- look<br><br><a href="https://e.org/?a=1">Map</a>'
    """
    lines = []
    for line in brief.rstrip("\n").split("\n"):
        link = _LINK.fullmatch(line)
        if link is not None:
            address, label = escape(link["address"]), escape(link["label"])
            lines.append(f'<a href="{address}">{label}</a>')
        else:
            lines.append(f"<b>{escape(line)}</b>" if line == DO else escape(line))
    return "<br>".join(lines)


def with_pictures(html: str, pictures: Sequence[tuple[str, str]]) -> str:
    """The HTML of a message with pictures (address and words) above its numbers, or at its end."""
    shown = "".join(
        f'<p><img src="{escape(address)}" alt="{escape(words)}" style="max-width: 100%; height: auto"></p>\n'
        for address, words in pictures
    )
    before = "<hr>" if "<hr>" in html else "</body>"
    return html.replace(before, shown + before, 1)


def with_machine(alert: Alert, machine: str) -> Alert:
    """A message that names the machine whose gliderwatch sends it, above all else."""
    return with_lead(alert, f"GLIDERWATCH {clean(machine, 16)}, to its operator:")


def with_lead(alert: Alert, line: str) -> Alert:
    """A message with one more line above all others."""
    html = alert.html.replace("<p ", f"<p><b>{escape(line)}</b></p>\n<p ", 1)
    brief = f"{line}\n\n{alert.brief}" if alert.brief else ""
    return replace(alert, body=f"{line}\n\n{alert.body}", html=html, brief=brief)


# ----------------------------------------
# What a message says that reaches somebody because nobody has acknowledged it.


def command(words: str) -> str:
    """What to type on the machine of gliderwatch, whole."""
    return f"sudo -u gliderwatch gliderwatch {clean(words)}"


def escalated(alert: Alert, waited: float) -> Alert:
    """The message, for who is notified of it after so long (s) without an acknowledgement."""
    kinds = (Kind.OVERDUE, Kind.UNKNOWN, Kind.NEIGHBOURS)
    muted = tuple(f"{alert.glider}/{kind}/" for kind in kinds)
    is_muted = alert.incident.startswith(muted)  # there is no incident to acknowledge
    words = f"mute {alert.glider} --hours 6" if is_muted else f"ack {alert.incident.rstrip('+')}"
    lead = f"Nobody has acknowledged this for {duration(waited)}: that is why it comes to you. "
    lead += f"To take it on: {command(words)}"
    return replace(with_lead(alert, lead), title=clean(f"NOT ACKNOWLEDGED {alert.title}"))
