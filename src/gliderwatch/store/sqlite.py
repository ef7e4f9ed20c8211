"""The state of the daemon or of a replay: ledger, segments, checkpoints, assessments, incidents, messages."""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from gliderwatch.model import Alert, Assessment, Expected, Incident, Segment, SegmentId
from gliderwatch.navigation.quality import NOT_SURFACED
from gliderwatch.navigation.samples import compact
from gliderwatch.pipeline import GliderState, Outcome
from gliderwatch.rules.announce import Said, unanswered
from gliderwatch.rules.silence import Sign
from gliderwatch.store import codec, outbox, retention
from gliderwatch.store.ahead import Ahead
from gliderwatch.store.database import MEMORY, SCHEMA, connect, guarded, read_only
from gliderwatch.store.known import Known
from gliderwatch.store.notes import Notes
from gliderwatch.store.rows import File, Status, Undelivered, file_of

__all__ = ["File", "Known", "Status", "Store", "Undelivered"]

RECENT = 64
"""Newest segments of a glider that all keep their checkpoint."""
SPARSE = 16
"""Of the older ones one in this many does. Its name decides, so that no order of arrival matters."""
T = TypeVar("T")


class Store:
    """One connection to a state file; used by one thread."""

    def __init__(self, connection: sqlite3.Connection, path: Path | str = MEMORY) -> None:
        self._db, self._path = connection, path
        self._ahead, self._following = Ahead(), 0
        self.notes = Notes(connection)

    @classmethod
    def open(cls, path: Path | str, *, durable: bool = True) -> Store:
        """The store at a path, made if need be; `durable` as in `database.connect`. Raises StateError.

        Where it is not, few checkpoints are written: what can be run again comes in the order of time.
        """
        store = cls(connect(path, durable=durable), path)
        store._following = 0 if durable else RECENT
        return store

    @classmethod
    def reading(cls, path: Path) -> Store:
        """The store at a path, for looking only. Raises StateError where there is none."""
        return cls(read_only(path), path)

    def close(self) -> None:
        """Give the connection back."""
        self._db.close()

    def guarded(self) -> AbstractContextManager[None]:
        """Inside, what SQLite cannot do is raised as StateError or DamagedError."""
        return guarded(self._path)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing of what is written inside. Raises StateError or DamagedError: nothing is written."""
        with self.guarded():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._db.execute("COMMIT")
                self._ahead.commit()
            except BaseException:
                self._ahead.rollback()
                if self._db.in_transaction:  # on a full disk SQLite may have ended it by itself
                    self._db.execute("ROLLBACK")
                raise

    @contextmanager
    def followed_by(self, files: int) -> Iterator[None]:
        """Inside, inputs of one glider are taken of which so many more files are at hand.

        Then nobody is told anything, and a power cut may take the last of them back, whole: their files are
        there to be taken again. What is told, or is the last, is on the disk when its transaction ends.
        """
        self._following = files
        if files:
            self._db.execute("PRAGMA synchronous = NORMAL")
        try:
            yield
        finally:
            self._following = 0
            if files:
                self._db.execute("PRAGMA synchronous = FULL")

    def probe(self) -> None:
        """Write something that changes nothing. Raises StateError where that cannot be done."""
        with self.transaction():
            self._db.execute(f"PRAGMA user_version = {SCHEMA}")

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
        f = file
        row = (f.path, f.size, f.mtime_ns, f.status, f.glider, f.segment, f.reason, f.crc, now)
        self._db.execute("INSERT OR REPLACE INTO files VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", row)

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
                _is_milestone(segment.id.name),
            ),
        )
        before = [] if old is None else [SegmentId(old[0], *key)]
        return min([segment.id, *before])

    def resume(self, first: SegmentId) -> tuple[GliderState, list[SegmentId]]:
        """The newest state before a segment, and the ids of all segments after it, in order of time."""
        ahead = self._ahead.before(first)
        if ahead is not None:
            return ahead[1], self._after(first.glider, ahead[0].opened_at, ahead[0].name)
        self._ahead.drop(first.glider)
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

    def segment(self, identity: SegmentId) -> Segment:
        """A segment that is held."""
        row = self._db.execute(
            "SELECT segment FROM segments WHERE glider = ? AND name = ?", (identity.glider, identity.name)
        ).fetchone()
        return codec.decode(row[0], Segment)

    def checkpoint(self, identity: SegmentId, state: GliderState) -> None:
        """Keep the state after a segment, and the surfacing that it leads to expect."""
        key = (identity.glider, identity.name)
        if self._following:
            self._ahead.keep(identity, state)
        else:
            self._ahead.drop(identity.glider)
        is_kept = self._following < RECENT or _is_milestone(identity.name)
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

    def is_past(self, identity: SegmentId) -> bool:
        """Whether a segment is older than what is kept of its glider (`state.keep_days`)."""
        return retention.is_past(self._db, identity)

    def remove(self, before: float) -> Iterator[int]:
        """`retention.remove` of all gliders, in steps."""
        return retention.remove(self._db, self.transaction, self.gliders(), before)

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

    def forecasts(self, glider: str) -> list[Expected]:
        """What was expected after each segment of a glider, in the order of the segments."""
        return self._all(
            "SELECT data FROM expected WHERE glider = ? ORDER BY opened_at, segment", (glider,), Expected
        )

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

    def has_dived(self, glider: str, since: float) -> bool:
        """Whether a dive of a glider began at `since` (s) or later, also one that cannot be used.

        A time without files that has not ended with a fix is none; it has headings at its two ends at most.
        """
        sql = (
            "SELECT EXISTS (SELECT 1 FROM assessments WHERE glider = ? AND t_dive >= ? "
            "AND (ended = 1 OR json_extract(data, '$.n_samples') > 2))"
        )
        return bool(self._db.execute(sql, (glider, since)).fetchone()[0])

    def signs(self, glider: str, since: float) -> tuple[Sign, ...]:
        """The files of a glider that were opened at `since` (s) or later."""
        sql = "SELECT opened_at, last_t, at FROM heard WHERE glider = ? AND opened_at >= ?"
        return tuple(Sign(*row) for row in self._db.execute(sql, (glider, since)))

    def gliders(self) -> list[str]:
        """The gliders of which segments are held."""
        sql = (  # from each to the next in the index; DISTINCT would read all of it
            "WITH RECURSIVE g (name) AS (SELECT min(glider) FROM segments UNION ALL "
            "SELECT (SELECT min(glider) FROM segments WHERE glider > g.name) FROM g "
            "WHERE g.name IS NOT NULL) SELECT name FROM g WHERE name IS NOT NULL ORDER BY name"
        )
        return [row[0] for row in self._db.execute(sql)]

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
        """Keep messages, one outbox row for each of their channels, and that they have been said.

        What is held of incidents that are over by then is withdrawn (`answer`).
        """
        self._db.execute("INSERT OR REPLACE INTO said VALUES (?, ?)", (glider, codec.plain_encode(said)))
        going_on = self.answer(glider, now)
        for alert in alerts:
            outbox.post(self._db, alert, channels(alert), now, going_on)

    def answer(self, glider: str, now: float, *, quiet: bool = False) -> frozenset[str]:
        """The threads that go on and that nobody has taken on, none of a glider that is `quiet`.

        What is held of the others until it escalates is withdrawn.
        """
        going_on = frozenset[str]()
        if not quiet:
            incidents, acks = tuple(self.incidents(glider)), self.notes.acks(glider)
            going_on = unanswered(self.said(glider), incidents, acks)
        outbox.withdraw(self._db, glider, going_on, now)
        return going_on

    def post(self, alert: Alert, channels: Iterable[str], now: float) -> None:
        """Keep one message about no glider and put it into the outbox of its channels, as `outbox.post`."""
        outbox.post(self._db, alert, channels, now)

    def alerts(self) -> list[Alert]:
        """All messages, in the order in which they were made."""
        return self._all("SELECT data FROM alerts ORDER BY rowid", (), Alert)

    def undelivered(self) -> list[Undelivered]:
        """What waits in the outbox, oldest first."""
        return outbox.undelivered(self._db)

    def refused(self, since: float) -> list[Undelivered]:
        """What a channel refused for good, or could not be read, since a time (s); oldest first."""
        return outbox.refused(self._db, since)

    def _all(self, sql: str, values: tuple[object, ...], kind: type[T]) -> list[T]:
        return [codec.plain_decode(row[0], kind) for row in self._db.execute(sql, values)]


def _is_milestone(name: str) -> bool:
    """Whether the checkpoint of a segment is kept for good."""
    return zlib.crc32(name.encode()) % SPARSE == 0
