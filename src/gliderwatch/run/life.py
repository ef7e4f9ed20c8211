"""The file beside the state file that a daemon locks, so that it is alone, and touches as a sign of life."""

from __future__ import annotations

import fcntl
import os
import time
from pathlib import Path
from typing import BinaryIO

from gliderwatch.errors import StateError

BEAT = 10.0
"""Seconds between two signs of life."""
STALE = 6 * BEAT
"""Seconds without a sign of life after which a daemon is taken for stuck."""
_PATIENCE = 1.0
"""Seconds for which a lock is tried: `is_held` takes it for a moment."""


class Life:
    """The lock of a state file, held from now on. Raises StateError where another daemon holds it."""

    def __init__(self, state: Path) -> None:
        self._folder, self._file = state.parent, _open(alive_path(state))
        deadline = time.monotonic() + _PATIENCE
        while not _try(self._file, fcntl.LOCK_EX):
            if time.monotonic() > deadline:
                self._file.close()
                raise StateError(f"another gliderwatch uses the state file {state}: stop it first")
            time.sleep(0.05)

    def beat(self) -> None:
        """Give a sign of life. Raises StateError where its folder cannot be written any more."""
        try:
            os.utime(self._file.fileno())
        except OSError as error:
            raise StateError(
                f"folder {self._folder} cannot be written: {error.strerror}. "
                "Let the user of the service write there, on a disk that is not mounted read-only"
            ) from None

    def end(self) -> None:
        """Let go of the lock."""
        self._file.close()


def alive_path(state: Path) -> Path:
    """The file that the daemon with this state file locks and touches."""
    return state.with_name(state.name + ".alive")


def is_held(state: Path) -> bool:
    """Whether a daemon has this state file now."""
    try:
        with alive_path(state).open("rb") as file:
            return not _try(file, fcntl.LOCK_SH)
    except OSError:
        return False


def silence(state: Path) -> float | None:
    """Seconds since the last sign of life of a daemon with this state file; None: there was never one."""
    try:
        return max(0.0, time.time() - alive_path(state).stat().st_mtime)
    except OSError:
        return None


def _open(path: Path) -> BinaryIO:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("ab")
    except OSError as error:
        raise StateError(
            f"{path} cannot be written: {error.strerror}. "
            "Choose another state.path, or let the user of the service write there"
        ) from None


def _try(file: BinaryIO, kind: int) -> bool:
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
