"""The way of a file: seen, settled, judged by its header, decoded, processed, committed; and when its
glider's messages are due."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import structlog

from gliderwatch.errors import MissingCache, NotAssessed, Quarantine, Retry, StateError
from gliderwatch.model import Alert, Hindrance, Segment
from gliderwatch.service import logs, transaction
from gliderwatch.service.backlog import Job
from gliderwatch.service.heartbeat import Upkeep
from gliderwatch.service.routing import Routing
from gliderwatch.service.runtime import Decoded, Runtime
from gliderwatch.slocum import folders
from gliderwatch.slocum.caches import is_there
from gliderwatch.slocum.calls import Dialog, read_log
from gliderwatch.slocum.folders import Settling
from gliderwatch.slocum.header import read_header
from gliderwatch.slocum.science import flight_files, needs_science, science_files
from gliderwatch.slocum.watch import CacheChanged
from gliderwatch.store.codec import plain_decode
from gliderwatch.store.state_file import File, Status, Store

# ----------------------------------------
# What to do with a file that has come (decode it, wait, or leave it alone), and the queue of files for the
# decoder.

# ----------------------------------------
# Files on their way from settled to taken: in order within a glider, in turn between gliders.


# ----------------------------------------
# What to do with a file that has come: let it settle; once complete, decode it, wait, or leave it alone.

DONE = (Status.TAKEN, Status.DUPLICATE, Status.QUARANTINED)


def state(path: Path) -> tuple[int, int] | None:
    """Size (bytes) and time of change (ns) of a file; None where there is none, zeros where it is closed."""
    try:
        status = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError:
        return 0, 0
    return status.st_size, status.st_mtime_ns


def observe(path: Path, settling: Settling, now: float) -> None:
    """Let a file settle that has changed; `now` is monotonic (s)."""
    try:
        status = path.lstat()
    except OSError:  # gone or renamed: its new name is news of its own
        settling.forget(path)
        return
    settling.observe(path, status.st_size, status.st_mtime_ns, now)


def settle_again(path: Path, settling: Settling, now: float) -> None:
    """Let a file settle as if nothing were known of it; `now` is monotonic (s)."""
    settling.forget(path)
    observe(path, settling, now)


def lacks_depth(flight: Path, store: Store, caches: Sequence[Path]) -> bool:
    """Whether a flight file that was looked at before, and is as it was, names no sensor of the depth."""
    before = store.file(_text(flight))
    if before is None or (before.size, before.mtime_ns) != state(flight):
        return False
    try:
        return needs_science(read_header(flight), caches)
    except (Quarantine, Retry):
        return False


def newer_science(flight: Path, store: Store) -> list[Path]:
    """The science files beside a flight file that came after it was looked at, by this machine's clock."""
    noted = store.noted_at(_text(flight))
    if noted is None:
        return []
    try:
        return [path for path in science_files(flight) if path.stat().st_ctime > noted]
    except OSError:
        return []


def triage(
    path: Path,
    store: Store,
    caches: Sequence[Path],
    is_known: Callable[[str], bool],
    *,
    anew: bool = False,
) -> Job | File | None:
    """A job where the file is to be decoded, a row for the ledger where not, None where nothing is new.

    Reads nothing but the header, which takes well under a millisecond. `anew`: also one that is done with.
    """
    now, before = state(path), store.file(_text(path))
    if now is None:
        return _gone(before, store, is_known)
    is_same = before is not None and (before.size, before.mtime_ns) == now
    if before is not None and is_same and not anew and _is_settled(before, caches, is_known):
        return None
    file = File(_text(path), *now, Status.WAITING)
    try:
        header = read_header(_plain(path))
    except (Quarantine, Retry) as error:
        return failed(file, error)
    file = replace(file, glider=header.id.glider, segment=header.id.name, opened_at=header.id.opened_at)
    if not is_known(header.id.glider):
        reason = f"glider {header.id.glider} is not in the configuration"
        return replace(file, status=Status.UNKNOWN, reason=reason)
    if header.factored and _is_missing(header.crc, caches):
        return failed(file, MissingCache(header.crc, caches))
    return Job(file, header)


def judge_log(path: Path, store: Store, is_known: Callable[[str], bool]) -> tuple[File, Dialog | None] | None:
    """The row of a log for the ledger, and what it tells by now if it could be read; None: nothing is new."""
    now, name = state(path), _text(path)
    before = store.file(name)
    if now is None:
        if before is not None and before.status not in DONE:
            return replace(before, status=Status.DUPLICATE, reason="is gone"), None
        return None
    was_unknown = before is not None and before.status == Status.UNKNOWN and is_known(before.glider)
    if before is not None and (before.size, before.mtime_ns) == now and not was_unknown:
        return None
    file, kept = File(name, *now, Status.TAKEN), store.calls.dialog(name)
    try:
        dialog = read_log(_plain(path), None if kept is None else plain_decode(kept, Dialog))
    except (Quarantine, Retry) as error:
        return failed(file, error), None
    return _of_glider(file, dialog.call.glider, is_known), dialog


