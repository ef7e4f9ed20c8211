"""The thread of one channel: a slow or dead channel holds up its own messages alone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Protocol

from gliderwatch.alerts.channels import DeliveryError
from gliderwatch.model import Alert


@dataclass(frozen=True, slots=True)
class OutboxRow:
    """One alert for one channel; ``attempts`` counts the failed ones so far.

    ``unacknowledged``: it goes out because nobody acknowledged its incident for so long (s; None: it does
    not).
    """

    id: int
    alert: Alert
    channel: str
    attempts: int
    unacknowledged: float | None = None


class Sender(Protocol):
    """What the dispatcher needs of a channel (`channels.Channel`)."""

    def prepare(self) -> None:
        """Load what the first message would otherwise wait for."""
        ...

    def send(self, alert: Alert) -> None:
        """Deliver, or raise DeliveryError."""
        ...


@dataclass(frozen=True, slots=True)
class Result:
    """What became of a row: no ``error`` means delivered; ``refused``: for good."""

    row: OutboxRow
    error: str | None
    refused: bool
    seconds: float
    worker: Worker


class Worker:
    """The thread of one channel: sends one row at a time and reports to the dispatcher."""

    def __init__(self, name: str, channel: Sender, report: Callable[[Result], None]) -> None:
        self.name, self.channel, self._report = name, channel, report
        self.row: OutboxRow | None = None
        self.since = 0.0
        self._inbox: SimpleQueue[OutboxRow | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=f"channel-{name}", daemon=True)
        self._thread.start()

    def give(self, row: OutboxRow) -> None:
        """Let it send a row; only while ``row`` is None."""
        self.row, self.since = row, time.monotonic()
        self._inbox.put(row)

    def end(self) -> None:
        """Let the thread end after what it does now."""
        self._inbox.put(None)

    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def _run(self) -> None:
        with suppress(Exception):  # the first send tells what is wrong with the channel
            self.channel.prepare()
        while (row := self._inbox.get()) is not None:
            begun, error, refused = time.monotonic(), None, False
            try:
                self.channel.send(row.alert)
            except DeliveryError as failure:
                error, refused = str(failure), failure.permanent
            except Exception as failure:  # a text of unknown making could hold a secret
                error = f"unexpected {type(failure).__name__}"
            self._report(Result(row, error, refused, time.monotonic() - begun, self))
