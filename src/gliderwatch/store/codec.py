"""How states and segments are written down (JSON, versioned, compressed, no pickle), and rows as values."""

from __future__ import annotations

import base64
import sqlite3
import zlib
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from typing import Any, TypeVar

import msgspec
import numpy as np

from gliderwatch.errors import DamagedError, LayoutError, StateError
from gliderwatch.model import Hindrance, readonly
from gliderwatch.store import conversion

# ----------------------------------------
# How states and segments are written down: JSON, versioned, compressed. Never pickle.
#
# A record is zlib-compressed UTF-8 JSON of ``{"v": version, "data": ...}``. Values are objects with
# the fields of their dataclass; an array is ``{"shape": [...], "f64": "..."}`` with its little-endian
# float64 bytes in base64, so that every bit comes back. `docs/state-file.md` shows how to look into one.
# A record of an earlier layout is converted when it is read (`conversion`).

T = TypeVar("T")


class _Record(msgspec.Struct):
    v: int
    data: msgspec.Raw


def encode(value: object) -> bytes:
    """A record of any of the values of gliderwatch."""
    return zlib.compress(_record(value), 1)


def encode_state(value: object) -> bytes:
    """The same of a state, not packed: nearly all of it is numbers that differ in all their bits. To pack
    them takes twice as long as to assess a dive, for a third of the room."""
    return zlib.compress(_record(value), 0)


def _record(value: object) -> bytes:
    data = msgspec.json.encode(value, enc_hook=_from_array)
    return msgspec.json.encode(_Record(conversion.version(type(value)), msgspec.Raw(data)))


def decode(record: bytes, kind: type[T]) -> T:
    """The value of a record, converted where its layout is an earlier one.

    Raises DamagedError where its bytes are broken, LayoutError where they are whole but make no such value.
    """
    try:
        parsed = msgspec.json.decode(zlib.decompress(record), type=_Record)
    except (zlib.error, msgspec.MsgspecError, UnicodeError) as error:
        raise _unreadable(error, kind) from error
    today = conversion.version(kind)
    if not 1 <= parsed.v <= today:
        raise LayoutError(
            f"the state file holds a {kind.__name__} of layout {parsed.v}, this gliderwatch knows {today}: "
            "install the gliderwatch that wrote it, or a newer one"
        )
    if parsed.v == today:
        return plain_decode(parsed.data, kind)
    try:
        data = conversion.converted(msgspec.json.decode(parsed.data), kind, parsed.v)
    except (LookupError, TypeError, ValueError, AttributeError) as error:  # not of the layout that it says
        raise _unreadable(error, kind) from error
    return plain_decode(msgspec.json.encode(data), kind)


def plain_encode(value: object) -> str:
    """JSON text of a value without version: for rows whose table has one."""
    return msgspec.json.encode(value, enc_hook=_from_array).decode()


def plain_decode(text: str | bytes | msgspec.Raw, kind: type[T]) -> T:
    """The value of such a text. Raises DamagedError or LayoutError, as `decode`."""
    try:
        return msgspec.json.decode(text, type=kind, dec_hook=_to_array)
    except (msgspec.MsgspecError, UnicodeError) as error:
        raise _unreadable(error, kind) from error


def _unreadable(error: Exception, kind: type) -> StateError:
    """Broken bytes are the disk's doing: to be set aside. Whole JSON of another type is the program's.

    msgspec.ValidationError is a DecodeError of JSON that is well-formed.
    """
    if isinstance(error, zlib.error | UnicodeError) or (
        isinstance(error, msgspec.DecodeError) and not isinstance(error, msgspec.ValidationError)
    ):
        return DamagedError(f"a record of the state file is damaged: {error}")
    return LayoutError(
        f"the state file holds a {getattr(kind, '__name__', kind)} that this gliderwatch cannot read: "
        f"{type(error).__name__}: {error}. Nothing of it is lost. What to do: if an older gliderwatch wrote "
        "it, start the service of this one on it once, or replay again; else install the one that wrote it, "
        "and report this"
    )


def _from_array(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value, dtype="<f8")
        return {"shape": list(value.shape), "f64": base64.b64encode(data.tobytes()).decode()}
    if isinstance(value, np.floating):
        return float(value)
    if hasattr(value, "keys"):
        return dict(value)
    raise NotImplementedError(f"no way to write down {type(value).__name__}")


def _to_array(kind: Any, value: Any) -> Any:
    """Raises TypeError or ValueError, of which msgspec makes a ValidationError."""
    try:
        raw = np.frombuffer(base64.b64decode(value["f64"]), dtype="<f8")
        return readonly(raw.reshape(value["shape"]))
    except KeyError as error:
        raise ValueError(f"an array without {error}") from None


# ----------------------------------------
# Rows of the state file as values.

R = TypeVar("R")


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


def values(db: sqlite3.Connection, sql: str, arguments: tuple[object, ...], kind: type[R]) -> list[R]:
    """The values in the first column of what a query finds. Raises DamagedError."""
    of: Any = kind  # a class can be hashed, whatever mypy makes of `type[R]`
    return [_remembered(row[0], of) for row in db.execute(sql, arguments)]


@lru_cache(maxsize=256)
def _remembered(text: str, kind: Any) -> Any:
    """`plain_decode` of a row: a dozen rules ask for the same dives after each file."""
    return plain_decode(text, kind)
