"""Opening the state file, also when it is damaged: set aside, made anew, and the operator is told."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import structlog

from gliderwatch.alerts import message
from gliderwatch.config import Config
from gliderwatch.errors import DamagedError
from gliderwatch.model import Alert, Severity
from gliderwatch.rules.waiting import NO_INCIDENT, deliveries
from gliderwatch.run import logs, operator
from gliderwatch.store import damage
from gliderwatch.store.database import refuse_foreign
from gliderwatch.store.sqlite import Store

log = structlog.get_logger(__name__)


def open_state(config: Config) -> Store:
    """The state of a configuration, in use by nobody else. Raises StateError where it cannot be used."""
    path = Path(config.state.path)
    refuse_foreign(path)
    found = damage.damage(path)
    if found is not None:
        set_aside(path, found)
    try:
        store = Store.open(path)
    except DamagedError as error:
        set_aside(path, str(error))
        store = Store.open(path)
    for aside in damage.asides(path):
        _tell(aside, config)
    return store


def set_aside(path: Path, reason: str) -> None:
    """Put a damaged state file out of the way. Raises StateError where it cannot be renamed."""
    aside = damage.set_aside(path, time.time())
    log.error(
        "state file is damaged, set aside, made anew from the files",
        path=str(path),
        reason=reason,
        kept=str(aside),
    )


def _tell(aside: Path, config: Config) -> None:
    """Save what can be of a damaged file and tell the operator; once for each, also after a power cut."""
    now = time.time()

    def report(saved: int) -> Alert:
        text = (
            f"It was found damaged and set aside as {aside.name}. All is made anew from the files on the "
            f"dockserver; dives of files that are not there any more are lost. {saved} messages, told or to "
            "be told, were saved from it.\nLook after the disk. Delete the damaged file when nobody needs it."
        )
        return message.operator(
            "the state file was damaged",
            text,
            now,
            alert_id=f"state/{aside.name}",
            severity=Severity.WARNING,
            audience=Severity.WARNING,
        )

    waits = operator.channels(config, Severity.WARNING, "state")
    channels = deliveries(report(0), waits, now, lambda channel: NO_INCIDENT)
    alert = damage.restore(Path(config.state.path), aside, report, channels)
    if alert is not None:
        logs.alerts([alert])


@contextmanager
def setting_aside(path: Path) -> Iterator[None]:
    """A state file that is found damaged inside is set aside; the next start makes it anew."""
    try:
        yield
    except DamagedError as error:
        set_aside(path, str(error))
        raise
