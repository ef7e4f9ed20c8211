"""A copy of the state file of one moment, made while the service writes, and proved to be whole."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from gliderwatch.errors import GliderwatchError, StateError
from gliderwatch.store.database import guarded, read_only

PART = ".part"
"""Ends the name of a copy until it is proved to be whole."""


def backup(source: Path, target: Path) -> int:
    """Copy the state file `source` to `target`; its size (bytes).

    https://sqlite.org/backup.html: all in one step, so that a writer neither waits nor makes it begin anew.
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
