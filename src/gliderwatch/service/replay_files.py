"""The files and logs of calls that a replay finds, in the order of their sending."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gliderwatch.model import Segment
from gliderwatch.navigation.clock import Stamp, corrections, is_same, numbered
from gliderwatch.service import judgement
from gliderwatch.service.backlog import Job
from gliderwatch.slocum.calls import Dialog
from gliderwatch.slocum.folders import is_log, kind
from gliderwatch.store.state_file import File, Store

LONGEST = 2 * 86400.0
"""Seconds after which a file is sent at the latest: if the next is opened later, there was a pause."""


def find_files(folders: Iterable[Path]) -> list[Path]:
    """All flight data files below some folders, each once.

    The folders may be links. Below them a link is treated as the service does: a file that is one is named
    and left alone, a folder that is one is not looked into.
    """
    found = {
        path: None
        for folder in folders
        for path in sorted([folder] if folder.is_file() else folder.rglob("*"))
        if kind(path.name) is not None and (path.is_symlink() or not path.is_dir())
    }
    return list(found)


def correct_clocks(jobs: Sequence[Job]) -> None:
    """Give the files of a glider whose clock fell back their turn: when they were sent, not years before."""
    missions: dict[tuple[str, str], dict[str, list[list[Job]]]] = {}
    for job in jobs:
        mission = job.header.id.glider, numbered(job.header.id.name)[0]
        segments = missions.setdefault(mission, {}).setdefault(job.header.id.name, [])
        copies = next((s for s in segments if is_same(s[0].header.id, job.header.id)), None)
        if copies is None:
            segments.append([job])
        else:
            copies.append(job)
    for by_name in missions.values():
        segments = [copies for found in by_name.values() for copies in found]
        opened = [(copies[0].header.id.name, copies[0].header.id.opened_at) for copies in segments]
        stamps = [Stamp(numbered(name)[1], t, t) for name, t in opened]
        for copies, correction in zip(segments, corrections(stamps), strict=True):
            for job in copies:
                job.offset = correction.offset


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
