"""The exchange of batches with other relays, in a thread of its own.

It owns the connection to the broker, and one to the state file. What is to be sent is marked in the state
file; what comes is handed to the daemon, which puts it into the fields. So a broker that is slow, down or
full of nonsense delays no message to a pilot, and what is lost on the way is found by comparison
(`fleet.exchange`): after each connection, after each change, and once an hour.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue

import structlog

from gliderwatch.config import Config
from gliderwatch.delivery.mqtt import Broker, Connection, Ears, broker_of
from gliderwatch.errors import ConfigError
from gliderwatch.fleet.batches import unpacked
from gliderwatch.fleet.constants import AHEAD
from gliderwatch.fleet.exchange import (
    FORM,
    FieldHoldings,
    Holdings,
    Parcel,
    Request,
    decode,
    differing,
    encode,
    key_of,
    parcels,
)
from gliderwatch.fleet.scalar_field import Batch
from gliderwatch.service.fields import fields_of
from gliderwatch.store.relays import Link, Neighbour, RelayRows

log = structlog.get_logger(__name__)

PAUSE = 1.0
"""s between two looks at what is to be sent."""
CALM = 5.0
"""s after which it is published what there is, once something has changed."""
COMPARISON = 3600.0
"""s after which that is published in any case."""
AT_ONCE = 40
"""Messages on their way to the broker at a time."""
PATIENCE = 30.0
"""s after which a message that the broker has not confirmed is sent again."""


@dataclass(frozen=True, slots=True)
class RelaySettings:
    """What follows from the section `relays`; ``fields`` has the checksum of the settings of each field."""

    name: str
    topic: str
    broker: Broker
    fields: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class BatchesCame:
    """News of the exchange: batches of another relay for a field."""

    field: str
    batches: tuple[Batch, ...]


def relay_settings(config: Config) -> RelaySettings | None:
    """As configured; None: there are no other relays. Raises ConfigError."""
    if config.relays.broker is None:
        return None
    url = config.secret("relays.broker", config.relays.broker)
    try:
        broker = broker_of(url, config.relays.ca)
    except ValueError as error:
        raise ConfigError(str(error)) from None
    keys = {field.name: key_of(field.key) for field in fields_of(config)}
    return RelaySettings(config.relays.name or socket.gethostname(), config.relays.topic, broker, keys)


class RelayExchange:
    """Exchanges batches until it is stopped. `news` gets a `BatchesCame` for what other relays send."""

    def __init__(self, settings: RelaySettings, state: Path, news: Callable[[BatchesCame], None]) -> None:
        self.settings, self._state, self._news = settings, state, news
        self._events: SimpleQueue[Callable[[RelayRows], None]] = SimpleQueue()
        topic, put = settings.topic, self._events.put
        self._ears = Ears(
            lambda is_up, why: put(lambda rows: self._turned(rows, is_up, why)),
            lambda where, data: put(lambda rows: self._came(rows, where, data)),
            lambda number, why: put(lambda rows: self._confirmed(rows, number, why)),
        )
        topics = [f"{topic}/batches", f"{topic}/holdings/+", f"{topic}/to/{settings.name}/+"]
        self._link = Connection(settings.broker, settings.name, topics, self._ears)
        self._thread = threading.Thread(target=self._run, name="relays", daemon=True)
        self._is_up, self._trouble = False, ""
        self._on_way: dict[int, Parcel] = {}
        self._sent_at = 0.0
        self._version = -1
        self._changed_at: float | None = None
        self._published: dict[str, FieldHoldings] | None = None
        self._published_at = 0.0
        self._stopping = threading.Event()

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self, timeout: float = 2.0) -> None:
        """End; what is not confirmed is sent by the next one."""
        self._stopping.set()
        self._events.put(lambda _rows: None)
        if self._thread.ident is not None:
            self._thread.join(timeout)

    # ------------------------------------------------------------------ thread

    def _run(self) -> None:
        rows, trouble = None, ""
        self._link.start()
        while not self._stopping.is_set():
            try:
                if rows is None:
                    rows = RelayRows(self._state)
                    self._keep_link(rows)
                self._wait(rows)
                if self._is_up:
                    self._send(rows, time.monotonic())
                    self._publish_holdings(rows, time.monotonic())
                trouble = ""
            except Exception as error:  # a locked or full disk passes: this thread must not end by it
                if (failure := f"{type(error).__name__}: {error}") != trouble:
                    log.error("batches cannot be exchanged", reason=failure)
                _closed(rows)
                trouble, rows = failure, None
                self._stopping.wait(PAUSE)
        self._link.stop()
        _closed(rows)

    def _wait(self, rows: RelayRows) -> None:
        """Do what has come, or wait for it a while."""
        with suppress(Empty):
            self._events.get(timeout=PAUSE)(rows)
            for _ in range(self._events.qsize()):
                self._events.get_nowait()(rows)

    def _turned(self, rows: RelayRows, is_up: bool, why: str) -> None:
        """The connection came up or went down."""
        before = (self._is_up, self._trouble)
        self._is_up, self._trouble = is_up, why
        self._on_way.clear()
        self._published = None
        place = self.settings.broker.place
        if (is_up, why) == before:
            return
        if is_up:
            log.info("broker connected", broker=place, relay=self.settings.name)
        elif why:
            log.warning("broker not connected: batches wait in the state file", broker=place, reason=why)
        self._keep_link(rows)

    def _keep_link(self, rows: RelayRows) -> None:
        link = Link(self.settings.name, self.settings.broker.place, self._is_up, self._trouble)
        rows.keep("", time.time(), link)

    # -------------------------------------------------------------------- send

    def _send(self, rows: RelayRows, now: float) -> None:
        """Hand new batches to the broker, some at a time."""
        if self._on_way and now <= self._sent_at + PATIENCE:
            return
        self._on_way.clear()
        self._sent_at = now
        for field, batches in rows.to_send(self.settings.fields, AT_ONCE).items():
            for parcel in parcels(self.settings.name, field, self.settings.fields[field], batches):
                number = self._link.publish(f"{self.settings.topic}/batches", encode(parcel))
                self._on_way[number] = parcel

    def _confirmed(self, rows: RelayRows, number: int, why: str) -> None:
        """The broker has taken a message, or not: then it is sent again after `PATIENCE`."""
        if why:
            trouble = f"it takes no messages: {why}"
            if trouble != self._trouble:
                log.warning("broker takes no messages", broker=self.settings.broker.place, reason=why)
                self._trouble = trouble
                self._keep_link(rows)
            return
        parcel = self._on_way.pop(number, None)
        if parcel is not None:
            rows.sent(parcel.field, parcel.batches)

    def _publish_holdings(self, rows: RelayRows, now: float) -> None:
        """Publish what there is: after a connection, some time after a change, and once in a while."""
        version = rows.version()
        if version != self._version:
            self._version = version
            self._changed_at = now if self._changed_at is None else self._changed_at
        is_new = self._published is None or now > self._published_at + COMPARISON
        if not is_new and (self._changed_at is None or now < self._changed_at + CALM):
            return
        self._changed_at = None
        held = {name: FieldHoldings(key, rows.days(name)) for name, key in self.settings.fields.items()}
        if not is_new and held == self._published:
            return
        message = Holdings(FORM, self.settings.name, time.time(), held)
        topic = f"{self.settings.topic}/holdings/{self.settings.name}"
        self._link.publish(topic, encode(message), is_kept=True)
        self._published, self._published_at = held, now

    # -------------------------------------------------------------------- come

    def _came(self, rows: RelayRows, topic: str, data: bytes) -> None:
        """A message came; what is none, or of no field that is configured alike, is left alone."""
        try:
            if topic.endswith("/batches"):
                self._take(decode(data, Parcel))
            elif topic.endswith("/wanted"):
                self._answer(rows, decode(data, Request))
            else:
                self._compare(rows, decode(data, Holdings))
        except ValueError as error:
            log.warning("message of another relay left alone", topic=topic, reason=str(error))

    def _take(self, parcel: Parcel) -> None:
        if self.settings.fields.get(parcel.field) != parcel.key:
            return
        found, latest = list[Batch](), time.time() + AHEAD
        for sample in parcel.batches:
            try:
                batch = unpacked(sample.data, sample.id, sample.glider)
            except ValueError as error:
                log.warning("batch left alone", relay=parcel.relay, batch=sample.id, reason=str(error))
            else:
                found += [batch] if batch.t.max() <= latest else []
        if found:
            self._news(BatchesCame(parcel.field, tuple(found)))

    def _compare(self, rows: RelayRows, theirs: Holdings) -> None:
        """Ask another relay for the days of which it has other batches."""
        if theirs.relay == self.settings.name:
            return
        mine = self.settings.fields
        for field, held in theirs.fields.items():
            if mine.get(field) != held.key:
                continue
            for day in differing(rows.days(field), held.days):
                request = Request(FORM, self.settings.name, field, held.key, day, rows.held(field, day))
                self._link.publish(f"{self.settings.topic}/to/{theirs.relay}/wanted", encode(request))
        counts = {field: sum(n for n, _ in held.days.values()) for field, held in theirs.fields.items()}
        apart = tuple(sorted(field for field, held in theirs.fields.items() if mine.get(field) != held.key))
        rows.keep(theirs.relay, theirs.t, Neighbour(counts, apart))

    def _answer(self, rows: RelayRows, request: Request) -> None:
        """Send another relay what it lacks of a day."""
        field, key = request.field, request.key
        if self.settings.fields.get(field) != key:
            return
        lacking = rows.others(field, request.day, request.held)
        for parcel in parcels(self.settings.name, field, key, lacking):
            self._link.publish(f"{self.settings.topic}/to/{request.relay}/batches", encode(parcel))


def _closed(rows: RelayRows | None) -> None:
    """Give a connection back; what fails in that is no news."""
    if rows is not None:
        with suppress(Exception):
            rows.close()
