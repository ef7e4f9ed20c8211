"""Opening the state file: is it gliderwatch's, settings, schema, migrations."""

from __future__ import annotations

import re
import sqlite3
import stat
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

from gliderwatch.errors import DamagedError, StateError
from gliderwatch.store import conversion

# ----------------------------------------
# Whose file is it? A state file of gliderwatch is told from everything else by its content.
#
# SQLite keeps a number for the program that a file belongs to
# (https://sqlite.org/pragma.html#pragma_application_id). Files of earlier releases, which have none, are
# known by their tables; damaged ones by what is left of them.

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


# ----------------------------------------
# Opening the state file: settings, schema, migrations.

__all__ = [
    "MEMORY",
    "SCHEMA",
    "StateError",
    "connect",
    "guarded",
    "read_only",
    "refuse_foreign",
    "schema",
]

SCHEMA = 15
DELIVERY_BY_WORDS = """CASE
    WHEN delivered_at IS NULL THEN 'pending' WHEN error = '' THEN 'delivered'
    WHEN error LIKE 'withdrawn: %' THEN 'withdrawn' WHEN error LIKE 'given up: %' THEN 'unreadable'
    WHEN error LIKE 'refused: only some took it: %' THEN 'partly_refused' ELSE 'refused' END"""
"""SQL: how it stands with a row of the outbox of schema 4 or before, which said it in words alone."""
MIGRATIONS: dict[int, str] = {
    2: """
CREATE TABLE expected (           -- the next surfacing, as expected after each segment
    glider    TEXT NOT NULL,
    segment   TEXT NOT NULL,
    opened_at REAL NOT NULL,
    after     REAL NOT NULL,      -- the surfacing that it rests upon
    data      TEXT NOT NULL,
    PRIMARY KEY (glider, segment)
) STRICT;
CREATE INDEX expected_in_order ON expected (glider, after, opened_at);
CREATE TABLE heard (              -- signs of life: every segment of which a file came, read or not
    glider    TEXT NOT NULL,
    segment   TEXT NOT NULL,
    opened_at REAL NOT NULL,      -- by the glider's clock
    last_t    REAL,               -- its last sample; NULL where it is not read
    at        REAL NOT NULL,      -- when the first file of it came
    PRIMARY KEY (glider, segment)
) STRICT;
CREATE INDEX heard_in_order ON heard (glider, opened_at);
UPDATE segments SET checkpoint = NULL;  -- a glider's next file has it estimated anew, from all its segments
""",
    3: """
CREATE TABLE mutes (              -- gliders of which nothing is told, by the command `mute`
    glider TEXT PRIMARY KEY,
    until  REAL NOT NULL,
    at     REAL NOT NULL          -- when that was told
) STRICT;
CREATE TABLE acks (               -- incidents that somebody has taken on, by the command `ack`
    incident TEXT PRIMARY KEY,
    glider   TEXT NOT NULL,
    at       REAL NOT NULL,
    data     TEXT NOT NULL
) STRICT;
CREATE INDEX acks_by_glider ON acks (glider);
""",
    4: """
ALTER TABLE outbox ADD COLUMN held_until REAL NOT NULL DEFAULT 0;     -- not sent before; infinite: never
ALTER TABLE outbox ADD COLUMN escalates REAL NOT NULL DEFAULT 9e999;  -- while nobody acknowledges, sent then
CREATE INDEX outbox_by_delivery ON outbox (delivered_at);
""",
    5: f"""
ALTER TABLE outbox ADD COLUMN delivery TEXT NOT NULL DEFAULT 'pending';  -- `alerts.worker.Delivery`
UPDATE outbox SET delivery = {DELIVERY_BY_WORDS};
ALTER TABLE files ADD COLUMN hindrance TEXT NOT NULL DEFAULT '';  -- why it is not taken: `model.Hindrance`
UPDATE files SET hindrance = CASE WHEN status = 'duplicate' AND reason = 'was renamed' THEN 'renamed'
    WHEN status = 'waiting' AND crc != '' THEN 'no_cache'
    WHEN status = 'waiting' AND reason LIKE 'is not there any more%' THEN 'gone'
    WHEN status = 'waiting' THEN 'unreadable'
    WHEN status = 'quarantined' AND reason LIKE 'cannot be assessed%' THEN 'not_assessed'
    WHEN status = 'quarantined' THEN 'damaged' ELSE '' END;
CREATE INDEX files_by_segment ON files (glider, segment);
""",
    6: """
CREATE TABLE segments_6 (
    glider       TEXT NOT NULL,
    opened_at    REAL NOT NULL,        -- as corrected: the glider's clock and clock_offset
    name         TEXT NOT NULL,        -- not unique: a mission counter may begin again
    completeness TEXT NOT NULL,
    milestone    INTEGER NOT NULL,     -- 1 where the checkpoint is kept for good
    last_t       REAL NOT NULL,        -- its last sample, by the glider's clock
    clock_offset REAL NOT NULL DEFAULT 0,  -- added to the glider's clock (s)
    clock_step   REAL NOT NULL DEFAULT 0,  -- by how much that was set back before it (s; 0: not)
    segment      BLOB NOT NULL,        -- its times are those of the glider's clock
    checkpoint   BLOB,                 -- NULL where thinned out: the next older one is gone on from
    PRIMARY KEY (glider, opened_at, name)
) STRICT;
INSERT INTO segments_6 (glider, opened_at, name, completeness, segment, checkpoint, milestone, last_t)
    SELECT s.glider, s.opened_at, s.name, s.completeness, s.segment, s.checkpoint, s.milestone,
        coalesce(h.last_t, s.opened_at)
    FROM segments s LEFT JOIN heard h ON h.glider = s.glider AND h.segment = s.name;
DROP TABLE segments;
ALTER TABLE segments_6 RENAME TO segments;
CREATE INDEX segments_by_name ON segments (glider, name);
CREATE INDEX segments_to_resume_from ON segments (glider, opened_at, name) WHERE checkpoint IS NOT NULL;
CREATE INDEX segments_with_step ON segments (glider) WHERE clock_step != 0;
CREATE TABLE heard_6 (
    glider       TEXT NOT NULL,
    segment      TEXT NOT NULL,
    opened_at    REAL NOT NULL,        -- as corrected
    last_t       REAL,                 -- as corrected; NULL where it is not read
    at           REAL NOT NULL,
    clock_offset REAL NOT NULL DEFAULT 0,
    PRIMARY KEY (glider, opened_at, segment)
) STRICT;
INSERT INTO heard_6 (glider, segment, opened_at, last_t, at)
    SELECT glider, segment, opened_at, last_t, at FROM heard;
DROP TABLE heard;
ALTER TABLE heard_6 RENAME TO heard;
CREATE INDEX heard_by_segment ON heard (glider, segment);
CREATE INDEX heard_by_arrival ON heard (glider, at);
CREATE TABLE expected_6 (
    glider    TEXT NOT NULL,
    segment   TEXT NOT NULL,
    opened_at REAL NOT NULL,
    after     REAL NOT NULL,
    data      TEXT NOT NULL,
    PRIMARY KEY (glider, opened_at, segment)
) STRICT;
INSERT INTO expected_6 SELECT glider, segment, opened_at, after, data FROM expected;
DROP TABLE expected;
ALTER TABLE expected_6 RENAME TO expected;
CREATE INDEX expected_in_order ON expected (glider, after, opened_at);
""",
    7: """
CREATE TABLE calls (              -- what the log of each call has told
    path   TEXT PRIMARY KEY,
    glider TEXT NOT NULL,         -- as the log says; empty while it has not
    began  REAL NOT NULL,         -- by the glider's clock, as is last_t
    last_t REAL NOT NULL,
    at     REAL NOT NULL,         -- when it came
    call   TEXT NOT NULL,         -- `model.Call`
    dialog TEXT NOT NULL          -- how far it is read: `ingest.calls.Dialog`
) STRICT;
CREATE INDEX calls_in_order ON calls (glider, last_t);
""",
    8: """
CREATE TABLE field_settings (     -- by which settings each field of `fields:` is made
    field TEXT PRIMARY KEY,
    key   TEXT NOT NULL
) STRICT;
CREATE TABLE field_batches (      -- samples of a segment for a field: `fleet.batches.packed`
    field   TEXT NOT NULL,
    id      TEXT NOT NULL,        -- the same at all relays
    glider  TEXT NOT NULL,
    first_t REAL NOT NULL,
    last_t  REAL NOT NULL,
    data    BLOB NOT NULL,
    PRIMARY KEY (field, id)
) STRICT;
CREATE INDEX field_batches_in_order ON field_batches (field, last_t);
CREATE TABLE field_checkpoints (  -- what is known after a bin: `fleet.scalar_field.Information`
    field TEXT NOT NULL,
    bin   INTEGER NOT NULL,
    data  BLOB NOT NULL,
    PRIMARY KEY (field, bin)
) STRICT;
CREATE TABLE field_soundings (    -- the least water depth (m) in cells of 0.01 degrees
    field TEXT NOT NULL,
    lat   INTEGER NOT NULL,
    lon   INTEGER NOT NULL,
    depth REAL NOT NULL,
    PRIMARY KEY (field, lat, lon)
) STRICT;
CREATE TABLE field_advice (       -- where each glider should look next: `fleet.advice.Advice`
    field  TEXT NOT NULL,
    glider TEXT NOT NULL,
    t      REAL NOT NULL,         -- the surfacing
    data   TEXT NOT NULL,
    PRIMARY KEY (field, glider)
) STRICT;
""",
    9: """
CREATE TABLE layers (             -- layers of the sea after each segment, and the advice that followed
    glider    TEXT NOT NULL,
    opened_at REAL NOT NULL,
    segment   TEXT NOT NULL,
    t         REAL NOT NULL,      -- of the advice
    data      TEXT NOT NULL,      -- `layers.advice.Layered`
    PRIMARY KEY (glider, opened_at, segment)
) STRICT;
""",
    10: """
CREATE TABLE health (             -- readings of each segment and call, and what the rules found in them
    source   TEXT PRIMARY KEY,    -- name of a segment, or path of a log
    glider   TEXT NOT NULL,
    t        REAL NOT NULL,       -- its last reading, by the glider's clock
    readings TEXT NOT NULL,
    judged   TEXT                 -- `health.rules.Judged`; NULL: it is to be judged
) STRICT;
CREATE INDEX health_in_order ON health (glider, t);
CREATE INDEX health_to_judge ON health (glider, t) WHERE judged IS NULL;
""",
    11: """
UPDATE said SET data = notified_of_schema_10(data);
""",
    12: """
ALTER TABLE field_batches ADD COLUMN crc INTEGER NOT NULL DEFAULT 0;      -- of id and data
ALTER TABLE field_batches ADD COLUMN to_send INTEGER NOT NULL DEFAULT 0;  -- 1: no broker has it yet
UPDATE field_batches SET crc = crc_of_batch(id, data);
CREATE INDEX field_batches_by_crc ON field_batches (field, first_t, crc);
CREATE INDEX field_batches_to_send ON field_batches (field, id) WHERE to_send = 1;
CREATE TABLE relays (             -- how it stands with the exchange of batches: `fleet.exchange`
    name  TEXT PRIMARY KEY,       -- of another relay; empty: this one's connection to the broker
    t     REAL NOT NULL,          -- since when, or when it was last heard of
    data  TEXT NOT NULL           -- `store.relays.Link` or `store.relays.Neighbour`
) STRICT;
""",
    13: "",  # checkpoints are of layout 5
    14: "",  # checkpoints are of layout 6
    15: "",  # checkpoints are of layout 8
}
"""SQL that leads from the schema before to the one of the key. It may call the functions of
`conversion.ROW_CONVERTERS`. Only the 2nd sets checkpoints to NULL: nothing before it had `state.keep_days`,
so all could be made again. A state file is never written by an older gliderwatch than the one that migrated
it."""
MEMORY = ":memory:"
DAMAGE = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB})
"""Codes of SQLite for a file whose content makes no sense."""
_ROOM = "make room on its disk: it goes on by itself, nothing is lost"
_WRITE = "let the user of the service write there, on a disk that is not mounted read-only"
_CURES = {
    sqlite3.SQLITE_ERROR: "systemctl restart gliderwatch, which takes on a file of an earlier release",
    sqlite3.SQLITE_FULL: _ROOM,
    sqlite3.SQLITE_IOERR: f"see what the kernel says of its disk (dmesg); where that is full, {_ROOM}",
    sqlite3.SQLITE_READONLY: _WRITE,
    sqlite3.SQLITE_CANTOPEN: _WRITE,
    sqlite3.SQLITE_PERM: _WRITE,
    sqlite3.SQLITE_BUSY: "end the program that holds it locked",
    sqlite3.SQLITE_LOCKED: "end the program that holds it locked",
}


