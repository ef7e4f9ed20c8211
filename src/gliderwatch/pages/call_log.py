"""The log of a glider's last call as a page shows it: the lines that matter first, then all. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gliderwatch.messages.formatting import clean
from gliderwatch.model import Call
from gliderwatch.slocum import log_events as events
from gliderwatch.slocum.logs import parse_line

TEXT = 12_000
"""Characters of a log at the most: a page stays small whatever comes."""
MOST_MARKED = 15
_ALWAYS = (
    events.AbortCause,
    events.AbortTime,
    events.AbortPlace,
    events.AbortNow,
    events.WeightDropped,
    events.FellOut,
    events.LastMission,
    events.Prompt,
    events.Emergency,
    events.Trouble,
    events.Because,
)
"""What a line tells that is shown first."""


@dataclass(frozen=True, slots=True)
class CallLog:
    """The ``marked`` lines of a log, and its ``text``; of the files of the call those ``sent`` whole, and
    those that were ``cut``."""

    marked: tuple[str, ...]
    text: str
    sent: tuple[str, ...]
    cut: tuple[str, ...]


def call_log(text: str, call: Call | None) -> CallLog:
    """The log of a call, of which `text` is the end. Every line is made printable."""
    lines = text.splitlines()
    marked = dict.fromkeys(clean(line, 160) for line in lines if is_marked(line))
    shown = "\n".join(clean(line, 300) for line in lines)[-TEXT:]
    sent, announced = (call.sent, call.announced) if call is not None else ((), ())
    cut = tuple(clean(name, 40) for name in announced if name not in sent)
    return CallLog(tuple(marked)[-MOST_MARKED:], shown, tuple(clean(name, 40) for name in sent), cut)


def is_marked(line: str) -> bool:
    """Whether a pilot should see a line of a log first: aborts, prompts, errors, fresh warnings.

    >>> [is_marked(f"ABORT HISTORY: {words}") for words in ("total since reset: 0", "last abort cause: LEAK")]
    [False, True]
    """
    return any(_matters(event) for event in parse_line(line.encode("latin-1", "replace")))


def _matters(event: events.Event) -> bool:
    match event:
        case events.AbortCount():
            return event.count > 0
        case events.Counts():
            return _is_fresh(event)
        case events.Device():
            return _is_fresh(event.counts)
    return isinstance(event, _ALWAYS)


def _is_fresh(counts: events.Counts) -> bool:
    """Whether there were errors at all, or warnings in the segment."""
    return any(counts.errors) or counts.warnings[2] > 0


def transferred(names: Sequence[str]) -> str:
    """Names of files as words.

    >>> transferred(()), transferred(("a.sbd", "b.tbd"))
    ('nothing', 'a.sbd, b.tbd')
    """
    return ", ".join(names) or "nothing"
