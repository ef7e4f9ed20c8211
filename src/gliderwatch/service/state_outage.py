"""The state file cannot be used: damaged, the disk full, or read-only. It is reported, and tried again."""

from __future__ import annotations

import os
import socket
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import structlog

from gliderwatch.config import Config
from gliderwatch.errors import DamagedError, StateError
from gliderwatch.incidents.send_schedule import NO_INCIDENT, deliveries
from gliderwatch.messages import notice_text
from gliderwatch.model import Alert, Severity
from gliderwatch.service import logs, operator_alerts
from gliderwatch.service.liveness import notify
from gliderwatch.store import maintenance
from gliderwatch.store.database import refuse_foreign
from gliderwatch.store.state_file import Store

# ----------------------------------------
# The state file cannot be used: the disk is full, or read-only. It is reported, and tried again until it can.

log = structlog.get_logger(__name__)

PAUSE = 2.0
"""Seconds between two tries."""
ROOM = 1 << 20
"""Bytes that have to be free before it is tried again: one small write can succeed where the next cannot."""
_STEP = 0.2


class StateOutage:
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


# ----------------------------------------
# Opening the state file, also when it is damaged: set aside, made again, and the operator is notified.


def open_state(config: Config) -> Store:
    """The state of a configuration, in use by nobody else. Raises StateError where it cannot be used."""
    path = Path(config.state.path)
    refuse_foreign(path)
    found = maintenance.damage(path)
    if found is not None:
        set_aside(path, found)
    try:
        store = Store.open(path)
    except DamagedError as error:
        set_aside(path, str(error))
        store = Store.open(path)
    for aside in maintenance.asides(path):
        _tell(aside, config)
    return store


def set_aside(path: Path, reason: str) -> None:
    """Put a damaged state file out of the way. Raises StateError where it cannot be renamed."""
    aside = maintenance.set_aside(path, time.time())
    log.error(
        "state file is damaged, set aside, made again from the files",
        path=str(path),
        reason=reason,
        kept=str(aside),
    )


def _tell(aside: Path, config: Config) -> None:
    """Save what can be of a damaged file and tell the operator; once for each, also after a power cut."""
    now = time.time()

    def report(saved: int) -> Alert:
        text = (
            f"It was found damaged and set aside as {aside.name}. All is made again from the files on the "
            f"dockserver; dives of files that are not there any more are lost. {saved} messages, told or to "
            "be told, were saved from it.\nWhat to do: look after the disk.\n"
            "What to do: delete the damaged file when nobody needs it."
        )
        return notice_text.operator(
            "the state file was damaged",
            text,
            now,
            alert_id=f"state/{aside.name}",
            machine=socket.gethostname(),
            severity=Severity.WARNING,
            audience=Severity.WARNING,
        )

    waits = operator_alerts.channels(config, Severity.WARNING, "state")
    channels = deliveries(report(0), waits, now, lambda channel: NO_INCIDENT)
    alert = maintenance.restore(Path(config.state.path), aside, report, channels)
    if alert is not None:
        logs.alerts([alert])


@contextmanager
def setting_aside(path: Path) -> Iterator[None]:
    """A state file that is found damaged inside is set aside; the next start makes it again."""
    try:
        yield
    except DamagedError as error:
        set_aside(path, str(error))
        raise
