"""What the daemon does with each file that has come, and what it says of its glider."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import structlog

from gliderwatch.errors import Quarantine, StateError
from gliderwatch.ingest import names
from gliderwatch.model import Alert, Segment
from gliderwatch.run import arrivals, intake, logs
from gliderwatch.run.backlog import Job
from gliderwatch.run.heartbeat import Upkeep
from gliderwatch.run.intake import Speaking
from gliderwatch.run.parts import Decoded, Parts
from gliderwatch.store.sqlite import File, Status, Store

log = structlog.get_logger(__name__)


class Reception:
    """Files that have settled come in, go through the decoder, and are taken into the store.

    Used in the daemon's thread. `wake` is set when there are messages to deliver; while `is_stopping` nothing
    is begun any more.
    """

    def __init__(
        self, store: Store, upkeep: Upkeep, wake: threading.Event, is_stopping: Callable[[], bool]
    ) -> None:
        self._store, self._upkeep, self._wake, self._is_stopping = store, upkeep, wake, is_stopping
        self._heeded = time.time()

    def use(self, parts: Parts) -> None:
        """Work with these parts; comes before all else."""
        self._parts = parts

    def judge(self, path: Path) -> None:
        """Look at a file that has settled: it is queued for the decoder, or noted for what it is."""
        if names.is_log(path.name):
            self._take_log(path)
            return
        caches = self._parts.decoder.cache_folders
        found = arrivals.judge(path, self._store, caches, self._is_known)
        if isinstance(found, Job):
            self._upkeep.queued(found)
            self._parts.backlog.add(found)
        elif found is not None:
            self._note(found)
        if arrivals.state(path) is None:  # it may come back as it was: a share that was away
            self._parts.settling.forget(path)

    def decoded(self, news: Decoded) -> None:
        """Take the files of a glider that are decoded, in their order.

        Raises StateError where that cannot be written; then the file has its turn once more.
        """
        backlog = self._parts.backlog
        if news.backlog is not backlog:
            return  # of before the configuration was read again: the scan has found it again
        self._upkeep.decoded(news.job)
        backlog.finish(news.job, news.outcome)
        while (job := backlog.decoded(news.job.header.id.glider)) is not None:
            try:
                self._take(job)
            except StateError:
                self._again(Path(job.file.path))
                raise
        self._parts.feed()

    def speak_of_all(self) -> None:
        """Say what an earlier life left unsaid of any glider."""
        for glider in self._store.gliders():
            self._speak(glider)

    def heed_mutes(self, now: float) -> None:
        """Say what there is to say of gliders whose mute has ended since the last time, by `now` (s)."""
        since, self._heeded = self._heeded, now
        attention = self._parts.speaking.attention
        ends = {glider: attention(glider).muted_until for glider in self._parts.config.gliders}
        over = {glider for glider, end in ends.items() if end is not None and since < end <= now}
        for glider in sorted(over | set(self._store.notes.unmuted(since, now))):
            self._speak(glider)

    def alerted(self, alerts: tuple[Alert, ...]) -> None:
        """Messages were made: log them, and have them delivered."""
        logs.alerts(alerts)
        if alerts:
            self._wake.set()

    def _is_known(self, glider: str) -> bool:
        return glider in self._parts.config.gliders

    def _take(self, job: Job) -> None:
        path, result, glider = Path(job.file.path), job.result, job.header.id.glider
        if arrivals.state(path) not in (None, (job.file.size, job.file.mtime_ns)):
            # it has grown, or is another one: what was decoded may be of before or of after
            self._again(path)
            self._speak(glider)
        elif isinstance(result, Segment) and result.id == job.header.id:
            self._take_in(job.file, result)
        elif isinstance(result, Exception):
            self._note(arrivals.failed(job.file, result))
        else:  # it was replaced between header and decoding, and has gone since
            self._parts.settling.forget(path)
            self._speak(glider)

    def _again(self, path: Path) -> None:
        """Let a file have its turn once more."""
        arrivals.settle_anew(path, self._parts.settling, time.monotonic())

    def _take_in(self, file: File, segment: Segment) -> None:
        glider = segment.id.glider
        if self._store.is_past(segment.id):
            reason = "older than what state.keep_days keeps"
            self._note(replace(file, status=Status.DUPLICATE, reason=reason, opened_at=None))
            return
        params, speaking = self._parts.config.glider(glider), self._speaking(glider)
        begun = time.monotonic()
        try:
            now, ocean = time.time(), self._parts.ocean.field(glider)
            with self._store.followed_by(self._parts.backlog.behind(glider)):
                taken = intake.take(
                    self._store, file, segment, params, speaking, now, self._is_stopping, ocean
                )
        except Quarantine as error:
            log.error("file cannot be assessed", path=file.path, glider=glider, exc_info=error.__cause__)
            self._note(arrivals.failed(file, error))
        else:
            self._told(taken, time.monotonic() - begun)

    def _take_log(self, path: Path) -> None:
        """Read on in the log of a call."""
        found = arrivals.judge_log(path, self._store, self._is_known)
        if found is None:
            return
        file, dialog = found
        params, speaking = self._parts.config.glider(file.glider), self._speaking(file.glider)
        before = self._store.file(file.path)
        taken = intake.take_log(self._store, file, dialog, params, speaking, time.time())
        if before is None or before.status != file.status:  # not once for each line that comes
            self._told(taken)
        else:
            self.alerted(taken.alerts)

    def _note(self, file: File) -> None:
        """Write down what became of a file that is not taken (now), if that is new."""
        if self._store.file(file.path) == file:
            self._speak(file.glider)
            return
        params, speaking = self._parts.config.glider(file.glider), self._speaking(file.glider)
        self._told(intake.note(self._store, file, params, speaking, time.time()))

    def _speaking(self, glider: str) -> Speaking | None:
        """Who is told of a glider; None while more of its files are at hand: the last speaks for all."""
        last = self._is_known(glider) and not self._parts.backlog.more(glider)
        return self._parts.speaking if last else None

    def _speak(self, glider: str) -> None:
        """Say what is to be said of a glider without a new file."""
        speaking = self._speaking(glider)
        if speaking is not None:
            params = self._parts.config.glider(glider)
            self.alerted(intake.speak(self._store, glider, params, speaking, time.time()))

    def _told(self, taken: intake.Taken, seconds: float | None = None) -> None:
        logs.taken(taken)
        self._upkeep.took(taken, seconds)
        self.alerted(taken.alerts)
