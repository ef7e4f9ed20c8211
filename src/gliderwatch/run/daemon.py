"""The daemon: watches, decodes, takes in, and lives.

One thread, this one, owns the estimation and the state file; the dispatcher owns the network; they meet
only in the outbox. The watcher and the decoder put their news into one queue.
"""

from __future__ import annotations

import fcntl
import os
import signal
import threading
import time
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from types import FrameType
from typing import BinaryIO

import structlog

from gliderwatch.alerts.channels import Channel
from gliderwatch.alerts.outbox import Dispatcher
from gliderwatch.config import Config, load
from gliderwatch.errors import ConfigError, GliderwatchError
from gliderwatch.ingest.decode import Decoder
from gliderwatch.ingest.settle import Settling
from gliderwatch.ingest.watch import CacheChanged, Change, FileChanged, Watcher
from gliderwatch.model import Segment
from gliderwatch.run import arrivals, intake, notify
from gliderwatch.run.backlog import Backlog, Job
from gliderwatch.run.speaking import speaking
from gliderwatch.store.database import StateError
from gliderwatch.store.outbox import Outbox
from gliderwatch.store.sqlite import File, Status, Store

log = structlog.get_logger(__name__)

BEAT = 10.0
"""Seconds between two signs of life."""
STALLED = 60.0
"""Seconds without progress after which the dispatcher counts as stuck."""


@dataclass(frozen=True, slots=True)
class Decoded:
    """News of the decoder."""

    job: Job
    future: Future[Segment]


News = Change | Decoded | signal.Signals


