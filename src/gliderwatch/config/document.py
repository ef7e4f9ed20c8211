"""YAML to plain values with the line of every key, and what is wrong with it, where, with the cure."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode

from gliderwatch.errors import ConfigError

# ----------------------------------------
# What is wrong with the settings, where, and what to do about it.

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


# ----------------------------------------
# YAML to plain values, with the line of every key and item.
#
# The node graph is converted here and not by the parser, because every duplicate key is to be
# reported (the parser stops at the first), a glider may be called `2024` or `null`, and lines are
# wanted for scalars too. No text of the file is repeated in an error: it may be a secret.

_TAG = "tag:yaml.org,2002:"
_SCALARS = {"null", "bool", "int", "float", "str", "timestamp", "merge"}

# Start of the parser's complaint -> (is the start of the construct the better line?, what, cure).
_SYNTAX = (
    ("found character '\\t'", False, "a tab is used for indentation", "indent with spaces"),
    ("found character", False, "a value starts with a character that YAML reserves", "put it in quotes"),
    (
        "mapping values are not",
        False,
        "a `:` where none can stand",
        "check the indentation; quote the text",
    ),
    ("could not find expected ':'", True, "a key without `:`", "write `key: value`"),
    ("expected ',' or", True, "a bracket is not closed, or a comma is missing", "write `[one, two]`"),
    ("expected <block end>", False, "the indentation is not that of the lines around", "align it with them"),
    ("found unexpected end of stream", True, "a quote is not closed", "close it"),
    ("found unknown escape", False, "an unknown `\\` in a quoted text", "use single quotes"),
    ("but found another document", False, "a second document begins", "remove the `---`"),
    ("found undefined alias", False, "a value starts with `*`", "put it in quotes"),
)


@dataclass(frozen=True, slots=True)
class Document:
    """A parsed file: plain ``data``, the line (from 1) of each dotted key, and problems met."""

    path: Path
    data: Any
    lines: Mapping[str, int]
    problems: tuple[Problem, ...] = ()

    def line(self, dotted: str) -> int:
        """The line of a key (`channels.mail.url`, `dockserver.roots.0`), else of what it belongs to."""
        while dotted and dotted not in self.lines:
            dotted = dotted.rpartition(".")[0]
        return self.lines.get(dotted, 1)

    def error(self, parts: Sequence[str], text: str, cure: str = "") -> Problem:
        """A problem at a key, given as its parts and named with its place."""
        key = ".".join(shown(part) for part in parts)
        where = f"{self.path}:{self.line('.'.join(parts))}"
        return Problem("error", where, f"{key}: {text}" if key else text, cure)


def read(path: Path) -> Document:
    """Parse a YAML file; duplicate keys and unusable values are in its `problems`.

    Raises `ConfigError` when the file cannot be read or is no YAML at all.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ConfigError(f"{path}:{line}: not UTF-8 text (save the file as UTF-8)") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a usable name"
        raise ConfigError(f"{path}: cannot be read: {reason} (check the path and its permissions)") from None
    parser = YAML(typ="safe", pure=True)
    try:
        node = parser.compose(text)
    except RecursionError:
        raise ConfigError(f"{path}:1: nested too deeply (remove the brackets)") from None
    except (YAMLError, LookupError, ValueError) as error:  # the latter on odd directives and tags
        raise ConfigError(_explain(path, text, error)) from None
    builder = _Builder(path, parser)
    data = None if node is None else builder.value(node, ())
    return Document(path, data, builder.lines, tuple(builder.problems))


def _explain(path: Path, text: str, error: Exception) -> str:
    """A parser's complaint as `FILE:LINE: what is wrong (cure)`."""
    what, cure, line = "not valid YAML", "look at this line and the one before it", 1
    if isinstance(error, MarkedYAMLError):
        mark = error.problem_mark or error.context_mark
        for start, at_context, known_what, known_cure in _SYNTAX:
            if str(error.problem).startswith(start):
                what, cure = known_what, known_cure
                mark = (error.context_mark if at_context else None) or mark
                break
        line = mark.line + 1 if mark else 1
    elif hasattr(error, "position"):
        what, cure = "a control character", "remove it"
        line = text.count("\n", 0, error.position) + 1
    return f"{path}:{line}: {what} ({cure})"


@dataclass(slots=True)
class _Builder:
    """Turns nodes into dict, list and scalars, collecting lines and problems."""

    path: Path
    parser: YAML
    lines: dict[str, int] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    seen: set[int] = field(default_factory=set)

    def value(self, node: Any, at: tuple[str, ...]) -> Any:
        """The plain value of a node; None, with a problem noted, where it has none."""
        if id(node) in self.seen:  # an alias; a cycle of them would run forever
            line = self.lines.get(".".join(at)) or self.lines[".".join(at[:-1])]
            return self._problem(line, at, "YAML aliases (`*name`) are not used here", "write the value out")
        self.seen.add(id(node))
        line = node.start_mark.line + 1
        self.lines.setdefault(".".join(at), line)
        kind = str(node.tag).removeprefix(_TAG)
        if isinstance(node, MappingNode) and kind == "map":
            return self._mapping(node, at)
        if isinstance(node, SequenceNode) and kind == "seq":
            return [self.value(item, (*at, str(i))) for i, item in enumerate(node.value)]
        if isinstance(node, ScalarNode) and kind in _SCALARS:
            return self._scalar(node, kind, at)
        return self._problem(line, at, "YAML tags (`!name`) are not used here", "put the value in quotes")

    def _mapping(self, node: MappingNode, at: tuple[str, ...]) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, ScalarNode):
                self._problem(line, at, "a key that is not a word", "quote it if it starts with `[` or `{`")
                continue
            key = str(key_node.value)
            if key in values:
                first = self.lines[".".join((*at, key))]
                self._problem(line, (*at, key), f"given twice, first on line {first}", "keep one of them")
                continue
            self.lines[".".join((*at, key))] = line
            values[key] = self.value(value_node, (*at, key))
        return values

    def _scalar(self, node: ScalarNode, kind: str, at: tuple[str, ...]) -> Any:
        if kind in {"null", "bool", "int", "float"}:
            try:
                return self.parser.constructor.construct_object(node)
            except (YAMLError, LookupError, ValueError):
                line = node.start_mark.line + 1
                return self._problem(line, at, "not a number", "put it in quotes if it is text")
        text = str(node.value)
        if not text.isprintable():
            line = node.start_mark.line + 1
            return self._problem(line, at, "a line break or a control character", "write it on one line")
        return text

    def _problem(self, line: int, at: tuple[str, ...], text: str, cure: str) -> None:
        key = ".".join(shown(part) for part in at)
        where = f"{self.path}:{line}"
        self.problems.append(Problem("error", where, f"{key}: {text}" if key else text, cure))
