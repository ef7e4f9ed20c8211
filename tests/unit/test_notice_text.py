"""Every kind of message on a phone: pinned, short at the top, and answering what a tired reader asks."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

import written
from alert_support import SLOW, incident
from gliderwatch.messages.template import DO, TITLE
from gliderwatch.model import Kind, Severity
from message_kinds import anomaly, disagreement, kinds
from phone import COLUMNS, narrow

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "messages"
ANEW = "python tests/golden/write_messages.py writes them anew; read the difference"
KINDS = kinds()
WHICH = r"electa|GLIDERWATCH dockserver-2"
SINCE = r"\d{4}-\d\d-\d\d \d\d:\d\d UTC"
SURE = r"\(\d+ %\)|\(\d+ of \d+( calls)?\)|\d of \d other gliders|\d dives? in a row|only one at sea"
TWICE = "twice in a row"
WHERE = r"\d\d° \d\d\.\d{3}' N, \d{3}° \d\d\.\d{3}' W"
NEXT = r"Next call: "
TODO = rf"{DO}\n- \w|Nothing to do|ake it on|Quiet while you work"
ALARM = (WHICH, SINCE, SURE, WHERE, NEXT, TODO)
QUESTIONS = {
    "anomaly": ALARM,
    "disagree": ALARM,
    "overdue": ALARM,
    "unknown": ALARM,
    "abort": ALARM,
    "calls": (WHICH, SINCE, WHERE, NEXT, TODO),
    "called": (WHICH, SINCE, TODO),
    "call": ALARM,
    "neighbours": (WHICH, SINCE, SURE, WHERE, NEXT, TODO),
    "health-over": (WHICH, SINCE, WHERE, TODO),
    "health": (WHICH, SINCE, TWICE, WHERE, NEXT, TODO),
    "still-aborted": (WHICH, SINCE, WHERE, NEXT, TODO),
    "reminder": (WHICH, SINCE, WHERE, NEXT, TODO),
    "all-clear": (WHICH, SINCE, WHERE, NEXT, TODO),
    "correction": (WHICH, SINCE, WHERE, NEXT, TODO),
    "regime": (WHICH, SINCE, WHERE, NEXT, TODO),
    "surfacing": (WHICH, SINCE, WHERE, NEXT),
    "resumed": (WHICH, SINCE, WHERE, NEXT, TODO),
    "sends": (WHICH, SINCE, WHERE, NEXT, TODO),
    "judged": (WHICH, SINCE, TODO),
    "acknowledged": (WHICH, SINCE),
    "given": (WHICH, SINCE, TODO),
    "operator": (WHICH, SINCE, TODO),
}
"""What the first 600 characters have to answer, by how its name begins."""


REMINDERS = {"reminder", "still-aborted", "health-reminder", "overdue-circle", "unknown-reminder"}


class Tags(HTMLParser):
    """The tags of a page with their attributes, and its words."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.words = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data: str) -> None:
        self.words += data


def test_each_kind_is_here() -> None:
    assert {alert.kind for alert in KINDS.values()} == set(Kind)


def test_the_golden_messages_are_those_that_are_made() -> None:
    assert {path.stem for path in GOLDEN.iterdir()} == set(KINDS), ANEW


@pytest.mark.parametrize("name", KINDS)
def test_a_message_reads_as_pinned(name: str) -> None:
    assert narrow(KINDS[name]) == (GOLDEN / f"{name}.txt").read_text("utf-8"), ANEW
    assert KINDS[name].html == (GOLDEN / f"{name}.html").read_text("utf-8"), ANEW


@pytest.mark.parametrize("name", KINDS)
def test_the_title_fits_and_names_whose_it_is_first(name: str) -> None:
    title = KINDS[name].title
    assert len(title) <= TITLE and "..." not in title
    assert title.startswith(("electa ", "GLIDERWATCH dockserver-2: "))


@pytest.mark.parametrize("name", KINDS)
def test_the_first_600_characters_answer_what_is_asked(name: str) -> None:
    text = f"{KINDS[name].title}\n{KINDS[name].body}"[:600]
    for question in next(asked for kind, asked in QUESTIONS.items() if name.startswith(kind)):
        assert re.search(question, text), (question, text)


