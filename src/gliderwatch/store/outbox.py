"""The outbox table as the dispatcher sees it.

A row is done with once ``delivered_at`` is set. Where ``error`` is not empty then, it was not delivered but
given up: the channel refused it for good, or it cannot be read any more.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterable
from pathlib import Path

from gliderwatch.alerts.outbox import LONGEST_DELAY, OutboxRow
from gliderwatch.errors import DamagedError
from gliderwatch.model import Alert
from gliderwatch.store import codec
from gliderwatch.store.database import connect

PARKED = math.inf
"""`next_try` of rows whose channel is not in the configuration."""
FAR = 1e300
"""Any time (s) but that."""


def post(db: sqlite3.Connection, alert: Alert, channels: Iterable[str], now: float) -> None:
    """Keep one message and put it into the outbox of its channels; a known id is left alone."""
    db.execute(
        "INSERT OR IGNORE INTO alerts VALUES (?, ?, ?, ?, ?)",
        (alert.id, alert.glider, alert.time, now, codec.plain_encode(alert)),
    )
    db.executemany(
        "INSERT OR IGNORE INTO outbox (alert, channel, incident) VALUES (?, ?, ?)",
        [(alert.id, channel, alert.incident) for channel in channels],
    )


class Outbox:
    """`alerts.outbox.OutboxStore` on a connection of its own."""

    def __init__(self, path: Path) -> None:
        self._db = connect(path)

    def due(self, now: float) -> list[OutboxRow]:
        """Undelivered rows to try now, oldest first, none before an older one of its thread and channel.

        A row that cannot be read is given up, so that it keeps no other back. One whose time is farther off
        than any delay was put off by a clock that has been set back since: it is due.
        """
        rows = self._db.execute(
            "SELECT o.id, a.data, o.channel, o.attempts FROM outbox o JOIN alerts a ON a.id = o.alert "
            "WHERE o.delivered_at IS NULL AND (o.next_try <= ?1 OR o.next_try BETWEEN ?1 + ?2 AND ?3) "
            "AND NOT EXISTS (SELECT 1 FROM outbox e WHERE e.delivered_at IS NULL AND e.channel = o.channel "
            "AND e.incident = o.incident AND e.incident != '' AND e.id < o.id) ORDER BY o.id",
            (now, 2 * LONGEST_DELAY, FAR),
        ).fetchall()
        found = []
        for row in rows:
            try:
                found.append(OutboxRow(row[0], codec.plain_decode(row[1], Alert), row[2], row[3]))
            except DamagedError as error:
                self._give_up(row[0], f"given up: {error}", now)
        return found

    def delivered(self, row_id: int, now: float) -> None:
        """Mark a row as delivered."""
        self._db.execute(
            "UPDATE outbox SET delivered_at = ?, error = '' WHERE id = ? AND delivered_at IS NULL",
            (now, row_id),
        )

    def failed(self, row_id: int, error: str, next_try: float) -> None:
        """Count a failed attempt, with its reason, and when to try next."""
        self._db.execute(
            "UPDATE outbox SET attempts = attempts + 1, error = ?, next_try = ? "
            "WHERE id = ? AND delivered_at IS NULL",
            (error, next_try, row_id),
        )

    def refused(
        self, row_id: int, error: str, now: float, report: Alert | None, channels: Iterable[str]
    ) -> None:
        """Give a row up, and put a report of it into the outbox of other channels, both or none."""
        self._db.execute("BEGIN IMMEDIATE")
        try:
            self._give_up(row_id, f"refused: {error}", now)
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

    def _give_up(self, row_id: int, reason: str, now: float) -> None:
        self._db.execute(
            "UPDATE outbox SET attempts = attempts + 1, delivered_at = ?, error = ? "
            "WHERE id = ? AND delivered_at IS NULL",
            (now, reason, row_id),
        )
