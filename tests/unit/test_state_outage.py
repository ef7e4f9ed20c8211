"""What the daemon does while its state cannot be used."""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest
import structlog

from gliderwatch.errors import DamagedError, StateError
from gliderwatch.service import state_outage
from gliderwatch.service.state_outage import StateOutage
from gliderwatch.store.state_file import Store


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setattr(state_outage, "PAUSE", 0.0)
    return Store.open(tmp_path / "state.sqlite")


def test_no_turn_is_done_until_the_state_can_be_written_again(store: Store) -> None:
    """A turn may find nothing to write, and must not give a sign of life then."""
    turns: list[int] = []

    def turn() -> None:
        turns.append(1)
        if len(turns) == 1:
            store.probe()

    watch = StateOutage(store, lambda: False)
    store._db.execute("PRAGMA query_only = 1")
    assert [watch.spared(turn) for _ in range(3)] == [False] * 3 and len(turns) == 1
    store._db.execute("PRAGMA query_only = 0")
    assert watch.spared(turn) and len(turns) == 2


def test_what_sqlite_says_outside_a_transaction_is_trouble_too(store: Store) -> None:
    store.close()
    path = Path(store._path)
    path.write_bytes(b"")
    bare = Store(sqlite3.connect(path), path)
    assert not StateOutage(bare, lambda: False).spared(lambda: print(bare.counts()))


def test_damage_and_mistakes_are_not_waited_for(store: Store) -> None:
    watch = StateOutage(store, lambda: False)
    for error in (DamagedError("bad"), ZeroDivisionError()):

        def turn(error: Exception = error) -> None:
            raise error

        with pytest.raises(type(error)):
            watch.spared(turn)


def test_it_ends_at_once_when_it_is_told_to(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state_outage, "PAUSE", 1e6)

    def turn() -> None:
        raise StateError("full")

    assert not StateOutage(store, lambda: True).spared(turn)


def events(watch: StateOutage, turn: Callable[[], None], turns: int) -> list[str]:
    with structlog.testing.capture_logs() as log:
        for _ in range(turns):
            watch.spared(turn)
    return [entry["event"] for entry in log]


SAID, OVER = "state cannot be used, tried again", "state can be used again"


def test_while_no_room_is_made_it_is_said_once(store: Store) -> None:
    """A small write succeeds on the full disk, what comes next does not: that is no good news."""
    room = False

    def turn() -> None:
        if not room:
            raise StateError("full")

    watch = StateOutage(store, lambda: False)
    assert events(watch, turn, 5) == [SAID]
    room = True
    assert events(watch, turn, 2) == [OVER]


def test_a_turn_with_nothing_to_do_is_no_good_news_on_a_full_disk(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    outcomes = iter([StateError("full"), None, None, None])

    def turn() -> None:
        if (error := next(outcomes)) is not None:
            raise error

    watch = StateOutage(store, lambda: False)
    with monkeypatch.context() as disk:
        disk.setattr(os, "posix_fallocate", full)
        assert events(watch, turn, 3) == [SAID]
    assert events(watch, turn, 1) == [OVER]
    assert [path.name for path in Path(store._path).parent.iterdir() if "sqlite" not in path.name] == []
