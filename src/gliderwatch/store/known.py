"""What is known of one glider, as the rules ask for it."""

from __future__ import annotations

import sqlite3

from gliderwatch.model import Assessment, Expected, Fix, Incident
from gliderwatch.rules.irregularities import PLACES, Coming, Irregularity, found
from gliderwatch.rules.silence import GONE, Sign
from gliderwatch.store import clocks
from gliderwatch.store.rows import values


class Known:
    """`rules.announce.Known` and `rules.overdue.Known` of one glider, on the connection of its store."""

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

    def expected(self, until: float) -> Expected | None:
        """What was expected after the last surfacing at `until` (s) or before."""
        sql = (
            "SELECT data FROM expected WHERE glider = ? AND after <= ? "
            "ORDER BY after DESC, opened_at DESC LIMIT 1"
        )
        return next(iter(values(self._db, sql, (self.glider, until), Expected)), None)

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
        """Its files that were opened at `since` (s) or later, or that came since."""
        sql = "SELECT opened_at, last_t, at FROM heard WHERE glider = ?1 AND (opened_at >= ?2 OR at >= ?2)"
        return tuple(Sign(*row) for row in self._db.execute(sql, (self.glider, since)))
