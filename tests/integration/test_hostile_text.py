"""Names and notes from files, wherever they are shown: nothing in them is markup or a line of its own."""

from __future__ import annotations

import email
import email.policy
import html.parser
import io
import json
import logging
import os
import re
import sys
from collections.abc import Iterator

import pytest
import requests
import structlog
from rich.console import Console

import dinkum
from gliderwatch.cli import tables
from gliderwatch.cli import tables as frames
from gliderwatch.cli.status import Overview, status_as_json
from gliderwatch.config import Problem
from gliderwatch.delivery.channels import Channel
from gliderwatch.delivery.mail import Envelope, compose
from gliderwatch.errors import Quarantine
from gliderwatch.messages import notice_text
from gliderwatch.model import Alert, Severity
from gliderwatch.service import logs
from gliderwatch.service.transaction import FileOutcome
from gliderwatch.slocum.header import parse_header
from gliderwatch.store.state_file import File, Status

NASTY = (
    "\x1b[2J\x1b]0;owned\x07\x9b31m\r\nBcc: thief@x.org\r\n\r\n<script>alert(1)</script><img src=x onerror=a>"
    " <!channel> <!here|x> <@U0123> @everyone @here *b* _i_ ~s~ `c` [bold]x[/] [go](http://evil)"
    " <http://evil|x>"
    " &amp; \u202egnp\u2028new\u0085line \x00 %s {title} {{ title }} $(touch x) '; DROP TABLE files; --"
)
PATH = f"/gliders/{NASTY.replace('/', '')}/x.sbd"
BARE = "/gliders/\x1b[2J\x1b]0;owned\x07\x9b31m.sbd"  # without a space, for which structlog would quote it
UNKEPT = os.fsdecode(b"/gliders/\xff\xfe.sbd")
BAD = File(PATH, 1, 2, Status.QUARANTINED, NASTY, NASTY, f"not good: {NASTY}")
UNKNOWN = File(PATH, 1, 2, Status.UNKNOWN, NASTY, NASTY, NASTY)


def operator(text: str) -> Alert:
    """A message of which every part comes from outside."""
    return notice_text.operator(
        text,
        f"first\n{text}",
        1.7e9,
        alert_id=text,
        severity=Severity.CRITICAL,
        audience=Severity.CRITICAL,
        machine=text,
    )


def is_harmless(shown: str, *allowed: str) -> bool:
    """Whether text for a terminal holds no control character but line ends and what is allowed."""
    for each in allowed:
        shown = shown.replace(each, "")
    return all(c.isprintable() or c == "\n" for c in shown)


# --------------------------------------------------------------------------- logs


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[io.StringIO]:
    """Standard error as a terminal, to which the log goes."""
    yield from heard(monkeypatch, True)


@pytest.fixture
def journal(monkeypatch: pytest.MonkeyPatch) -> Iterator[io.StringIO]:
    """Standard error as a service manager has it."""
    yield from heard(monkeypatch, False)


def heard(monkeypatch: pytest.MonkeyPatch, tty: bool) -> Iterator[io.StringIO]:
    stream, root, kept = io.StringIO(), logging.getLogger(), structlog.get_config()
    monkeypatch.setattr(stream, "isatty", lambda: tty, raising=False)
    monkeypatch.setattr(sys, "stderr", stream)
    handlers = root.handlers[:]
    root.handlers[:] = []
    logs.configure()
    structlog.configure(cache_logger_on_first_use=False)
    monkeypatch.setattr(logs, "log", structlog.get_logger("test"))
    yield stream
    root.handlers[:] = handlers
    structlog.configure(**kept)


def say() -> None:
    """One line each of the log that tells of a file, of a message, of an error, and of a library."""
    logs.processed(FileOutcome(BAD))
    logs.alerts([operator(NASTY)])
    logs.log.warning("folder left out", reason=f"{PATH} cannot be read", paths=[PATH])
    logs.log.info("seen", path=BARE)
    logging.getLogger("watchdog").warning("below %r: %s", PATH, PATH)


COLOURS = [f"\x1b[{code}m" for code in (0, 1, 2, 31, 32, 33, 34, 35, 36)]


def test_a_terminal_shows_each_event_in_one_harmless_line(terminal: io.StringIO) -> None:
    say()
    shown = terminal.getvalue()
    assert is_harmless(shown, *COLOURS)
    assert len(shown.splitlines()) == 5
    assert "DROP TABLE" in shown


def test_a_traceback_on_a_terminal_keeps_its_lines_and_is_harmless(terminal: io.StringIO) -> None:
    try:
        raise ValueError(NASTY)
    except ValueError:
        logs.log.exception("file cannot be assessed", path=PATH)
    shown = terminal.getvalue()
    assert is_harmless(shown, *COLOURS)
    assert "    raise ValueError(NASTY)\n" in shown


def test_the_journal_gets_one_line_an_event_and_all_of_the_name(journal: io.StringIO) -> None:
    say()
    lines = journal.getvalue().splitlines()
    assert len(lines) == 5
    assert all(line.isprintable() for line in lines)
    entries = [json.loads(line) for line in lines]
    assert (entries[0]["path"], entries[0]["event"]) == (PATH, "file quarantined")
    library = entries[-1]
    assert (library["logger"], library["level"]) == ("watchdog", "warning")
    assert PATH in library["event"] and library["timestamp"]


def test_an_error_in_a_library_is_one_line_of_the_journal(journal: io.StringIO) -> None:
    try:
        raise ValueError(NASTY)
    except ValueError:
        logging.getLogger("watchdog").exception("unforeseen")
    (line,) = journal.getvalue().splitlines()
    assert json.loads(line)["event"] == "unforeseen"
    assert "raise ValueError(NASTY)" in json.loads(line)["exception"]


