"""The daemon: watches, decodes, processes, and stays alive."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from types import FrameType

import structlog

from gliderwatch.config import Config, load
from gliderwatch.errors import ConfigError, DamagedError, GliderwatchError
from gliderwatch.export.ais import VirtualAis
from gliderwatch.model import Alert
from gliderwatch.service import liveness, preconditions, state_outage, transaction
from gliderwatch.service.fields import catch_up, take_from_relays
from gliderwatch.service.heartbeat import Upkeep
from gliderwatch.service.intake import Intake
from gliderwatch.service.liveness import BEAT, PidLock
from gliderwatch.service.page_writer import PagesWritten, PageWriter
from gliderwatch.service.relays import BatchesCame
from gliderwatch.service.routing import Routing
from gliderwatch.service.run import StoppedError
from gliderwatch.service.runtime import Decoded, News, Ran, Runtime, build
from gliderwatch.service.state_outage import StateOutage
from gliderwatch.slocum.watch import CacheChanged, EventsLost, FileChanged, ScienceChanged
from gliderwatch.store.state_file import Status, Store

# ----------------------------------------
# The clock as an input: who is overdue now, and when to look again.

TICK = 60.0
"""Seconds between two ticks at the most."""
JUMP = 10.0
"""Seconds by which the clock may run apart from the monotonic one between two ticks."""
HOLD = 60.0
"""Seconds for which nobody is called overdue after the clock has jumped: it may jump back."""


class OverdueTimer:
    """Ticks of one daemon; remembers how the clock runs."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._offset: float | None = None
        self._trusted_from = float("-inf")

    def tick(
        self,
        gliders: Sequence[str],
        routing: Routing,
        is_busy: Callable[[str], bool],
        now: float,
        monotonic: float,
    ) -> tuple[tuple[Alert, ...], float]:
        """Messages about those `gliders` that are overdue at `now` (s), and seconds until the next tick.

        A glider of which files are at hand (`is_busy`) is left for the next one.
        """
        if self._offset is not None and abs(now - monotonic - self._offset) > JUMP:
            self._trusted_from = monotonic + HOLD
        self._offset = now - monotonic
        hold, pause = self._trusted_from - monotonic, TICK
        alerts: list[Alert] = []
        for glider in gliders:
            if is_busy(glider) or hold > 0:
                continue
            alerts += transaction.tick(self._store, glider, routing, _others(gliders, glider, routing), now)
            at = transaction.next_tick(self._store, glider, routing, now, now + TICK)
            if at is not None and at > now:
                pause = min(pause, at - now)
        return tuple(alerts), min(pause, hold) if hold > 0 else pause


def _others(gliders: Iterable[str], glider: str, routing: Routing) -> list[str]:
    return [other for other in gliders if other != glider and not routing.attention(other).recovered]


# ----------------------------------------
# When what is older than `state.keep_days` is removed: once a day, in steps, while no file is at hand.

log = structlog.get_logger(__name__)

DAY, HOUR = 86400.0, 3600.0
STEADY = 60.0
"""Seconds by which the clock may run apart from the monotonic one between two runs."""


class Retention:
    """Removes what is old once a day, a step at a time, whenever nothing else is to be done.

    `steps` begins a run for a time before which all may go (s). The first is an hour after the start. A
    clock that has jumped since the last time may be wrong by years: then nothing is removed that time.
    """

    def __init__(self, steps: Callable[[float], Iterator[int]], now: float, monotonic: float) -> None:
        self._steps, self._offset = steps, now - monotonic
        self._due = monotonic + HOUR
        self._work: Iterator[int] | None = None
        self._removed = 0

    def pause(self, monotonic: float) -> float:
        """Seconds until there is something to do."""
        return max(0.0, self._due - monotonic)

    def turn(self, keep_days: float | None, now: float, monotonic: float) -> None:
        """Do one step, if one is due. Raises StateError; it begins again in an hour."""
        if monotonic < self._due:
            return
        if self._work is None:
            self._due = monotonic + DAY
            is_steady = abs(now - monotonic - self._offset) < STEADY
            self._offset = now - monotonic
            if keep_days is None or not is_steady:
                return
            self._work, self._removed = self._steps(now - keep_days * DAY), 0
        work, self._work, self._due = self._work, None, monotonic + HOUR
        for removed in work:
            self._removed += removed
            self._work, self._due = work, monotonic
            return
        self._due = monotonic + DAY
        log.info("what is older than state.keep_days is removed", rows=self._removed)


# ----------------------------------------
# The daemon: watches, decodes, processes, and stays alive.
#
# One thread, this one, owns the estimation and the state file; the dispatcher owns the network; they meet
# only in the outbox. The watcher and the decoder put their news into one queue.

