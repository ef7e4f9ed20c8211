"""The outbox table as the dispatcher sees it."""

from __future__ import annotations

from pathlib import Path

from gliderwatch.alerts.outbox import OutboxRow
from gliderwatch.model import Alert
from gliderwatch.store import codec
from gliderwatch.store.database import connect


class Outbox:
    """`alerts.outbox.OutboxStore` on a connection of its own."""

    def __init__(self, path: Path) -> None:
        self._db = connect(path)

    def due(self, now: float) -> list[OutboxRow]:
        """Undelivered rows to try now, oldest first, none before an older one of its thread and channel."""
        rows = self._db.execute(
            "SELECT o.id, a.data, o.channel, o.attempts FROM outbox o JOIN alerts a ON a.id = o.alert "
            "WHERE o.delivered_at IS NULL AND o.next_try <= ? AND NOT EXISTS (SELECT 1 FROM outbox e "
            "WHERE e.delivered_at IS NULL AND e.channel = o.channel AND e.incident = o.incident "
            "AND e.incident != '' AND e.id < o.id) ORDER BY o.id",
            (now,),
        )
        return [OutboxRow(r[0], codec.plain_decode(r[1], Alert), r[2], r[3]) for r in rows]

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

    def close(self) -> None:
        """Give the connection back."""
        self._db.close()
