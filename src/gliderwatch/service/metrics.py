"""Numbers for Prometheus, on a port of this machine where one is configured.

Events are counted as they happen; what the state file tells is looked up at each beat of the daemon.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from threading import Thread
from typing import Any

import structlog
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, Info, start_http_server

from gliderwatch import __version__
from gliderwatch.config import Config
from gliderwatch.config.schema import Metrics as Settings
from gliderwatch.delivery.dispatcher import Delivery
from gliderwatch.incidents.constants import GONE, RECENT
from gliderwatch.incidents.overdue import expected_call
from gliderwatch.model import Assessment
from gliderwatch.service.liveness import STALE
from gliderwatch.store.state_file import File, Status, Store
from gliderwatch.store.watch_health import last_files, outbox_since

log = structlog.get_logger(__name__)

_SHORT = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0, 60.0)
_LONG = (0.1, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 300.0, 900.0, 3600.0, 14400.0, 86400.0)


class Metrics:
    """All numbers of one daemon. Used by its thread; the server reads them from others."""

    def __init__(self, state: Path, config: Config) -> None:
        self._server: tuple[Any, Thread] | None = None
        self._at: tuple[str, int] | None = None
        self._refused: tuple[str, int] | None = None
        self._outbox = Outbox(state)
        self.registry = registry = CollectorRegistry()
        one: dict[str, Any] = {"registry": registry, "namespace": "gliderwatch"}
        self.build = Info("build", "Version of gliderwatch and of Python", **one)
        self.build.info({"version": __version__, "python": platform.python_version()})
        self.files = Counter("files", "Files that arrived, by what became of them", ["status"], **one)
        self.decode = Histogram("decode_seconds", "Time to decode a file", buckets=_SHORT, **one)
        self.assess = Histogram(
            "assessment_seconds",
            "Time to take a segment in, with all dives that are assessed by it",
            buckets=_SHORT,
            **one,
        )
        self.queue = Gauge("queue_files", "Files at hand that are not taken yet", **one)
        self.flags = Counter(
            "flags",
            "Dives by flag; each assessment counts",
            ["glider", "flag"],
            **one,
        )
        self.incidents = Gauge("open_incidents", "Incidents that are open", ["glider"], **one)
        self.overdue = Gauge("overdue", "1 while a glider is overdue", ["glider"], **one)
        self.last_file = Gauge(
            "last_file_timestamp_seconds", "When the last file of a glider came", ["glider"], **one
        )
        self.delivery = Histogram(
            "delivery_seconds", "Time from a message to its delivery", ["channel"], buckets=_LONG, **one
        )
        self.failures = Counter("delivery_failures", "Deliveries that failed", ["channel"], **one)
        self.undelivered = Gauge("undelivered_messages", "Messages that wait", ["channel"], **one)
        self.healthy = Gauge("healthy", "1 while all parts of the service make progress", **one)
        self.healthy.set_function(self._is_healthy)
        self._well_at = float("-inf")
        for status in Status:
            self.files.labels(status)
        for glider, at in last_files(state, config.gliders).items():
            self.last_file.labels(glider).set(at)

    def serve(self, settings: Settings) -> None:
        """Listen where the settings say, and nowhere else; called again, try again a port that was taken."""
        wanted = (str(settings.address), settings.port) if settings.port is not None else None
        if wanted == self._at:
            return
        self.stop()
        if wanted is None:
            return
        try:
            self._server = start_http_server(wanted[1], wanted[0], self.registry)
        except OSError as error:
            if wanted != self._refused:
                log.error("metrics are not served", address=wanted[0], port=wanted[1], reason=error.strerror)
            self._refused = wanted
            return
        self._at, self._refused = wanted, None
        log.info("metrics are served", address=wanted[0], port=wanted[1])

    def stop(self) -> None:
        """Listen no more."""
        if self._server is not None:
            server, thread = self._server
            server.shutdown()
            server.server_close()
            thread.join()
        self._server = self._at = None

    def is_served(self) -> bool:
        """Whether somebody may look at them."""
        return self._server is not None

    def beat(self, is_well: bool, at_hand: int) -> None:
        """The loop of the daemon came round with so many files at hand; whether the other parts do too."""
        self._well_at = time.monotonic() if is_well else float("-inf")
        self.queue.set(at_hand)

    def _is_healthy(self) -> float:
        """Asked by the server, which lives on when the loop hangs."""
        return float(time.monotonic() - self._well_at < STALE)

    def came(self, file: File, now: float) -> None:
        """A file has been judged or taken at `now` (s)."""
        self.files.labels(file.status).inc()
        if file.glider and file.status != Status.UNKNOWN:
            self.last_file.labels(file.glider).set(now)

    def assessed(self, assessments: Iterable[Assessment]) -> None:
        """Dives have been assessed."""
        for a in assessments:
            self.flags.labels(a.glider, "none" if a.flag is None else str(int(a.flag))).inc()

    def look(self, store: Store, config: Config, now: float) -> None:
        """Look up at `now` (s) what the state file tells."""
        for name in config.gliders:
            is_open = [i for i in store.incidents(name) if i.cleared_at is None]
            self.incidents.labels(name).set(len(is_open))
            self.overdue.labels(name).set(_is_overdue(store, config, name, now))
        delays, failed, waiting = self._outbox.look(now)
        for channel, seconds in delays:
            self.delivery.labels(channel).observe(seconds)
        for channel, number in failed:
            self.failures.labels(channel).inc(number)
        for channel in config.channels.keys() | waiting.keys():
            self.undelivered.labels(channel).set(waiting.get(channel, 0))

    def forget(self, config: Config) -> None:
        """Leave out gliders that are not in the configuration any more."""
        for gauge in (self.incidents, self.overdue, self.last_file):
            for labels in [tuple(s.labels.values()) for m in gauge.collect() for s in m.samples]:
                if labels[0] not in config.gliders:
                    gauge.remove(*labels)


def _is_overdue(store: Store, config: Config, glider: str, now: float) -> bool:
    """As `gliderwatch status` says."""
    known, settings = store.facts(glider), config.gliders[glider]
    expected = known.expected(now)
    if expected is None or settings.recovered:
        return False
    call = expected_call(expected, known.signs(now - RECENT), now, config.attention(glider).overdue_hours)
    return call.due <= now and now - call.last_sign < GONE


class Outbox:
    """What became of messages since the last look, in the rows of the outbox."""

    def __init__(self, state: Path) -> None:
        self._state = state
        self._attempts: dict[int, int] = {}
        self._delivered: set[int] = set()
        self._from = 0
        self.look(0.0)

    def look(self, now: float) -> tuple[list[tuple[str, float]], list[tuple[str, int]], Mapping[str, int]]:
        """By channel: seconds of each new delivery, number of new failures, number of messages that wait.

        What is held at `now` (s) does not wait; what was given up or withdrawn is no delivery.
        """
        delays: list[tuple[str, float]] = []
        failed: list[tuple[str, int]] = []
        waiting: dict[str, int] = {}
        rows = outbox_since(self._state, self._from)
        for row in rows:
            if more := row.attempts - self._attempts.get(row.id, 0):
                failed.append((row.channel, more))
                self._attempts[row.id] = row.attempts
            if row.delivered_at is None:
                waiting[row.channel] = waiting.get(row.channel, 0) + (row.due <= now)
            elif row.id not in self._delivered:
                self._delivered.add(row.id)
                if row.delivery == Delivery.DELIVERED:
                    delays.append((row.channel, max(0.0, row.delivered_at - row.due)))
        self._move_on([row.id for row in rows if row.delivered_at is None], [row.id for row in rows])
        return delays, failed, waiting

    def _move_on(self, waiting: list[int], numbers: list[int]) -> None:
        """Look no more at the rows before the first that waits."""
        self._from = waiting[0] - 1 if waiting else (numbers[-1] if numbers else self._from)
        self._attempts = {n: a for n, a in self._attempts.items() if n > self._from}
        self._delivered = {n for n in self._delivered if n > self._from}