_SWITCH = 0.0005
"""Seconds after which a thread that has something to do interrupts the estimation (Python: 0.005). What the
decoder sends comes through several hands: with the longer time its processes wait for this one."""


class Daemon:
    """The service; made from a configuration, run once."""

    def __init__(self, config: Config, config_path: Path, workers: int = 2) -> None:
        self._config_path, self._workers = config_path, workers
        self._state = Path(config.state.path)
        preconditions.require(
            config, config_path
        )  # before anything is made beside what may be another's file
        self._lock = PidLock(self._state)
        self._store = state_outage.open_state(config)
        self._outage = StateOutage(self._store, self._is_stopping)
        self._overdue_timer = OverdueTimer(self._store)
        self._retention = Retention(self._store.remove, time.time(), time.monotonic())
        with state_outage.setting_aside(self._state), self._store.guarded():
            self._upkeep = Upkeep(config, self._store)
        self._news: SimpleQueue[News] = SimpleQueue()
        self._wake = threading.Event()
        self._stopping = False
        self._pages = PageWriter(self._news.put)
        self._ais = VirtualAis(self._store)
        self._intake = Intake(self._store, self._upkeep, self._wake, self._is_stopping, self._pages.changed)
        self._use(build(config, self._news, self._wake, workers))

    def _use(self, runtime: Runtime) -> None:
        """Work by another configuration, from nothing: a scan finds again what was at hand."""
        self._runtime = runtime
        self._intake.use(runtime)
        self._upkeep.use(runtime.config)
        self._pages.use(runtime.config)
        self._ais.use(runtime.config)
        self._caught_up = self._retry = False
        self._behind: dict[str, float] = {}
        self._returned_in: float | None = None
        self._next_scan = self._next_beat = time.monotonic()
        # files that came while nobody watched settle first
        self._next_tick = self._next_scan + runtime.config.dockserver.settle_seconds + 1.0

    def run(self) -> None:
        """Watch until SIGTERM or SIGINT."""
        sys.setswitchinterval(_SWITCH)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._on_signal)
        self._runtime.start()
        gliders = sorted(self._runtime.config.gliders)
        log.info("watching", pid=os.getpid(), gliders=gliders, state=str(self._state))
        liveness.notify("READY=1", "STATUS=watching")
        try:
            with state_outage.setting_aside(self._state):
                while not self._stopping:
                    if not self._outage.spared(self._turn):
                        self._caught_up, self._retry = False, True  # what it had begun may be half done
        except StoppedError:
            pass
        except DamagedError:  # it is logged: the next start makes a new state
            raise
        except Exception:
            log.exception("ended by an error")
            raise
        finally:
            liveness.notify("STOPPING=1")
            self._upkeep.stop()
            self._pages.stop()
            self._runtime.stop()
            self._store.close()
            self._lock.end()
            log.info("stopped")

    def _is_stopping(self) -> bool:
        return self._stopping

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._stopping = self._stopping or number != signal.SIGHUP
        self._news.put(signal.Signals(number))  # wakes the loop

    # ------------------------------------------------------------------- loop

    def _turn(self) -> None:
        """Wait for news or for the next thing that is due, and do what is due; not for ever."""
        self._receive(self._pause())
        if time.monotonic() >= self._next_scan:
            self._scan()
        if self._retry:
            self._retry = False
            self._intake.retry_waiting()
        self._intake.judge_settled()
        self._catch_up()
        self._returned_in = self._intake.notify_returned(time.monotonic())
        if self._caught_up and time.monotonic() >= self._next_tick:
            self._tick()
        if self._is_idle():
            self._runtime.workers_of_runs.stop()
            self._bring_fields_up_to_date()
            self._retention.turn(self._runtime.config.state.keep_days, time.time(), time.monotonic())
        if self._caught_up:
            self._pages.turn(self._store.gliders(), time.monotonic())
            self._ais.turn(time.time(), time.monotonic())
        if time.monotonic() >= self._next_beat:
            self._beat()

    def _pause(self) -> float:
        """Seconds until something is due."""
        now = time.monotonic()
        settled = self._intake.next_settled()
        due = [self._next_scan - now, self._next_beat - now, BEAT if settled is None else settled]
        due += [self._next_tick - now] if self._caught_up else []
        due += [0.0 if self._behind else self._retention.pause(now)] if self._is_idle() else []
        due += [self._returned_in] if self._returned_in is not None else []
        return max(0.0, min(due))

    def _is_idle(self) -> bool:
        """Whether no file is at hand."""
        return self._caught_up and not self._intake.at_hand

    def _receive(self, pause: float) -> None:
        """Wait for news and handle what has come by then; what comes meanwhile has its turn later."""
        try:
            self._handle(self._news.get(timeout=pause))
            for _ in range(self._news.qsize()):
                self._handle(self._news.get_nowait())
        except Empty:
            return

    def _handle(self, news: News) -> None:
        if self._stopping:
            return
        if isinstance(news, Decoded):
            self._intake.decoded(news)
        elif isinstance(news, Ran):
            self._intake.ran(news)
        elif isinstance(news, FileChanged | ScienceChanged):
            self._intake.observe(news.path)
        elif isinstance(news, CacheChanged):
            self._retry = True
        elif isinstance(news, BatchesCame):
            self._take_from_relays(news)
        elif isinstance(news, PagesWritten):
            return  # the turn that it woke has the next ones written
        elif news == signal.SIGHUP:
            self._reload()
        elif isinstance(news, EventsLost):
            log.warning("inotify lost events, all folders are watched again", reason="its queue overflowed")
            self._runtime.watcher.restart()
            self._next_scan = time.monotonic()
        else:  # a folder came: files may have come in it before it was watched
            self._next_scan = time.monotonic()

    def _take_from_relays(self, news: BatchesCame) -> None:
        """Put the batches of another relay into their field."""
        field = next((each for each in self._runtime.fields if each.name == news.field), None)
        if field is not None and take_from_relays(self._store, field, news.batches):
            self._behind[field.name] = float("-inf")

    def _bring_fields_up_to_date(self) -> None:
        """Go on with a field into which batches of other relays came, by some hours of samples."""
        for name, before in list(self._behind.items())[:1]:
            field = next(each for each in self._runtime.fields if each.name == name)
            self._behind[name] = catch_up(self._store, field)
            if self._behind[name] == before:
                del self._behind[name]

    def _scan(self) -> None:
        """Look at everything: what the observer missed, what waits, folders that are new."""
        begun = time.monotonic()
        self._intake.scan(first=not self._caught_up)
        took = time.monotonic() - begun  # where it takes long there is to be time for more than rescans
        self._next_scan = begun + took + max(took, self._runtime.config.dockserver.rescan_seconds)
        self._retry = True

    # ------------------------------------------------------------------- life

    def _catch_up(self) -> None:
        """After a start, once all files are in: say what an earlier life left unsaid."""
        if not self._caught_up and not self._intake.at_hand:
            self._intake.notify_all()
            self._caught_up = True

    def _tick(self) -> None:
        """Say which gliders are overdue, and look again when the next may be."""
        gliders, routing = sorted(self._runtime.config.gliders), self._runtime.routing
        now, backlog, intake = time.monotonic(), self._runtime.backlog, self._intake

        def is_busy(glider: str) -> bool:
            return backlog.more(glider) or not intake.is_notified(glider)

        alerts, pause = self._overdue_timer.tick(gliders, routing, is_busy, time.time(), now)
        self._next_tick = now + pause
        self._intake.send(alerts)

    def _beat(self) -> None:
        """A sign of life, if all parts live; a dead observer is started again."""
        self._next_beat = time.monotonic() + min(BEAT, liveness.watchdog_seconds() or BEAT)
        watcher, backlog = self._runtime.watcher, self._runtime.backlog
        if not watcher.alive():
            log.error("observer died, started again")
            watcher.restart()
            self._next_scan = time.monotonic()
        if self._caught_up:
            self._intake.notify_unmuted(time.time())
        at_hand = self._intake.at_hand
        is_well = self._upkeep.is_well(self._runtime.dispatcher, backlog.decoding + backlog.running)
        self._intake.send(self._upkeep.beat(is_well, at_hand))
        if not is_well:
            return
        self._lock.beat()
        counts = self._store.counts()
        waiting, bad = (counts.get(status, 0) for status in (Status.WAITING, Status.QUARANTINED))
        liveness.notify("WATCHDOG=1", f"STATUS={at_hand} files at hand, {waiting} waiting, {bad} quarantined")

    def _reload(self) -> None:
        """Read the configuration again; a bad one is refused and the old one kept."""
        liveness.reloading()
        before, path = self._runtime, str(self._config_path)
        try:
            config = load(self._config_path)
            if Path(config.state.path) != self._state:
                raise ConfigError("state.path can only be changed by a restart")
            preconditions.require(config, self._config_path)
            runtime = build(config, self._news, self._wake, self._workers, before)
        except GliderwatchError as error:
            log.error("configuration refused, the old one is kept", path=path, reason=str(error))
        else:
            before.stop(runtime)
            self._use(runtime)
            runtime.start(before)
            log.info("configuration read again", path=path, gliders=sorted(config.gliders))
        liveness.notify("READY=1")
