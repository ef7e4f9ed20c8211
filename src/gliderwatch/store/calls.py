"""The calls of each glider in a state file, as their logs tell them."""

from __future__ import annotations

import sqlite3

from gliderwatch.model import Call
from gliderwatch.store import codec


class Calls:
    """The calls in a state file, on the connection of its store."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection

    def dialog(self, path: str) -> str | None:
        """How far the log at a path was read, as it was kept; None where it was not."""
        row = self._db.execute("SELECT dialog FROM calls WHERE path = ?", (path,)).fetchone()
        return None if row is None else str(row[0])

    def keep(self, path: str, call: Call, dialog: str, now: float) -> None:
        """Keep what the log at a path tells by now, and how far it was read."""
        row = (path, call.glider, call.began, call.last_t, now, codec.plain_encode(call), dialog)
        self._db.execute(
            "INSERT INTO calls VALUES (?, ?, ?, ?, ?, ?, ?) ON CONFLICT (path) DO UPDATE SET "
            "glider = excluded.glider, began = excluded.began, last_t = excluded.last_t, "
            "at = iif(last_t = excluded.last_t, at, excluded.at), "
            "call = excluded.call, dialog = excluded.dialog",
            row,
        )
