"""How states and segments are written down: JSON, versioned, compressed. Never pickle.

A record is zlib-compressed UTF-8 JSON of ``{"v": version, "data": ...}``. Values are objects with
the fields of their dataclass; an array is ``{"shape": [...], "f64": "..."}`` with its little-endian
float64 bytes in base64, so that every bit comes back. `docs/state-file.md` shows how to look into one.
"""

from __future__ import annotations

import base64
import zlib
from typing import Any, TypeVar

import msgspec
import numpy as np

from gliderwatch.errors import DamagedError, GliderwatchError
from gliderwatch.model import readonly

VERSION = 1
"""Of the layout of checkpoints and segments. A change of a field of any value in them raises it, and
`decode` then has to know the older ones."""

T = TypeVar("T")


class UnknownVersionError(GliderwatchError):
    """A record was written by a newer gliderwatch."""


class _Record(msgspec.Struct):
    v: int
    data: msgspec.Raw


def encode(value: object) -> bytes:
    """A record of any of the values of gliderwatch."""
    data = msgspec.json.encode(value, enc_hook=_from_array)
    return zlib.compress(msgspec.json.encode(_Record(VERSION, msgspec.Raw(data))), 1)


def decode(record: bytes, kind: type[T]) -> T:
    """The value of a record. Raises UnknownVersionError, or DamagedError where it is no such value."""
    try:
        parsed = msgspec.json.decode(zlib.decompress(record), type=_Record)
    except (zlib.error, msgspec.MsgspecError, UnicodeError) as error:
        raise _damaged(error) from error
    if parsed.v != VERSION:
        raise UnknownVersionError(
            f"the state file holds records of version {parsed.v}, this gliderwatch knows {VERSION}: "
            "install the gliderwatch that wrote it, or a newer one"
        )
    return plain_decode(parsed.data, kind)


def plain_encode(value: object) -> str:
    """JSON text of a value without version: for rows whose table has one."""
    return msgspec.json.encode(value, enc_hook=_from_array).decode()


def plain_decode(text: str | bytes | msgspec.Raw, kind: type[T]) -> T:
    """The value of such a text. Raises DamagedError where it is none."""
    try:
        return msgspec.json.decode(text, type=kind, dec_hook=_to_array)
    except (msgspec.MsgspecError, UnicodeError) as error:
        raise _damaged(error) from error


def _damaged(error: Exception) -> DamagedError:
    return DamagedError(f"a record of the state file is damaged: {error}")


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
    raw = np.frombuffer(base64.b64decode(value["f64"]), dtype="<f8")
    return readonly(raw.reshape(value["shape"]))
