"""What is wrong with the settings, where, and what to do about it."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

_HARMLESS = re.compile(r"[\w<][\w .<>-]{0,63}")


@dataclass(frozen=True, slots=True)
class Problem:
    """One problem: ``where`` is `FILE:LINE`, ``cure`` may be empty. ``str()`` gives the whole line."""

    severity: Literal["error", "warning"]
    where: str
    text: str
    cure: str = ""

    def __str__(self) -> str:
        return f"{self.where}: {self.text}" + (f" ({self.cure})" if self.cure else "")


def shown(word: object) -> str:
    """`word` if it can be a name, else a stand-in.

    What stands in the wrong place may be a channel's URL with its password in it, and that must
    never be printed.

    >>> shown("unit_595"), shown("mailtos://me:secret@smtp.example.org")
    ('unit_595', '***')
    """
    return str(word) if _HARMLESS.fullmatch(str(word)) else "***"


def nearest(word: str, known: Iterable[str]) -> str:
    """A cure for an unknown word: the nearest known one, else all of them.

    >>> nearest("root", ["roots", "cache"])
    'did you mean `roots`?'
    """
    names = sorted(known)
    close = difflib.get_close_matches(word, names, n=1)
    if close:
        return f"did you mean `{close[0]}`?"
    return f"known are: {', '.join(shown(name) for name in names)}" if names else ""