@contextmanager
def guarded(path: Path | str) -> Iterator[None]:
    """What SQLite cannot do inside with the file at `path` is raised as StateError or DamagedError.

    Its errors that are mistakes in the program (a constraint, a closed connection) stay what they are.
    """
    try:
        yield
    except (sqlite3.IntegrityError, sqlite3.ProgrammingError, sqlite3.DataError, sqlite3.NotSupportedError):
        raise
    except sqlite3.Error as error:
        raise _state_error(path, error) from error


def primary(error: sqlite3.Error) -> int:
    """The primary result code of SQLite (https://sqlite.org/rescode.html); 0 where it gave none."""
    code: int = getattr(error, "sqlite_errorcode", 0)
    return code & 0xFF


def _state_error(path: Path | str, error: sqlite3.Error) -> StateError:
    if primary(error) in DAMAGE:
        return DamagedError(f"state file {path} is damaged: {error}")
    cure = _CURES.get(primary(error))
    return StateError(
        f"state file {path} cannot be used: {error}" + (f". What to do: {cure}" if cure else "")
    )


def connect(path: Path | str, *, durable: bool = True) -> sqlite3.Connection:
    """A connection to the state file, made or migrated if need be.

    `durable`: a commit survives a power cut (the daemon's state); not needed for a replay, which can be run
    again. Raises StateError.
    """
    if path != MEMORY:
        refuse_foreign(Path(path))
        _make_folder(Path(path))
    with guarded(path):
        connection = sqlite3.connect(
            path, timeout=30.0, isolation_level=None, check_same_thread=False, factory=_Connection
        )
        try:
            if (
                connection.execute("PRAGMA page_count").fetchone()[0] == 0
            ):  # of no effect after the next lines
                connection.execute("PRAGMA auto_vacuum = INCREMENTAL")
                connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")  # before all else in the file
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute(f"PRAGMA synchronous = {'FULL' if durable else 'OFF'}")
            connection.execute("PRAGMA foreign_keys = ON")
            connection.row_factory = sqlite3.Row
            _migrate(connection, path)
            if path != MEMORY:
                status = Path(path).stat()
                _OURS.add((status.st_dev, status.st_ino))
        except BaseException:
            connection.close()
            raise
    return connection


