"""Layers of the sea in a state file: what is known after each segment, and the advice that followed."""

from __future__ import annotations

import sqlite3

from gliderwatch.layers.advice import Layered
from gliderwatch.model import SegmentId
from gliderwatch.store import codec
from gliderwatch.store.codec import values


class LayerRows:
    """The layers of all gliders, on the connection of their store."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection

    def before(self, identity: SegmentId) -> Layered | None:
        """What was known of a glider's layers before a segment; None: nothing."""
        sql = (
            "SELECT data FROM layers WHERE glider = ? AND (opened_at, segment) < (?, ?) "
            "ORDER BY opened_at DESC, segment DESC LIMIT 1"
        )
        key = (identity.glider, identity.opened_at, identity.name)
        return next(iter(values(self._db, sql, key, Layered)), None)

    def keep(self, identity: SegmentId, found: Layered | None) -> None:
        """Keep what is known after a segment, in place of what was kept of it; None: it told nothing."""
        key = (identity.glider, identity.opened_at, identity.name)
        self._db.execute("DELETE FROM layers WHERE glider = ? AND opened_at = ? AND segment = ?", key)
        if found is not None:
            row = (*key, found.advice.t, codec.plain_encode(found))
            self._db.execute("INSERT INTO layers VALUES (?, ?, ?, ?, ?)", row)

    def history(self, glider: str, n: int) -> list[Layered]:
        """The last `n` of a glider, the newest first."""
        sql = "SELECT data FROM layers WHERE glider = ? ORDER BY opened_at DESC, segment DESC LIMIT ?"
        return list(values(self._db, sql, (glider, n), Layered))
