"""The daemon: watches, decodes, takes in, and lives.

One thread, this one, owns the estimation and the state file; the dispatcher owns the network; they meet
only in the outbox. The watcher and the decoder put their news into one queue.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections import deque
from pathlib import Path
from queue import Empty, SimpleQueue
from types import FrameType

import structlog

from gliderwatch.config import Config, load
from gliderwatch.errors import ConfigError, DamagedError, GliderwatchError
from gliderwatch.ingest.watch import CacheChanged, EventsLost, FileChanged, ScienceChanged
from gliderwatch.run import arrivals, intake, notify, preconditions, recovery
from gliderwatch.run.heartbeat import Upkeep
from gliderwatch.run.life import BEAT, Life
from gliderwatch.run.parts import Decoded, News, Parts, build
from gliderwatch.run.reception import Reception
from gliderwatch.run.retention import Retention
from gliderwatch.run.ticking import Ticking
from gliderwatch.run.trouble import Trouble
from gliderwatch.store.sqlite import Status

log = structlog.get_logger(__name__)

_AT_ONCE = 100
"""Files looked at in one turn, so that signals and signs of life do not wait for a long list."""
_LONGEST_TURN = 2.0
"""Seconds after which it is enough of them: on a share that is slow to open each."""
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
        self._life = Life(self._state)
        self._store = recovery.open_state(config)
        self._trouble = Trouble(self._store, self._is_stopping)
        self._ticking = Ticking(self._store)
        self._retention = Retention(self._store.remove, time.time(), time.monotonic())
        with recovery.setting_aside(self._state), self._store.guarded():
            self._upkeep = Upkeep(config, self._store)
        self._news: SimpleQueue[News] = SimpleQueue()
        self._wake = threading.Event()
        self._stopping = False
        self._reception = Reception(self._store, self._upkeep, self._wake, self._is_stopping)
        self._use(build(config, self._news, self._wake, workers))

    def _use(self, parts: Parts) -> None:
        """Work with these parts, from nothing: a scan finds again what was at hand."""
        self._parts = parts
        self._reception.use(parts)
        self._upkeep.use(parts.config)
        self._settled: deque[Path] = deque()
        self._caught_up = self._retry = False
        self._calm_in: float | None = None
        self._next_scan = self._next_beat = time.monotonic()
        # files that came while nobody watched settle first
        self._next_tick = self._next_scan + parts.config.dockserver.settle_seconds + 1.0

    def run(self) -> None:
        """Watch until SIGTERM or SIGINT."""
        sys.setswitchinterval(_SWITCH)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._on_signal)
        self._parts.start()
        gliders = sorted(self._parts.config.gliders)
        log.info("watching", pid=os.getpid(), gliders=gliders, state=str(self._state))
        notify.notify("READY=1", "STATUS=watching")
        try:
            with recovery.setting_aside(self._state):
                while not self._stopping:
                    if not self._trouble.spared(self._turn):
                        self._caught_up, self._retry = False, True  # what it had begun may be half done
        except intake.StoppedError:
            pass
        except DamagedError:  # it is said: the next start makes the state anew
            raise
        except Exception:
            log.exception("ended by an error")
            raise
        finally:
            notify.notify("STOPPING=1")
            self._upkeep.stop()
            self._parts.stop()
            self._store.close()
            self._life.end()
            log.info("stopped")

    def _is_stopping(self) -> bool:
        return self._stopping

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._stopping = self._stopping or number != signal.SIGHUP
        self._news.put(signal.Signals(number))  # wakes the loop

    # ------------------------------------------------------------------- loop

    def _turn(self) -> None:
        """Wait for news or for the next thing that is due, and do what is due; not for ever."""
        self._hear(self._pause())
        if time.monotonic() >= self._next_scan:
            self._scan()
        if self._retry:
            self._retry_waiting()
        fresh = [path for path in self._parts.settling.ready(time.monotonic()) if self._is_still(path)]
        if len(fresh) <= _AT_ONCE:  # a few that just came do not wait for a folder full of old ones
            self._settled.extendleft(reversed(fresh))
        else:
            self._settled.extend(fresh)
        end = time.monotonic() + _LONGEST_TURN
        for _ in range(min(_AT_ONCE, len(self._settled))):
            if self._stopping or time.monotonic() > end:
                break
            self._reception.judge(self._settled[0])
            self._settled.popleft()  # only now: when the state cannot be used, it has its turn again
        if not self._settled or 0 < len(fresh) <= _AT_ONCE:
            self._parts.feed()  # all that came together is in order of time before the first is taken
        if not self._settled:
            self._catch_up()
        self._calm_in = self._reception.speak_when_calm(time.monotonic())
        if self._caught_up and time.monotonic() >= self._next_tick:
            self._tick()
        if self._is_idle():
            self._retention.turn(self._parts.config.state.keep_days, time.time(), time.monotonic())
        if time.monotonic() >= self._next_beat:
            self._beat()

    def _pause(self) -> float:
        """Seconds until something is due."""
        now = time.monotonic()
        settled = 0.0 if self._settled else self._parts.settling.next_deadline(now)
        due = [self._next_scan - now, self._next_beat - now, BEAT if settled is None else settled]
        due += [self._next_tick - now] if self._caught_up else []
        due += [self._retention.pause(now)] if self._is_idle() else []
        due += [self._calm_in] if self._calm_in is not None else []
        return max(0.0, min(due))

    def _is_idle(self) -> bool:
        """Whether no file is at hand."""
        return self._caught_up and not self._settled and not self._parts.backlog

    def _hear(self, pause: float) -> None:
        """Wait for news and heed what has come by then; what comes meanwhile has its turn later."""
        try:
            self._heed(self._news.get(timeout=pause))
            for _ in range(self._news.qsize()):
                self._heed(self._news.get_nowait())
        except Empty:
            return

    def _heed(self, news: News) -> None:
        if self._stopping:
            return
        if isinstance(news, Decoded):
            self._reception.decoded(news)
        elif isinstance(news, FileChanged | ScienceChanged):
            arrivals.observe(news.path, self._parts.settling, time.monotonic())
        elif isinstance(news, CacheChanged):
            self._retry = True
        elif news == signal.SIGHUP:
            self._reload()
        elif isinstance(news, EventsLost):
            log.warning("inotify lost events, all is watched anew", reason="its queue overflowed")
            self._parts.watcher.restart()
            self._next_scan = time.monotonic()
        else:  # a folder came: files may have come in it before it was watched
            self._next_scan = time.monotonic()

    def _is_still(self, path: Path) -> bool:
        """Whether a file is as it was when it settled; one that has grown since settles anew."""
        settling = self._parts.settling
        if arrivals.state(path) in (None, settling.passed(path)):
            return True
        arrivals.settle_anew(path, settling, time.monotonic())
        return False

    def _scan(self) -> None:
        """Look at everything: what the observer missed, what waits, folders that are new."""
        begun = time.monotonic()
        watcher, settling = self._parts.watcher, self._parts.settling
        watcher.refresh()
        there = set()
        for found in watcher.scan():
            if self._stopping:
                return
            there.add(found.path)
            settling.observe(found.path, found.size, found.mtime_ns, time.monotonic())
            if not self._caught_up:  # science files that came while nobody watched
                for path in arrivals.newer_science(found.path, self._store):
                    arrivals.observe(path, settling, time.monotonic())
        settling.only(there)
        took = time.monotonic() - begun  # where it takes long there is to be time for more than rescans
        self._next_scan = begun + took + max(took, self._parts.config.dockserver.rescan_seconds)
        self._retry = True
        for problem in watcher.problems:
            log.warning("folder left out", reason=problem)

    def _retry_waiting(self) -> None:
        """Look again at the files that wait; one that has changed since has to settle first."""
        self._retry = False
        self._parts.decoder.cache_folders = self._parts.cache_folders()
        for file in self._store.files(Status.WAITING, Status.UNKNOWN):
            path = Path(file.path)
            if arrivals.state(path) in (None, (file.size, file.mtime_ns)):
                self._reception.judge(path)
            else:
                arrivals.observe(path, self._parts.settling, time.monotonic())

    # ------------------------------------------------------------------- life

    def _catch_up(self) -> None:
        """After a start, once all files are in: say what an earlier life left unsaid."""
        if not self._caught_up and not self._parts.backlog:
            self._reception.speak_of_all()
            self._caught_up = True

    def _tick(self) -> None:
        """Say which gliders are overdue, and look again when the next may be."""
        gliders, speaking = sorted(self._parts.config.gliders), self._parts.speaking
        now, backlog, reception = time.monotonic(), self._parts.backlog, self._reception

        def is_busy(glider: str) -> bool:
            return backlog.more(glider) or not reception.is_calm(glider)

        alerts, pause = self._ticking.tick(gliders, speaking, is_busy, time.time(), now)
        self._next_tick = now + pause
        self._reception.alerted(alerts)

    def _beat(self) -> None:
        """A sign of life, if all parts live; a dead observer is started again."""
        self._next_beat = time.monotonic() + min(BEAT, notify.watchdog_seconds() or BEAT)
        watcher, backlog = self._parts.watcher, self._parts.backlog
        if not watcher.alive():
            log.error("observer died, started again")
            watcher.restart()
            self._next_scan = time.monotonic()
        if self._caught_up:
            self._reception.heed_mutes(time.time())
        at_hand = len(backlog) + len(self._settled)
        is_well = self._upkeep.is_well(self._parts.dispatcher, backlog.decoding)
        self._reception.alerted(self._upkeep.beat(is_well, at_hand))
        if not is_well:
            return
        self._life.beat()
        counts = self._store.counts()
        waiting, bad = (counts.get(status, 0) for status in (Status.WAITING, Status.QUARANTINED))
        notify.notify("WATCHDOG=1", f"STATUS={at_hand} files at hand, {waiting} waiting, {bad} quarantined")

    def _reload(self) -> None:
        """Read the configuration again; a bad one is refused and the old one kept."""
        notify.reloading()
        before, path = self._parts, str(self._config_path)
        try:
            config = load(self._config_path)
            if Path(config.state.path) != self._state:
                raise ConfigError("state.path can only be changed by a restart")
            preconditions.require(config, self._config_path)
            parts = build(config, self._news, self._wake, self._workers, before)
        except GliderwatchError as error:
            log.error("configuration refused, the old one is kept", path=path, reason=str(error))
        else:
            before.stop(parts)
            self._use(parts)
            parts.start(before)
            log.info("configuration read again", path=path, gliders=sorted(config.gliders))
        notify.notify("READY=1")