def _of_glider(file: File, glider: str, is_known: Callable[[str], bool]) -> File:
    """The row of a log that was read, of the glider that it names."""
    if not glider:
        reason = "is a log in which no line `Vehicle Name:` says yet of which glider"
        return replace(file, status=Status.WAITING, reason=reason)
    if not is_known(glider):
        reason = f"glider {glider} is not in the configuration"
        return replace(file, status=Status.UNKNOWN, glider=glider, reason=reason)
    return replace(file, glider=glider)


def _is_settled(before: File, caches: Sequence[Path], is_known: Callable[[str], bool]) -> bool:
    """Whether nothing more can be done for a file that has not changed."""
    if before.status == Status.UNKNOWN:
        return bool(before.glider) and not is_known(before.glider)
    if before.hindrance is Hindrance.RENAMED:  # it was not read: if it comes back, it is to be
        return False
    return before.status in DONE or (bool(before.crc) and _is_missing(before.crc, caches))


def _plain(path: Path) -> Path:
    """The path, if its name can be kept. Raises Quarantine."""
    if str(path) != _text(path):
        raise Quarantine("its name is not UTF-8 text: give it another one")
    return path


def failed(file: File, error: Exception) -> File:
    """The row of a file that could not be decoded."""
    status, why = Status.QUARANTINED, Hindrance.DAMAGED
    if isinstance(error, MissingCache):
        status, why = Status.WAITING, Hindrance.NO_CACHE
    elif isinstance(error, Retry):
        status, why = Status.WAITING, Hindrance.UNREADABLE
    elif isinstance(error, NotAssessed):
        why = Hindrance.NOT_ASSESSED
    crc = error.crc if isinstance(error, MissingCache) else ""
    return replace(file, status=status, reason=str(error), crc=crc, hindrance=why)


def _gone(before: File | None, store: Store, is_known: Callable[[str], bool]) -> File | None:
    """A file that waited and is not there any more: it was renamed, or taken away."""
    if before is None or before.status in DONE:
        return None
    if before.status == Status.UNKNOWN and not is_known(before.glider):
        return None
    if not store.segments.is_held(before.glider, before.segment):
        reason = "is not there any more, and its segment has not come under another name"
        return replace(before, status=Status.WAITING, reason=reason, crc="", hindrance=Hindrance.GONE)
    return replace(before, status=Status.DUPLICATE, reason="was renamed", crc="", hindrance=Hindrance.RENAMED)


def _is_missing(crc: str, caches: Sequence[Path]) -> bool:
    """Whether a cache file is in none of the folders; where one cannot be read, the decoder tells why."""
    try:
        return not is_there(crc, caches)
    except OSError:
        return False


def _text(path: Path) -> str:
    """The path as text that can be kept, whatever bytes are in its name."""
    return str(path).encode("utf-8", "backslashreplace").decode()


# ----------------------------------------
# What the daemon does with each file that has come, and what it says of its glider.

log = structlog.get_logger(__name__)

CALM = 10.0
"""Seconds without a further file after which it is said that an overdue glider calls again: of several that
come at once only all together tell when it called."""
LONGEST = 120.0
"""Seconds after which that is said in any case."""


