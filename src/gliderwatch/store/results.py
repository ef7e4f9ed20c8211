"""What a state file holds of one glider, as the rules ask for it, and what people noted by command."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from math import inf
from pathlib import Path

from gliderwatch.incidents.acknowledgement import Ack, Acks
from gliderwatch.incidents.calls import announced_flight
from gliderwatch.incidents.constants import FRESH, GONE, PLACES, UNTIL_COME
from gliderwatch.incidents.irregularities import Arrival, irregularities
from gliderwatch.incidents.notices import Irregularity, Unjudged
from gliderwatch.incidents.overdue import Sign
from gliderwatch.model import (
    Alert,
    Assessment,
    Call,
    Fix,
    Hindrance,
    Incident,
    NextSurfacing,
    Unusable,
)
from gliderwatch.navigation.constants import FILE_TO_CALL, SURFACE_STAY
from gliderwatch.store import codec, segments
from gliderwatch.store.codec import values
from gliderwatch.store.database import has_table

_NEWEST = {
    "said": "SELECT data FROM said WHERE glider = ?",
    "heard": "SELECT max(at) FROM heard WHERE glider = ?",
    "assessments": "SELECT data FROM assessments WHERE glider = ? ORDER BY t_dive DESC LIMIT 2",
    "incidents": "SELECT data FROM incidents WHERE glider = ?",
    "expected": "SELECT data FROM expected WHERE glider = ? ORDER BY after DESC, opened_at DESC LIMIT 1",
    "acks": "SELECT data FROM acks WHERE glider = ?",
    "mutes": "SELECT until FROM mutes WHERE glider = ?",
    "calls": "SELECT call FROM calls WHERE glider = ? ORDER BY last_t DESC LIMIT 1",
    "health": "SELECT max(t) FROM health WHERE glider = ?",
    "layers": "SELECT max(opened_at) FROM layers WHERE glider = ?",
    "field_advice": "SELECT data FROM field_advice WHERE glider = ?",
}
"""What is new of a glider in each table: some rows by an index, however many there are."""


def _of_dive(dive: Assessment) -> Unjudged:
    return Unjudged(dive.t_dive, dive.t_surface, dive.unusable, dive.reason)


class Annotations:
    """The notes of people in a state file, on the connection of its store."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection

    def muted_until(self, glider: str) -> float | None:
        """Until when (s) a glider is muted by command; None: it is not."""
        row = self._one("SELECT until FROM mutes WHERE glider = ?", glider)
        return None if row is None else float(row[0])

    def mute(self, glider: str, until: float, now: float) -> None:
        """Send nothing of a glider until a time (s), in place of an earlier mute."""
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

    def give_back(self, incident: str) -> None:
        """Forget the acknowledgement of an incident."""
        self._db.execute("DELETE FROM acks WHERE incident = ?", (incident,))

    def acks(self, glider: str) -> Acks:
        """The acknowledgements of a glider's incidents."""
        if not has_table(self._db, "acks"):
            return {}
        rows = self._db.execute("SELECT data FROM acks WHERE glider = ?", (glider,))
        return {ack.incident: ack for ack in (codec.plain_decode(row[0], Ack) for row in rows)}

    def _one(self, sql: str, glider: str) -> sqlite3.Row | None:
        if not has_table(self._db, "mutes"):
            return None
        row: sqlite3.Row | None = self._db.execute(sql, (glider,)).fetchone()
        return row


