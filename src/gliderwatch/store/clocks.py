"""The clocks of gliders in a state file: segments get their right place in time (`navigation.clock`)."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from dataclasses import replace

from gliderwatch.model import SegmentId
from gliderwatch.navigation.clock import (
    SAME_OPENING,
    ClockStep,
    Correction,
    Stamp,
    corrections,
    numbered,
)

FIRST = 2
"""`milestone` of a segment before which nothing is kept any more."""
_COLUMNS = "name, opened_at, clock_offset, clock_step, last_t, milestone"
_OF_MISSION = "glider = ? AND name >= ? AND name < ?"


def _names(mission: str) -> tuple[str, str]:
    """The names of the segments of a mission lie between these: "." is the character after "-"."""
    return f"{mission}-", f"{mission}."


def correct(db: sqlite3.Connection, glider: str, mission: str) -> dict[SegmentId, SegmentId]:
    """Put the segments of a mission where they belong in time; the ids before and after of those moved."""
    rows = _rows(db, glider, mission)
    stamps = [_stamp(row) for row in rows]
    moves = {}
    for row, stamp, new in zip(rows, stamps, corrections(stamps, _start(rows)), strict=True):
        if new == _correction(row):
            continue
        before = SegmentId(row["opened_at"], glider, row["name"])
        after = SegmentId(stamp.opened_at + new.offset, glider, row["name"])
        _move(db, before, after, new)
        moves[before] = after
    return moves


def _rows(db: sqlite3.Connection, glider: str, mission: str) -> list[sqlite3.Row]:
    """The segments of a mission in the order of their numbers."""
    sql = f"SELECT {_COLUMNS} FROM segments WHERE {_OF_MISSION}"
    rows = db.execute(sql, (glider, *_names(mission))).fetchall()
    return sorted(rows, key=lambda row: numbered(row["name"])[1])


def _stamp(row: sqlite3.Row) -> Stamp:
    return Stamp(numbered(row["name"])[1], row["opened_at"] - row["clock_offset"], row["last_t"])


def _correction(row: sqlite3.Row) -> Correction:
    return Correction(row["clock_offset"], row["clock_step"])


def _start(rows: Sequence[sqlite3.Row]) -> Correction:
    """What was known at the first segment, where `state.keep_days` has removed those before it."""
    return _correction(rows[0]) if rows and rows[0]["milestone"] == FIRST else Correction()


def _move(db: sqlite3.Connection, before: SegmentId, after: SegmentId, correction: Correction) -> None:
    """Give a segment its place in time, and its sign of life with it."""
    key = (before.glider, before.opened_at, before.name)
    db.execute(
        "UPDATE segments SET opened_at = ?, clock_offset = ?, clock_step = ?, checkpoint = NULL "
        "WHERE glider = ? AND opened_at = ? AND name = ?",
        (after.opened_at, correction.offset, correction.step, *key),
    )
    db.execute(
        "UPDATE heard SET opened_at = opened_at - clock_offset + ?1, last_t = last_t - clock_offset + ?1, "
        "clock_offset = ?1 WHERE glider = ?2 AND segment = ?3 AND abs(opened_at - ?4) <= ?5",
        (correction.offset, before.glider, before.name, before.opened_at, SAME_OPENING),
    )
    db.execute("DELETE FROM expected WHERE glider = ? AND opened_at = ? AND segment = ?", key)


def offset(db: sqlite3.Connection, identity: SegmentId) -> float:
    """What would be added to the time of a segment (s) if it came now; by the glider's clock."""
    mission, number = numbered(identity.name)
    rows = [row for row in _rows(db, identity.glider, mission) if row["name"] != identity.name]
    own = Stamp(number, identity.opened_at, identity.opened_at)
    return corrections([own, *map(_stamp, rows)], _start(rows))[0].offset


def steps(db: sqlite3.Connection, glider: str) -> list[ClockStep]:
    """Where the clock of a glider was set back, or is right again, in order of time.

    The right time of one that is not corrected is not known: that of the newest segment of its mission stands
    for it.
    """
    rows = db.execute(
        "SELECT name, opened_at, clock_offset, clock_step FROM segments WHERE glider = ? AND clock_step != 0",
        (glider,),
    )
    found = [ClockStep(glider, *row) for row in rows]
    newest = f"SELECT max(opened_at) FROM segments WHERE {_OF_MISSION}"
    for i, step in enumerate(found):
        if not step.is_corrected:
            mission = numbered(step.segment)[0]
            t = db.execute(newest, (glider, *_names(mission))).fetchone()[0]
            found[i] = replace(step, t=t)
    return sorted(found, key=lambda step: step.t)
