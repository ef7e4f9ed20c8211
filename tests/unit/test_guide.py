"""The guide for pilots: each kind of message has its section, and leads to it."""

from __future__ import annotations

import re

import pytest

from gliderwatch.delivery.links import Linked
from gliderwatch.messages.guide import SECTIONS, anchor
from gliderwatch.model import Alert, Kind
from gliderwatch.pages.render import guide_page
from message_kinds import kinds

KINDS = kinds()


class Kept:
    """A channel that keeps what is sent."""

    def __init__(self) -> None:
        self.alerts: list[Alert] = []

    def prepare(self) -> None:
        """Nothing to load."""

    def send(self, alert: Alert) -> None:
        """Keep it."""
        self.alerts.append(alert)


def test_each_kind_of_message_has_a_section():
    assert set(SECTIONS) == set(Kind)
    targets = re.findall(r'<h2 id="([^"]*)"', guide_page())
    assert len(set(targets)) == len(targets)
    assert {anchor(heading) for heading in SECTIONS.values()} <= set(targets)


def test_the_guide_leads_to_no_page_that_is_not_there():
    page = guide_page()
    found = re.findall(r'href="([^"]*)"', page)
    assert set(found) <= {"index.html", *(f"#{anchor(h)}" for h in SECTIONS.values())}
    assert "<script" not in page and "](" not in page


@pytest.mark.parametrize("name", KINDS)
def test_each_message_ends_with_where_help_is(name):
    alert = KINDS[name]
    assert alert.body.endswith(f"\n\nHelp: docs/pilots.md, {SECTIONS[alert.kind]}\n")
    kept = Kept()
    Linked(kept, "https://g.example.org", "k" * 40, "mail").send(alert)
    (sent,) = kept.alerts
    url = f"https://g.example.org/pilots.html#{anchor(SECTIONS[alert.kind])}"
    assert f"\nHelp: {url}\n" in sent.body and "docs/pilots.md" not in sent.body
    assert f'<a href="{url}">Help</a>' in sent.html and "docs/pilots.md" not in sent.html
