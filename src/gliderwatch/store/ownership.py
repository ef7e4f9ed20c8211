"""Whose file is it? A state file of gliderwatch is told from everything else by its content.

SQLite keeps a number for the program that a file belongs to (https://sqlite.org/pragma.html#pragma_application_id).
Files of earlier releases, which have none, are known by their tables; damaged ones by what is left of them.
"""

from __future__ import annotations

import sqlite3
import stat
from contextlib import closing
from pathlib import Path

APPLICATION_ID = 0x676C6477
"""`gldw` in ASCII: `PRAGMA application_id` of every state file."""
_MAGIC = b"SQLite format 3\x00"
_ID_AT = slice(68, 72)
_TRACES = (b"CREATE TABLE outbox (", b"CREATE TABLE said (")
"""What SQLite keeps of the schema, word for word; in no other program's file."""
_CHUNK = 1 << 20
_LOOK = 64 * _CHUNK
"""Bytes of a damaged file that are searched for traces."""
_NAMED = 3


def foreign(path: Path, tables: frozenset[str]) -> str | None:
    """Why what is at `path` is no state file of gliderwatch, in words; None where it is one, or where there
    is nothing yet.

    `tables` are the names of all that a state file has. Nothing is written, not even beside the file. One of
    ours that is damaged is ours. What cannot be read, and folders, are left to who opens them.
    """
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            return None if stat.S_ISDIR(mode) else "it is no regular file"
        with path.open("rb") as file:
            head = file.read(4096)
    except (OSError, ValueError):
        return None
    return _stranger(path, head, tables) if head else None


def _stranger(path: Path, head: bytes, ours: frozenset[str]) -> str | None:
    if not head.startswith(_MAGIC):
        if _is_text(head):
            return "it is a text file"
        return None if _has_traces(path) else "it is not a database"
    number = int.from_bytes(head[_ID_AT])
    return None if number == APPLICATION_ID else _without_our_number(path, number, ours)


def _without_our_number(path: Path, number: int, ours: frozenset[str]) -> str | None:
    try:
        others = _tables(path) - ours
    except sqlite3.DatabaseError:
        return None if _has_traces(path) else "it is a database of another program, and damaged"
    if number:
        return "it is a database of another program" + _named(others)
    return f"it is a database with tables of another program{_named(others)}" if others else None


def _named(tables: frozenset[str]) -> str:
    names = sorted(tables)[:_NAMED]
    return f" ({', '.join(names)}{', ...' if len(tables) > _NAMED else ''})" if names else ""


def _tables(path: Path) -> frozenset[str]:
    """The tables, views and the like in the file itself; its log is not read, so that nothing is made."""
    uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(uri, uri=True)) as db:
        db.text_factory = lambda raw: raw.decode("utf-8", "replace")
        rows = db.execute("SELECT tbl_name FROM sqlite_master WHERE name NOT LIKE 'sqlite!_%' ESCAPE '!'")
        return frozenset(row[0] for row in rows)


def _is_text(head: bytes) -> bool:
    if b"\x00" in head:
        return False
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start > len(head) - 4  # a letter that was cut
    return True


def _has_traces(path: Path) -> bool:
    """Whether the schema of a state file is in what is left of it, or in its log."""
    for part in (path, path.with_name(path.name + "-wal")):
        try:
            with part.open("rb") as file:
                before = b""
                while file.tell() < _LOOK and (chunk := file.read(_CHUNK)):
                    if any(trace in before + chunk for trace in _TRACES):
                        return True
                    before = chunk[-64:]
        except OSError:
            continue
    return False
