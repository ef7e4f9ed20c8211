"""What must not be in the log of a daemon, whatever happens to it."""

from __future__ import annotations

import json
from collections.abc import Iterator

from acceptance.support import TRACEBACK

_EVENTS = ("file cannot be assessed", "ended by an error")
_CUT_OFF = ("EOFError", "_pickle.UnpicklingError")
"""How Python itself, in `spawn_main`, ends the start of a worker whose daemon is killed meanwhile."""


def complaints(text: str) -> list[str]:
    """Faults of gliderwatch in the text of a log: tracebacks, and events that say so."""
    lines = text.splitlines()
    found = [f"in the log: {error}" for error in _tracebacks(lines)]
    for line in lines:
        if any(event in line for event in _EVENTS) and json.loads(line)["event"] in _EVENTS:
            found.append(f"in the log: {line}")
    return found


def _tracebacks(lines: list[str]) -> Iterator[str]:
    """The last line of each traceback, which names the error."""
    inside: list[str] | None = None
    for line in lines:
        if line.startswith(TRACEBACK):
            inside = []
        elif inside is not None and line.startswith(" "):
            inside.append(line)
        elif inside is not None:
            is_cut_off = line.startswith(_CUT_OFF) and any("in spawn_main" in frame for frame in inside)
            inside = None
            if not is_cut_off:
                yield f"{TRACEBACK}: {line}"
