"""Backup of the state file, replacing one glider in it, and what is saved of a damaged one."""

from __future__ import annotations

import os
import sqlite3
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from gliderwatch.errors import GliderwatchError, StateError
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.model import Alert, SegmentId
from gliderwatch.pipeline import GliderState
from gliderwatch.store import codec
from gliderwatch.store.database import (
    DAMAGE,
    DELIVERY_BY_WORDS,
    connect,
    guarded,
    primary,
    read_only,
    refuse_foreign,
)
from gliderwatch.store.outbox import post
from gliderwatch.store.segments import FIRST

# ----------------------------------------
# A copy of the state file of one moment, made while the service writes, and proved to be whole.

PART = ".part"
"""Ends the name of a copy until it is proved to be whole."""


def backup(source: Path, target: Path) -> int:
    """Copy the state file `source` to `target`; its size (bytes).

    https://sqlite.org/backup.html: all in one step, so that a writer neither waits nor makes it begin again.
    Raises GliderwatchError where there is something at `target` already, where it cannot be written, or where
    the copy is not whole; then nothing is left there.
    """
    part = target.with_name(target.name + PART)
    with closing(read_only(source)) as db, _reserved(target, part):
        with closing(_open(part)) as copy:
            with guarded(source):
                _copy(db, copy, target)
            _prove(copy, source)
        part.chmod(source.stat().st_mode & 0o777)
        _sync(part)
        _finish(part, target)
        _sync(target.parent)
        return target.stat().st_size


@contextmanager
def _reserved(target: Path, part: Path) -> Iterator[None]:
    """The name of the copy while it is made, for nobody else; nothing is left of it after a failure."""
    if os.path.lexists(target):
        raise GliderwatchError(f"{target} is there already: name another file, or move it away")
    try:
        part.open("xb").close()
    except FileExistsError:
        raise GliderwatchError(
            f"{part} is there: another backup is at work, or was cut short; then delete it"
        ) from None
    except OSError as error:
        raise GliderwatchError(f"{target} cannot be written: {error.strerror}. Name another place") from None
    try:
        yield
    finally:
        for side in ("", "-wal", "-shm", "-journal"):
            with suppress(OSError):
                part.with_name(part.name + side).unlink()


def _open(part: Path) -> sqlite3.Connection:
    part.chmod(0o600)
    return sqlite3.connect(part, isolation_level=None)


def _copy(db: sqlite3.Connection, copy: sqlite3.Connection, target: Path) -> None:
    try:
        db.backup(copy)
        copy.execute("PRAGMA journal_mode = DELETE")  # one file, with nothing beside it
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        if code in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_READONLY):
            raise GliderwatchError(
                f"{target} cannot be written: {error}. Make room there, or name another place"
            ) from None
        raise


def _prove(copy: sqlite3.Connection, source: Path) -> None:
    try:
        found = str(copy.execute("PRAGMA integrity_check(1)").fetchone()[0])
    except sqlite3.Error as error:
        found = str(error)
    if found != "ok":
        raise StateError(
            f"the copy of {source} is not whole ({' '.join(found.split())}) and was removed. What to do: "
            "look after the disk, then systemctl restart gliderwatch, which sets a damaged state file aside"
        )


def _finish(part: Path, target: Path) -> None:
    """Give the copy its name, unless somebody else took it meanwhile."""
    try:
        os.link(part, target)
    except FileExistsError:
        raise GliderwatchError(f"{target} is there now, and was left alone: name another file") from None
    except OSError:  # a file system without links
        part.rename(target)


