"""Files that settled and wait for the decoder: in order within a glider, in turn between gliders."""

from __future__ import annotations

import heapq
from collections import OrderedDict, deque
from dataclasses import dataclass, field
from itertools import chain, islice, takewhile

from gliderwatch.model import Segment
from gliderwatch.slocum.header import Header
from gliderwatch.store.state_file import File


class Backlog:
    """Oldest first within each glider, so that nothing has to be taken back; gliders take turns.

    One glider with a month of files delays no other: one that had none at hand is next. A file that takes
    long to decode delays its own glider alone. ``decoding`` counts the files that are being decoded,
    ``running`` the runs that are being processed.

    Files are taken in runs once `LONG` of them are at hand, until none is: for fewer it takes longer to begin
    the processes that do it.
    """

    def __init__(self) -> None:
        self._queues: OrderedDict[str, _Queue] = OrderedDict()
        self._new: dict[str, None] = {}
        self._paths: set[str] = set()
        self.decoding = self.running = self._held = 0
        self._is_long = False

    def __len__(self) -> int:
        return len(self._paths)

    def add(self, job: Job) -> None:
        """Put a file into the queue of its glider; one that is there already stays as it is."""
        if job.file.path in self._paths:
            return
        self._paths.add(job.file.path)
        self._is_long |= len(self._paths) >= LONG
        glider = job.header.id.glider
        if glider not in self._queues:  # a file that just came does not wait for a round of all gliders
            self._queues[glider] = _Queue()
            self._new[glider] = None
        queue = self._queues[glider]
        heapq.heappush(queue.waiting, (job.header.id.opened_at, job.header.id.name, job.file.path, job))

    def next(self) -> Job | None:
        """The file to decode next, None when there is none."""
        for glider in self._new if self.is_full else chain(self._new, self._queues):
            queue = self._queues[glider]
            if queue.waiting and len(queue.decoding) < AHEAD:
                job = heapq.heappop(queue.waiting)[-1]
                queue.decoding.append(job)
                queue.in_turn = (queue.in_turn + 1) % RUN
                if not queue.in_turn or not queue.waiting:
                    self._queues.move_to_end(glider)
                self._new.pop(glider, None)
                self.decoding += 1
                self._held += 1
                return job
        return None

    @property
    def is_full(self) -> bool:
        """Whether so many files are decoded, or being decoded, that no more are begun but of gliders that had
        none at hand."""
        return self._held >= HELD

    def finish(self, job: Job, result: Segment | Exception) -> None:
        """Note what became of a file that was being decoded."""
        job.result = result
        self.decoding -= 1

    def decoded(self, glider: str) -> Job | None:
        """The next file of a glider to take, which leaves: decoded, and none before it is still in work."""
        queue = self._queues.get(glider)
        if queue is None or queue.in_run or not queue.decoding or queue.decoding[0].result is None:
            return None
        job = queue.decoding.popleft()
        self._held -= 1
        self._paths.discard(job.file.path)
        self._is_long &= bool(self._paths)
        if not queue.waiting and not queue.decoding:
            del self._queues[glider]
        return job

    def ready(self, glider: str) -> list[Job]:
        """The next files of a glider to take that are decoded, as many as may make a run, one where the list
        is short; none while a run is being processed, or while more files are on their way to be in it: those
        being decoded, and those of the glider whose turn it is."""
        queue = self._queues.get(glider)
        if queue is None or queue.in_run:
            return []
        most = RUN if self._is_long else 1
        found = list(islice(takewhile(lambda job: job.result is not None, queue.decoding), most))
        is_its_turn = bool(queue.waiting) and next(iter(self._queues)) == glider
        is_fed = not self.is_full or self.running > 0  # a run that ends lets go of its files
        is_more_to_come = len(found) < len(queue.decoding) or (is_its_turn and is_fed)
        return [] if len(found) < most and is_more_to_come and self.behind(glider) >= FEWEST else found

    def begin_run(self, glider: str, files: int) -> None:
        """The next files of a glider are being processed."""
        self._queues[glider].in_run = files
        self.running += 1

    def end_run(self, glider: str) -> list[Job]:
        """They are no more; which files they are."""
        queue = self._queues[glider]
        files, queue.in_run = queue.in_run, 0
        self.running -= 1
        return list(islice(queue.decoding, files))

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

    ``is_alone``: it is not to be in a run with others, one of which could not be processed.

    ``offset`` is what is to be added to the glider's clock (s), as far as headers tell.
    """

    file: File
    header: Header
    result: Segment | Exception | None = None
    begun: float | None = None
    offset: float = 0.0
    is_alone: bool = False

    @property
    def opened_at(self) -> float:
        """When the file was opened (s), by a clock that is right."""
        return self.header.id.opened_at + self.offset


@dataclass(slots=True)
class _Queue:
    waiting: list[tuple[float, str, str, Job]] = field(default_factory=list)
    decoding: deque[Job] = field(default_factory=deque)
    in_turn: int = 0
    in_run: int = 0


RUN = 16
"""Files of one glider that are decoded before another has its turn, and that a worker processes at once."""
LONG = 100
"""Files at hand from which on they are taken in runs: some 10 ms of work each, and about a second until the
processes that do it have begun."""
FEWEST = 4
"""Files of a glider at hand from which on they are taken in runs; fewer are taken as each is decoded."""
HELD = 8 * RUN
"""Files that are decoded, or being decoded, at once: their samples are in memory."""
AHEAD = 2 * RUN
"""Files of one glider that may be decoded, or done with it, before the first of them is taken."""
