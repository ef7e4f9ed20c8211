"""The readings of health in a state file, one row a segment or call, and what the rules found in each."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate, pairwise
from types import MappingProxyType

import numpy as np

from gliderwatch.health.constants import REMEMBERED, REPORTED
from gliderwatch.health.readings import Readings, joined
from gliderwatch.health.rule import Finding, Limits
from gliderwatch.health.rules import Judged, judge_rows
from gliderwatch.model import Array, Series, readonly
from gliderwatch.store import codec
from gliderwatch.store.database import has_table

_HELD = 4096
"""Rows whose readings are held in memory, by their text: those of a month of fifteen gliders, some 25 MB."""


@dataclass(frozen=True, slots=True)
class _Row:
    """Readings as they are kept: names and lengths of the series; all times, then all values."""

    names: tuple[str, ...]
    counts: tuple[int, ...]
    values: Array


class HealthRows:
    """The readings and findings of each glider, on the connection of its store."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection
        self._held: dict[str, dict[str, Readings]] = {}
        """Readings of the gliders that were judged last, by source."""

    def rollback(self) -> None:
        """What was written since the last commit is not in the state file."""
        self._held.clear()

    def put(self, glider: str, source: str, t: float, readings: Readings) -> None:
        """Keep the readings of a segment or call, the last of them at ``t`` (s), in place of those that its
        ``source`` had before; it and all that follow are to be judged (again)."""
        self._held.get(glider, {}).pop(source, None)
        row = self._db.execute("SELECT t FROM health WHERE source = ?", (source,)).fetchone()
        since = t if row is None else min(t, row[0])
        self._db.execute(
            "INSERT OR REPLACE INTO health VALUES (?, ?, ?, ?, NULL)",
            (source, glider, t, codec.plain_encode(_packed(readings))),
        )
        self._db.execute("UPDATE health SET judged = NULL WHERE glider = ? AND t >= ?", (glider, since))

    def judge(self, glider: str, limits: Mapping[str, Limits]) -> tuple[tuple[float, Judged], ...]:
        """Judge by ``limits`` what is to be judged, once for all files that came together; all that was found
        (`judged`)."""
        if limits:
            self._judge(glider, limits)
        return self.judged(glider)

    def _judge(self, glider: str, limits: Mapping[str, Limits]) -> None:
        sql = "SELECT min(t) FROM health WHERE glider = ? AND judged IS NULL"
        since: float | None = self._db.execute(sql, (glider,)).fetchone()[0]
        if since is None:
            return
        sql = "SELECT t, source FROM health WHERE glider = ? AND t >= ? ORDER BY t, source"
        rows = self._db.execute(sql, (glider, since - REMEMBERED)).fetchall()
        held = self._readings(glider, [source for _, source in rows])
        found = judge_rows([(t, held[source]) for t, source in rows], since, limits)
        sources = [source for t, source in rows if t >= since]
        self._db.executemany(
            "UPDATE health SET judged = ? WHERE source = ?",
            [(codec.plain_encode(each), source) for each, source in zip(found, sources, strict=True)],
        )

    def _readings(self, glider: str, sources: Sequence[str]) -> dict[str, Readings]:
        """The readings of some sources of a glider: of a month most are held from the file before."""
        before, sql = self._held.pop(glider, {}), "SELECT readings FROM health WHERE source = ?"
        found = {
            each: before[each] if each in before else _unpacked(self._db.execute(sql, (each,)).fetchone()[0])
            for each in sources
        }
        while self._held and len(found) + sum(map(len, self._held.values())) > _HELD:
            self._held.pop(next(iter(self._held)))
        self._held[glider] = found
        return found

    def readings(self, glider: str, since: float, until: float) -> Readings:
        """All readings of a glider from segments and calls of a time (s), joined by quantity."""
        if not has_table(self._db, "health"):
            return {}  # a state file of an earlier release, which may be looked at
        sql = "SELECT readings FROM health WHERE glider = ? AND t BETWEEN ? AND ? ORDER BY t, source"
        rows = [_unpacked(row[0]) for row in self._db.execute(sql, (glider, since, until))]
        names = sorted({name for row in rows for name in row})
        return MappingProxyType({n: joined([row[n] for row in rows if n in row]) for n in names})

    def judged(self, glider: str) -> tuple[tuple[float, Judged], ...]:
        """What the rules found in each segment and call of the last weeks, in order of time (s)."""
        if not has_table(self._db, "health"):
            return ()  # a state file of an earlier release, which may be looked at
        sql = (
            "SELECT t, judged FROM health WHERE glider = ?1 "
            "AND t >= (SELECT max(t) FROM health WHERE glider = ?1) - ?2 AND judged IS NOT NULL "
            "ORDER BY t, source"
        )
        rows = self._db.execute(sql, (glider, REPORTED))
        return tuple((t, _findings(data)) for t, data in rows)


def _packed(readings: Readings) -> _Row:
    parts = [s.t for s in readings.values()] + [s.v for s in readings.values()]
    counts = tuple(len(s) for s in readings.values())
    return _Row(tuple(readings), counts, readonly(np.concatenate(parts) if parts else []))


@lru_cache(_HELD)
def _findings(text: str) -> Judged:
    return MappingProxyType(codec.plain_decode(text, dict[str, Finding | None]))


@lru_cache(_HELD)
def _unpacked(text: str) -> Readings:
    row = codec.plain_decode(text, _Row)
    times, values = row.values.reshape(2, -1)
    slices = [slice(i, j) for i, j in pairwise([0, *accumulate(row.counts)])]
    return MappingProxyType(
        {name: Series(times[at], values[at]) for name, at in zip(row.names, slices, strict=True)}
    )