class Intake:
    """Files that have settled come in, go through the decoder, and are taken into the store.

    Used in the daemon's thread. `wake` is set when there are messages to deliver; while `is_stopping` nothing
    is begun any more.
    """

    def __init__(
        self, store: Store, upkeep: Upkeep, wake: threading.Event, is_stopping: Callable[[], bool]
    ) -> None:
        self._store, self._upkeep, self._wake, self._is_stopping = store, upkeep, wake, is_stopping
        self._heeded = time.time()
        self._calm: dict[str, tuple[float, float]] = {}

    def use(self, parts: Runtime) -> None:
        """Work with these parts; comes before all else."""
        self._parts = parts

    def judge(self, path: Path) -> None:
        """Look at a file that has settled: it is queued for the decoder, or noted for what it is.

        Of a science file it is the flight file beside it that is looked at, anew, if it lacks the depth.
        """
        if folders.is_log(path.name):
            self._take_log(path)
            return
        if not folders.is_science(path.name):
            self._judge(path)
            return
        for flight in flight_files(path):
            if lacks_depth(flight, self._store, self._parts.decoder.cache_folders):
                self._judge(flight, anew=True)

    def _judge(self, path: Path, *, anew: bool = False) -> None:
        caches = self._parts.decoder.cache_folders
        found = triage(path, self._store, caches, self._is_known, anew=anew)
        if isinstance(found, Job):
            self._keep_list(path, found)
            self._upkeep.queued(found)
            self._parts.backlog.add(found)
        elif found is not None:
            self._note(found)
        if state(path) is None:  # it may come back as it was: a share that was away
            self._parts.settling.forget(path)

    def _keep_list(self, path: Path, job: Job) -> None:
        """Keep the sensor list that a file holds: others that left it out may wait for it."""
        try:
            kept = self._parts.lists.keep(path, job.header)
        except OSError as error:
            log.warning("sensor list cannot be kept", path=str(path), crc=job.header.crc, reason=str(error))
            return
        if kept is not None:
            log.info("sensor list kept", path=str(path), crc=job.header.crc)
            self._parts.news.put(CacheChanged(kept))

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

    def speak_when_calm(self, monotonic: float) -> float | None:
        """Say what is to be said of gliders that were overdue and of which no file came for a while; seconds
        until the next may be due, None: there is none."""
        waiting = {g: at for g, (at, _) in self._calm.items() if not self._parts.backlog.more(g)}
        for glider in [g for g, at in waiting.items() if at <= monotonic]:
            del self._calm[glider], waiting[glider]
            if self._is_known(glider):
                self._say(glider)
        return min(waiting.values()) - monotonic if waiting else None

    def is_calm(self, glider: str) -> bool:
        """Whether nothing of a glider waits to be said."""
        return glider not in self._calm

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
        if state(path) not in (None, (job.file.size, job.file.mtime_ns)):
            # it has grown, or is another one: what was decoded may be of before or of after
            self._again(path)
            self._speak(glider)
        elif isinstance(result, Segment) and result.id == job.header.id:
            self._take_in(job.file, result)
        elif isinstance(result, Exception):
            self._note(failed(job.file, result))
        else:  # it was replaced between header and decoding, and has gone since
            self._parts.settling.forget(path)
            self._speak(glider)

    def _again(self, path: Path) -> None:
        """Let a file have its turn once more."""
        settle_again(path, self._parts.settling, time.monotonic())

    def _take_in(self, file: File, segment: Segment) -> None:
        glider = segment.id.glider
        if self._store.is_past(segment.id):
            reason = "older than what state.keep_days keeps"
            self._note(replace(file, status=Status.DUPLICATE, reason=reason, opened_at=None))
            return
        if self._gave_no_more(file, segment):
            self._speak(glider)
            return
        params, speaking = self._parts.config.glider(glider), self._speaking(glider)
        begun = time.monotonic()
        try:
            now, ocean = time.time(), self._parts.ocean.field(glider)
            with self._store.followed_by(self._parts.backlog.behind(glider)):
                taken = transaction.process_file(
                    self._store,
                    file,
                    segment,
                    params,
                    speaking,
                    now,
                    self._is_stopping,
                    ocean,
                    self._parts.config.health(glider),
                )
        except Quarantine as error:
            log.error("file cannot be assessed", path=file.path, glider=glider, exc_info=error.__cause__)
            self._note(failed(file, error))
        else:
            self._told(taken, time.monotonic() - begun)

    def _take_log(self, path: Path) -> None:
        """Read on in the log of a call."""
        found = judge_log(path, self._store, self._is_known)
        if found is None:
            return
        file, dialog = found
        params, speaking = self._parts.config.glider(file.glider), self._speaking(file.glider)
        before = self._store.file(file.path)
        limits = self._parts.config.health(file.glider)
        taken = transaction.take_log(self._store, file, dialog, params, speaking, time.time(), limits)
        if before is None or before.status != file.status:  # not once for each line that comes
            self._told(taken)
        else:
            self.alerted(taken.alerts)

    def _gave_no_more(self, file: File, segment: Segment) -> bool:
        """Whether a file that was looked at anew, for what lies beside it, gave no more than before."""
        before = self._store.file(file.path)
        held = self._store.segments.completeness(segment.id)
        return (
            before is not None
            and before.status == Status.TAKEN
            and (before.size, before.mtime_ns) == (file.size, file.mtime_ns)
            and held == segment.completeness
        )

    def _note(self, file: File) -> None:
        """Write down what became of a file that is not taken (now), if that is new."""
        if self._store.file(file.path) == file:
            self._speak(file.glider)
            return
        params, speaking = self._parts.config.glider(file.glider), self._speaking(file.glider)
        self._told(transaction.record_file(self._store, file, params, speaking, time.time()))

    def _speaking(self, glider: str) -> Routing | None:
        """Who is told of a glider; None while more of its files are at hand, or may be: the last speaks for
        all."""
        last = self._is_known(glider) and not self._parts.backlog.more(glider)
        return self._parts.speaking if last and not self._may_more_come(glider) else None

    def _may_more_come(self, glider: str) -> bool:
        """Whether it was told to be overdue: then a file may be the first of several that come at once."""
        now, waiting = time.monotonic(), self._calm.get(glider)
        if waiting is None:
            silences = self._store.said(glider).silences
            if not any(s.called is None and s.messages for s in silences):
                return False
        end = now + LONGEST if waiting is None else waiting[1]
        self._calm[glider] = min(now + CALM, end), end
        return True

    def _speak(self, glider: str) -> None:
        """Say what is to be said of a glider without a new file."""
        if self._speaking(glider) is not None:
            self._say(glider)

    def _say(self, glider: str) -> None:
        params = self._parts.config.glider(glider)
        self.alerted(
            transaction.notify_pilots(self._store, glider, params, self._parts.speaking, time.time())
        )

    def _told(self, taken: transaction.FileOutcome, seconds: float | None = None) -> None:
        logs.taken(taken)
        self._upkeep.took(taken, seconds)
        self.alerted(taken.alerts)
