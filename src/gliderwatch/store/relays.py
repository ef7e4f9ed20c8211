"""What the exchange with other relays reads and keeps in a state file: batches to send, and who has what.

A connection of its own, in the thread of the exchange. Batches that come are put into their field by the
daemon (`store.sea.Fields`).
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from gliderwatch.fleet.exchange import Day, Sample
from gliderwatch.store import codec
from gliderwatch.store.database import connect, crc_of_batch, guarded, has_table
from gliderwatch.store.watch_health import reading

DAY = 86400.0


@dataclass(frozen=True, slots=True)
class Link:
    """The connection of this relay: its ``name`` among the others, the ``broker`` (host and port), whether it
    is up, and the last ``error`` (empty: none)."""

    name: str
    broker: str
    is_up: bool
    error: str = ""


@dataclass(frozen=True, slots=True)
class Neighbour:
    """Another relay, as last heard of: how many ``batches`` it has of each field, and of which ``fields`` the
    settings are others than here, or are not configured here (``apart``)."""

    batches: dict[str, int]
    apart: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RelayState:
    """How the exchange stands: the ``link`` since ``t`` (s; None: it never was up), how many batches wait,
    and the other relays by name, with when each was heard of (s)."""

    link: Link | None
    t: float
    waiting: int
    others: dict[str, tuple[float, Neighbour]]


class RelayRows:
    """The rows of the exchange. Used by one thread; all raise StateError where the file cannot be used."""

    def __init__(self, path: Path) -> None:
        self._path, self._db = path, connect(path)

    def close(self) -> None:
        """Give the connection back."""
        self._db.close()

    def version(self) -> int:
        """A number that is another after each change by another connection."""
        with guarded(self._path):
            return int(self._db.execute("PRAGMA data_version").fetchone()[0])

    def to_send(self, fields: Iterable[str], most: int) -> dict[str, list[Sample]]:
        """Batches of these fields that no broker has yet, ``most`` of them at most; the oldest first."""
        sql = (
            "SELECT id, glider, data FROM field_batches WHERE to_send = 1 AND field = ? "
            "ORDER BY first_t LIMIT ?"
        )
        found: dict[str, list[Sample]] = {}
        with guarded(self._path):
            for field in fields:
                room = most - sum(map(len, found.values()))
                found[field] = [_sample(row) for row in self._db.execute(sql, (field, room))]
        return found

    def sent(self, field: str, batches: Iterable[Sample]) -> None:
        """A broker has these batches, but for those that have become others since."""
        sql = "UPDATE field_batches SET to_send = 0 WHERE field = ? AND id = ? AND crc = ?"
        with guarded(self._path):
            self._db.executemany(
                sql, [(field, each.id, crc_of_batch(each.id, each.data)) for each in batches]
            )

    def days(self, field: str) -> dict[int, Day]:
        """How many batches of a field there are of each day since 1970, and the sum of their checksums."""
        sql = (
            f"SELECT CAST(first_t / {DAY} AS INTEGER), count(*), sum(crc) FROM field_batches "
            "WHERE field = ? GROUP BY 1"
        )
        with guarded(self._path):
            return {row[0]: (row[1], row[2]) for row in self._db.execute(sql, (field,))}

    def held(self, field: str, day: int) -> dict[str, int]:
        """The checksums of the batches of a day, by their id."""
        sql = "SELECT id, crc FROM field_batches WHERE field = ? AND first_t >= ? AND first_t < ?"
        with guarded(self._path):
            return dict(map(tuple, self._db.execute(sql, (field, day * DAY, (day + 1) * DAY))))

    def others(self, field: str, day: int, held: Mapping[str, int]) -> list[Sample]:
        """The batches of a day that are not among those of another relay."""
        sql = (
            "SELECT id, glider, data, crc FROM field_batches "
            "WHERE field = ? AND first_t >= ? AND first_t < ? ORDER BY first_t, id"
        )
        with guarded(self._path):
            rows = self._db.execute(sql, (field, day * DAY, (day + 1) * DAY)).fetchall()
        return [_sample(row) for row in rows if held.get(row["id"]) != row["crc"]]

    def keep(self, name: str, t: float, row: Link | Neighbour) -> None:
        """Keep how it stands with the link (``name`` empty), or with another relay."""
        with guarded(self._path):
            values = (name, t, codec.plain_encode(row))
            self._db.execute("INSERT OR REPLACE INTO relays VALUES (?, ?, ?)", values)


def exchange(state: Path) -> RelayState:
    """How the exchange stands, by a state file. Raises StateError."""
    with reading(state) as db:
        return relay_state(db)


def relay_state(db: sqlite3.Connection) -> RelayState:
    """How the exchange stands, by the rows of a state file."""
    if not has_table(db, "relays"):
        return RelayState(None, 0.0, 0, {})
    rows = {row[0]: (row[1], row[2]) for row in db.execute("SELECT name, t, data FROM relays ORDER BY name")}
    t, link = rows.pop("", (0.0, ""))
    waiting = db.execute("SELECT count(*) FROM field_batches WHERE to_send = 1").fetchone()[0]
    others = {name: (at, codec.plain_decode(data, Neighbour)) for name, (at, data) in rows.items()}
    return RelayState(codec.plain_decode(link, Link) if link else None, t, waiting, others)


def _sample(row: sqlite3.Row) -> Sample:
    return Sample(row["id"], row["glider"], row["data"])
