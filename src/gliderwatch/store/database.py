"""Opening the state file: settings, schema, migrations."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from importlib.resources import files
from pathlib import Path

from gliderwatch.errors import GliderwatchError

SCHEMA = 2
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
}
"""SQL that leads from the schema before to the one of the key. A state file is never written by an older
gliderwatch than the one that migrated it."""
MEMORY = ":memory:"


class StateError(GliderwatchError):
    """The state file cannot be used; the text says which and what to do."""


def connect(path: Path | str, *, durable: bool = True) -> sqlite3.Connection:
    """A connection to the state file, made or migrated if need be.

    `durable`: a commit survives a power cut (the daemon's state); not needed for a replay, which can be run
    again. Raises StateError.
    """
    if path != MEMORY:
        _make_folder(Path(path))
    try:
        connection = sqlite3.connect(path, timeout=30.0, isolation_level=None, check_same_thread=False)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute(f"PRAGMA synchronous = {'FULL' if durable else 'OFF'}")
        connection.execute("PRAGMA foreign_keys = ON")
        connection.row_factory = sqlite3.Row
        _migrate(connection, path)
    except sqlite3.Error as error:
        raise StateError(f"state file {path} cannot be used: {error}") from None
    return connection


def read_only(path: Path) -> sqlite3.Connection:
    """A connection that only reads, for `status`. Raises StateError where there is no state file."""
    if not path.exists():
        raise StateError(f"there is no state file {path}: has the daemon run with this configuration?")
    try:
        connection = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=30.0)
        connection.row_factory = sqlite3.Row
        _check_version(connection.execute("PRAGMA user_version").fetchone()[0], path)
    except sqlite3.Error as error:
        raise StateError(f"state file {path} cannot be read: {error}") from None
    return connection


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
        return
    steps = [] if version else [schema()]
    steps += [MIGRATIONS[v] for v in range(max(version, 1) + 1, SCHEMA + 1)]
    with closing(connection.cursor()) as cursor:
        cursor.executescript(
            "BEGIN IMMEDIATE;\n" + "\n".join(steps) + f"\nPRAGMA user_version = {SCHEMA};\nCOMMIT;"
        )


def schema() -> str:
    """The SQL of schema 1, before all migrations."""
    return files("gliderwatch.store").joinpath("schema.sql").read_text(encoding="utf-8")
