"""The way of a file through the daemon, top to bottom: seen, settled, judged, decoded, processed, committed;
and when the messages about its glider are due.

Used in the daemon's thread, which alone estimates and writes the state file.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import structlog

from gliderwatch.errors import GliderwatchError, Quarantine, StateError
from gliderwatch.model import Alert, Segment
from gliderwatch.service import judgement, logs, transaction
from gliderwatch.service.backlog import Job
from gliderwatch.service.heartbeat import Upkeep
from gliderwatch.service.layers import layers_of
from gliderwatch.service.routing import Routing
from gliderwatch.service.run import Processed, Run, why_not
from gliderwatch.service.runtime import Decoded, Ran, Runtime
from gliderwatch.slocum import folders
from gliderwatch.slocum.folders import flight_files
from gliderwatch.slocum.mission_arguments import write_goto, write_yo
from gliderwatch.slocum.watch import CacheChanged
from gliderwatch.store.state_file import File, Status, Store

log = structlog.get_logger(__name__)

AT_ONCE = 100
"""Files judged in one turn, so that signals and signs of life do not wait for a long list."""
LONGEST_TURN = 2.0
"""Seconds after which it is enough of them: on a share that is slow to open each."""
QUIET = 10.0
"""Seconds without a further file after which it is reported that an overdue glider calls again: of several
that come at once only all together show when it called."""
LONGEST = 120.0
"""Seconds after which that is reported in any case."""
WRITTEN = 60.0
"""Seconds that the command `unmute` may take from when it reads the clock until what it wrote is seen: it
waits half of it for the state file."""


class Intake:
    """Takes files from the watcher to the state file.

    `wake` is set when there are messages to deliver, `changed` called with each glider that has news;
    while `is_stopping` nothing is begun any more.
    """

    def __init__(
        self,
        store: Store,
        upkeep: Upkeep,
        wake: threading.Event,
        is_stopping: Callable[[], bool],
        changed: Callable[[str], None],
    ) -> None:
        self._store, self._upkeep, self._wake, self._is_stopping = store, upkeep, wake, is_stopping
        self._changed = changed
        self._unmuted_until = time.time()
        self._returned: dict[str, tuple[float, float]] = {}

    def use(self, runtime: Runtime) -> None:
        """Work with these parts, from nothing: a scan finds again what was at hand. Comes before all else."""
        self._runtime = runtime
        self._settled: deque[Path] = deque()
        self._outdated: set[str] = set()

    @property
    def at_hand(self) -> int:
        """Files that have settled and are not processed yet."""
        return len(self._settled) + len(self._runtime.backlog)

    # ------------------------------------------------------------------- seen

    def observe(self, path: Path) -> None:
        """Let a file settle that has come or changed."""
        try:
            status = path.lstat()
        except OSError:  # gone or renamed: its new name is news of its own
            self._runtime.settling.forget(path)
            return
        self._runtime.settling.observe(path, status.st_size, status.st_mtime_ns, time.monotonic())

    def scan(self, *, first: bool) -> None:
        """See all files in all folders, as far as it is not stopping; `first`: of this runtime."""
        watcher, settling = self._runtime.watcher, self._runtime.settling
        watcher.refresh()
        there = set()
        for found in watcher.scan():
            if self._is_stopping():
                return
            there.add(str(found.path))
            settling.observe(found.path, found.size, found.mtime_ns, time.monotonic())
            if first:  # science files that came while nobody watched
                for path in judgement.newer_science(found.path, self._store):
                    self.observe(path)
        settling.only(there)
        for problem in watcher.problems:
            log.warning("folder left out", reason=problem)

    def retry_waiting(self) -> None:
        """Judge again the files that wait; one that has changed since has to settle first."""
        self._runtime.decoder.cache_folders = self._runtime.cache_folders()
        for file in self._store.files(Status.WAITING, Status.UNKNOWN):
            path = Path(file.path)
            if judgement.state(path) in (None, (file.size, file.mtime_ns)):
                self._judge_any(path)
            else:
                self.observe(path)

    # ---------------------------------------------------------------- settled

    def next_settled(self) -> float | None:
        """Seconds until a file may have settled; 0: some have. None: none is on its way."""
        return 0.0 if self._settled else self._runtime.settling.next_deadline(time.monotonic())

    def judge_settled(self) -> None:
        """Judge the files that have settled by now, for a while, and keep the decoder busy."""
        fresh = [path for path in self._runtime.settling.ready(time.monotonic()) if self._is_still(path)]
        if len(fresh) <= AT_ONCE:  # a few that just came do not wait for a folder full of old ones
            self._settled.extendleft(reversed(fresh))
        else:
            self._settled.extend(fresh)
        end = time.monotonic() + LONGEST_TURN
        for _ in range(min(AT_ONCE, len(self._settled))):
            if self._is_stopping() or time.monotonic() > end:
                break
            self._judge_any(self._settled[0])
            self._settled.popleft()  # only now: when the state cannot be used, it has its turn again
        if not self._settled:
            for glider in self._outdated:
                self._notify_if_last(glider)
            self._outdated.clear()
        if not self._settled or 0 < len(fresh) <= AT_ONCE:
            self._runtime.feed()  # all that came together is in order of time before the first is decoded

    def _is_still(self, path: Path) -> bool:
        """Whether a file is as it was when it settled; one that has grown since settles again."""
        if judgement.state(path) in (None, self._runtime.settling.passed(path)):
            return True
        self._settle_again(path)
        return False

    def _settle_again(self, path: Path) -> None:
        """Let a file settle as if nothing were known of it."""
        self._runtime.settling.forget(path)
        self.observe(path)

    # ----------------------------------------------------------------- judged

    def _judge_any(self, path: Path) -> None:
        """Of a science file it is the flight file beside it that is judged again, if it lacks the depth, or
        if there are fields to be made, or layers of the glider."""
        if folders.is_log(path.name):
            self._read_log(path)
        elif not folders.is_science(path.name):
            self._judge(path)
        else:
            for flight in flight_files(path):
                caches = self._runtime.decoder.cache_folders
                before = self._store.file(str(flight))
                layers = before is not None and layers_of(self._runtime.config, before.glider) is not None
                wanted = bool(self._runtime.fields) or layers
                if (wanted and judgement.is_as_judged(flight, self._store)) or judgement.lacks_depth(
                    flight, self._store, caches
                ):
                    self._judge(flight, again=True)

    def _judge(self, path: Path, *, again: bool = False) -> None:
        caches = self._runtime.decoder.cache_folders
        found = judgement.judge(path, self._store, caches, self._is_configured, again=again)
        if isinstance(found, Job):
            self._keep_list(path, found)
            self._upkeep.queued(found)
            self._runtime.backlog.add(found)
        elif found is not None:
            self._record(found)
        if judgement.state(path) is None:  # it may come back as it was: a share that was away
            self._runtime.settling.forget(path)

    def _keep_list(self, path: Path, job: Job) -> None:
        """Keep the sensor list that a file holds: others that left it out may wait for it."""
        try:
            kept = self._runtime.lists.keep(path, job.header)
        except OSError as error:
            log.warning("sensor list cannot be kept", path=str(path), crc=job.header.crc, reason=str(error))
            return
        if kept is not None:
            log.info("sensor list kept", path=str(path), crc=job.header.crc)
            self._runtime.news.put(CacheChanged(kept))

    # ---------------------------------------------------------------- decoded

    def decoded(self, news: Decoded) -> None:
        """Finish the files of a glider that are decoded, in their order.

        Raises StateError where that cannot be written; then the file has its turn once more.
        """
        backlog = self._runtime.backlog
        if news.backlog is not backlog:
            return  # of before the configuration was read again: the scan has found it again
        self._upkeep.decoded(news.job)
        backlog.finish(news.job, news.outcome)
        self._go_on(news.job.header.id.glider)
        self._runtime.feed()

    def _go_on(self, glider: str) -> None:
        """Take the next files of a glider that are decoded: many in a run, by a worker, else each at once."""
        backlog = self._runtime.backlog
        while jobs := backlog.ready(glider):
            try:
                run = self._run(jobs)
            except StateError:
                self._let_go(jobs)
                raise
            if run is not None:
                left = backlog.behind(glider)
                kept = [
                    self._store.segments.is_kept(one.name, left - n)
                    for n, one in enumerate(run.plan.segments, 1)
                ]
                self._runtime.process(glider, run, kept)
                return
            self._take(glider)

    def _let_go(self, jobs: Sequence[Job]) -> None:
        """Give some files of a glider that are decoded their turn once more."""
        for job in jobs:
            self._runtime.backlog.decoded(job.header.id.glider)
            self._settle_again(Path(job.file.path))

    def _take(self, glider: str) -> None:
        """Take the next file of a glider."""
        job = self._runtime.backlog.decoded(glider)
        if job is None:
            return
        try:
            self._finish(job)
        except StateError:
            self._settle_again(Path(job.file.path))
            raise

    def _run(self, jobs: Sequence[Job]) -> Run | None:
        """The first of these files that can be processed together; None where it is one that need not wait
        for a worker."""
        glider = jobs[0].header.id.glider
        if self._runtime.ocean.field(glider) is not None:
            return None
        segments = list[Segment]()
        for job in jobs[:1] if jobs[0].is_alone else jobs:
            result = job.result
            if (
                not isinstance(result, Segment)
                or result.id != job.header.id
                or job.is_alone != jobs[0].is_alone
            ):
                break
            if not self._is_as_decoded(job) or self._store.is_past(result.id):
                break
            if any(result.id.name == one.id.name for one in segments):
                break
            segments.append(result)
        if len(segments) < 2 and not (segments and jobs[0].is_alone):
            return None
        return transaction.foreseen(self._store, segments)

    def _is_as_decoded(self, job: Job) -> bool:
        """Whether a file is still as it was when it was judged."""
        return judgement.state(Path(job.file.path)) in (None, (job.file.size, job.file.mtime_ns))

    def ran(self, news: Ran) -> None:
        """Commit a run of files that a worker has processed. Raises StateError as `decoded`."""
        backlog, glider = self._runtime.backlog, news.glider
        if news.backlog is not backlog:
            return
        jobs, error = backlog.end_run(glider), news.future.exception()
        if error is None:
            self._commit(glider, jobs, news.future.result())
        else:
            log.warning(
                "run of files could not be processed", glider=glider, files=len(jobs), reason=str(error)
            )
            if jobs[0].is_alone:
                jobs[0].result = why_not(error)
            for job in jobs:
                job.is_alone = True  # which of them it was shows when each is processed by itself
        self._go_on(glider)
        self._runtime.feed()

    def _commit(self, glider: str, jobs: Sequence[Job], done: Processed) -> None:
        """Commit the outcomes of a run; where they do not hold any more, each file is processed again."""
        backlog, begun = self._runtime.backlog, time.monotonic()
        outcomes = None
        files = [(job.file, job.result) for job in jobs if isinstance(job.result, Segment)]
        if all(map(self._is_as_decoded, jobs)):
            last = backlog.behind(glider) == len(jobs)
            routing = self._routing_if_last(glider, last=last)
            try:
                with self._store.followed_by(backlog.behind(glider) - len(jobs)):
                    outcomes = transaction.process_run(
                        self._store,
                        files,
                        done,
                        self._runtime.config.glider(glider),
                        routing,
                        time.time(),
                        self._runtime.fields,
                        layers_of(self._runtime.config, glider),
                    )
            except StateError:
                self._let_go(jobs)
                raise
        if outcomes is None:
            for _ in jobs:
                self._take(glider)
            return
        seconds = (time.monotonic() - begun) / len(jobs)
        for outcome in outcomes:
            backlog.decoded(glider)
            self._report(outcome, seconds)

    def _finish(self, job: Job) -> None:
        path, result, glider = Path(job.file.path), job.result, job.header.id.glider
        if not self._is_as_decoded(job):
            # it has grown, or is another one: what was decoded may be of before or of after
            self._settle_again(path)
            self._notify_if_last(glider)
        elif isinstance(result, Segment) and result.id == job.header.id:
            self._process(job.file, result)
        elif isinstance(result, Exception):
            self._record(judgement.failed(job.file, result))
        else:  # it was replaced between header and decoding, and has gone since
            self._runtime.settling.forget(path)
            self._notify_if_last(glider)

    # ------------------------------------------------ processed and committed

    def _process(self, file: File, segment: Segment) -> None:
        glider = segment.id.glider
        if self._store.is_past(segment.id):
            reason = "older than what state.keep_days keeps"
            self._record(replace(file, status=Status.DUPLICATE, reason=reason, opened_at=None))
            return
        if self._gave_no_more(file, segment):
            self._notify_if_last(glider)
            return
        params, routing = self._runtime.config.glider(glider), self._routing_if_last(glider)
        begun = time.monotonic()
        try:
            now, ocean = time.time(), self._runtime.ocean.field(glider)
            with self._store.followed_by(self._runtime.backlog.behind(glider)):
                outcome = transaction.process_file(
                    self._store,
                    file,
                    segment,
                    params,
                    routing,
                    now,
                    self._is_stopping,
                    ocean,
                    self._runtime.fields,
                    layers_of(self._runtime.config, glider),
                )
        except Quarantine as error:
            log.error("file cannot be assessed", path=file.path, glider=glider, exc_info=error.__cause__)
            self._record(judgement.failed(file, error))
        else:
            self._report(outcome, time.monotonic() - begun)

    def _gave_no_more(self, file: File, segment: Segment) -> bool:
        """Whether a file that was judged again, for what lies beside it, gave no more than before."""
        before = self._store.file(file.path)
        held = self._store.segments.completeness(segment.id)
        return (
            before is not None
            and before.status == Status.TAKEN
            and (before.size, before.mtime_ns) == (file.size, file.mtime_ns)
            and held == segment.completeness
        )

    def _record(self, file: File) -> None:
        """Write down what became of a file that is not decoded (now), if that is new."""
        if self._store.file(file.path) == file:
            self._notify_if_last(file.glider)
            return
        params, routing = self._runtime.config.glider(file.glider), self._routing_if_last(file.glider)
        self._report(transaction.record_file(self._store, file, params, routing, time.time()))

    def _read_log(self, path: Path) -> None:
        """Read on in the log of a call."""
        found = judgement.judge_log(path, self._store, self._is_configured)
        if found is None:
            return
        file, dialog = found
        params, routing = self._runtime.config.glider(file.glider), self._routing_if_last(file.glider)
        before = self._store.file(file.path)
        more = len(self._settled) > 1  # one after another would assess the same dives as often
        try:
            outcome = transaction.process_log(
                self._store,
                file,
                dialog,
                params,
                routing,
                time.time(),
                self._runtime.ocean.field(file.glider),
                layers_of(self._runtime.config, file.glider),
                catch_up=not more,
            )
        except Quarantine as error:
            log.error("log cannot be assessed", path=file.path, glider=file.glider, exc_info=error.__cause__)
            failed = judgement.failed(file, error)
            outcome = transaction.record_file(self._store, failed, params, routing, time.time())
        if more and file.glider:
            self._outdated.add(file.glider)
        if before is None or before.status != file.status:  # not once for each line that comes
            self._report(outcome)
        else:
            self._changed(file.glider)
            self.send(outcome.alerts)

    def _report(self, outcome: transaction.FileOutcome, seconds: float | None = None) -> None:
        logs.processed(outcome)
        self._upkeep.processed(outcome, seconds)
        self._changed(outcome.file.glider)
        self.send(outcome.alerts)
        for advice in outcome.advice:
            try:
                path = write_goto(advice.glider, advice.field, advice.t, advice.advice, advice.outputs)
            except GliderwatchError as error:
                log.error("advice cannot be written", glider=advice.glider, reason=str(error))
            else:
                log.info("advice written", glider=advice.glider, path=str(path))
        self._write_yo(outcome)

    def _write_yo(self, outcome: transaction.FileOutcome) -> None:
        """Write the mission arguments of how deep to fly, where somebody wants them."""
        glider = outcome.file.glider
        layers = layers_of(self._runtime.config, glider)
        if outcome.layers is None or layers is None or layers.outputs is None:
            return
        try:
            paths = write_yo(glider, outcome.layers, layers.outputs)
        except GliderwatchError as error:
            log.error("advice cannot be written", glider=glider, reason=str(error))
        else:
            log.info("advice written", glider=glider, paths=[str(path) for path in paths])

    # --------------------------------------------------------------- messages

    def send(self, alerts: tuple[Alert, ...]) -> None:
        """Messages were made: log them, and have them delivered."""
        logs.alerts(alerts)
        if alerts:
            self._wake.set()
        for alert in alerts:
            self._changed(alert.glider)

    def notify_all(self) -> None:
        """Send the messages that were due of any glider when the daemon ended."""
        for glider in self._store.gliders():
            self._notify_if_last(glider)

    def notify_returned(self, monotonic: float) -> float | None:
        """Send what is due of gliders that were overdue and of which no file came for a while; seconds
        until the next may be due, None: there is none."""
        waiting = {g: at for g, (at, _) in self._returned.items() if not self._runtime.backlog.more(g)}
        for glider in [g for g, at in waiting.items() if at <= monotonic]:
            del self._returned[glider], waiting[glider]
            if self._is_configured(glider):
                self._notify(glider)
        return min(waiting.values()) - monotonic if waiting else None

    def is_notified(self, glider: str) -> bool:
        """Whether no message about a glider waits for more of its files."""
        return glider not in self._returned

    def notify_unmuted(self, now: float) -> None:
        """Send what is due of gliders whose mute has ended since the last time, by `now` (s), or by a command
        a while before; what was sent is not due again."""
        since, self._unmuted_until = self._unmuted_until, now
        attention = self._runtime.routing.attention
        ends = {glider: attention(glider).muted_until for glider in self._runtime.config.gliders}
        over = {glider for glider, end in ends.items() if end is not None and since < end <= now}
        for glider in sorted(over | set(self._store.notes.unmuted(since - WRITTEN, now))):
            self._notify_if_last(glider)

    def _notify_if_last(self, glider: str) -> None:
        """Send the messages that are due of a glider without a new file."""
        if self._routing_if_last(glider) is not None:
            self._notify(glider)

    def _notify(self, glider: str) -> None:
        config, ocean = self._runtime.config, self._runtime.ocean.field(glider)
        params, layers, routing = config.glider(glider), layers_of(config, glider), self._runtime.routing
        try:
            alerts = transaction.notify_pilots(
                self._store, glider, params, routing, time.time(), ocean, layers
            )
        except Quarantine as error:
            log.error("calls cannot be assessed", glider=glider, exc_info=error.__cause__)
            return
        self.send(alerts)

    def _routing_if_last(self, glider: str, *, last: bool | None = None) -> Routing | None:
        """Who is notified of a glider; None while more of its files are at hand (or it is not the `last` of
        them), or may be: then the last of them is reported for all."""
        if last is None:
            last = not self._runtime.backlog.more(glider)
        last = last and self._is_configured(glider)
        return self._runtime.routing if last and not self._may_more_come(glider) else None

    def _may_more_come(self, glider: str) -> bool:
        """Whether it was reported overdue: then a file may be the first of several that come at once."""
        now, waiting = time.monotonic(), self._returned.get(glider)
        if waiting is None:
            silences = self._store.notified(glider).silences
            if not any(s.called is None and s.messages for s in silences):
                return False
        end = now + LONGEST if waiting is None else waiting[1]
        self._returned[glider] = min(now + QUIET, end), end
        return True

    def _is_configured(self, glider: str) -> bool:
        return glider in self._runtime.config.gliders
