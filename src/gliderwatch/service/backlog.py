"""Files that settled and wait for the decoder: in order within a glider, in turn between gliders."""

from __future__ import annotations

import heapq
from collections import OrderedDict, deque
from dataclasses import dataclass, field
from itertools import chain

from gliderwatch.model import Segment
from gliderwatch.slocum.header import Header
from gliderwatch.store.state_file import File


class Backlog:
    """Oldest first within each glider, so that nothing has to be taken back; gliders take turns.

    One glider with a month of files delays no other: one that had none at hand is next. A file that takes
    long to decode delays its own glider alone. ``decoding`` counts the files that are being decoded.
    """

    def __init__(self) -> None:
        self._queues: OrderedDict[str, _Queue] = OrderedDict()
        self._new: dict[str, None] = {}
        self._paths: set[str] = set()
        self.decoding = 0

    def __len__(self) -> int:
        return len(self._paths)

    def add(self, job: Job) -> None:
        """Put a file into the queue of its glider; one that is there already stays as it is."""
        if job.file.path in self._paths:
            return
        self._paths.add(job.file.path)
        glider = job.header.id.glider
        if glider not in self._queues:  # a file that just came does not wait for a round of all gliders
            self._queues[glider] = _Queue()
            self._new[glider] = None
        queue = self._queues[glider]
        heapq.heappush(queue.waiting, (job.header.id.opened_at, job.header.id.name, job.file.path, job))

    def next(self) -> Job | None:
        """The file to decode next, None when there is none."""
        for glider in chain(self._new, self._queues):
            queue = self._queues[glider]
            if queue.waiting and len(queue.decoding) < AHEAD:
                job = heapq.heappop(queue.waiting)[-1]
                queue.decoding.append(job)
                self._queues.move_to_end(glider)
                self._new.pop(glider, None)
                self.decoding += 1
                return job
        return None

    def finish(self, job: Job, result: Segment | Exception) -> None:
        """Note what became of a file that was being decoded."""
        job.result = result
        self.decoding -= 1

    def decoded(self, glider: str) -> Job | None:
        """The next file of a glider to take, which leaves: decoded, and none before it is still in work."""
        queue = self._queues.get(glider)
        if queue is None or not queue.decoding or queue.decoding[0].result is None:
            return None
        job = queue.decoding.popleft()
        self._paths.discard(job.file.path)
        if not queue.waiting and not queue.decoding:
            del self._queues[glider]
        return job

    def more(self, glider: str) -> bool:
        """Whether more files of a glider are at hand."""
        return glider in self._queues

    def behind(self, glider: str) -> int:
        """How many more files of a glider are at hand."""
        queue = self._queues.get(glider)
        return 0 if queue is None else len(queue.waiting) + len(queue.decoding)


@dataclass(slots=True)
class Job:
    """A file to decode, ``begun`` (s, monotonic); ``result`` is there once it is decoded or has failed.

    ``offset`` is what is to be added to the glider's clock (s), as far as headers tell.
    """

    file: File
    header: Header
    result: Segment | Exception | None = None
    begun: float | None = None
    offset: float = 0.0

    @property
    def opened_at(self) -> float:
        """When the file was opened (s), by a clock that is right."""
        return self.header.id.opened_at + self.offset


@dataclass(slots=True)
class _Queue:
    waiting: list[tuple[float, str, str, Job]] = field(default_factory=list)
    decoding: deque[Job] = field(default_factory=deque)


AHEAD = 16
"""Files of one glider that may be decoded, or done with it, before the first of them is taken."""
