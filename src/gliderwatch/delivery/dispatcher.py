"""The dispatcher: one thread takes what is due out of the outbox, one worker a channel delivers it."""

from __future__ import annotations

import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from queue import SimpleQueue
from typing import Protocol
from zlib import crc32

import structlog

from gliderwatch.delivery.channels import DeliveryError
from gliderwatch.messages import notice_text
from gliderwatch.messages.template import escalated
from gliderwatch.model import Alert, Severity

# ----------------------------------------
# The thread of one channel: a slow or dead channel holds up its own messages alone.


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


# ----------------------------------------
# The dispatcher: one thread takes what is due out of the outbox, one worker a channel delivers it.
#
# At least once: a row is marked delivered after its channel confirmed it, and tried until then. Given up is
# only what a channel refuses for good, and that is reported over the others. A channel that is slow or down
# delays no other. Messages of one incident go to one channel in their order: the store holds back a row
# while an older one of the same incident and channel is undelivered.

__all__ = ["Delivery", "Dispatcher", "OutboxRow", "OutboxStore", "Sender", "retry_delay"]

log = structlog.get_logger(__name__)

FIRST_DELAY = 5.0
LONGEST_DELAY = 900.0
HEARTBEAT = 5.0
"""Seconds between two passes when nothing wakes the dispatcher."""
_REPORT = "refused/"
"""How the ids of reports of refusals begin."""
SEND_LIMIT = 90.0
"""Seconds after which a send that has not come back counts as failed."""


class OutboxStore(Protocol):
    """What the dispatcher needs of the store. Used in the dispatcher's thread alone."""

    def due(self, now: float) -> list[OutboxRow]:
        """Undelivered rows whose next try is not after `now`, oldest first.

        Not among them: rows with an older undelivered row of the same channel and the same
        (not empty) incident, due or not.
        """
        ...

    def delivered(self, row_id: int, now: float) -> None:
        """Mark a row as delivered and commit; may be called twice."""
        ...

    def failed(self, row_id: int, error: str, next_try: float) -> None:
        """Count a failed attempt, keep its reason and when to try next, and commit.

        Without effect on a row that is delivered.
        """
        ...

    def refused(
        self,
        row_id: int,
        delivery: Delivery,
        error: str,
        now: float,
        report: Alert | None,
        channels: Iterable[str],
    ) -> None:
        """Give a row up, keep how and why, post `report` to other channels, and commit both as one."""
        ...

    def park(self, row_id: int, error: str) -> None:
        """Make a row due no more until `adopt` knows its channel, and commit."""
        ...

    def adopt(self, channels: Iterable[str]) -> None:
        """Make parked rows due whose channel is one of these, and commit."""
        ...

    def close(self) -> None:
        """Give the connection back."""
        ...


def retry_delay(attempts: int, row_id: int) -> float:
    """Seconds until the next try after `attempts` (>= 1) failed ones.

    Doubles from 5 s up to 15 min, plus up to a tenth that depends on row and attempt only, so that
    rows that failed together do not all come back together.

    >>> [round(retry_delay(n, 1)) for n in (1, 2, 3, 20)]
    [5, 10, 21, 949]
    """
    delay = min(FIRST_DELAY * 2.0 ** min(attempts - 1, 30), LONGEST_DELAY)
    return delay * (1 + 0.1 * crc32(f"{row_id}:{attempts}".encode()) / 2**32)