@pytest.mark.parametrize("name", KINDS)
def test_what_stands_alone_is_short(name: str) -> None:
    lead, *rest = KINDS[name].brief.split("\n\n")
    limit = 5 if name in REMINDERS else 4 if name.startswith("surfacing") else 3
    assert len(lead.rstrip("\n").split("\n")) <= limit
    for block in rest:
        if block.startswith(DO):
            assert len(block.rstrip("\n").split("\n")) <= 1 + 3
    if name in {*REMINDERS, "surfacing", "surfacing-slow"}:
        assert not rest and KINDS[name].body.startswith(f"{KINDS[name].brief}\nHelp: ")


@pytest.mark.parametrize("name", KINDS)
def test_it_fits_on_a_phone(name: str) -> None:
    assert all(len(row) <= COLUMNS for row in narrow(KINDS[name]).split("\n"))
    page = Tags(KINDS[name].html)
    assert not set(page.tags) & {"table", "img", "script", "pre", "iframe", "link", "style"}
    assert not [a for a, _ in page.attributes if a in ("width", "height")]
    styles = " ".join(value or "" for name, value in page.attributes if name == "style")
    assert "overflow-wrap: anywhere" in styles and "width:" not in styles and "nowrap" not in styles
    assert ("name", "viewport") in page.attributes


@pytest.mark.parametrize("name", KINDS)
def test_text_and_html_say_the_same(name: str) -> None:
    shown = " ".join(Tags(KINDS[name].html).words.split())
    for line in KINDS[name].body.split("\n"):
        if line and not line.startswith("Map: "):
            assert " ".join(line.removeprefix("- ").split()) in shown


@pytest.mark.parametrize("name", KINDS)
def test_nothing_reads_as_it_should_not(name: str) -> None:
    text = f"{KINDS[name].title}\n{KINDS[name].body}".lower()
    for fault in (
        "false alarm",
        "it cannot be told",
        "nothing found",
        "reference flow",
        "shore side?",
        "look at:",
        ", unknown\n",
        "1.30",
        "within 4.0 h",
        "nan m/s",
        "why it is flagged: slower than normal",
        "depth-averaged current is provisional",
        "))",
    ):
        assert fault not in text, fault


def test_each_cause_has_a_title_and_first_line_of_its_own() -> None:
    """Remora, net and lost wing read differently from the first line on."""
    made = [alert for name, alert in KINDS.items() if name.startswith("anomaly-") and "wing-way" not in name]
    assert len({alert.title for alert in made}) == len(made)
    assert len({alert.body.split("\n")[0] for alert in made}) == len(made)


def test_the_order_is_that_of_need() -> None:
    body = KINDS["anomaly-drag"].body
    parts = ("Next call", DO, "Take it on", "Last speeds", "For: drag", "Data\n", "In symbols")
    assert [body.index(part) for part in parts] == sorted(body.index(part) for part in parts)
    assert "Last speeds: 0.26, 0.25, 0.25, 0.12, 0.11 m/s" in body


def test_the_glider_is_enough_to_acknowledge_where_one_is_open() -> None:
    assert "sudo -u gliderwatch gliderwatch ack electa\n" in KINDS["anomaly-drag"].brief


def test_how_sure_follows_from_the_standard_error() -> None:
    """Two standard errors below the bound: 97.7 % (one side of a normal law)."""
    assert "almost sure (98 %)" in anomaly(0.16, speed_sigma=0.03).body
    assert "not sure (50 %)" in anomaly(0.2199, speed_sigma=0.3, own_speed=0.22).body
    assert "almost sure (99 %)" in disagreement("the current is wrong", across_misfit=0.6).body


def test_what_is_as_usual_speaks_only_of_the_cause() -> None:
    """Pitch as usual fits a remora; rates as usual speak against it."""
    drag = KINDS["anomaly-drag"].body
    assert "pitch 26° climbing, as usual" not in drag.partition("Against: ")[2]
    growth = KINDS["anomaly-growth"].body.partition("Against: ")[2]
    assert "climbs at 0.16 m/s, as usual" in growth


def test_a_bound_that_was_not_learnt_is_not_named() -> None:
    wide = replace(SLOW, speed_max=1.3, evidence={**SLOW.evidence, "usual_speed": 0.26})
    made = written.opened(incident(wide), wide, alert_id="a", audience=Severity.CRITICAL)
    assert "(normal above 0.22)" in made.title and "1.30" not in made.body
