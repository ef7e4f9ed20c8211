"""What the doctor found, and how it reads."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from gliderwatch.alerts.words import clean

WIDTH = 80
_INDENT = 9


class Level(IntEnum):
    """How bad it is: as it should be, worth knowing, to be looked at, to be cured."""

    OK = 0
    NOTE = 1
    WARNING = 2
    ERROR = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at: ``text`` says how it is, ``cure`` what to do about it."""

    level: Level
    topic: str
    text: str
    cure: str = ""


Findings = Iterator[Finding]


def ok(topic: str, text: str) -> Finding:
    """As it should be."""
    return Finding(Level.OK, topic, text)


def note(topic: str, text: str, cure: str = "") -> Finding:
    """Worth knowing; nothing need be done."""
    return Finding(Level.NOTE, topic, text, cure)


def warning(topic: str, text: str, cure: str) -> Finding:
    """The service works, but not as well as it could."""
    return Finding(Level.WARNING, topic, text, cure)


def error(topic: str, text: str, cure: str) -> Finding:
    """The service, or the watch of some glider, does not work."""
    return Finding(Level.ERROR, topic, text, cure)


def exit_code(findings: Iterable[Finding]) -> int:
    """0: nothing to do, 1: warnings, 2: errors.

    >>> exit_code([note("a", "b")]), exit_code([ok("a", "b"), error("a", "b", "c")])
    (0, 2)
    """
    return max(0, max((f.level for f in findings), default=Level.OK) - Level.NOTE)


def as_lines(f: Finding) -> list[str]:
    """A finding in lines of at most 80 columns; names from files and folders are made printable."""
    label = f.level.name if f.level > Level.NOTE else f.level.name.lower()
    lines = _wrapped(f"{label:<{_INDENT - 1}} ", f"{f.topic}: {f.text}")
    return lines + (_wrapped(" " * _INDENT, f"-> {f.cure}") if f.cure else [])


def summary(findings: Iterable[Finding]) -> str:
    """How many errors and warnings there are."""
    levels = [f.level for f in findings]
    return f"{levels.count(Level.ERROR)} errors, {levels.count(Level.WARNING)} warnings"


def report(findings: Iterable[Finding]) -> dict[str, Any]:
    """All findings for machines."""
    found = list(findings)
    return {
        "result": ("ok", "warnings", "errors")[exit_code(found)],
        "findings": [
            {"level": f.level.name.lower(), "topic": f.topic, "text": f.text, "cure": f.cure or None}
            for f in found
        ],
    }


def _wrapped(start: str, text: str) -> list[str]:
    return textwrap.wrap(
        clean(text, 2000),
        WIDTH,
        initial_indent=start,
        subsequent_indent=" " * _INDENT,
        break_on_hyphens=False,
    )
