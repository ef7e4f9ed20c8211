"""A state file that is damaged: found at start, set aside, and what people were told saved from it.

All else is made anew from the files on the dockserver.
"""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from gliderwatch.errors import GliderwatchError, StateError
from gliderwatch.model import Alert
from gliderwatch.rules.announce import Said
from gliderwatch.store import codec
from gliderwatch.store.database import DAMAGE, DELIVERY_BY_WORDS, connect, guarded, primary, refuse_foreign
from gliderwatch.store.outbox import post

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
                told = str(db.execute("PRAGMA quick_check(1)").fetchone()[0])
            finally:
                timer.cancel()
                timer.join()
    except sqlite3.Error as error:  # what else there may be, `database.connect` tells
        return str(error) if primary(error) in DAMAGE else None
    return None if told == "ok" or late.is_set() else " ".join(told.split())


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
    """Save from a file that was set aside what people were told, and what waits to be told.

    So nothing is told twice after all is made anew, and no message is lost. `report` makes the message about
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
    """Copy messages, what was said, muted and acknowledged, as far as they can be read; how many messages."""
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
            if _is(row[1], Said):
                _put(db, "INSERT OR IGNORE INTO said VALUES (?, ?)", row)
        for row in _rows(damaged, "SELECT glider, until, at FROM mutes"):
            _put(db, "INSERT OR IGNORE INTO mutes VALUES (?, ?, ?)", row)
        for row in _rows(damaged, "SELECT incident, glider, at, data FROM acks"):
            _put(db, "INSERT OR IGNORE INTO acks VALUES (?, ?, ?, ?)", row)
        for row in _rows(damaged, "SELECT id, glider, time, made_at, data FROM alerts ORDER BY rowid"):
            if _is(row[4], Alert):
                _put(db, "INSERT OR IGNORE INTO alerts VALUES (?, ?, ?, ?, ?)", row)
                kept.add(row[0])
        columns = "alert, channel, incident, attempts, next_try, delivered_at, error"
        # of an earlier release it has not all columns
        for wait in (", held_until, escalates, delivery", ", held_until, escalates", ""):
            for row in _rows(damaged, f"SELECT {columns}{wait} FROM outbox ORDER BY id"):
                if row[0] in kept:
                    marks = ", ".join("?" * len(row))
                    _put(db, f"INSERT OR IGNORE INTO outbox ({columns}{wait}) VALUES ({marks})", row)
        db.execute(
            f"UPDATE outbox SET delivery = {DELIVERY_BY_WORDS} "
            "WHERE delivery = 'pending' AND delivered_at IS NOT NULL"
        )
    return len(kept)


def _put(db: sqlite3.Connection, sql: str, row: Any) -> None:
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
