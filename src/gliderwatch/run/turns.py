"""The files of several gliders in the order of their sending: for a replay, whose time is theirs."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator

from gliderwatch.model import Segment
from gliderwatch.run.backlog import Job

LONGEST = 2 * 86400.0
"""Seconds after which a file is sent at the latest: if the next is opened later, there was a pause."""


class Turns:
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
