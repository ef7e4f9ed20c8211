"""One structure of a message, rendered as text and as HTML so that the two cannot differ. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from html import escape

from jinja2 import Environment, StrictUndefined

from gliderwatch.messages.formatting import clean, duration
from gliderwatch.model import Alert, Kind

# ----------------------------------------
# One structure of a message, rendered as text and as HTML, so that the two cannot differ.

_HTML = Environment(
    autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
).from_string(
    """\
<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"></head>
<body style="font-family: sans-serif; font-size: 16px; line-height: 1.4">
<p style="font-size: 18px"><b>{{ title }}</b></p>
{% for line in page.lead %}
<p>{{ line }}</p>
{% endfor %}
<p>
{% for label, value in page.facts %}
{% if label == "Map" %}
<b>Map:</b> <a href="{{ value }}">OpenStreetMap</a><br>
{% else %}
<b>{{ label }}:</b> {{ value }}<br>
{% endif %}
{% endfor %}
</p>
{% for heading, items in page.lists %}
<p style="margin-bottom: 0"><b>{{ heading }}</b></p>
<ul style="margin-top: 4px">
{% for item in items %}
<li>{{ item }}</li>
{% endfor %}
</ul>
{% endfor %}
</body>
</html>
"""
)


@dataclass(frozen=True, slots=True)
class Page:
    """A message before it has a form: paragraphs, labelled facts, lists under headings.

    The fact labelled ``Map`` is a link, made by `formatting.map_link` and of numbers only.
    """

    lead: tuple[str, ...]
    facts: tuple[tuple[str, str], ...] = ()
    lists: tuple[tuple[str, tuple[str, ...]], ...] = ()

    def text(self) -> str:
        """The page as plain text."""
        facts = [f"{label}: {value}" for label, value in self.facts]
        blocks = ["\n".join(self.lead), "\n".join(facts)]
        blocks += ["\n".join([heading, *(f"- {item}" for item in items)]) for heading, items in self.lists]
        return "\n\n".join(block for block in blocks if block) + "\n"

    def html(self, title: str) -> str:
        """The page as HTML without tables, every value escaped."""
        return _HTML.render(title=title, page=self)


Text = tuple[str, Page]
"""A message's title and what it says."""


def with_lead(html: str, line: str) -> str:
    """HTML of a page with one more line above its title, the first paragraph."""
    return html.replace("<p ", f"<p><b>{escape(line)}</b></p>\n<p ", 1)


# ----------------------------------------
# What a message says that reaches somebody because nobody has acknowledged it.


def escalated(alert: Alert, waited: float) -> Alert:
    """The message, for who is told it after so long (s) without an acknowledgement."""
    kinds = (Kind.OVERDUE, Kind.UNKNOWN, Kind.NEIGHBOURS)
    muted = tuple(f"{alert.glider}/{kind}/" for kind in kinds)
    is_muted = alert.incident.startswith(muted)  # there is no incident to acknowledge
    command = f"mute {alert.glider} --hours 6" if is_muted else f"ack {alert.incident.rstrip('+')}"
    lead = f"Nobody has acknowledged this for {duration(waited)}: that is why you are told. "
    lead += f"If you take it on: gliderwatch {clean(command)}"
    return replace(
        alert,
        title=clean(f"NOT ACKNOWLEDGED {alert.title}"),
        body=f"{lead}\n\n{alert.body}",
        html=with_lead(alert.html, lead),
    )
