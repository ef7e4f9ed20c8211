"""What a state file says of how the watch itself is: files, channels, messages to the operator.

Each look has a connection of its own that only reads. All raise StateError where the file cannot be used.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from gliderwatch.delivery.dispatcher import Delivery
from gliderwatch.store.database import guarded, read_only
from gliderwatch.store.outbox import delivery, released

DAY = 86400.0


@dataclass(frozen=True, slots=True)
class Failing:
    """A channel with messages that it did not take: the oldest was to go out ``since`` (s)."""

    since: float
    messages: int
    error: str


@dataclass(frozen=True, slots=True)
class Waiting:
    """Files of a glider that wait: how many, the oldest ``since`` (s) and why that one does."""

    files: int
    since: float
    reason: str


@dataclass(frozen=True, slots=True)
class OutboxState:
    """How it stands with row ``id`` of the outbox, which was ``due`` (s) and delivered (s; None: it waits).

    ``delivery`` is how it stands with it.
    """

    id: int
    channel: str
    attempts: int
    delivered_at: float | None
    due: float
    delivery: Delivery


@contextmanager
def reading(state: Path) -> Iterator[sqlite3.Connection]:
    """A connection to look with."""
    with guarded(state), closing(read_only(state)) as db:
        yield db


def schema_version(state: Path) -> int:
    """The schema of a state file."""
    with reading(state) as db:
        return int(db.execute("PRAGMA user_version").fetchone()[0])


def quick_check(state: Path) -> str:
    """What SQLite's quick_check says of a state file: ``ok`` where its pages are whole."""
    with reading(state) as db:
        return str(db.execute("PRAGMA quick_check(1)").fetchone()[0])


def failing(state: Path, now: float) -> dict[str, Failing]:
    """Channels that failed to take a message that still waits, or that refused one for good in the day before
    `now` (s) and have delivered none since. What is held does not wait before it is due, and a message that
    some of a channel's addresses took counts as notified: the report of the refusal names the others."""
    with reading(state) as db:
        since, how = f"max(a.made_at, {released(db)})", delivery(db)
        sql = (
            "SELECT channel, min(since), count(*), error FROM ("
            f"SELECT o.channel, {since} AS since, o.error FROM outbox o JOIN alerts a ON a.id = o.alert "
            "WHERE o.delivered_at IS NULL AND o.attempts > 0 UNION ALL "
            f"SELECT o.channel, {since} AS since, o.error FROM outbox o JOIN alerts a ON a.id = o.alert "
            f"WHERE o.delivered_at > ? AND {how} = 'refused' "
            "AND NOT EXISTS (SELECT 1 FROM outbox l WHERE l.delivered_at > o.delivered_at "
            f"AND l.channel = o.channel AND {how} = 'delivered')) GROUP BY channel"
        )
        return {row[0]: Failing(*row[1:]) for row in db.execute(sql, (now - DAY,))}


def outbox_since(state: Path, number: int) -> list[OutboxState]:
    """The rows of the outbox after that of a number, in order."""
    with reading(state) as db:
        sql = (
            "SELECT o.id, o.channel, o.attempts, o.delivered_at, "
            f"max(a.made_at, {released(db)}), {delivery(db)} "
            "FROM outbox o JOIN alerts a ON a.id = o.alert WHERE o.id > ? ORDER BY o.id"
        )
        return [
            OutboxState(row[0], row[1], row[2], row[3], row[4], Delivery(row[5]))
            for row in db.execute(sql, (number,))
        ]


def quarantined(state: Path, since: float) -> dict[str, int]:
    """How many files of each glider were quarantined since a time (s)."""
    sql = (
        "SELECT glider, count(*) FROM files WHERE status = 'quarantined' AND noted_at > ? "
        "GROUP BY glider ORDER BY glider"
    )
    with reading(state) as db:
        return {row[0]: row[1] for row in db.execute(sql, (since,))}


def waiting(state: Path) -> dict[str, Waiting]:
    """The files of each glider that wait; what has gone is not waited for."""
    sql = (  # of a query with min() SQLite takes the other columns from the row of the minimum
        "SELECT glider, count(*), min(noted_at), reason FROM files "
        "WHERE status = 'waiting' AND hindrance != 'gone' GROUP BY glider ORDER BY glider"
    )
    with reading(state) as db:
        return {row[0]: Waiting(*row[1:]) for row in db.execute(sql)}


def last_files(state: Path, gliders: Iterable[str]) -> dict[str, float]:
    """When the last file of each glider came (s), whatever its date."""
    sql = "SELECT max(at) FROM heard WHERE glider = ?"
    with reading(state) as db:
        found = {glider: db.execute(sql, (glider,)).fetchone()[0] for glider in gliders}
    return {glider: at for glider, at in found.items() if at is not None}


def operator_messages(state: Path, prefix: str) -> dict[str, float]:
    """The messages about no glider whose id begins so, in the order of their making: id and time (s)."""
    sql = "SELECT id, time FROM alerts WHERE glider = '' AND id >= ? AND id < ? ORDER BY rowid"
    with reading(state) as db:
        return {row[0]: row[1] for row in db.execute(sql, (prefix, prefix[:-1] + chr(ord(prefix[-1]) + 1)))}