def test_a_name_that_is_no_text_can_be_logged(terminal: io.StringIO) -> None:
    logs.log.warning("file left out", path=UNKEPT)
    assert terminal.getvalue().encode("utf-8")


# --------------------------------------------------------------------------- status, tables


def shown(*, width: int = 100) -> tuple[Console, io.StringIO]:
    """A console that thinks it is a terminal, and what it was told."""
    stream = io.StringIO()
    return Console(file=stream, force_terminal=True, color_system=None, width=width), stream


def test_status_is_harmless() -> None:
    view = Overview(
        running=True,
        silent_for=1.0,
        gliders=(),
        files={Status.QUARANTINED: 1},
        waiting=(),
        quarantined=(BAD,),
        unknown=(UNKNOWN,),
        undelivered=(),
    )
    console, stream = shown()
    tables.status(view, console)
    assert is_harmless(stream.getvalue())
    assert "[bold]x[/]" in stream.getvalue()
    (told,) = json.loads(json.dumps(status_as_json(view)))["quarantined"]
    assert told["path"] == PATH


def test_what_check_found_is_harmless() -> None:
    console, stream = shown()
    tables.problems(
        [Problem("warning", "a.yml:1", f"not configured, so not watched: {PATH}", "add")], console
    )
    assert is_harmless(stream.getvalue())
    assert len(stream.getvalue().splitlines()) == 1


def test_an_alert_on_a_terminal_is_harmless() -> None:
    console, stream = shown()
    frames.show_alert(operator(NASTY), console)
    assert is_harmless(stream.getvalue())
    assert "[bold]x[/]" in " ".join(stream.getvalue().split())


# --------------------------------------------------------------------------- mail


class _Tags(html.parser.HTMLParser):
    """The tags of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.links: list[str | None] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.links += [value for key, value in attrs if key in ("href", "src") or key.startswith("on")]


def test_mail_has_no_header_line_or_tag_of_its_own() -> None:
    alert = operator(NASTY)
    envelope = Envelope(("gliderwatch", "a@b.org"), [("pilot", "c@d.org")])
    mail = email.message_from_bytes(compose(alert, envelope).as_bytes(), policy=email.policy.default)
    assert "Bcc" not in mail
    assert mail["To"] == "pilot <c@d.org>"
    assert [part.get_content_type() for part in mail.iter_parts()] == ["text/plain", "text/html"]
    subject = str(mail["Subject"])
    assert "Bcc: thief" in subject
    assert subject.isprintable()
    text, page = (mail.get_body((kind,)) for kind in ("plain", "html"))
    assert text is not None
    assert page is not None
    assert is_harmless(text.get_content().replace("\r\n", "\n"))
    plain = _Tags(operator("nothing").html)
    tags = _Tags(page.get_content())
    assert (tags.tags, tags.links) == (plain.tags, plain.links)


# --------------------------------------------------------------------------- chat


SERVICES = {
    "slack": "slack://T1JJ3T3L2/A1BRTD4JD/TIiajkdnlazkcOXrIdevi7FQ/#c",
    "slack in blocks": "slack://T1JJ3T3L2/A1BRTD4JD/TIiajkdnlazkcOXrIdevi7FQ/#c?blocks=yes",
    "slack, markdown": "slack://T1JJ3T3L2/A1BRTD4JD/TIiajkdnlazkcOXrIdevi7FQ/#c?format=markdown",
    "discord": "discord://1234567890123/abcdefghijklmnopqrstuvwxyz",
    "mattermost": "mmost://localhost/aaaaaaaaaaaaaaaaaaaaaaaaaa",
    "telegram": "tgram://123456789:ABCdefghijkl_mnopqrstuvwxyz0123456/12315544",
}
LIVE = {
    "slack": r"<[!@#][^<>&]*>|@everyone|@here|\]\(",
    "telegram": r"<(?!/?b>)|@everyone|@here",
    "discord": r"<@\w|@everyone|@here|\]\(",
    "mattermost": r"@U0|@everyone|@here|\]\(",
}
"""What each of them would act upon."""


@pytest.mark.parametrize("service", SERVICES)
def test_chat_calls_nobody_and_leads_nowhere(service: str, monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[str] = []

    def post(_session: object, method: str, url: str, **more: object) -> requests.Response:
        sent.append(str(more.get("data") or more.get("json")))
        response = requests.Response()
        response.status_code, response._content = 200, b"ok" if "slack" in url else b'{"ok": true}'
        return response

    monkeypatch.setattr(requests.Session, "request", post)
    Channel("chat", SERVICES[service]).send(operator(NASTY))
    (body,) = sent
    said = json.dumps(json.loads(body), ensure_ascii=False)
    assert "DROP TABLE" in said
    assert not re.search(LIVE[service.partition(",")[0].partition(" ")[0]], said)
    assert "\\u001b" not in said
    assert "\x1b" not in said


def test_the_name_of_a_file_is_no_path_of_ours() -> None:
    """What a header says becomes no path: a cache file is looked for by eight hexadecimal digits."""
    for crc in ("../../etc/passwd", "/etc/passwd", "0abc12ef\x00", "0abc12ef/..", "*", "0abc12ef.cac", ""):
        with pytest.raises(Quarantine):
            parse_header(dinkum.header(crc=crc))
    for name in ("../x", "a/b", "<script>", "a\x1b", "-rf", "a b", "a;b", "@here"):
        with pytest.raises(Quarantine):
            parse_header(dinkum.header(f"{name}-2024-250-1-3"))
