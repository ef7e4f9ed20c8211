"""The outbox table as the dispatcher sees it.

A row is done with once ``delivered_at`` is set. ``delivery`` says how (`alerts.worker.Delivery`): delivered,
given up (the channel refused it for good, or it cannot be read any more) or withdrawn, because somebody had
acknowledged its incident before it was due. ``error`` says why in words, for people.

A row is held until ``held_until``, or until ``escalates`` while nobody has acknowledged its incident,
whichever is first (`incidents.send_schedule`); infinite is never. Within an incident and channel no row is
held longer than a later one: what is urgent brings along what came before it.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from gliderwatch.delivery.dispatcher import LONGEST_DELAY, Delivery, OutboxRow
from gliderwatch.errors import DamagedError, LayoutError
from gliderwatch.incidents.send_schedule import Due
from gliderwatch.model import Alert
from gliderwatch.store import codec
from gliderwatch.store.codec import Undelivered
from gliderwatch.store.database import DELIVERY_BY_WORDS, connect

PARKED = math.inf
"""`next_try` of rows whose channel is not in the configuration."""
FAR = 1e300
"""Any time (s) but that."""


SET_BACK = 60.0
"""Seconds: a clock that is that far before the time when a message was made was set back since. By such a
clock nothing is held."""
HELD = f"(o.held_until > :now AND o.escalates > :now AND :now >= a.made_at - {SET_BACK})"
"""SQL: whether a row of the outbox ``o`` and its message ``a`` is held at a time `now`."""


def post(db: sqlite3.Connection, alert: Alert, channels: Iterable[str], now: float) -> None:
    """Keep one message and put it into the outbox of its channels; a known id is left alone.

    A mapping of `channels` tells when it is due by each (`rules.waiting.Due`); by names alone it is at once.
    """
    db.execute(
        "INSERT OR IGNORE INTO alerts VALUES (?, ?, ?, ?, ?)",
        (alert.id, alert.glider, alert.time, now, codec.plain_encode(alert)),
    )
    dues = channels if isinstance(channels, Mapping) else dict.fromkeys(channels, Due(0.0, math.inf))
    for channel, due in dues.items():
        db.execute(
            "INSERT OR IGNORE INTO outbox (alert, channel, incident, held_until, escalates) "
            "VALUES (?, ?, ?, ?, ?)",
            (alert.id, channel, alert.incident, due.at, due.escalates),
        )
        db.execute(
            "UPDATE outbox SET held_until = min(held_until, ?), escalates = min(escalates, ?) "
            "WHERE delivered_at IS NULL AND channel = ? AND incident = ? AND incident != '' "
            "AND min(held_until, escalates) > ?",
            (due.at, due.escalates, channel, alert.incident, now),
        )


def standing(db: sqlite3.Connection, incident: str, channel: str, now: float) -> tuple[bool, float]:
    """Whether a message of an incident went out by a channel, or is about to, and when what waits there
    escalates (s; infinite: nothing waits)."""
    delivered, escalates = db.execute(
        f"SELECT coalesce(max(iif(o.delivered_at IS NULL, NOT {HELD}, o.delivery = 'delivered')), 0), "
        "coalesce(min(iif(o.delivered_at IS NULL, o.escalates, NULL)), 9e999) "
        "FROM outbox o JOIN alerts a ON a.id = o.alert WHERE o.channel = :channel AND o.incident = :incident",
        {"now": now, "channel": channel, "incident": incident},
    ).fetchone()
    return bool(delivered), float(escalates)


def withdraw(db: sqlite3.Connection, glider: str, unanswered: Collection[str], now: float) -> None:
    """Escalate what is held of a glider no more, but for the threads that are `unanswered`.

    What is held for that alone is done with; what is held for quiet hours too goes on being held for them.
    """
    rows = db.execute(
        "SELECT o.id, o.incident FROM outbox o JOIN alerts a ON a.id = o.alert "
        f"WHERE o.delivered_at IS NULL AND o.escalates < 9e999 AND a.glider = :glider AND {HELD}",
        {"glider": glider, "now": now},
    ).fetchall()
    ids = [row[0] for row in rows if row[1] not in unanswered]
    db.executemany(
        "UPDATE outbox SET delivered_at = ?, delivery = ?, error = ? WHERE id = ? AND held_until = 9e999",
        [(now, Delivery.WITHDRAWN, "withdrawn: acknowledged, muted or over", n) for n in ids],
    )
    db.executemany("UPDATE outbox SET escalates = 9e999 WHERE id = ?", [(n,) for n in ids])


def released(db: sqlite3.Connection) -> str:
    """SQL: until when a row of the outbox ``o`` is or was held (s), also in a file that the service has not
    migrated yet."""
    has_column = "SELECT 1 FROM pragma_table_info('outbox') WHERE name = 'escalates'"
    return "min(o.held_until, o.escalates)" if db.execute(has_column).fetchone() is not None else "0.0"


def delivery(db: sqlite3.Connection) -> str:
    """SQL: how it stands with a row of the innermost outbox, also in a file that is not migrated yet."""
    has_column = "SELECT 1 FROM pragma_table_info('outbox') WHERE name = 'delivery'"
    return "delivery" if db.execute(has_column).fetchone() is not None else DELIVERY_BY_WORDS


def undelivered(db: sqlite3.Connection) -> list[Undelivered]:
    """What waits in the outbox, oldest first."""
    until = released(db)
    escalates = "0" if until == "0.0" else "o.escalates < o.held_until"
    rows = db.execute(
        f"SELECT o.alert, o.channel, o.attempts, o.error, {until}, {escalates} FROM outbox o "
        "WHERE o.delivered_at IS NULL ORDER BY o.id"
    )
    return [Undelivered(row[0], row[1], row[2], row[3], row[4], bool(row[5])) for row in rows]


def refused(db: sqlite3.Connection, since: float) -> list[Undelivered]:
    """What a channel refused for good, or could not be read, since a time (s); oldest first."""
    rows = db.execute(
        "SELECT o.alert, o.channel, o.attempts, o.error FROM outbox o WHERE o.delivered_at >= ? "
        f"AND {delivery(db)} NOT IN ('delivered', 'withdrawn') ORDER BY o.id",
        (since,),
    )
    return [Undelivered(*row) for row in rows]


class Outbox:
    """`alerts.outbox.OutboxStore` on a connection of its own."""

    def __init__(self, path: Path) -> None:
        self._db = connect(path)

    def due(self, now: float) -> list[OutboxRow]:
        """Undelivered rows to try now, oldest first, none before an older one of its thread and channel.

        A row that cannot be read is given up, so that it keeps no other back. One whose time is farther off
        than any delay was put off by a clock that has been set back since: it is due. Of one that goes out
        because nobody has acknowledged its incident, ``unacknowledged`` is how long that was waited for (s).
        """
        rows = self._db.execute(
            "SELECT o.id, a.data, o.channel, o.attempts, o.held_until > :now AND o.escalates < 9e999, "
            "o.escalates - a.made_at FROM outbox o JOIN alerts a ON a.id = o.alert "
            "WHERE o.delivered_at IS NULL "
            f"AND (o.next_try <= :now OR o.next_try BETWEEN :now + :late AND :far) AND NOT {HELD} "
            "AND NOT EXISTS (SELECT 1 FROM outbox e WHERE e.delivered_at IS NULL AND e.channel = o.channel "
            "AND e.incident = o.incident AND e.incident != '' AND e.id < o.id) ORDER BY o.id",
            {"now": now, "late": 2 * LONGEST_DELAY, "far": FAR},
        ).fetchall()
        found = []
        for row in rows:
            try:
                alert = codec.plain_decode(row[1], Alert)
            except (DamagedError, LayoutError) as error:
                self._give_up(row[0], Delivery.UNREADABLE, f"given up: {error}", now)
                continue
            found.append(OutboxRow(row[0], alert, row[2], row[3], row[5] if row[4] else None))
        return found

    def delivered(self, row_id: int, now: float) -> None:
        """Mark a row as delivered, also one that was withdrawn while it was on its way."""
        self._db.execute(
            "UPDATE outbox SET delivered_at = ?, delivery = ?, error = '' "
            "WHERE id = ? AND (delivered_at IS NULL OR delivery = ?)",
            (now, Delivery.DELIVERED, row_id, Delivery.WITHDRAWN),
        )

    def failed(self, row_id: int, error: str, next_try: float) -> None:
        """Count a failed attempt, with its reason, and when to try next."""
        self._db.execute(
            "UPDATE outbox SET attempts = attempts + 1, error = ?, next_try = ? "
            "WHERE id = ? AND delivered_at IS NULL",
            (error, next_try, row_id),
        )

    def refused(
        self,
        row_id: int,
        delivery: Delivery,
        error: str,
        now: float,
        report: Alert | None,
        channels: Iterable[str],
    ) -> None:
        """Give a row up, and put a report of it into the outbox of other channels, both or none."""
        self._db.execute("BEGIN IMMEDIATE")
        try:
            self._give_up(row_id, delivery, f"refused: {error}", now)
            if report is not None:
                post(self._db, report, channels, now)
            self._db.execute("COMMIT")
        except BaseException:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            raise

    def park(self, row_id: int, error: str) -> None:
        """Try a row no more, until `adopt` knows its channel."""
        self._db.execute(
            "UPDATE outbox SET error = ?, next_try = ? WHERE id = ? AND delivered_at IS NULL",
            (error, PARKED, row_id),
        )

    def adopt(self, channels: Iterable[str]) -> None:
        """Make parked rows due whose channel there is now."""
        self._db.executemany(
            "UPDATE outbox SET next_try = 0 WHERE delivered_at IS NULL AND next_try = ? AND channel = ?",
            [(PARKED, channel) for channel in channels],
        )

    def close(self) -> None:
        """Give the connection back."""
        self._db.close()

    def _give_up(self, row_id: int, delivery: Delivery, reason: str, now: float) -> None:
        self._db.execute(
            "UPDATE outbox SET attempts = attempts + 1, delivered_at = ?, delivery = ?, error = ? "
            "WHERE id = ? AND delivered_at IS NULL",
            (now, delivery, reason, row_id),
        )
