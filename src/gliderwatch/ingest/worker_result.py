"""What a worker process hands back to the daemon: a segment, or why there is none.

MessagePack with the bytes of the arrays as they are, checked against the types of `Segment`. Not pickle: code
of C that a damaged file leads astray may have written over the memory of the worker, and a pickle is a
program that the daemon would run.
"""

from __future__ import annotations

from math import prod
from typing import Any

import msgspec
import numpy as np

from gliderwatch.errors import GliderwatchError, MissingCache, Quarantine, Retry
from gliderwatch.model import Segment

_ERRORS: dict[str, type[GliderwatchError]] = {e.__name__: e for e in (Retry, MissingCache, Quarantine)}


class _Decoded(msgspec.Struct, tag=True):
    segment: Segment


class _Array(msgspec.Struct):
    shape: list[int]
    f64: bytes


class _Failed(msgspec.Struct, tag=True):
    kind: str
    arguments: list[Any]


def encoded(outcome: Segment | GliderwatchError) -> bytes:
    """A segment, or an error of `decode`, as bytes. Raises TypeError for anything else."""
    if isinstance(outcome, GliderwatchError):
        kind = type(outcome).__name__
        arguments = outcome.__reduce__()[1] if kind in _ERRORS else (str(outcome),)
        return msgspec.msgpack.encode(_Failed(kind, [_printable(a) for a in arguments]))
    if not isinstance(outcome, Segment):
        raise TypeError(f"no segment but {type(outcome).__name__}")
    return msgspec.msgpack.encode(_Decoded(outcome), enc_hook=_from_array)


def decoded(data: bytes) -> Segment | GliderwatchError:
    """What `encoded` made into bytes, to the last bit; arrays are read-only.

    An error of another kind than `Retry`, `MissingCache` and `Quarantine` comes back as Quarantine. Raises
    ValueError for bytes that `encoded` did not make.
    """
    found = msgspec.msgpack.decode(data, type=_Decoded | _Failed, dec_hook=_to_array)
    if isinstance(found, _Decoded):
        return found.segment
    try:
        return _ERRORS.get(found.kind, Quarantine)(*found.arguments)
    except TypeError as error:
        raise ValueError(f"no {found.kind}: {error}") from None


def _printable(argument: Any) -> Any:
    """Names of files may hold bytes that are no UTF-8."""
    if isinstance(argument, str):
        return argument.encode("utf-8", "backslashreplace").decode()
    return [_printable(a) for a in argument]


def _from_array(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return _Array(list(value.shape), np.ascontiguousarray(value, dtype="<f8").tobytes())
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"no way to hand over {type(value).__name__}")


def _to_array(kind: Any, value: Any) -> Any:
    """Raises TypeError or ValueError, of which msgspec makes a ValidationError (a ValueError)."""
    array = msgspec.convert(value, _Array)
    if prod(array.shape) * 8 != len(array.f64):
        raise ValueError("an array of another size than its shape")
    return np.frombuffer(array.f64, dtype="<f8").reshape(array.shape)  # of bytes, so read-only
