"""The order in which a replay takes files and logs of calls: that of their sending."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from gliderwatch.model import Segment
from gliderwatch.service import judgement
from gliderwatch.service.backlog import Job
from gliderwatch.slocum.calls import Dialog
from gliderwatch.slocum.folders import is_log
from gliderwatch.store.state_file import File, Store

LONGEST = 2 * 86400.0
"""Seconds after which a file is sent at the latest: if the next is opened later, there was a pause."""


class ReplayOrder:
    """Puts decoded jobs, which come as their files were opened, into the order of their sending."""

    def __init__(self, jobs: Iterable[Job]) -> None:
        self._coming: dict[str, deque[float]] = {}
        self._ready: dict[str, deque[Job]] = {}
        for job in jobs:
            self._coming.setdefault(job.header.id.glider, deque()).append(job.opened_at)
            self._ready[job.header.id.glider] = deque()

    def after(self, job: Job) -> Iterator[tuple[Job, float]]:
        """The jobs whose turn it is once one more is decoded, each with the time (s) of its sending."""
        self._coming[job.header.id.glider].popleft()
        self._ready[job.header.id.glider].append(job)
        while heads := [(self._sent(glider), glider) for glider, ready in self._ready.items() if ready]:
            sent, first = min(heads)
            if any(c and c[0] < sent and not self._ready[g] for g, c in self._coming.items()):
                return  # a file that was opened before may have been sent before
            yield self._ready[first].popleft(), sent

    def _sent(self, glider: str) -> float:
        """When the first file that is ready was sent: at its end, else before the next was opened."""
        job, *later = self._ready[glider]
        if isinstance(job.result, Segment):
            return job.result.last_t + job.offset
        opened = job.opened_at
        coming = [*(j.opened_at for j in later), *self._coming[glider]]
        return min(next(iter(coming), opened), opened + LONGEST)


@dataclass(frozen=True, slots=True)
class Log:
    """A log as it was read; ``dialog`` is None where it could not be."""

    file: File
    dialog: Dialog | None

    @property
    def sent(self) -> float:
        """When the call was over (s); a log that tells nothing comes first."""
        return 0.0 if self.dialog is None else self.dialog.call.last_t


def find_logs(folders: Iterable[Path]) -> list[Path]:
    """All logs of calls below some folders, each once."""
    found = {
        path.resolve() if path.is_symlink() else path: None
        for folder in folders
        for path in sorted([folder] if folder.is_file() else folder.rglob("*.[lL][oO][gG]"))
        if is_log(path.name) and not path.is_dir()
    }
    return list(found)


def read_logs(paths: Iterable[Path], store: Store, is_wanted: Callable[[str], bool]) -> list[Log]:
    """The logs at some paths, in the order in which the calls were over."""
    found = (judgement.judge_log(path, store, is_wanted) for path in paths)
    return sorted((Log(*one) for one in found if one is not None), key=lambda log: (log.sent, log.file.path))
