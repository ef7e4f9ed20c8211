"""The thread of one channel: a slow or dead channel holds up its own messages alone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from queue import SimpleQueue
from typing import Protocol

from gliderwatch.alerts.channels import DeliveryError
from gliderwatch.model import Alert


class Delivery(StrEnum):
    """How it stands with one message on one channel."""

    PENDING = "pending"
    DELIVERED = "delivered"
    REFUSED = "refused"
    PARTLY_REFUSED = "partly_refused"
    UNREADABLE = "unreadable"
    WITHDRAWN = "withdrawn"


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
    """What became of a row: ``PENDING`` is to be tried again. ``error`` has the failure in words."""

    row: OutboxRow
    error: str
    delivery: Delivery
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
            begun, error, delivery = time.monotonic(), "", Delivery.DELIVERED
            try:
                self.channel.send(row.alert)
            except DeliveryError as failure:
                error, delivery = str(failure), _delivery(failure)
            except Exception as failure:  # a text of unknown making could hold a secret
                error, delivery = f"unexpected {type(failure).__name__}", Delivery.PENDING
            self._report(Result(row, error, delivery, time.monotonic() - begun, self))


def _delivery(failure: DeliveryError) -> Delivery:
    """How it stands with a message after a channel failed to take it."""
    if not failure.permanent:
        return Delivery.PENDING
    return Delivery.PARTLY_REFUSED if failure.partly else Delivery.REFUSED