class GliderFacts:
    """What the rules ask of one glider (`incidents.facts.Facts`), on the connection of its store."""

    def __init__(self, connection: sqlite3.Connection, glider: str) -> None:
        self._db, self.glider = connection, glider

    def newest(self) -> int:
        """A number that changes with what comes of it, and with what people note; not where data that come
        late change a dive of the past alone. It costs a tenth of a millisecond."""
        tables = {row[0] for row in self._db.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")}
        some = (self._db.execute(sql, (self.glider,)) for name, sql in _NEWEST.items() if name in tables)
        return hash(tuple(tuple(map(tuple, rows)) for rows in some))

    def incidents(self) -> tuple[Incident, ...]:
        """All its incidents, in order of time."""
        sql = "SELECT data FROM incidents WHERE glider = ? ORDER BY opened_at, id"
        return tuple(values(self._db, sql, (self.glider,), Incident))

    def dive(self, t_dive: float) -> Assessment | None:
        """The dive that began at a time (s)."""
        sql = "SELECT data FROM assessments WHERE glider = ? AND t_dive = ?"
        return next(iter(values(self._db, sql, (self.glider, t_dive), Assessment)), None)

    def latest_dives(self, n: int, until: float = inf) -> tuple[Assessment, ...]:
        """The last `n` dives that have ended, not after `until` (s), in order of time."""
        sql = (
            "SELECT data FROM assessments WHERE glider = ? AND ended = 1 AND t_surface <= ? "
            "ORDER BY t_surface DESC, t_dive DESC LIMIT ?"
        )
        return tuple(reversed(values(self._db, sql, (self.glider, until, n), Assessment)))

    def latest_alerts(self, n: int) -> tuple[Alert, ...]:
        """The last `n` messages about it, the newest first."""
        sql = "SELECT data FROM alerts WHERE glider = ? ORDER BY made_at DESC, rowid DESC LIMIT ?"
        return tuple(values(self._db, sql, (self.glider, n), Alert))

    def last_log(self) -> str | None:
        """The path of the log of its last call; None where there is none, or no such table yet."""
        if not has_table(self._db, "calls"):
            return None
        sql = "SELECT path FROM calls WHERE glider = ? ORDER BY last_t DESC LIMIT 1"
        row = self._db.execute(sql, (self.glider,)).fetchone()
        return None if row is None else str(row[0])

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
        sql = "SELECT data FROM assessments WHERE glider = ? AND t_dive > ? AND flag IS NULL AND ended = 1"
        dives = values(self._db, sql, (self.glider, since), Assessment)
        return (*map(_of_dive, dives), *self._no_fix(since), *self._not_taken(since), *self._empty(since))

    def _no_fix(self, since: float) -> Iterator[Unjudged]:
        """The dive since the last fix, however it looks by depth rate and pitch, up to the last file."""
        sql = (
            "SELECT data, ended, (SELECT max(last_t) FROM heard WHERE glider = ?1) FROM assessments "
            "WHERE glider = ?1 AND t_dive > ?2 ORDER BY t_dive DESC LIMIT 1"
        )
        for data, ended, last in self._db.execute(sql, (self.glider, since)):
            dive = codec.plain_decode(data, Assessment)
            if not ended and dive.n_samples > 2:  # fewer: a time without files
                words = "no fix" if dive.flag is None else f"no fix; {dive.reason.partition(' (')[0]}"
                yield Unjudged(dive.t_dive, max(dive.t_surface, last or 0.0), dive.unusable, words)

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
        """Segments of which a file was taken that holds nothing, but the newest: it may still grow."""
        sql = (
            "SELECT opened_at, at FROM heard h WHERE glider = ? AND opened_at > ? AND last_t <= opened_at "
            "AND EXISTS (SELECT 1 FROM heard n WHERE n.glider = h.glider AND n.opened_at > h.opened_at)"
        )
        for row in self._db.execute(sql, (self.glider, since)):
            yield Unjudged(row[0], row[1], Unusable.DATA_MISSING, "its file holds no data")

    def irregularities(self, now: float) -> list[Irregularity]:
        """What is wrong with its files, as known at `now` (s)."""
        steps = segments.steps(self._db, self.glider)
        arrivals = self.arrivals(now - GONE, now) if self._came_late(now - GONE, now) else []
        return irregularities(self.glider, steps, self.places(PLACES), arrivals)

    def _came_late(self, since: float, until: float) -> bool:
        """Whether any file came days after its date, between two times (s): hardly ever."""
        sql = (
            "SELECT EXISTS (SELECT 1 FROM heard WHERE glider = ? AND at BETWEEN ? AND ? "
            "AND at - coalesce(last_t, opened_at) >= ?)"
        )
        return bool(self._db.execute(sql, (self.glider, since, until, FRESH)).fetchone()[0])

    def places(self, n: int) -> list[Fix]:
        """Where and when it surfaced the last `n` times that are known, in order of time."""
        sql = "SELECT data FROM assessments WHERE glider = ? AND ended = 1 ORDER BY t_surface DESC LIMIT ?"
        dives = reversed(values(self._db, sql, (self.glider, n), Assessment))
        return [Fix(a.t_surface, a.lat, a.lon) for a in dives if a.lat is not None and a.lon is not None]

    def arrivals(self, since: float, until: float) -> list[Arrival]:
        """Its segments of which the first file came between two times (s), in that order."""
        sql = (
            "SELECT segment, coalesce(last_t, opened_at), at, "
            "(SELECT min(at) FROM heard WHERE glider = ?1) "
            "FROM heard WHERE glider = ?1 AND at BETWEEN ?2 AND ?3 ORDER BY at"
        )
        return [Arrival(*row) for row in self._db.execute(sql, (self.glider, since, until))]

    def signs(self, since: float) -> tuple[Sign, ...]:
        """Its files that were opened at `since` (s) or later, or that came since, and its calls."""
        sql = "SELECT opened_at, last_t, at FROM heard WHERE glider = ?1 AND (opened_at >= ?2 OR at >= ?2)"
        files = (Sign(*row) for row in self._db.execute(sql, (self.glider, since)))
        return (*files, *self._call_signs(since))

    def _call_signs(self, since: float) -> Iterator[Sign]:
        """Its calls; a state file of an earlier release, which may be looked at, has none."""
        if not has_table(self._db, "calls"):
            return
        sql = "SELECT began, last_t, at FROM calls WHERE glider = ? AND last_t >= ?"
        for row in self._db.execute(sql, (self.glider, since)):
            yield Sign(row[0], row[1], row[2], is_call=True)

    def calls(self, since: float) -> tuple[Call, ...]:
        """Its calls that went on at `since` (s) or later, in order of time."""
        if not has_table(self._db, "calls"):
            return ()  # a state file of an earlier release, which may be looked at
        sql = "SELECT call FROM calls WHERE glider = ? AND last_t >= ? ORDER BY began, path"
        return tuple(values(self._db, sql, (self.glider, since), Call))

    def last_fix(self, since: float) -> Fix | None:
        """Its last fix, by the surfacings that its files tell, and the calls since a time (s)."""
        fixes = [*self.places(1), *(call.fix for call in self.calls(since) if call.fix is not None)]
        return max(fixes, key=lambda fix: fix.t, default=None)

    def came_up(self, t: float) -> str:
        """Why it came up at a time (s), as it said in the call of that surfacing; empty: not known."""
        calls = (call for call in self.calls(t - SURFACE_STAY) if call.reason)
        return next((c.reason for c in calls if c.began - t < FILE_TO_CALL), "")

    def not_come(self, since: float, now: float) -> tuple[tuple[float, str], ...]:
        """The flight files that it announced in a call that was over since (s), an hour ago at least, and of
        which none came, under whatever name: when that call began (s), and their names in it."""
        names = {
            row[0].lower()
            for row in self._db.execute("SELECT segment FROM heard WHERE glider = ?", (self.glider,))
        }
        sql = "SELECT path FROM files WHERE glider = ? AND status != 'unknown'"
        names |= {Path(row[0]).name.lower() for row in self._db.execute(sql, (self.glider,))}
        missing: dict[str, float] = {}
        for call in self.calls(since):
            if now - call.last_t < UNTIL_COME:
                continue
            for file in announced_flight(call):
                if not names & {file.name, file.segment}:
                    missing.setdefault(file.name, call.began)
        return tuple((t, name) for name, t in missing.items())


class Calls:
    """The calls in a state file, on the connection of its store."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection

    def dialog(self, path: str) -> str | None:
        """How far the log at a path was read, as it was kept; None where it was not."""
        row = self._db.execute("SELECT dialog FROM calls WHERE path = ?", (path,)).fetchone()
        return None if row is None else str(row[0])

    def has(self, glider: str) -> bool:
        """Whether any call of a glider is held."""
        sql = "SELECT EXISTS (SELECT 1 FROM calls WHERE glider = ?)"
        return bool(self._db.execute(sql, (glider,)).fetchone()[0])

    def during(self, glider: str, since: float, until: float) -> tuple[Call, ...]:
        """The calls of a glider that went on between two times (s), in order of time."""
        sql = "SELECT call FROM calls WHERE glider = ? AND last_t >= ? AND began <= ? ORDER BY began, path"
        return tuple(values(self._db, sql, (glider, since, until), Call))

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