class Daemon:
    """The service; made from a configuration, run once."""

    def __init__(self, config: Config, config_path: Path, workers: int = 2) -> None:
        self._config_path, self._workers = config_path, workers
        self._state = Path(config.state.path)
        self._lock = _lock(self._state)
        self._store = Store.open(self._state)
        self._news: SimpleQueue[News] = SimpleQueue()
        self._wake = threading.Event()
        self._backlog, self._decoding = Backlog(), 0
        self._caught_up = False
        self._stop = False
        self._configure(config)

    def _configure(self, config: Config) -> None:
        """Everything that follows from the configuration; raises ConfigError before anything is changed."""
        channels = {
            name: Channel(name, config.channel_url(name).get_secret_value()) for name in config.channels
        }
        self.config, self._speaking = config, speaking(config)
        self._settling = Settling(config.dockserver.settle_seconds)
        self._watcher = Watcher(
            config.dockserver.roots,
            {name: glider.paths for name, glider in config.gliders.items()},
            config.dockserver.cache,
            self._news,
            config.dockserver.observer,
        )
        self._caches = self._watcher.cache_folders()
        self._decoder = Decoder(self._caches, max_workers=self._workers)
        self._dispatcher = Dispatcher(lambda: Outbox(self._state), channels, time.time, self._wake)

    def run(self) -> None:
        """Watch until SIGTERM or SIGINT."""
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._on_signal)
        self._start()
        log.info("watching", gliders=sorted(self.config.gliders), state=str(self._state))
        try:
            while not self._stop:
                self._turn()
        finally:
            notify.notify("STOPPING=1")
            self._end()
            self._store.close()
            self._lock.close()
            log.info("stopped")

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._news.put(signal.Signals(number))

    def _start(self) -> None:
        self._dispatcher.start()
        self._watcher.start()
        self._next_scan = self._next_beat = time.monotonic()

    def _end(self) -> None:
        self._watcher.stop()
        self._decoder.close()
        self._dispatcher.stop()

    # ------------------------------------------------------------------- loop

    def _turn(self) -> None:
        """Wait for news or for the next thing that is due, and do all of it."""
        now = time.monotonic()
        settled = self._settling.next_deadline(now)
        pause = min(self._next_scan - now, self._next_beat - now, settled if settled is not None else BEAT)
        try:
            self._heed(self._news.get(timeout=max(0.0, pause)))
            while True:
                self._heed(self._news.get_nowait())
        except Empty:
            pass
        now = time.monotonic()
        if now >= self._next_scan:
            self._scan()
        for path in self._settling.ready(time.monotonic()):
            self._judge(path)
        self._feed()
        if not self._caught_up and not self._backlog:
            self._catch_up()
        if now >= self._next_beat:
            self._beat()

    def _heed(self, news: News) -> None:
        if isinstance(news, Decoded):
            self._decoding -= 1
            news.job.result = _result(news.future)
            while (job := self._backlog.decoded(news.job.header.id.glider)) is not None:
                self._take(job)
                self._feed()
        elif isinstance(news, FileChanged):
            self._observe(news.path)
        elif isinstance(news, CacheChanged):
            self._retry_waiting()
        elif news == signal.SIGHUP:
            self._reload()
        elif isinstance(news, signal.Signals):
            self._stop = True
        else:  # a folder came: files may have come in it before it was watched
            self._next_scan = time.monotonic()

    def _observe(self, path: Path) -> None:
        try:
            status = path.stat()
        except OSError:  # gone or renamed: its new name is news of its own
            self._settling.forget(path)
            return
        self._settling.observe(path, status.st_size, status.st_mtime_ns, time.monotonic())

    def _scan(self) -> None:
        """Look at everything: what the observer missed, what waits, folders that are new."""
        self._next_scan = time.monotonic() + self.config.dockserver.rescan_seconds
        self._watcher.refresh()
        for found in self._watcher.scan():
            self._settling.observe(found.path, found.size, found.mtime_ns, time.monotonic())
        self._retry_waiting()
        for problem in self._watcher.problems:
            log.warning("folder left out", reason=problem)

    def _retry_waiting(self) -> None:
        self._caches = self._decoder.cache_folders = self._watcher.cache_folders()
        for file in self._store.files(Status.WAITING, Status.UNKNOWN):
            self._judge(Path(file.path))

    def _judge(self, path: Path) -> None:
        found = arrivals.judge(arrivals.seen(path), self._store, self._caches, self._is_known)
        if isinstance(found, Job):
            self._backlog.add(found)
        elif found is not None:
            self._note(found)

    def _is_known(self, glider: str) -> bool:
        return glider in self.config.gliders

    def _feed(self) -> None:
        """Keep the decoder busy, with no more than it can take."""
        while self._decoding < 2 * self._workers and (job := self._backlog.next()) is not None:
            self._decoding += 1
            future = self._decoder.submit(Path(job.file.path))
            future.add_done_callback(partial(self._on_decoded, job))

    def _on_decoded(self, job: Job, future: Future[Segment]) -> None:
        self._news.put(Decoded(job, future))

    def _take(self, job: Job) -> None:
        result, glider = job.result, job.header.id.glider
        last = None if self._backlog.more(glider) else self._speaking
        if isinstance(result, Segment) and result.id == job.header.id:
            params = self.config.glider(glider)
            taken = intake.take(self._store, job.file, result, params, last, time.time())
            self._told(taken)
        elif isinstance(result, Exception):
            self._note(arrivals.failed(job.file, result))
        else:  # it was replaced between header and decoding
            self._settling.forget(Path(job.file.path))
            self._observe(Path(job.file.path))

    def _note(self, file: File) -> None:
        last = self._speaking if file.glider in self.config.gliders else None
        if file.glider and self._backlog.more(file.glider):
            last = None
        known = self._store.file(file.path)
        if known != file:
            params = self.config.glider(file.glider)
            self._told(intake.note(self._store, file, params, last, time.time()))

    def _told(self, taken: intake.Taken) -> None:
        file = taken.file
        log.info(
            f"file {file.status}",
            path=file.path,
            glider=file.glider,
            segment=file.segment,
            **({"reason": file.reason} if file.reason else {}),
            **({"dives": len(taken.assessments)} if taken.assessments else {}),
        )
        for alert in taken.alerts:
            log.warning("alert", glider=alert.glider, kind=str(alert.kind), alert=alert.id, title=alert.title)
        if taken.alerts:
            self._wake.set()

    def _catch_up(self) -> None:
        """After a start, once all files are in: say what an earlier life left unsaid."""
        self._caught_up = True
        for glider in self._store.gliders():
            if glider in self.config.gliders:
                params = self.config.glider(glider)
                alerts = intake.speak(self._store, glider, params, self._speaking, time.time())
                self._wake.set() if alerts else None
        notify.notify("READY=1", "STATUS=watching")

    # ------------------------------------------------------------------- life

    def _beat(self) -> None:
        """A sign of life, if all parts live; a dead observer is started again."""
        self._next_beat = time.monotonic() + min(BEAT, notify.watchdog_seconds() or BEAT)
        if not self._watcher.alive():
            log.error("observer died, started again")
            self._watcher.restart()
            self._next_scan = time.monotonic()
        late = time.monotonic() - self._dispatcher.progress()
        if not self._dispatcher.alive() or late > STALLED:
            log.error("dispatcher is stuck: no sign of life given", seconds=round(late))
            return
        os.utime(self._lock.fileno())
        waiting, bad = (len(self._store.files(s)) for s in (Status.WAITING, Status.QUARANTINED))
        notify.notify(
            "WATCHDOG=1", f"STATUS={len(self._backlog)} files at hand, {waiting} waiting, {bad} quarantined"
        )

    def _reload(self) -> None:
        """Read the configuration again; a bad one is refused and the old one kept."""
        notify.reloading()
        try:
            config = load(self._config_path)
            if Path(config.state.path) != self._state:
                raise ConfigError("state.path can only be changed by a restart")
            old = (self._watcher, self._decoder, self._dispatcher)
            self._configure(config)
        except GliderwatchError as error:
            log.error("configuration refused, the old one is kept", reason=str(error))
        else:
            for part in old:
                part.stop() if hasattr(part, "stop") else part.close()
            self._backlog, self._decoding, self._caught_up = Backlog(), 0, False
            self._start()
            log.info("configuration read again", gliders=sorted(config.gliders))
        notify.notify("READY=1")


def _result(future: Future[Segment]) -> Segment | Exception:
    error = future.exception()
    if error is None:
        return future.result()
    return error if isinstance(error, Exception) else GliderwatchError(f"the decoder failed: {error!r}")


def _lock(state: Path) -> BinaryIO:
    """The lock of a state file, held by its daemon, who touches it as a sign of life."""
    path = alive_path(state)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("ab")
    except OSError as error:
        raise StateError(f"{path} cannot be written: {error.strerror}") from None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise StateError(f"another gliderwatch uses the state file {state}: stop it first") from None
    return file


def alive_path(state: Path) -> Path:
    """The file beside the state file that a daemon locks and touches."""
    return state.with_name(state.name + ".alive")
