"""Opening the state file: settings, schema, migrations."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from importlib.resources import files
from pathlib import Path

from gliderwatch.errors import GliderwatchError

SCHEMA = 1
MIGRATIONS: dict[int, str] = {}
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
    steps = [MIGRATIONS[v] for v in range(version + 1, SCHEMA + 1)] if version else [schema()]
    if version == SCHEMA:
        return
    with closing(connection.cursor()) as cursor:
        cursor.executescript(
            "BEGIN IMMEDIATE;\n" + "\n".join(steps) + f"\nPRAGMA user_version = {SCHEMA};\nCOMMIT;"
        )


def schema() -> str:
    """The SQL of the schema."""
    return files("gliderwatch.store").joinpath("schema.sql").read_text(encoding="utf-8")
