"""Every line of the log can be found by what it is about: a file, a glider, a message, a channel."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import structlog

import gliderwatch
from acceptance.support import lacks_key
from alert_support import alert
from gliderwatch.delivery.dispatcher import OutboxRow, _about
from gliderwatch.model import Severity
from gliderwatch.service import logs
from gliderwatch.service.transaction import FileOutcome
from gliderwatch.store.state_file import File, Status

LEVELS = {"debug", "info", "warning", "error", "critical", "exception"}
KEYS = {"path", "paths", "glider", "gliders", "alert", "channel"}
OF_THE_SERVICE = {
    "batch left alone",  # of another relay, which the line names
    "batches cannot be exchanged",
    "broker connected",
    "broker not connected: batches wait in the state file",
    "broker takes no messages",
    "decoder is stuck: no sign of life given",
    "dispatcher is stuck: no sign of life given",
    "ended by an error",
    "folder left out",  # the reason names it, or says what of the machine forbids to watch any
    "heartbeat is late: the one before has not come back",
    "heartbeat not given",  # its URL is a secret
    "inotify lost events, all folders are watched again",
    "map file cannot be used",  # the reason names it
    "message of another relay left alone",
    "metrics are not served",
    "metrics are served",
    "not answered",  # the reason names the file, or the state
    "observer died, started again",
    "outbox cannot be read or written",
    "pages not made anew",  # of all gliders: drawn next time
    "state can be used again",
    "state cannot be used, tried again",
    "stopped",
    "virtual AIS not given out",
    "what is older than state.keep_days is removed",
}
"""Lines that are about no file, glider, message or channel."""


def calls() -> Iterator[tuple[str, set[str | None]]]:
    """Event and keywords of every line of the log in the code; None among them stands for `**`."""
    for path in Path(gliderwatch.__file__).parent.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            match node:
                case ast.Call(ast.Attribute(ast.Name("log"), name), [event, *_], keywords) if name in LEVELS:
                    yield ast.literal_eval(_fixed(event)), {keyword.arg for keyword in keywords}


def _fixed(text: ast.expr) -> ast.expr:
    """The beginning of an f-string, which is the same whatever comes in."""
    return text.values[0] if isinstance(text, ast.JoinedStr) else text


def test_every_line_says_what_it_is_about_or_is_of_the_service_itself() -> None:
    found = list(calls())
    assert {event for event, keys in found if not keys & (KEYS | {None})} <= OF_THE_SERVICE
    assert {event for event, _ in found} >= OF_THE_SERVICE
    assert len(found) > 25
    assert [
        event for event, keys in found if event.startswith("file ") and not {"path", "glider"} <= keys
    ] == []


def test_what_is_told_of_files_and_messages_has_their_keys() -> None:
    about, operator = alert("bruce/anomaly/1", glider="bruce"), alert("operator/disk/1", glider="")
    with structlog.testing.capture_logs() as lines:
        logs.processed(
            FileOutcome(File("/r/bruce/from-glider/a.sbd", 1, 1, Status.TAKEN, "bruce", "bruce-2024-1-0-0"))
        )
        logs.alerts([about, operator])
        for each in (about, operator):
            logs.log.info("alert delivered", **_about(OutboxRow(1, each, "mail", 0)))
    assert [lacks_key(line, {"bruce"}) for line in lines] == [None] * 5
    assert [line.get("glider") for line in lines] == ["bruce", "bruce", None, "bruce", None]


def test_a_notice_of_a_surfacing_is_no_warning() -> None:
    with structlog.testing.capture_logs() as lines:
        logs.alerts([replace(alert(), severity=severity) for severity in Severity])
    assert [(s, line["log_level"]) for s, line in zip(Severity, lines, strict=True)] == [
        (Severity.INFO, "info"),
        (Severity.WARNING, "warning"),
        (Severity.CRITICAL, "warning"),
    ]


def test_a_line_without_its_key_is_noticed() -> None:
    assert lacks_key({"event": "file taken", "glider": "bruce"}, ()) == "path"
    assert lacks_key({"event": "file taken", "path": "/a.sbd"}, ()) == "glider"
    assert (
        lacks_key({"event": "alert delivered", "alert": "bruce/1", "channel": "mail"}, {"bruce"}) == "glider"
    )
    assert lacks_key({"event": "alert parked", "alert": "operator/1"}, {"bruce"}) == "channel"
    assert lacks_key({"event": "left out", "reason": "/r/bruce/from-glider/a.sbd is closed"}, ()) == "path"
    assert lacks_key({"event": "folder left out", "reason": "/r/bruce/from-glider is closed"}, ()) is None