class Dispatcher:
    """Delivers the outbox until stopped.

    `open_store` is called in the dispatcher's own thread. Set `wake` after each commit that may have
    filled the outbox: the dispatcher then looks at once. `clock` gives the time rows are due by.
    """

    def __init__(
        self,
        open_store: Callable[[], OutboxStore],
        channels: Mapping[str, Sender],
        clock: Callable[[], float],
        wake: threading.Event,
        delay: Callable[[int, int], float] = retry_delay,
        limit: float = SEND_LIMIT,
    ) -> None:
        self._open, self._channels, self._clock, self._wake = open_store, dict(channels), clock, wake
        self._delay, self._limit = delay, limit
        self._results: deque[Result] = deque()
        self._workers: dict[str, Worker] = {}
        self._waiting: dict[int, float] = {}
        self._give_up_at: float | None = None
        self._beat = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="dispatcher", daemon=True)

    def start(self) -> None:
        """Start the threads."""
        self._thread.start()

    def stop(self, timeout: float = 2.0) -> None:
        """End within `timeout` seconds; sends on their way get most of it to be marked.

        A send that hangs is left behind in its daemon thread: its row stays undelivered.
        """
        self._give_up_at = time.monotonic() + 0.8 * timeout
        self._wake.set()
        if self._thread.ident is not None:
            self._thread.join(timeout)

    def alive(self) -> bool:
        """Whether all threads run; the workers exist from the first pass on."""
        return self._thread.is_alive() and all(w.alive() for w in list(self._workers.values()))

    def progress(self) -> float:
        """When the dispatcher last came round (s, `time.monotonic`); at most some seconds ago when well."""
        return self._beat

    def _run(self) -> None:
        store: OutboxStore | None = None
        trouble = ""
        for name, channel in self._channels.items():
            self._workers[name] = Worker(name, channel, self._report)
        while not self._finished():
            self._wake.clear()
            try:
                if store is None:
                    store = self._open()
                    store.adopt(self._channels)
                pause = self._pass(store)
                trouble, self._beat = "", time.monotonic()
            except Exception as error:  # a locked or full disk passes: this thread must not end by it
                if (failure := f"{type(error).__name__}: {error}") != trouble:
                    log.error("outbox cannot be read or written", error=failure)
                _close(store)
                store, pause, trouble = None, 1.0, failure
            self._wake.wait(pause)
        _close(store)
        for worker in self._workers.values():
            worker.end()

    def _finished(self) -> bool:
        end = self._give_up_at
        if end is None:
            return False
        busy = any(w.row is not None for w in self._workers.values())  # until its result is noted
        return not busy or time.monotonic() >= end

    def _report(self, result: Result) -> None:
        self._results.append(result)
        self._wake.set()

    def _pass(self, store: OutboxStore) -> float:
        """One round: note what came back, hand out what is due. Returns how long to wait (s)."""
        while self._results:
            self._note(store, self._results[0])
            self._results.popleft()  # only now: when the store fails, the result is noted next time
        self._replace_stuck(store)
        if self._give_up_at is not None:
            return max(0.0, min(0.1, self._give_up_at - time.monotonic()))
        now = self._clock()
        for row in sorted(store.due(now), key=lambda r: (-r.alert.severity, r.id)):
            worker = self._workers.get(row.channel)
            if worker is None:
                error = "the configuration has no such channel any more: kept until it is there again"
                store.park(row.id, error)
                log.warning("alert parked", **_about(row), reason=error)
            elif worker.row is None:
                self._waiting.pop(row.id, None)
                worker.give(_with_reason(row))
        # a row that is due but waits for its worker needs no alarm clock: the worker's report wakes us
        return min([HEARTBEAT, self._limit, *(t - now for t in self._waiting.values() if t > now)])

    def _note(self, store: OutboxStore, result: Result) -> None:
        row, worker = result.row, result.worker
        if result.delivery is Delivery.DELIVERED:
            store.delivered(row.id, self._clock())
            self._waiting.pop(row.id, None)
            seconds = round(result.seconds, 3)
            log.info("alert delivered", **_about(row), seconds=seconds)
        elif result.delivery is not Delivery.PENDING:
            self._refused(store, row, result.delivery, result.error)
        elif worker.row is not None:  # else its row was given up before, and counted
            self._failed(store, row, result.error)
        worker.row = None

    def _replace_stuck(self, store: OutboxStore) -> None:
        """Leave a send that does not come back behind, so that the channel's next message has a thread.

        Every network call has its own time limit: this is for what has none, such as name look-up.
        """
        for name, worker in list(self._workers.items()):
            if worker.row is not None and time.monotonic() - worker.since > self._limit:
                self._failed(store, worker.row, f"no answer within {self._limit:g} s")
                worker.row = None
                worker.end()
                self._workers[name] = Worker(name, worker.channel, self._report)

    def _refused(self, store: OutboxStore, row: OutboxRow, delivery: Delivery, error: str) -> None:
        now, others = self._clock(), [name for name in self._channels if name != row.channel]
        is_report = row.alert.id.startswith(_REPORT)  # of which no report is made: it would go round
        report = None if is_report or not others else _report_of(row, error, now)
        store.refused(row.id, delivery, error, now, report, others)
        self._waiting.pop(row.id, None)
        log.error("alert refused for good", **_about(row), error=error)
        if report is not None:
            self._wake.set()

    def _failed(self, store: OutboxStore, row: OutboxRow, error: str) -> None:
        delay = self._delay(row.attempts + 1, row.id)
        store.failed(row.id, error, self._clock() + delay)
        self._waiting[row.id] = self._clock() + delay
        log.warning(
            "alert not delivered",
            **_about(row),
            error=error,
            attempts=row.attempts + 1,
            retry_in=round(delay, 1),
        )


def _with_reason(row: OutboxRow) -> OutboxRow:
    """The row with a message that says so where nobody acknowledged its incident."""
    if row.unacknowledged is None:
        return row
    return replace(row, alert=escalated(row.alert, row.unacknowledged))


def _report_of(row: OutboxRow, error: str, now: float) -> Alert:
    """That a channel refused a message, for the others; one a day, whatever else the channel refuses."""
    text = (
        f"Channel {row.channel} refused for good: {error}\n"
        f"The message: {row.alert.title}\n"
        "It is not tried again there, nor are others that are refused so; `gliderwatch status` lists them. "
        f"\nWhat to do: correct the channel's URL, then try `gliderwatch test-alert --channel {row.channel}`."
    )
    return notice_text.operator(
        f"channel {row.channel} refuses messages",
        text,
        now,
        alert_id=f"{_REPORT}{row.channel}/{now // 86400:.0f}",
        machine=socket.gethostname(),
        severity=Severity.WARNING,
        audience=Severity.WARNING,
    )


def _about(row: OutboxRow) -> dict[str, str]:
    """The keys of a line about a message on its way; one to the operator is about no glider."""
    glider = {"glider": row.alert.glider} if row.alert.glider else {}
    return {"alert": row.alert.id, "channel": row.channel, **glider}


def _close(store: OutboxStore | None) -> None:
    if store is not None:
        with suppress(Exception):  # it may be what failed
            store.close()
