"""The segments of each glider in a state file, and the checkpoints after them."""

from __future__ import annotations

import sqlite3
import zlib
from dataclasses import replace

from gliderwatch.model import Segment, SegmentId
from gliderwatch.navigation.samples import compact
from gliderwatch.pipeline import GliderState
from gliderwatch.store import codec, retention
from gliderwatch.store.ahead import Ahead

RECENT = 64
"""Newest segments of a glider that all keep their checkpoint."""
SPARSE = 16
"""Of the older ones one in this many does. Its name decides, so that no order of arrival matters."""


class Segments:
    """The segments in a state file, on the connection of its store.

    ``following`` counts the files of the glider that are at hand behind the one that is taken in; ``ahead``
    has the states that are not written for it.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection
        self.ahead, self.following = Ahead(), 0

    def completeness(self, glider: str, name: str) -> tuple[int, int, str] | None:
        """Of the copy of a segment that is held, None when there is none."""
        row = self._db.execute(
            "SELECT completeness FROM segments WHERE glider = ? AND name = ?", (glider, name)
        ).fetchone()
        return codec.plain_decode(row[0], tuple[int, int, str]) if row is not None else None

    def put(self, segment: Segment) -> SegmentId:
        """Keep a segment in place of an earlier copy; the first id in time that this touches.

        What navigation would average anyway is kept as that: 4 s data would fill the state file.
        """
        thinned = replace(segment, quantities=compact(segment.quantities))
        key = (segment.id.glider, segment.id.name)
        old = self._db.execute("SELECT opened_at FROM segments WHERE glider = ? AND name = ?", key).fetchone()
        self._db.execute(
            "INSERT OR REPLACE INTO segments VALUES (?, ?, ?, ?, ?, NULL, ?)",
            (
                segment.id.glider,
                segment.id.opened_at,
                segment.id.name,
                codec.plain_encode(segment.completeness),
                codec.encode(thinned),
                _is_milestone(segment.id.name),
            ),
        )
        before = [] if old is None else [SegmentId(old[0], *key)]
        return min([segment.id, *before])

    def resume(self, first: SegmentId) -> tuple[GliderState, list[SegmentId]]:
        """The newest state before a segment, and the ids of all segments after it, in order of time."""
        ahead = self.ahead.before(first)
        if ahead is not None:
            return ahead[1], self._after(first.glider, ahead[0].opened_at, ahead[0].name)
        self.ahead.drop(first.glider)
        row = self._db.execute(
            "SELECT opened_at, name, checkpoint FROM segments WHERE glider = ? AND checkpoint IS NOT NULL "
            "AND (opened_at, name) < (?, ?) ORDER BY opened_at DESC, name DESC LIMIT 1",
            (first.glider, first.opened_at, first.name),
        ).fetchone()
        if row is None:
            return GliderState(), self._after(first.glider, float("-inf"), "")
        return codec.decode(row[2], GliderState), self._after(first.glider, row[0], row[1])

    def _after(self, glider: str, opened_at: float, name: str) -> list[SegmentId]:
        rows = self._db.execute(
            "SELECT opened_at, name FROM segments WHERE glider = ? AND (opened_at, name) > (?, ?) "
            "ORDER BY opened_at, name",
            (glider, opened_at, name),
        )
        return [SegmentId(row[0], glider, row[1]) for row in rows]

    def get(self, identity: SegmentId) -> Segment:
        """A segment that is held."""
        row = self._db.execute(
            "SELECT segment FROM segments WHERE glider = ? AND name = ?", (identity.glider, identity.name)
        ).fetchone()
        return codec.decode(row[0], Segment)

    def checkpoint(self, identity: SegmentId, state: GliderState) -> None:
        """Keep the state after a segment, and the surfacing that it leads to expect."""
        key = (identity.glider, identity.name)
        if self.following:
            self.ahead.keep(identity, state)
        else:
            self.ahead.drop(identity.glider)
        is_kept = self.following < RECENT or _is_milestone(identity.name)
        self._db.execute(
            "UPDATE segments SET checkpoint = ?1 WHERE glider = ?2 AND name = ?3 "
            "AND (?1 IS NOT NULL OR checkpoint IS NOT NULL)",
            (codec.encode(state) if is_kept else None, *key),
        )
        self._db.execute("DELETE FROM expected WHERE glider = ? AND segment = ?", key)
        if (e := state.memory.expected) is not None:
            row = (*key, identity.opened_at, e.after, codec.plain_encode(e))
            self._db.execute("INSERT INTO expected VALUES (?, ?, ?, ?, ?)", row)

    def thin(self, glider: str) -> None:
        """Let go of the checkpoints that are not among the `RECENT` newest, but for one in `SPARSE`."""
        rows = self._db.execute(  # of the index alone: `milestone` lies behind the long records of its row
            "SELECT name FROM segments WHERE glider = ?1 AND checkpoint IS NOT NULL AND (opened_at, name) < "
            "(SELECT opened_at, name FROM segments WHERE glider = ?1 "
            "ORDER BY opened_at DESC, name DESC LIMIT 1 OFFSET ?2)",
            (glider, RECENT - 1),
        ).fetchall()
        self._db.executemany(
            f"UPDATE segments SET checkpoint = NULL WHERE glider = ? AND name = ? "
            f"AND milestone != {retention.FIRST}",
            [(glider, row[0]) for row in rows if not _is_milestone(row[0])],
        )


def _is_milestone(name: str) -> bool:
    """Whether the checkpoint of a segment is kept for good."""
    return zlib.crc32(name.encode()) % SPARSE == 0
