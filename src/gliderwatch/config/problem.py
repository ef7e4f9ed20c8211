"""What is wrong with the settings, where, and what to do about it."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

_HARMLESS = re.compile(r"[\w<][\w .<>-]{0,63}")
_SECRET = re.compile(r"://|@|[^\s/]{16,}/|/[^\s/]{16,}|.{65,}", re.DOTALL)
"""What may be a URL with a password or a token in it."""


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
    """`word` as it is or, if it is no usual name, in quotes; a stand-in where it may be a secret.

    What stands in the wrong place may be a channel's URL with its password in it, and that must
    never be printed.

    >>> shown("unit_595"), shown("unit 595!"), shown("mailtos://me:secret@smtp.example.org")
    ('unit_595', '"unit 595!"', '***')
    """
    text = str(word)
    if _HARMLESS.fullmatch(text):
        return text
    if not text or _SECRET.search(text):
        return "***"
    return '"' + "".join(letter if letter.isprintable() else "?" for letter in text) + '"'


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
