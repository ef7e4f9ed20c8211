"""The state of the daemon or of a replay: ledger, segments, checkpoints, assessments, incidents, messages."""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from gliderwatch.model import Alert, Assessment, Expected, Incident, Segment, SegmentId
from gliderwatch.navigation.quality import NOT_SURFACED
from gliderwatch.navigation.samples import compact
from gliderwatch.pipeline import GliderState, Outcome
from gliderwatch.rules.announce import Said
from gliderwatch.rules.silence import Sign
from gliderwatch.store import codec
from gliderwatch.store.database import connect, read_only
from gliderwatch.store.known import Known
from gliderwatch.store.rows import File, Status, Undelivered, file_of

__all__ = ["File", "Known", "Status", "Store", "Undelivered"]

RECENT = 64
"""Newest segments of a glider that all keep their checkpoint."""
SPARSE = 16
"""Of the older ones one in this many does. Its name decides, so that no order of arrival matters."""
T = TypeVar("T")


class Store:
    """One connection to a state file; used by one thread."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection

    @classmethod
    def open(cls, path: Path | str, *, durable: bool = True) -> Store:
        """The store at a path, made if need be; `durable` as in `database.connect`. Raises StateError."""
        return cls(connect(path, durable=durable))

    @classmethod
    def reading(cls, path: Path) -> Store:
        """The store at a path, for looking only. Raises StateError where there is none."""
        return cls(read_only(path))

    def close(self) -> None:
        """Give the connection back."""
        self._db.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing of what is written inside."""
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    # ------------------------------------------------------------------ ledger

    def file(self, path: str) -> File | None:
        """What the ledger knows of a path."""
        row = self._db.execute("SELECT * FROM files WHERE path = ?", (path,)).fetchone()
        return file_of(row) if row is not None else None

    def files(self, *statuses: Status) -> list[File]:
        """The files of some statuses, by path."""
        marks = ",".join("?" * len(statuses))
        rows = self._db.execute(f"SELECT * FROM files WHERE status IN ({marks}) ORDER BY path", statuses)
        return [file_of(row) for row in rows]

    def counts(self) -> dict[Status, int]:
        """How many files of each status the ledger holds."""
        rows = self._db.execute("SELECT status, count(*) FROM files GROUP BY status")
        return {Status(row[0]): row[1] for row in rows}

    def note(self, file: File, now: float) -> None:
        """Write what became of a file."""
        self._db.execute(
            "INSERT OR REPLACE INTO files VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                file.path,
                file.size,
                file.mtime_ns,
                file.status,
                file.glider,
                file.segment,
                file.reason,
                file.crc,
                now,
            ),
        )

    # ---------------------------------------------------------------- segments

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
                zlib.crc32(segment.id.name.encode()) % SPARSE == 0,
            ),
        )
        before = [] if old is None else [SegmentId(old[0], *key)]
        return min([segment.id, *before])

    def resume(self, first: SegmentId) -> tuple[GliderState, list[SegmentId]]:
        """The newest checkpoint before a segment, and the ids of all segments after it, in order of time."""
        row = self._db.execute(
            "SELECT opened_at, name, checkpoint FROM segments WHERE glider = ? AND checkpoint IS NOT NULL "
            "AND (opened_at, name) < (?, ?) ORDER BY opened_at DESC, name DESC LIMIT 1",
            (first.glider, first.opened_at, first.name),
        ).fetchone()
        after = (row[0], row[1]) if row is not None else (float("-inf"), "")
        rows = self._db.execute(
            "SELECT opened_at, name FROM segments WHERE glider = ? AND (opened_at, name) > (?, ?) "
            "ORDER BY opened_at, name",
            (first.glider, *after),
        )
        state = codec.decode(row[2], GliderState) if row is not None else GliderState()
        return state, [SegmentId(r[0], first.glider, r[1]) for r in rows]

    def segment(self, identity: SegmentId) -> Segment:
        """A segment that is held."""
        row = self._db.execute(
            "SELECT segment FROM segments WHERE glider = ? AND name = ?", (identity.glider, identity.name)
        ).fetchone()
        return codec.decode(row[0], Segment)

    def checkpoint(self, identity: SegmentId, state: GliderState) -> None:
        """Keep the state after a segment, and the surfacing that it leads to expect."""
        key = (identity.glider, identity.name)
        self._db.execute(
            "UPDATE segments SET checkpoint = ? WHERE glider = ? AND name = ?",
            (codec.encode(state), *key),
        )
        self._db.execute("DELETE FROM expected WHERE glider = ? AND segment = ?", key)
        if (e := state.memory.expected) is not None:
            row = (*key, identity.opened_at, e.after, codec.plain_encode(e))
            self._db.execute("INSERT INTO expected VALUES (?, ?, ?, ?, ?)", row)

    def thin(self, glider: str) -> None:
        """Let go of the checkpoints that are not among the `RECENT` newest, but for one in `SPARSE`."""
        self._db.execute(
            "UPDATE segments SET checkpoint = NULL "
            "WHERE glider = ?1 AND checkpoint IS NOT NULL AND NOT milestone AND (opened_at, name) < "
            "(SELECT opened_at, name FROM segments WHERE glider = ?1 "
            "ORDER BY opened_at DESC, name DESC LIMIT 1 OFFSET ?2)",
            (glider, RECENT - 1),
        )

    # ----------------------------------------------------------------- results

    def apply(self, glider: str, outcome: Outcome) -> None:
        """Put the results of one segment in place of those that they replace."""
        self._db.execute("DELETE FROM assessments WHERE glider = ? AND t_dive >= ?", (glider, outcome.since))
        self._db.execute("DELETE FROM incidents WHERE glider = ? AND opened_at > ?", (glider, outcome.since))
        self._db.executemany(
            "INSERT OR REPLACE INTO assessments VALUES (?, ?, ?, ?, ?, ?)",
            [
                (glider, a.t_dive, a.t_surface, a.reason != NOT_SURFACED, a.flag, codec.plain_encode(a))
                for a in outcome.assessments
            ],
        )
        self._db.executemany(
            "INSERT OR REPLACE INTO incidents VALUES (?, ?, ?, ?, ?)",
            [(i.id, glider, i.opened_at, i.cleared_at, codec.plain_encode(i)) for i in outcome.incidents],
        )

    def hear(self, identity: SegmentId, last_t: float | None, now: float) -> None:
        """Note a sign of life: a file of a segment came, with its last sample (s) if it was read."""
        self._db.execute(
            "INSERT INTO heard VALUES (?, ?, ?, ?, ?) ON CONFLICT (glider, segment) DO UPDATE SET "
            "opened_at = excluded.opened_at, at = min(at, excluded.at), "
            "last_t = max(coalesce(last_t, excluded.last_t), coalesce(excluded.last_t, last_t))",
            (identity.glider, identity.name, identity.opened_at, last_t, now),
        )

    def assessments(self, glider: str) -> list[Assessment]:
        """All of a glider, in order of time."""
        return self._all(
            "SELECT data FROM assessments WHERE glider = ? ORDER BY t_dive", (glider,), Assessment
        )

    def incidents(self, glider: str) -> list[Incident]:
        """All of a glider, in order of time."""
        return self._all(
            "SELECT data FROM incidents WHERE glider = ? ORDER BY opened_at, id", (glider,), Incident
        )

    def known(self, glider: str) -> Known:
        """What is known of a glider, for the rules."""
        return Known(self, glider)

    def dive(self, glider: str, t_dive: float) -> Assessment | None:
        """The assessment of the dive that began at a time (s)."""
        sql = "SELECT data FROM assessments WHERE glider = ? AND t_dive = ?"
        return next(iter(self._all(sql, (glider, t_dive), Assessment)), None)

    def last_surfacing(self, glider: str, until: float) -> Assessment | None:
        """The last dive whose end is known and not after `until` (s)."""
        sql = (
            "SELECT data FROM assessments WHERE glider = ? AND ended = 1 AND t_surface <= ? "
            "ORDER BY t_surface DESC LIMIT 1"
        )
        return next(iter(self._all(sql, (glider, until), Assessment)), None)

    def expected(self, glider: str, until: float) -> Expected | None:
        """What was expected after the last surfacing at `until` (s) or before."""
        sql = (
            "SELECT data FROM expected WHERE glider = ? AND after <= ? "
            "ORDER BY after DESC, opened_at DESC LIMIT 1"
        )
        return next(iter(self._all(sql, (glider, until), Expected)), None)

    def first_surfacing(self, glider: str, after: float) -> float | None:
        """The first surfacing later than `after` (s)."""
        sql = "SELECT min(t_surface) FROM assessments WHERE glider = ? AND ended = 1 AND t_surface > ?"
        found: float | None = self._db.execute(sql, (glider, after)).fetchone()[0]
        return found

    def signs(self, glider: str, since: float) -> tuple[Sign, ...]:
        """The files of a glider that were opened at `since` (s) or later."""
        sql = "SELECT opened_at, last_t, at FROM heard WHERE glider = ? AND opened_at >= ?"
        return tuple(Sign(*row) for row in self._db.execute(sql, (glider, since)))

    def gliders(self) -> list[str]:
        """The gliders of which segments are held."""
        return [r[0] for r in self._db.execute("SELECT DISTINCT glider FROM segments ORDER BY glider")]

    def extent(self, glider: str) -> tuple[int, int]:
        """How many segments and how many dives of a glider are known."""
        row = self._db.execute(
            "SELECT (SELECT count(*) FROM segments WHERE glider = ?1), "
            "(SELECT count(*) FROM assessments WHERE glider = ?1)",
            (glider,),
        ).fetchone()
        return row[0], row[1]

    # ---------------------------------------------------------------- messages

    def said(self, glider: str) -> Said:
        """What people have been told of a glider."""
        row = self._db.execute("SELECT data FROM said WHERE glider = ?", (glider,)).fetchone()
        return codec.plain_decode(row[0], Said) if row is not None else Said()

    def say(
        self,
        glider: str,
        said: Said,
        alerts: Iterable[Alert],
        channels: Callable[[Alert], Iterable[str]],
        now: float,
    ) -> None:
        """Keep messages, one outbox row for each of their channels, and that they have been said."""
        self._db.execute("INSERT OR REPLACE INTO said VALUES (?, ?)", (glider, codec.plain_encode(said)))
        for alert in alerts:
            self.post(alert, channels(alert), now)

    def post(self, alert: Alert, channels: Iterable[str], now: float) -> None:
        """Keep one message and put it into the outbox of its channels; a known id is left alone."""
        self._db.execute(
            "INSERT OR IGNORE INTO alerts VALUES (?, ?, ?, ?, ?)",
            (alert.id, alert.glider, alert.time, now, codec.plain_encode(alert)),
        )
        self._db.executemany(
            "INSERT OR IGNORE INTO outbox (alert, channel, incident) VALUES (?, ?, ?)",
            [(alert.id, channel, alert.incident) for channel in channels],
        )

    def alerts(self) -> list[Alert]:
        """All messages, in the order in which they were made."""
        return self._all("SELECT data FROM alerts ORDER BY rowid", (), Alert)

    def undelivered(self) -> list[Undelivered]:
        """What waits in the outbox, oldest first."""
        rows = self._db.execute(
            "SELECT alert, channel, attempts, error FROM outbox WHERE delivered_at IS NULL ORDER BY id"
        )
        return [Undelivered(*row) for row in rows]

    def _all(self, sql: str, values: tuple[object, ...], kind: type[T]) -> list[T]:
        return [codec.plain_decode(row[0], kind) for row in self._db.execute(sql, values)]