def read_only(path: Path) -> sqlite3.Connection:
    """A connection that only reads, for `status`. Raises StateError where there is no state file."""
    if not path.exists():
        raise StateError(f"there is no state file {path}: has the daemon run with this configuration?")
    refuse_foreign(path)
    with guarded(path):
        uri = f"{path.absolute().as_uri()}?mode=ro"
        connection = sqlite3.connect(uri, uri=True, timeout=30.0, factory=_Connection)
        try:
            connection.row_factory = sqlite3.Row
            _check_version(connection.execute("PRAGMA user_version").fetchone()[0], path)
        except BaseException:
            connection.close()
            raise
    return connection


class _Connection(sqlite3.Connection):
    """A connection that remembers which tables it has seen: none ever goes."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.seen: set[str] = set()


def has_table(connection: sqlite3.Connection, name: str) -> bool:
    """Whether there is such a table: a file of an earlier release, not migrated yet, may be looked at."""
    seen = connection.seen if isinstance(connection, _Connection) else set[str]()
    if name in seen:
        return True
    sql = "SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = ?"
    if connection.execute(sql, (name,)).fetchone() is None:
        return False
    seen.add(name)
    return True


def refuse_foreign(path: Path, cure: str = "Name another file in state.path, or move this one away") -> None:
    """Raises StateError where there is a file at `path` that is not gliderwatch's. Nothing is written.

    A file is looked at once in a process, before any connection to it: to close a file drops the locks that
    SQLite holds on it anywhere in the process, and another program would then take its log away.
    """
    try:
        status = path.stat()
    except OSError:
        return
    if (status.st_dev, status.st_ino) in _OURS:
        return
    why = foreign(path, _table_names())
    if why is not None:
        raise StateError(f"state file {path} is not gliderwatch's: {why}. It is left alone. {cure}")
    _OURS.add((status.st_dev, status.st_ino))


_OURS: set[tuple[int, int]] = set()
"""Device and inode of the files of this process that are ours."""


@cache
def _table_names() -> frozenset[str]:
    return frozenset(re.findall(r"CREATE TABLE (\w+)", "\n".join([schema(), *MIGRATIONS.values()])))


def _make_folder(path: Path) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StateError(
            f"folder of the state file {path} cannot be made: {error.strerror}. "
            "Choose another state.path, or let the user of the service write there"
        ) from None


def _check_version(version: int, path: Path | str) -> None:
    if version > SCHEMA:
        raise StateError(
            f"state file {path} has schema {version}, this gliderwatch knows up to {SCHEMA}: "
            "install the newer gliderwatch again, or name another state.path"
        )


def _migrate(connection: sqlite3.Connection, path: Path | str) -> None:
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    _check_version(version, path)
    if version == SCHEMA:
        if (
            connection.execute("PRAGMA application_id").fetchone()[0] != APPLICATION_ID
        ):  # of an earlier release
            connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        return
    steps = [] if version else [schema()]
    steps += [MIGRATIONS[v] for v in range(max(version, 1) + 1, SCHEMA + 1)]
    for name, convert in conversion.ROW_CONVERTERS.items():
        connection.create_function(name, 1, _on_text(convert), deterministic=True)
    connection.create_function("crc_of_batch", 2, crc_of_batch, deterministic=True)
    with closing(connection.cursor()) as cursor:
        cursor.executescript(
            "BEGIN IMMEDIATE;\n"
            + "\n".join(steps)
            + f"\nPRAGMA application_id = {APPLICATION_ID};\nPRAGMA user_version = {SCHEMA};\nCOMMIT;"
        )


def crc_of_batch(identity: str, data: bytes) -> int:
    """The checksum by which relays see whether they have the same batch."""
    return zlib.crc32(data, zlib.crc32(identity.encode()))


def _on_text(convert: conversion.Converter) -> Callable[[str], str]:
    """A converter as a function of SQL: from JSON text to JSON text."""
    return lambda text: msgspec.json.encode(convert(msgspec.json.decode(text))).decode()


def schema() -> str:
    """The SQL of schema 1, before all migrations."""
    return files("gliderwatch.store").joinpath("schema.sql").read_text(encoding="utf-8")
