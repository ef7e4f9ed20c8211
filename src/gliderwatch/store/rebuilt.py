"""Putting what was assessed anew of one glider in place of what a state file holds of it."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from gliderwatch.model import SegmentId
from gliderwatch.pipeline import GliderState
from gliderwatch.rules.announce import Said
from gliderwatch.store import codec
from gliderwatch.store.clocks import FIRST

_TABLES = ("segments", "assessments", "incidents", "expected")


def paths(db: sqlite3.Connection, glider: str) -> list[str]:
    """The files of a glider that the ledger knows."""
    rows = db.execute("SELECT path FROM files WHERE glider = ? AND path != '' ORDER BY path", (glider,))
    return [row[0] for row in rows]


def held(db: sqlite3.Connection, glider: str) -> list[SegmentId]:
    """The segments of a glider that are held, in order of time."""
    rows = db.execute(
        "SELECT opened_at, name FROM segments WHERE glider = ? ORDER BY opened_at, name", (glider,)
    )
    return [SegmentId(row[0], glider, row[1]) for row in rows]


def seed(old: sqlite3.Connection, new: sqlite3.Connection, glider: str) -> None:
    """Where `state.keep_days` removed what was before a segment, begin after it, with what was known then."""
    row = old.execute(
        "SELECT * FROM segments WHERE glider = ? ORDER BY opened_at, name LIMIT 1", (glider,)
    ).fetchone()
    if row is None or row["milestone"] != FIRST:
        return
    _put(new, "segments", [row])
    if row["checkpoint"] is None:
        return
    last = codec.decode(row["checkpoint"], GliderState).last
    until = float("-inf") if last is None else last.t_dive
    for table, time in (("assessments", "t_dive"), ("incidents", "opened_at")):
        sql = f"SELECT * FROM {table} WHERE glider = ? AND {time} <= ?"
        _put(new, table, old.execute(sql, (glider, until)).fetchall())
    sql = "SELECT * FROM expected WHERE glider = ? AND opened_at = ? AND segment = ?"
    _put(new, "expected", old.execute(sql, (glider, row["opened_at"], row["name"])).fetchall())


def _put(db: sqlite3.Connection, table: str, rows: list[sqlite3.Row]) -> None:
    for row in rows:
        db.execute(f"INSERT INTO {table} VALUES ({', '.join('?' * len(row))})", tuple(row))


def replace(db: sqlite3.Connection, fresh: Path, glider: str, said: Said) -> None:
    """Put what the state file `fresh` holds of a glider in place of what is held, all or nothing.

    The ledger learns of the files that were taken; messages, signs of life and notes stay.
    """
    db.execute("ATTACH DATABASE ? AS fresh", (str(fresh),))
    db.execute("BEGIN IMMEDIATE")
    try:
        for table in _TABLES:
            db.execute(f"DELETE FROM main.{table} WHERE glider = ?", (glider,))
            db.execute(f"INSERT INTO main.{table} SELECT * FROM fresh.{table} WHERE glider = ?", (glider,))
        db.execute(
            "INSERT OR REPLACE INTO main.files SELECT * FROM fresh.files "
            "WHERE path != '' AND status IN ('taken', 'duplicate')"
        )
        db.execute("INSERT OR REPLACE INTO main.said VALUES (?, ?)", (glider, codec.plain_encode(said)))
        db.execute("COMMIT")
    except BaseException:
        if db.in_transaction:
            db.execute("ROLLBACK")
        raise
    db.execute("DETACH DATABASE fresh")