def _sync(path: Path) -> None:
    """See that it is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


# ----------------------------------------
# Putting what was assessed again of one glider in place of what a state file holds of it.

_TABLES = ("segments", "assessments", "incidents", "expected", "layers")


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
    """Begin with its calls. Where `state.keep_days` removed what was before a segment, begin after it, with
    what was known then."""
    _insert(new, "calls", old.execute("SELECT * FROM calls WHERE glider = ?", (glider,)).fetchall())
    row = old.execute(
        "SELECT * FROM segments WHERE glider = ? ORDER BY opened_at, name LIMIT 1", (glider,)
    ).fetchone()
    if row is None or row["milestone"] != FIRST:
        return
    _insert(new, "segments", [row])
    if row["checkpoint"] is None:
        return
    last = codec.decode(row["checkpoint"], GliderState).last
    until = float("-inf") if last is None else last.t_dive
    for table, column in (("assessments", "t_dive"), ("incidents", "opened_at")):
        sql = f"SELECT * FROM {table} WHERE glider = ? AND {column} <= ?"
        _insert(new, table, old.execute(sql, (glider, until)).fetchall())
    for table in ("expected", "layers"):
        sql = f"SELECT * FROM {table} WHERE glider = ? AND opened_at = ? AND segment = ?"
        _insert(new, table, old.execute(sql, (glider, row["opened_at"], row["name"])).fetchall())


def _insert(db: sqlite3.Connection, table: str, rows: list[sqlite3.Row]) -> None:
    for row in rows:
        db.execute(f"INSERT INTO {table} VALUES ({', '.join('?' * len(row))})", tuple(row))


def replace(db: sqlite3.Connection, fresh: Path, glider: str, notified: NotificationState) -> None:
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
        db.execute("INSERT OR REPLACE INTO main.said VALUES (?, ?)", (glider, codec.plain_encode(notified)))
        db.execute("COMMIT")
    except BaseException:
        if db.in_transaction:
            db.execute("ROLLBACK")
        raise
    db.execute("DETACH DATABASE fresh")


# ----------------------------------------
# A state file that is damaged: found at start, set aside, and what people were notified of saved from it.
#
# All else is made again from the files on the dockserver.

LOOK = 1.0
"""Seconds that the check of a large file may take at each start; the rest shows itself when it is read."""
_MARK = ".damaged-"
_SIDES = ("-wal", "-shm")


def damage(path: Path, seconds: float = LOOK) -> str | None:
    """What is wrong with the content of a state file, None where nothing is found in the time given.

    SQLite's quick_check: pages, trees and records, but not their values. Nobody may write meanwhile.
    """
    if not path.exists():
        return None
    if path.stat().st_size == 0:
        return "it is empty"
    late = threading.Event()
    try:
        with closing(
            sqlite3.connect(path, timeout=30.0, isolation_level=None, check_same_thread=False)
        ) as db:
            timer = threading.Timer(seconds, _interrupt, (db, late))
            timer.start()
            try:
                result = str(db.execute("PRAGMA quick_check(1)").fetchone()[0])
            finally:
                timer.cancel()
                timer.join()
    except sqlite3.Error as error:  # what else there may be, `database.connect` tells
        return str(error) if primary(error) in DAMAGE else None
    return None if result == "ok" or late.is_set() else " ".join(result.split())


def _interrupt(db: sqlite3.Connection, late: threading.Event) -> None:
    """End a check: what SQLite says after that may be of pages that it has not come to."""
    late.set()
    db.interrupt()


def set_aside(path: Path, now: float) -> Path:
    """Give a state file another name, with its log; which. Raises StateError where that cannot be done, or
    where the file is not gliderwatch's.

    The file itself comes last: after a power cut half-way it is found damaged again.
    """
    refuse_foreign(path)
    name = path.name + _MARK + time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(now))
    aside = path.with_name(name)
    while aside.exists():
        aside = aside.with_name(aside.name + "+")
    try:
        for side in _SIDES:
            wal = path.with_name(path.name + side)
            if wal.exists():
                wal.rename(aside.with_name(aside.name + side))
        return path.rename(aside)
    except OSError as error:
        raise StateError(
            f"damaged state file {path} cannot be renamed: {error.strerror}. Move it away by hand"
        ) from None


def asides(path: Path) -> list[Path]:
    """The damaged files that were set aside beside a state file, oldest first."""
    found = path.parent.glob(path.name + _MARK + "*")
    return sorted(p for p in found if not p.name.endswith((*_SIDES, "-journal")))


def restore(path: Path, aside: Path, report: Callable[[int], Alert], channels: Iterable[str]) -> Alert | None:
    """Save from a file that was set aside what people were notified of, and what waits to be sent.

    No message comes twice after all is made again, and none is lost. `report` makes the message about
    it from the number of messages saved; None: it was made before. All in one transaction. Raises StateError.
    """
    with guarded(path), closing(connect(path)) as db:
        db.execute("BEGIN IMMEDIATE")
        if db.execute("SELECT 1 FROM alerts WHERE id = ?", (report(0).id,)).fetchone() is not None:
            return None
        alert = report(_save(aside, db))
        post(db, alert, channels, alert.time)
        db.execute("COMMIT")
    return alert


def _save(aside: Path, db: sqlite3.Connection) -> int:
    """Copy messages, what was notified, muted and acknowledged, as far as they can be read; how many."""
    kept: set[str] = set()
    try:
        look = sqlite3.connect(f"{aside.absolute().as_uri()}?mode=ro", uri=True)
    except sqlite3.Error:
        return 0
    look.text_factory = lambda raw: raw.decode("utf-8", "replace")
    with suppress(sqlite3.Error):
        look.execute("PRAGMA writable_schema = ON")  # else none of a file that was cut short can be read
    with closing(look) as damaged:
        for row in _rows(damaged, "SELECT glider, data FROM said"):
            if _is(row[1], NotificationState):
                _put_back(db, "INSERT OR IGNORE INTO said VALUES (?, ?)", row)
        for row in _rows(damaged, "SELECT glider, until, at FROM mutes"):
            _put_back(db, "INSERT OR IGNORE INTO mutes VALUES (?, ?, ?)", row)
        for row in _rows(damaged, "SELECT incident, glider, at, data FROM acks"):
            _put_back(db, "INSERT OR IGNORE INTO acks VALUES (?, ?, ?, ?)", row)
        for row in _rows(damaged, "SELECT id, glider, time, made_at, data FROM alerts ORDER BY rowid"):
            if _is(row[4], Alert):
                _put_back(db, "INSERT OR IGNORE INTO alerts VALUES (?, ?, ?, ?, ?)", row)
                kept.add(row[0])
        columns = "alert, channel, incident, attempts, next_try, delivered_at, error"
        # of an earlier release it has not all columns
        for wait in (", held_until, escalates, delivery", ", held_until, escalates", ""):
            for row in _rows(damaged, f"SELECT {columns}{wait} FROM outbox ORDER BY id"):
                if row[0] in kept:
                    marks = ", ".join("?" * len(row))
                    _put_back(db, f"INSERT OR IGNORE INTO outbox ({columns}{wait}) VALUES ({marks})", row)
        db.execute(
            f"UPDATE outbox SET delivery = {DELIVERY_BY_WORDS} "
            "WHERE delivery = 'pending' AND delivered_at IS NOT NULL"
        )
    return len(kept)


def _put_back(db: sqlite3.Connection, sql: str, row: Any) -> None:
    with suppress(sqlite3.IntegrityError):  # a value of another kind than the table takes
        db.execute(sql, row)


def _rows(db: sqlite3.Connection, sql: str) -> Iterator[Any]:
    """The rows of a table up to the first that cannot be read."""
    try:
        yield from db.execute(sql)
    except sqlite3.Error:
        return


def _is(text: object, kind: type) -> bool:
    """Whether a text is such a value."""
    try:
        codec.plain_decode(str(text), kind)
    except GliderwatchError:
        return False
    return True
