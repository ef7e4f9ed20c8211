"""The state file cannot be used: the disk is full, or read-only. It is said, and tried again until it can."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable

import structlog

from gliderwatch.errors import DamagedError, StateError
from gliderwatch.run.notify import notify
from gliderwatch.store.sqlite import Store

log = structlog.get_logger(__name__)

PAUSE = 2.0
"""Seconds between two tries."""
ROOM = 1 << 20
"""Bytes that have to be free before it is tried again: one small write can succeed where the next cannot."""
_STEP = 0.2


class Trouble:
    """Of one daemon with its state; used in its thread.

    While it lasts no sign of life is given: a daemon that can keep nothing is not well. Nothing is lost, for
    what was not written down is as if it had not come yet.
    """

    def __init__(self, store: Store, is_stopping: Callable[[], bool]) -> None:
        self._store, self._is_stopping = store, is_stopping
        self._reason = ""
        self._since = 0.0

    def spared(self, turn: Callable[[], None]) -> bool:
        """Do one turn of a loop; False, after a pause, where the state could not be used in it.

        Raises DamagedError: then there is nothing to wait for.
        """
        try:
            with self._store.guarded():
                if self._reason:
                    self._store.probe()
                    self._reserve()
                turn()
        except DamagedError:
            raise
        except StateError as error:
            self._tell(str(error))
            self._rest()
            return False
        if self._reason:  # only now: what failed has been done, or there was nothing to do
            self._end()
        return True

    def _reserve(self) -> None:
        """Take some room on the disk of the state for a moment. Raises StateError where there is none."""
        folder = self._store.folder
        if folder is None:
            return
        try:
            with tempfile.TemporaryFile(dir=folder) as file:
                os.posix_fallocate(file.fileno(), 0, ROOM)
        except OSError:
            raise StateError(self._reason) from None

    def _tell(self, reason: str) -> None:
        if not self._reason:
            self._since = time.monotonic()
        if reason != self._reason:
            log.error("state cannot be used, tried again", reason=reason, every=PAUSE)
        self._reason = reason
        notify("WATCHDOG=1", f"STATUS=NOT WATCHING: {reason}")

    def _end(self) -> None:
        log.warning("state can be used again", seconds=round(time.monotonic() - self._since))
        self._reason = ""

    def _rest(self) -> None:
        end = time.monotonic() + PAUSE
        while time.monotonic() < end and not self._is_stopping():
            time.sleep(_STEP)
