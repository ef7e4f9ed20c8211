"""The lock and the sign of life of a daemon."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from gliderwatch.errors import StateError
from gliderwatch.service.liveness import PidLock, alive_path, is_held, seconds_silent


@pytest.fixture
def state(tmp_path: Path) -> Path:
    return tmp_path / "made" / "state.sqlite"


def test_one_daemon_holds_a_state_file(state: Path) -> None:
    assert not is_held(state)
    life = PidLock(state)
    assert is_held(state)
    with pytest.raises(StateError, match="another gliderwatch uses"):
        PidLock(state)
    assert is_held(state)
    life.end()
    assert not is_held(state)
    PidLock(state).end()


def test_to_look_does_not_take_the_lock(state: Path) -> None:
    PidLock(state).end()
    assert not is_held(state)
    PidLock(state).end()


def test_a_sign_of_life_is_seen(state: Path) -> None:
    assert seconds_silent(state) is None
    life = PidLock(state)
    os.utime(alive_path(state), (0, time.time() - 500))
    assert seconds_silent(state) == pytest.approx(500, abs=60)
    life.beat()
    assert seconds_silent(state) == pytest.approx(0, abs=60)
    life.end()


def test_a_sign_of_life_of_the_future_is_no_negative_silence(state: Path) -> None:
    PidLock(state).end()
    os.utime(alive_path(state), (0, time.time() + 500))
    assert seconds_silent(state) == 0.0


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(StateError, match=r"cannot be written: .* Choose another state.path"):
        PidLock(tmp_path / "file" / "state.sqlite")
