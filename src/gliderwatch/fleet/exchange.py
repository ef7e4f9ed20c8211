"""What relays write to each other, so that all of them end with the same batches. Pure.

Each dockserver is a relay. New batches go to all at once (`Parcel`). What an outage, a broker without memory
or a new relay leaves behind is found by comparison: each relay publishes how many batches it has of each day
and a checksum over them (`Holdings`); who has others asks for that day with what it has (`Request`), and gets
a parcel with the rest. All of that may come in any order and any number of times.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import TypeVar

import msgspec

from gliderwatch.fleet.constants import LARGEST_PARCEL

FORM = 1
"""Number of this form of the messages; others are left alone."""
Day = tuple[int, int]
"""Batches of a day of a field: how many, and the sum of their checksums."""
_Message = TypeVar("_Message", "Parcel", "Holdings", "Request")


@dataclass(frozen=True, slots=True)
class Sample:
    """A batch on its way: its ``id`` and ``glider``, and its samples as bytes (`batches.packed`)."""

    id: str
    glider: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Parcel:
    """Batches of a ``field`` whose settings have the checksum ``key``, from a ``relay``."""

    form: int
    relay: str
    field: str
    key: str
    batches: tuple[Sample, ...]


@dataclass(frozen=True, slots=True)
class FieldHoldings:
    """What a relay has of a field with the settings of ``key``: batches by ``days`` since 1970."""

    key: str
    days: dict[int, Day]


@dataclass(frozen=True, slots=True)
class Holdings:
    """What a ``relay`` has, by field; ``t`` (s) is when it said so."""

    form: int
    relay: str
    t: float
    fields: dict[str, FieldHoldings]


@dataclass(frozen=True, slots=True)
class Request:
    """That a ``relay`` wants the batches of a ``day`` of a field but for those that it has (``held``: id to
    checksum)."""

    form: int
    relay: str
    field: str
    key: str
    day: int
    held: dict[str, int]


def encode(message: Parcel | Holdings | Request) -> bytes:
    """A message as bytes (MessagePack)."""
    return msgspec.msgpack.encode(message)


def decode(data: bytes, kind: type[_Message]) -> _Message:
    """The message of such bytes. Raises ValueError where they are none, or of another form."""
    if len(data) > 4 * LARGEST_PARCEL:
        raise ValueError(f"{len(data)} bytes are too many for a message of a relay")
    try:
        message = msgspec.msgpack.decode(data, type=kind)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise ValueError(f"no {kind.__name__.lower()} of a relay: {error}") from None
    if message.form != FORM:
        form = message.form
        raise ValueError(f"form {form}, this gliderwatch has {FORM}: install the same on all relays")
    return message


def key_of(settings: str) -> str:
    """The checksum by which relays see that a field has the same settings at both."""
    return sha256(settings.encode()).hexdigest()[:16]


def differing(own: Mapping[int, Day], other: Mapping[int, Day]) -> list[int]:
    """The days of which another relay has batches, and not just those that are here; newest first.

    >>> differing({1: (2, 30), 2: (1, 7)}, {1: (2, 30), 2: (1, 8), 3: (1, 9)})
    [3, 2]
    """
    return sorted((day for day, held in other.items() if own.get(day) != held), reverse=True)


def parcels(relay: str, field: str, key: str, batches: Iterable[Sample]) -> Iterator[Parcel]:
    """Batches in parcels of about `LARGEST_PARCEL` bytes at most, for which brokers have room."""
    chosen, size = list[Sample](), 0
    for batch in batches:
        if chosen and size + len(batch.data) > LARGEST_PARCEL:
            yield Parcel(FORM, relay, field, key, tuple(chosen))
            chosen, size = [], 0
        chosen.append(batch)
        size += len(batch.data)
    if chosen:
        yield Parcel(FORM, relay, field, key, tuple(chosen))
