"""The state of the daemon or of a replay: ledger, segments, checkpoints, assessments, incidents, outbox."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.model import (
    Alert,
    Assessment,
    Incident,
    NextSurfacing,
    SegmentId,
    Unusable,
)
from gliderwatch.navigation.clock import ClockStep
from gliderwatch.navigation.constants import SAME_OPENING
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.pipeline import GliderState, Outcome
from gliderwatch.store import codec, outbox, retention, segments
from gliderwatch.store.codec import File, Status, Undelivered, file_of, values
from gliderwatch.store.database import MEMORY, SCHEMA, connect, guarded, has_table, read_only
from gliderwatch.store.health import HealthRows
from gliderwatch.store.relays import RelayState, relay_state
from gliderwatch.store.results import Annotations, Calls, GliderFacts
from gliderwatch.store.sea import Fields, LayerRows
from gliderwatch.store.segments import LATELY, Segments

__all__ = ["File", "GliderFacts", "Status", "Store", "Undelivered"]


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a dive ended (degrees), of all that its row holds."""

    lat: float | None = None
    lon: float | None = None


class Store:
    """One connection to a state file; used by one thread."""

    def __init__(self, connection: sqlite3.Connection, path: Path | str = MEMORY) -> None:
        self._db, self._path = connection, path
        self.segments, self.notes = Segments(connection), Annotations(connection)
        self.calls, self.fields = Calls(connection), Fields(connection)
        self.health = HealthRows(connection)
        self.layers = LayerRows(connection)

    @classmethod
    def open(cls, path: Path | str, *, durable: bool = True) -> Store:
        """The store at a path, made if need be; `durable` as in `database.connect`. Raises StateError.

        Where it is not, few checkpoints are written: what can be run again comes in the order of time.
        """
        store = cls(connect(path, durable=durable), path)
        store.segments.following = 0 if durable else LATELY
        return store

    @classmethod
    def reading(cls, path: Path) -> Store:
        """The store at a path, for looking only. Raises StateError where there is none."""
        return cls(read_only(path), path)

    @classmethod
    @contextmanager
    def looking(cls, path: Path) -> Iterator[Store]:
        """Inside, the store at a path for looking only, `guarded`. Raises StateError where there is none."""
        store = cls.reading(path)
        try:
            with store.guarded():
                yield store
        finally:
            store.close()

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
                self.segments.commit()
            except BaseException:
                self.segments.rollback()
                self.fields.rollback()
                self.health.rollback()
                if self._db.in_transaction:  # on a full disk SQLite may have ended it by itself
                    self._db.execute("ROLLBACK")
                raise

    @contextmanager
    def followed_by(self, files: int) -> Iterator[None]:
        """Inside, inputs of one glider are processed of which so many more files are at hand.

        Then no message is made, and a power cut may undo the last of them, each as a whole: their files are
        there to be processed again. The last one, and all messages, are on the disk when a transaction ends.
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

    def record(self, file: File, now: float) -> None:
        """Write what became of a file."""
        f, why = file, file.hindrance or ""
        row = (f.path, f.size, f.mtime_ns, f.status, f.glider, f.segment, f.reason, f.crc, now, why)
        self._db.execute("INSERT OR REPLACE INTO files VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)

    def receive(self, file: File, identity: SegmentId, last_t: float | None, now: float) -> None:
        """Write what became of a file of a segment, and that it is a sign of life (`record_sign`)."""
        self.record(file, now)
        self.record_sign(identity, last_t, now)

    # --------------------------------------------------------------- retention

    def is_past(self, identity: SegmentId) -> bool:
        """Whether a segment is older than what is kept of its glider (`state.keep_days`)."""
        opened_at = identity.opened_at + self.segments.clocks.offset(identity)
        return retention.is_past(self._db, replace(identity, opened_at=opened_at))

    def remove(self, before: float) -> Iterator[int]:
        """`retention.remove` of all gliders, in steps."""
        for removed in retention.remove(self._db, self.transaction, self.gliders(), before):
            self.segments.clocks.clear()
            yield removed

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

    def keep(self, identity: SegmentId, outcome: Outcome, state: GliderState | bytes | None) -> None:
        """Keep the outcome of a segment: its results (`apply`), and the state after it as in
        `Segments.checkpoint`."""
        self.apply(identity.glider, outcome)
        self.segments.checkpoint(identity, state, outcome.expected)

    def record_sign(self, identity: SegmentId, last_t: float | None, now: float) -> None:
        """Note a sign of life: a file of a segment came, with its last sample (s) if it was read; by the
        glider's clock."""
        updated = self._db.execute(
            "UPDATE heard SET opened_at = ?3 + clock_offset, at = min(at, ?5), last_t = max("
            "coalesce(last_t, ?4 + clock_offset), coalesce(?4 + clock_offset, last_t)) "
            "WHERE glider = ?1 AND segment = ?2 AND abs(opened_at - clock_offset - ?3) <= ?6",
            (identity.glider, identity.name, identity.opened_at, last_t, now, SAME_OPENING),
        )
        if not updated.rowcount:
            self._db.execute(
                "INSERT INTO heard (glider, segment, opened_at, last_t, at) VALUES (?, ?, ?, ?, ?)",
                (identity.glider, identity.name, identity.opened_at, last_t, now),
            )

    def assessments(self, glider: str) -> list[Assessment]:
        """All of a glider, in order of time."""
        return values(
            self._db, "SELECT data FROM assessments WHERE glider = ? ORDER BY t_dive", (glider,), Assessment
        )

    def surfaced_between(self, glider: str, start: float, end: float) -> list[Assessment]:
        """Those of a glider that ended between two times (s) with a fix, in order of time."""
        sql = (
            "SELECT data FROM assessments WHERE glider = ? AND ended = 1 AND t_surface BETWEEN ? AND ? "
            "ORDER BY t_surface"
        )
        return values(self._db, sql, (glider, start, end), Assessment)

    def surfaced_near(self, dive: Assessment, start: float, distance: float) -> list[str]:
        """Gliders that came up within ``distance`` (m) of the end of a dive, from a time (s) on until then.

        That of the dive is one. Of rows only the places are decoded.
        """
        sql = "SELECT data FROM assessments WHERE glider = ? AND ended = 1 AND t_surface BETWEEN ? AND ?"
        if dive.lat is None or dive.lon is None:
            return []
        out = list[str]()
        for glider in self.gliders():
            rows = self._db.execute(sql, (glider, start, dive.t_surface))
            places = [codec.plain_decode(row[0], _Place) for row in rows]
            fixes = [(each.lat, each.lon) for each in places if each.lat is not None and each.lon is not None]
            lat, lon = np.array(fixes, dtype=np.float64).reshape(-1, 2).T
            if (np.hypot(*to_plane(lat, lon, dive.lat, dive.lon).T) <= distance).any():
                out.append(glider)
        return out

    def incidents(self, glider: str) -> list[Incident]:
        """All of a glider, in order of time."""
        return list(self.facts(glider).incidents())

    def clock_steps(self, glider: str) -> list[ClockStep]:
        """Where the clock of a glider was set back, or is right again, in order of time."""
        return segments.steps(self._db, glider)

    def facts(self, glider: str) -> GliderFacts:
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

    def callers(self) -> list[str]:
        """The gliders of which there is the log of a call, also of those without a segment."""
        if not has_table(self._db, "calls"):
            return []  # a state file of an earlier release, which may be looked at
        return [row[0] for row in self._db.execute("SELECT DISTINCT glider FROM calls ORDER BY glider")]

    def extent(self, glider: str) -> tuple[int, int]:
        """How many segments and how many dives of a glider are known."""
        row = self._db.execute(
            "SELECT (SELECT count(*) FROM segments WHERE glider = ?1), "
            "(SELECT count(*) FROM assessments WHERE glider = ?1)",
            (glider,),
        ).fetchone()
        return row[0], row[1]

    # ---------------------------------------------------------------- messages

    def notified(self, glider: str) -> NotificationState:
        """What people were notified of about a glider."""
        row = self._db.execute("SELECT data FROM said WHERE glider = ?", (glider,)).fetchone()
        return codec.plain_decode(row[0], NotificationState) if row is not None else NotificationState()

    def keep_notified(
        self, glider: str, notified: NotificationState, open_threads: Collection[str], now: float
    ) -> None:
        """Keep what people were notified of about a glider, and withdraw what is held of it but for some
        threads (`withdraw`)."""
        row = (glider, codec.plain_encode(notified))
        self._db.execute("INSERT OR REPLACE INTO said VALUES (?, ?)", row)
        self.withdraw(glider, open_threads, now)

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

    def relays(self) -> RelayState:
        """How the exchange with other relays stands."""
        return relay_state(self._db)

    def refused(self, since: float) -> list[Undelivered]:
        """What a channel refused for good, or could not be read, since a time (s); oldest first."""
        return outbox.refused(self._db, since)


def _has_ended(dive: Assessment) -> bool:
    """Whether the fix that ends a dive is known."""
    return dive.unusable is not Unusable.NOT_SURFACED
