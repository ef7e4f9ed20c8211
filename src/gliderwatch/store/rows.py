"""Rows of the state file as values."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TypeVar

from gliderwatch.model import Hindrance
from gliderwatch.store import codec

T = TypeVar("T")


class Status(StrEnum):
    """What became of a file."""

    TAKEN = "taken"
    DUPLICATE = "duplicate"
    WAITING = "waiting"
    QUARANTINED = "quarantined"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class File:
    """A row of the ledger: ``hindrance`` and, in words, ``reason`` say why it was not taken.

    ``crc`` names the cache file that it waits for.

    ``opened_at`` (s) of its header is not in the row: it makes the file a sign of life when it is noted.
    """

    path: str
    size: int
    mtime_ns: int
    status: Status
    glider: str = ""
    segment: str = ""
    reason: str = ""
    crc: str = ""
    opened_at: float | None = field(default=None, compare=False)
    hindrance: Hindrance | None = None


@dataclass(frozen=True, slots=True)
class Undelivered:
    """A message that waits for a channel; ``error`` is the reason of the last failed attempt.

    It is not sent before ``held_until`` (s), and not at all where its incident is acknowledged by then, if
    ``escalates``.
    """

    alert: str
    channel: str
    attempts: int
    error: str
    held_until: float = 0.0
    escalates: bool = False


def file_of(row: sqlite3.Row) -> File:
    """The row of the ledger."""
    names = ("path", "size", "mtime_ns", "glider", "segment", "reason", "crc")
    why = row["hindrance"] if "hindrance" in row.keys() else ""  # noqa: SIM118 (a row is no mapping)
    hindrance = Hindrance(why) if why else None
    return File(status=Status(row["status"]), hindrance=hindrance, **{name: row[name] for name in names})


def values(db: sqlite3.Connection, sql: str, arguments: tuple[object, ...], kind: type[T]) -> list[T]:
    """The values in the first column of what a query finds. Raises DamagedError."""
    return [codec.plain_decode(row[0], kind) for row in db.execute(sql, arguments)]
