"""What people told gliderwatch by command: mutes, and acknowledgements of incidents."""

from __future__ import annotations

import sqlite3

from gliderwatch.rules.acknowledged import Ack, Acks
from gliderwatch.store import codec


class Notes:
    """The notes of people in a state file, on the connection of its store."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection

    def muted_until(self, glider: str) -> float | None:
        """Until when (s) a glider is muted by command; None: it is not."""
        row = self._one("SELECT until FROM mutes WHERE glider = ?", glider)
        return None if row is None else float(row[0])

    def mute(self, glider: str, until: float, now: float) -> None:
        """Tell nothing of a glider until a time (s), in place of what was noted before."""
        self._db.execute("INSERT OR REPLACE INTO mutes VALUES (?, ?, ?)", (glider, until, now))

    def unmute(self, glider: str, now: float) -> None:
        """End a mute at a time (s)."""
        self._db.execute("UPDATE mutes SET until = min(until, ?) WHERE glider = ?", (now, glider))

    def unmuted(self, after: float, until: float) -> list[str]:
        """The gliders whose mute by command ended `after` a time and `until` another (s)."""
        return [
            row[0]
            for row in self._db.execute(
                "SELECT glider FROM mutes WHERE until > ? AND until <= ?", (after, until)
            )
        ]

    def acknowledge(self, glider: str, ack: Ack) -> None:
        """Keep an acknowledgement, in place of an earlier one of its incident."""
        row = (ack.incident, glider, ack.at, codec.plain_encode(ack))
        self._db.execute("INSERT OR REPLACE INTO acks VALUES (?, ?, ?, ?)", row)

    def acks(self, glider: str) -> Acks:
        """The acknowledgements of a glider's incidents."""
        if not self._is_there("acks"):
            return {}
        rows = self._db.execute("SELECT data FROM acks WHERE glider = ?", (glider,))
        return {ack.incident: ack for ack in (codec.plain_decode(row[0], Ack) for row in rows)}

    def _one(self, sql: str, glider: str) -> sqlite3.Row | None:
        if not self._is_there("mutes"):
            return None
        row: sqlite3.Row | None = self._db.execute(sql, (glider,)).fetchone()
        return row

    def _is_there(self, table: str) -> bool:
        """Whether there is such a table: `status` also reads a file that the service has not migrated yet."""
        sql = "SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = ?"
        return self._db.execute(sql, (table,)).fetchone() is not None
