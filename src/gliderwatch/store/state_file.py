"""The state of the daemon or of a replay: ledger, segments, checkpoints, assessments, incidents, outbox."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path

from gliderwatch.incidents.acknowledgement import Ack, Acks
from gliderwatch.incidents.constants import GONE
from gliderwatch.incidents.irregularities import PLACES, Coming, Irregularity, found
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.incidents.overdue import Sign
from gliderwatch.messages.unjudged_text import Unjudged
from gliderwatch.model import (
    Alert,
    Assessment,
    Call,
    Fix,
    Hindrance,
    Incident,
    NextSurfacing,
    SegmentId,
    Unusable,
)
from gliderwatch.navigation.clock import SAME_OPENING, ClockStep
from gliderwatch.pipeline import Outcome
from gliderwatch.store import clocks, codec, outbox, retention
from gliderwatch.store.calls import Calls
from gliderwatch.store.codec import File, Status, Undelivered, file_of, values
from gliderwatch.store.database import MEMORY, SCHEMA, connect, guarded, read_only
from gliderwatch.store.segments import RECENT, Segments

# ----------------------------------------
# What is known of one glider, as the rules ask for it.


class GliderFacts:
    """What `rules` asks of one glider (each `Known` there), on the connection of its store."""

    def __init__(self, connection: sqlite3.Connection, glider: str) -> None:
        self._db, self.glider = connection, glider

    def incidents(self) -> tuple[Incident, ...]:
        """All its incidents, in order of time."""
        sql = "SELECT data FROM incidents WHERE glider = ? ORDER BY opened_at, id"
        return tuple(values(self._db, sql, (self.glider,), Incident))

    def dive(self, t_dive: float) -> Assessment | None:
        """The dive that began at a time (s)."""
        sql = "SELECT data FROM assessments WHERE glider = ? AND t_dive = ?"
        return next(iter(values(self._db, sql, (self.glider, t_dive), Assessment)), None)

    def last_surfacing(self, until: float) -> Assessment | None:
        """The last dive whose end is known and not after `until` (s)."""
        sql = (
            "SELECT data FROM assessments WHERE glider = ? AND ended = 1 AND t_surface <= ? "
            "ORDER BY t_surface DESC LIMIT 1"
        )
        return next(iter(values(self._db, sql, (self.glider, until), Assessment)), None)

    def expected(self, until: float) -> NextSurfacing | None:
        """What was expected after the last surfacing at `until` (s) or before."""
        sql = (
            "SELECT data FROM expected WHERE glider = ? AND after <= ? "
            "ORDER BY after DESC, opened_at DESC LIMIT 1"
        )
        return next(iter(values(self._db, sql, (self.glider, until), NextSurfacing)), None)

    def first_surfacing(self, after: float) -> float | None:
        """The first surfacing later than `after` (s)."""
        sql = "SELECT min(t_surface) FROM assessments WHERE glider = ? AND ended = 1 AND t_surface > ?"
        found: float | None = self._db.execute(sql, (self.glider, after)).fetchone()[0]
        return found

    def has_dived(self, since: float) -> bool:
        """Whether a dive began at `since` (s) or later, also one that has not ended or cannot be used.

        A time without files that has not ended with a fix is none; it has headings at its two ends at most.
        """
        sql = (
            "SELECT EXISTS (SELECT 1 FROM assessments WHERE glider = ? AND t_dive >= ? "
            "AND (ended = 1 OR json_extract(data, '$.n_samples') > 2))"
        )
        return bool(self._db.execute(sql, (self.glider, since)).fetchone()[0])

    def judged(self, until: float) -> float | None:
        """The last surfacing (s) at `until` (s) or before whose dive has a flag."""
        sql = (
            "SELECT t_surface FROM assessments WHERE glider = ? AND ended = 1 AND t_surface <= ? "
            "AND flag IS NOT NULL ORDER BY t_surface DESC LIMIT 1"
        )
        row = self._db.execute(sql, (self.glider, until)).fetchone()
        return None if row is None else float(row[0])

    def unjudged(self, since: float) -> tuple[Unjudged, ...]:
        """Dives without a flag, and files that were not taken, that began later than `since` (s)."""
        sql = (
            "SELECT data FROM assessments WHERE glider = ? AND t_dive > ? AND flag IS NULL "
            "AND (ended = 1 OR json_extract(data, '$.n_samples') > 2)"
        )
        dives = values(self._db, sql, (self.glider, since), Assessment)
        return (*map(_of_dive, dives), *self._not_taken(since), *self._empty(since))

    def _not_taken(self, since: float) -> Iterator[Unjudged]:
        """Segments of which a file came, but none that could be taken."""
        sql = (
            "SELECT h.opened_at, h.at, f.hindrance, f.reason, f.crc FROM heard h "
            "JOIN files f ON f.glider = h.glider AND f.segment = h.segment "
            "WHERE h.glider = ?1 AND h.opened_at > ?2 AND f.status IN ('waiting', 'quarantined') "
            "AND f.hindrance != 'gone' AND NOT EXISTS "
            "(SELECT 1 FROM segments s WHERE s.glider = h.glider AND s.name = h.segment) "
            "GROUP BY h.segment"
        )
        for row in self._db.execute(sql, (self.glider, since)):
            cause = Hindrance(row[2]) if row[2] else None
            yield Unjudged(row[0], row[1], cause, row[3], row[4])

    def _empty(self, since: float) -> Iterator[Unjudged]:
        """Segments of which a file was taken that holds nothing."""
        sql = "SELECT opened_at, at FROM heard WHERE glider = ? AND opened_at > ? AND last_t <= opened_at"
        for row in self._db.execute(sql, (self.glider, since)):
            yield Unjudged(row[0], row[1], Unusable.DATA_MISSING, "its file holds no data")

    def irregularities(self, now: float) -> list[Irregularity]:
        """What is wrong with its files, as known at `now` (s)."""
        steps = clocks.steps(self._db, self.glider)
        return found(self.glider, steps, self.places(PLACES), self.comings(now - GONE, now))

    def places(self, n: int) -> list[Fix]:
        """Where and when it surfaced the last `n` times that are known, in order of time."""
        sql = (
            "SELECT t_surface, json_extract(data, '$.lat'), json_extract(data, '$.lon') FROM assessments "
            "WHERE glider = ? AND ended = 1 ORDER BY t_surface DESC LIMIT ?"
        )
        rows = self._db.execute(sql, (self.glider, n)).fetchall()
        return [Fix(*row) for row in reversed(rows) if row[1] is not None and row[2] is not None]

    def comings(self, since: float, until: float) -> list[Coming]:
        """Its segments of which the first file came between two times (s), in that order."""
        sql = (
            "SELECT segment, coalesce(last_t, opened_at), at, "
            "(SELECT min(at) FROM heard WHERE glider = ?1) "
            "FROM heard WHERE glider = ?1 AND at BETWEEN ?2 AND ?3 ORDER BY at"
        )
        return [Coming(*row) for row in self._db.execute(sql, (self.glider, since, until))]

    def signs(self, since: float) -> tuple[Sign, ...]:
        """Its files that were opened at `since` (s) or later, or that came since, and its calls."""
        sql = "SELECT opened_at, last_t, at FROM heard WHERE glider = ?1 AND (opened_at >= ?2 OR at >= ?2)"
        files = (Sign(*row) for row in self._db.execute(sql, (self.glider, since)))
        return (*files, *self._call_signs(since))

    def _call_signs(self, since: float) -> Iterator[Sign]:
        """Its calls; a state file of an earlier release, which may be looked at, has none."""
        if not self._db.execute("SELECT 1 FROM sqlite_schema WHERE name = 'calls'").fetchone():
            return
        sql = "SELECT began, last_t, at FROM calls WHERE glider = ? AND last_t >= ?"
        for row in self._db.execute(sql, (self.glider, since)):
            yield Sign(row[0], row[1], row[2], is_call=True)

    def calls(self, since: float) -> tuple[Call, ...]:
        """Its calls that went on at `since` (s) or later, in order of time."""
        sql = "SELECT call FROM calls WHERE glider = ? AND last_t >= ? ORDER BY began, path"
        return tuple(values(self._db, sql, (self.glider, since), Call))


def _of_dive(dive: Assessment) -> Unjudged:
    return Unjudged(dive.t_dive, dive.t_surface, dive.unusable, dive.reason)


# ----------------------------------------
# What people told gliderwatch by command: mutes, and acknowledgements of incidents.


class Annotations:
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


# ----------------------------------------
# The state of the daemon or of a replay: ledger, segments, checkpoints, assessments, incidents, messages.

__all__ = ["File", "GliderFacts", "Status", "Store", "Undelivered"]


class Store:
    """One connection to a state file; used by one thread."""

    def __init__(self, connection: sqlite3.Connection, path: Path | str = MEMORY) -> None:
        self._db, self._path = connection, path
        self.segments, self.notes = Segments(connection), Annotations(connection)
        self.calls = Calls(connection)

    @classmethod
    def open(cls, path: Path | str, *, durable: bool = True) -> Store:
        """The store at a path, made if need be; `durable` as in `database.connect`. Raises StateError.

        Where it is not, few checkpoints are written: what can be run again comes in the order of time.
        """
        store = cls(connect(path, durable=durable), path)
        store.segments.following = 0 if durable else RECENT
        return store

    @classmethod
    def reading(cls, path: Path) -> Store:
        """The store at a path, for looking only. Raises StateError where there is none."""
        return cls(read_only(path), path)

    @property
    def folder(self) -> Path | None:
        """The folder of the state file; None of one in memory."""
        return None if self._path == MEMORY else Path(self._path).parent

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
                self.segments.ahead.commit()
            except BaseException:
                self.segments.ahead.rollback()
                if self._db.in_transaction:  # on a full disk SQLite may have ended it by itself
                    self._db.execute("ROLLBACK")
                raise

    @contextmanager
    def followed_by(self, files: int) -> Iterator[None]:
        """Inside, inputs of one glider are taken of which so many more files are at hand.

        Then nobody is told anything, and a power cut may take the last of them back, whole: their files are
        there to be taken again. What is told, or is the last, is on the disk when its transaction ends.
        """
        self.segments.following = files
        if files:
            self._db.execute("PRAGMA synchronous = NORMAL")
        try:
            yield
        finally:
            self.segments.following = 0
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

    def noted_at(self, path: str) -> float | None:
        """When it was last written down what became of a path (s); None where the ledger has it not."""
        row = self._db.execute("SELECT noted_at FROM files WHERE path = ?", (path,)).fetchone()
        return None if row is None else float(row[0])

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
        f, why = file, file.hindrance or ""
        row = (f.path, f.size, f.mtime_ns, f.status, f.glider, f.segment, f.reason, f.crc, now, why)
        self._db.execute("INSERT OR REPLACE INTO files VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)

    # --------------------------------------------------------------- retention

    def is_past(self, identity: SegmentId) -> bool:
        """Whether a segment is older than what is kept of its glider (`state.keep_days`)."""
        opened_at = identity.opened_at + clocks.offset(self._db, identity)
        return retention.is_past(self._db, replace(identity, opened_at=opened_at))

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
                (glider, a.t_dive, a.t_surface, _has_ended(a), a.flag, codec.plain_encode(a))
                for a in outcome.assessments
            ],
        )
        self._db.executemany(
            "INSERT OR REPLACE INTO incidents VALUES (?, ?, ?, ?, ?)",
            [(i.id, glider, i.opened_at, i.cleared_at, codec.plain_encode(i)) for i in outcome.incidents],
        )

    def hear(self, identity: SegmentId, last_t: float | None, now: float) -> None:
        """Note a sign of life: a file of a segment came, with its last sample (s) if it was read; by the
        glider's clock."""
        known = self._db.execute(
            "UPDATE heard SET opened_at = ?3 + clock_offset, at = min(at, ?5), last_t = max("
            "coalesce(last_t, ?4 + clock_offset), coalesce(?4 + clock_offset, last_t)) "
            "WHERE glider = ?1 AND segment = ?2 AND abs(opened_at - clock_offset - ?3) <= ?6",
            (identity.glider, identity.name, identity.opened_at, last_t, now, SAME_OPENING),
        )
        if not known.rowcount:
            self._db.execute(
                "INSERT INTO heard (glider, segment, opened_at, last_t, at) VALUES (?, ?, ?, ?, ?)",
                (identity.glider, identity.name, identity.opened_at, last_t, now),
            )

    def assessments(self, glider: str) -> list[Assessment]:
        """All of a glider, in order of time."""
        return values(
            self._db, "SELECT data FROM assessments WHERE glider = ? ORDER BY t_dive", (glider,), Assessment
        )

    def incidents(self, glider: str) -> list[Incident]:
        """All of a glider, in order of time."""
        return list(self.known(glider).incidents())

    def clock_steps(self, glider: str) -> list[ClockStep]:
        """Where the clock of a glider was set back, or is right again, in order of time."""
        return clocks.steps(self._db, glider)

    def known(self, glider: str) -> GliderFacts:
        """What is known of a glider, for the rules."""
        return GliderFacts(self._db, glider)

    def forecasts(self, glider: str) -> list[NextSurfacing]:
        """What was expected after each segment of a glider, in the order of the segments."""
        sql = "SELECT data FROM expected WHERE glider = ? ORDER BY opened_at, segment"
        return values(self._db, sql, (glider,), NextSurfacing)

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

    def said(self, glider: str) -> NotificationState:
        """What people have been told of a glider."""
        row = self._db.execute("SELECT data FROM said WHERE glider = ?", (glider,)).fetchone()
        return codec.plain_decode(row[0], NotificationState) if row is not None else NotificationState()

    def keep_said(self, glider: str, said: NotificationState) -> None:
        """Keep what people have been told of a glider."""
        self._db.execute("INSERT OR REPLACE INTO said VALUES (?, ?)", (glider, codec.plain_encode(said)))

    def post(self, alert: Alert, channels: Iterable[str], now: float) -> None:
        """Keep one message and put it into the outbox of its channels, as `outbox.post`."""
        outbox.post(self._db, alert, channels, now)

    def standing(self, incident: str, channel: str, now: float) -> tuple[bool, float]:
        """How an incident stands with a channel, as `outbox.standing`."""
        return outbox.standing(self._db, incident, channel, now)

    def withdraw(self, glider: str, unanswered: Collection[str], now: float) -> None:
        """Escalate what is held of a glider no more, but for some threads, as `outbox.withdraw`."""
        outbox.withdraw(self._db, glider, unanswered, now)

    def alerts(self) -> list[Alert]:
        """All messages, in the order in which they were made."""
        return values(self._db, "SELECT data FROM alerts ORDER BY rowid", (), Alert)

    def undelivered(self) -> list[Undelivered]:
        """What waits in the outbox, oldest first."""
        return outbox.undelivered(self._db)

    def refused(self, since: float) -> list[Undelivered]:
        """What a channel refused for good, or could not be read, since a time (s); oldest first."""
        return outbox.refused(self._db, since)


def _has_ended(dive: Assessment) -> bool:
    """Whether the fix that ends a dive is known."""
    return dive.unusable is not Unusable.NOT_SURFACED
