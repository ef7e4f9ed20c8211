"""Another program's file is never taken for a state file, and ours always is, also when it is damaged."""

from __future__ import annotations

import gzip
import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from gliderwatch.errors import StateError
from gliderwatch.store import maintenance
from gliderwatch.store.database import APPLICATION_ID, connect, read_only, refuse_foreign
from gliderwatch.store.state_file import Store

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "schema-1.sqlite.gz"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "state.sqlite"


def database(path: Path, *statements: str) -> Path:
    with closing(sqlite3.connect(path)) as db:
        for statement in statements:
            db.execute(statement)
        db.commit()
    return path


BINARY = bytes(range(256)) * 64
FOREIGN = {
    "tables": lambda p: database(p, "CREATE TABLE contacts (name)", "CREATE TABLE mails (text)"),
    "its own number": lambda p: database(p, "PRAGMA application_id = 42"),
    "its own version": lambda p: database(
        p, "PRAGMA user_version = 4", "CREATE TABLE files (x)", "CREATE TABLE z (y)"
    ),
    "a view": lambda p: database(p, "CREATE VIEW answers AS SELECT 42"),
    "its own log": lambda p: database(p, "PRAGMA journal_mode = WAL", "CREATE TABLE contacts (name)"),
    "text": lambda p: p.write_text("dear diary\n" * 999),
    "SQL of ours": lambda p: p.write_text("CREATE TABLE outbox (x);\nCREATE TABLE said (y);\n"),
    "letters that are cut": lambda p: p.write_text("x" + "ä" * 4000, encoding="utf-8"),
    "bytes": lambda p: p.write_bytes(BINARY),
    "a damaged database": lambda p: p.write_bytes(b"SQLite format 3\x00" + BINARY),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_file_of_another_program_is_refused_and_left_as_it_is(path: Path, kind: str) -> None:
    FOREIGN[kind](path)
    before = {p.name: p.read_bytes() for p in path.parent.iterdir()}
    for attempt in (refuse_foreign, connect, read_only, lambda p: maintenance.set_aside(p, 0.0)):
        with pytest.raises(StateError, match=r"is not gliderwatch's: it is .* left alone"):
            attempt(path)
    assert {p.name: p.read_bytes() for p in path.parent.iterdir()} == before


def test_a_pipe_is_refused_and_not_read(path: Path) -> None:
    os.mkfifo(path)
    with pytest.raises(StateError, match="no regular file"):
        connect(path)


def test_tables_that_gliderwatch_once_added_to_anothers_database_make_it_no_state_file(path: Path) -> None:
    path.write_bytes(gzip.decompress(GOLDEN.read_bytes()))
    refuse_foreign(path)
    path = path.with_name("another.sqlite")  # a file that was found to be ours is not looked at again
    path.write_bytes(gzip.decompress(GOLDEN.read_bytes()))
    database(path, "CREATE TABLE contacts (name)")
    with pytest.raises(StateError, match=r"tables of another program \(contacts\)"):
        Store.open(path)


def number(path: Path) -> int:
    with closing(sqlite3.connect(path)) as db:
        return int(db.execute("PRAGMA application_id").fetchone()[0])


def test_ours_has_the_number_from_its_first_byte_on(path: Path) -> None:
    with closing(Store.open(path)):
        assert path.read_bytes()[68:72] == APPLICATION_ID.to_bytes(4) == b"gldw"  # else in the log alone


@pytest.mark.parametrize("version", [1, 4])
def test_a_file_of_an_earlier_release_gets_the_number(path: Path, version: int) -> None:
    path.write_bytes(gzip.decompress(GOLDEN.read_bytes()))
    if version == 4:
        Store.open(path).close()
        database(path, "PRAGMA application_id = 0")
    assert number(path) == 0
    Store.open(path).close()
    assert number(path) == APPLICATION_ID


def test_an_empty_file_and_an_empty_database_can_become_ours(path: Path) -> None:
    for make in (lambda: path.write_bytes(b""), lambda: database(path, "PRAGMA user_version = 0", "VACUUM")):
        make()
        Store.open(path).close()
        path.unlink()


HARM = {
    "the header is zeros": lambda data: bytes(100) + data[100:],
    "the header is noise": lambda data: b"\xa5" * 100 + data[100:],
    "the first page is noise": lambda data: b"\xa5" * 4096 + data[4096:],
    "bad pages": lambda data: data[:8192] + b"\xa5" * 8192 + data[16384:],
    "cut": lambda data: data[:5000],
    "nothing": lambda data: b"",
}


@pytest.mark.parametrize("harm", HARM)
@pytest.mark.parametrize("is_old", [False, True])
def test_our_own_damaged_file_is_ours(path: Path, harm: str, is_old: bool) -> None:
    if is_old:
        path.write_bytes(gzip.decompress(GOLDEN.read_bytes()))
    else:
        Store.open(path).close()
    path.write_bytes(HARM[harm](path.read_bytes()))
    assert maintenance.damage(path)
    if is_old and harm == "the first page is noise":  # nothing is left that would tell
        with pytest.raises(StateError, match="move this one away"):
            maintenance.set_aside(path, 0.0)
        return
    refuse_foreign(path)
    assert maintenance.set_aside(path, 0.0).exists()
