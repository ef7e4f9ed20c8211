"""What is older than it is to be kept is removed, in small transactions; the room is given back where cheap.

Of each glider the newest checkpoint before that time stays, and all after it: a late file can be put in its
place as far back as there, and `is_past` tells of one that is older. That segment is marked in the step that
removes what lies before it, so that an interruption anywhere leaves a good store, and the next run goes on.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.incidents.open_threads import ended_at, is_removable, kept_since
from gliderwatch.model import Incident, SegmentId
from gliderwatch.navigation.clock import is_same
from gliderwatch.pipeline import GliderState
from gliderwatch.store import codec
from gliderwatch.store.segments import FIRST

AT_ONCE = 500
"""Rows removed in one transaction."""
_PAGES = 1000
"""Free pages given back in one transaction."""
_LARGEST = 256e6
"""Bytes in use up to which a state file is written again to make it smaller: that takes a second or two, in
which nothing else is written."""

Transaction = Callable[[], AbstractContextManager[None]]


def is_past(db: sqlite3.Connection, identity: SegmentId) -> bool:
    """Whether a segment belongs before what is kept of its glider, so that it cannot be put in its place."""
    row = db.execute(
        "SELECT opened_at, name, milestone FROM segments WHERE glider = ? ORDER BY opened_at, name LIMIT 1",
        (identity.glider,),
    ).fetchone()
    if row is None or row[2] != FIRST:
        return False
    first = SegmentId(row[0], identity.glider, row[1])
    return is_same(identity, first) or (identity.opened_at, identity.name) <= (row[0], row[1])


def remove(
    db: sqlite3.Connection, transaction: Transaction, gliders: Iterable[str], cut: float
) -> Iterator[int]:
    """Remove what is older than `cut` (s): each step is one small transaction, and gives its rows removed.

    Kept is what open incidents, and threads of messages that have not ended, are about; what waits to be
    delivered; messages to the operator; files that are still there. Raises StateError: begin again later.
    """
    for glider in gliders:
        incidents, notified = _incidents(db, glider), _notified(db, glider)
        before = min(kept_since(incidents, notified.threads, cut), _came_since(db, glider, cut))
        yield from _segments(db, transaction, glider, before)
        yield from _results(db, transaction, glider)
    yield from _files(db, transaction, cut)
    yield from _compact(db)


def _came_since(db: sqlite3.Connection, glider: str, cut: float) -> float:
    """The opening (s, its clock) of the first segment that came since, whatever that clock says."""
    sql = "SELECT min(opened_at) FROM heard WHERE glider = ? AND at >= ?"
    found: float | None = db.execute(sql, (glider, cut)).fetchone()[0]
    return math.inf if found is None else found


# ------------------------------------------------------------------- incidents


def _incidents(db: sqlite3.Connection, glider: str) -> list[Incident]:
    rows = db.execute("SELECT data FROM incidents WHERE glider = ?", (glider,))
    return [codec.plain_decode(row[0], Incident) for row in rows]


def _notified(db: sqlite3.Connection, glider: str) -> NotificationState:
    row = db.execute("SELECT data FROM said WHERE glider = ?", (glider,)).fetchone()
    return codec.plain_decode(row[0], NotificationState) if row is not None else NotificationState()


def _forget_incidents(db: sqlite3.Connection, glider: str, cut: float) -> tuple[float, set[str]]:
    """Remove incidents that are over, and what was notified of them: one that is gone, but notified, would be
    withdrawn. The time (s) from which on all is kept for those that stay, and the threads that stay."""
    incidents, notified = _incidents(db, glider), _notified(db, glider)
    floor = kept_since(incidents, notified.threads, cut)
    gone = [(i.id,) for i in incidents if is_removable(i, floor)]
    db.executemany("DELETE FROM incidents WHERE id = ?", gone)
    db.executemany("DELETE FROM acks WHERE incident = ?", gone)
    threads = tuple(t for t in notified.threads if ended_at(t) >= floor)
    if threads != notified.threads:
        text = codec.plain_encode(replace(notified, threads=threads))
        db.execute("UPDATE said SET data = ? WHERE glider = ?", (text, glider))
    return floor, {t.id for t in threads} | {s.id for s in notified.silences}


# -------------------------------------------------------------------- segments


def _segments(db: sqlite3.Connection, transaction: Transaction, glider: str, before: float) -> Iterator[int]:
    """Remove the segments before the newest checkpoint before a time, from checkpoint to checkpoint."""
    sql = (
        "SELECT opened_at, name FROM segments WHERE glider = ? AND checkpoint IS NOT NULL AND opened_at < ? "
        "ORDER BY opened_at, name"
    )
    for opened_at, name in db.execute(sql, (glider, before)).fetchall():
        with transaction():
            key = (glider, name)
            marked = db.execute(  # it may have been put back since it was found
                "UPDATE segments SET milestone = ? WHERE glider = ? AND name = ? AND checkpoint IS NOT NULL "
                "AND opened_at = ?",
                (FIRST, *key, opened_at),
            ).rowcount
            removed = 0
            if marked:
                removed = db.execute(
                    "DELETE FROM segments WHERE glider = ? AND (opened_at, name) < (?, ?)",
                    (glider, opened_at, name),
                ).rowcount
        yield removed


def _results(db: sqlite3.Connection, transaction: Transaction, glider: str) -> Iterator[int]:
    """Remove what was made before the first checkpoint that is kept: going on from there makes the rest."""
    row = db.execute(
        "SELECT opened_at, milestone, checkpoint FROM segments WHERE glider = ? "
        "ORDER BY opened_at, name LIMIT 1",
        (glider,),
    ).fetchone()
    if row is None or row[1] != FIRST or row[2] is None:
        return  # without its checkpoint nothing tells where that begins: the next file makes it again
    opened_at, last = row[0], codec.decode(row[2], GliderState).last
    with transaction():
        until = opened_at if last is None else min(opened_at, last.t_dive)
        until, kept = _forget_incidents(db, glider, until)
    yield 0
    for table, where, values in (
        ("assessments", "glider = ? AND t_dive < ?", (glider, until)),
        ("heard", "glider = ? AND opened_at < ?", (glider, opened_at)),
        ("calls", "glider = ? AND last_t < ?", (glider, opened_at)),
        ("health", "glider = ? AND t < ?", (glider, opened_at)),
        ("expected", "glider = ? AND after < ? AND opened_at < ?", (glider, opened_at, opened_at)),
        ("layers", "glider = ? AND opened_at < ?", (glider, opened_at)),
    ):
        yield from _by_and_by(db, transaction, table, where, values)
    yield from _messages(db, transaction, glider, until, kept)


def _by_and_by(
    db: sqlite3.Connection, transaction: Transaction, table: str, where: str, values: tuple[object, ...]
) -> Iterator[int]:
    """Delete rows of a table, some at a time."""
    sql = f"DELETE FROM {table} WHERE rowid IN (SELECT rowid FROM {table} WHERE {where} LIMIT {AT_ONCE})"
    removed = AT_ONCE
    while removed == AT_ONCE:
        with transaction():
            removed = db.execute(sql, values).rowcount
        yield removed


# ----------------------------------------------------------- messages and files


def _messages(
    db: sqlite3.Connection, transaction: Transaction, glider: str, before: float, kept: set[str]
) -> Iterator[int]:
    """Remove messages about a glider that were delivered, of threads that are over."""
    rows = db.execute(
        "SELECT id, json_extract(data, '$.incident') FROM alerts WHERE glider = ? AND made_at < ? "
        "AND NOT EXISTS (SELECT 1 FROM outbox WHERE alert = alerts.id "
        "AND (delivered_at IS NULL OR delivered_at >= ?))",
        (glider, before, before),
    ).fetchall()
    gone = [(row[0],) for row in rows if row[1] not in kept]
    for i in range(0, len(gone), AT_ONCE):
        with transaction():
            db.executemany("DELETE FROM outbox WHERE alert = ?", gone[i : i + AT_ONCE])
            db.executemany("DELETE FROM alerts WHERE id = ?", gone[i : i + AT_ONCE])
        yield len(gone[i : i + AT_ONCE])


def _files(db: sqlite3.Connection, transaction: Transaction, cut: float) -> Iterator[int]:
    """Remove old files from the ledger that are not there any more. A file that is there stays known: it
    would be taken again. So does one whose folder is away: its share may come back."""
    path = ""
    while True:
        rows = db.execute(
            "SELECT path, noted_at, status FROM files WHERE path > ? ORDER BY path LIMIT ?", (path, AT_ONCE)
        ).fetchall()
        if not rows:
            return
        path = rows[-1][0]
        done = ("taken", "duplicate", "quarantined")
        gone = [(row[0], cut) for row in rows if row[1] < cut and row[2] in done and _is_gone(Path(row[0]))]
        if gone:
            with transaction():
                db.executemany("DELETE FROM files WHERE path = ? AND noted_at < ?", gone)
        yield len(gone)


def _is_gone(path: Path) -> bool:
    try:
        path.lstat()
    except FileNotFoundError:
        return path.parent.is_dir()
    except OSError:
        return False
    return False


# ------------------------------------------------------------------------ room


def _compact(db: sqlite3.Connection) -> Iterator[int]:
    """Give the room of a file that is for the greater part empty back to the disk, where that is cheap.

    A large file of an earlier making stays as it is: its free pages are used for what comes.
    """

    def number(name: str) -> int:
        return int(db.execute(f"PRAGMA {name}").fetchone()[0])

    pages, free = number("page_count"), number("freelist_count")
    if free <= pages / 2:
        return
    incremental = 2
    if number("auto_vacuum") != incremental:
        if (pages - free) * number("page_size") > _LARGEST:
            return
        db.execute(f"PRAGMA auto_vacuum = {incremental}")
        db.execute("VACUUM")
        yield 0
        return
    for _ in range(free // _PAGES + 1):
        db.executescript(f"PRAGMA incremental_vacuum({_PAGES})")  # `execute` frees one page: it steps by rows
        yield 0
