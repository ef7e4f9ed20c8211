"""A run of segments of one glider, processed one after another: a value in, a value out; and the processes
that do so where many files are at hand.

What is to be processed is read from the state file, processed while nobody's write waits for it, and
committed if by then the same is to be processed (`service.transaction`).
"""

from __future__ import annotations

import copyreg
import os
import signal
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from pebble import ProcessExpired

from gliderwatch.errors import GliderwatchError, NotAssessed, Retry
from gliderwatch.model import Segment
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, Outcome, process
from gliderwatch.processes import NotBegun, Workers
from gliderwatch.sea.ocean_field import Field
from gliderwatch.store.codec import encode_state
from gliderwatch.store.segments import Plan


@dataclass(frozen=True, slots=True)
class Run:
    """A plan with all that it needs: the state after its base, its segments with what calls add to them."""

    plan: Plan
    state: GliderState
    segments: tuple[Segment, ...]


@dataclass(frozen=True, slots=True)
class Processed:
    """The outcome of each segment of a plan, and the state to be kept after each: as it is, as its record, or
    None. The outcomes of a worker have no state but the last."""

    plan: Plan
    outcomes: tuple[Outcome, ...]
    states: tuple[GliderState | bytes | None, ...]


class StoppedError(GliderwatchError):
    """The daemon ends while an input is processed: nothing of it is kept, the next start processes it."""


def processed(
    run: Run, params: GliderParams, ocean: Field | None, stopping: Callable[[], bool] = lambda: False
) -> Processed:
    """Process a run. Raises NotAssessed for a segment that cannot be assessed, StoppedError once `stopping`
    holds."""
    state, outcomes = run.state, list[Outcome]()
    for segment in run.segments:
        if stopping():
            raise StoppedError(f"{segment.id.name} was not processed: the daemon ends")
        outcomes.append(_outcome(state, segment, params, ocean))
        state = outcomes[-1].state
    return Processed(run.plan, tuple(outcomes), tuple(outcome.state for outcome in outcomes))


def processed_for_another(run: Run, params: GliderParams, is_kept: Sequence[bool]) -> Processed:
    """Process a run in a worker: what is not to be kept is not sent back."""
    done = processed(run, params, None)
    *before, last = done.outcomes
    records = [encode_state(one.state) if kept else None for one, kept in zip(before, is_kept, strict=False)]
    bare = [replace(one, state=GliderState()) for one in before]
    return Processed(run.plan, (*bare, last), (*records, last.state))


def _outcome(state: GliderState, segment: Segment, params: GliderParams, ocean: Field | None) -> Outcome:
    """`process`, in which one segment of unforeseen content must not stop all gliders for good."""
    try:
        return process(state, segment, params, ocean)
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise NotAssessed(f"cannot be assessed, please report it ({segment.id.name}: {what})") from error


LIMIT = 60.0
"""Seconds that a run may take; one of 16 files takes some tenths."""
MOST = 4
"""Processes at most: more than the one that commits can keep up with."""


class RunWorkers:
    """A process for each core, `MOST` at most, begun when there is a run; used by one thread.

    They end where nothing is at hand: a daemon that waits needs no memory for them. They are not those that
    decode: no foreign code that a damaged file leads astray has been in them.
    """

    def __init__(self) -> None:
        self._pool: Workers | None = None

    def submit(self, run: Run, params: GliderParams, is_kept: Sequence[bool]) -> Future[Processed]:
        """A run to be processed as by `processed_for_another`."""
        for _ in range(2):
            if self._pool is None:
                self._pool = Workers(min(MOST, len(os.sched_getaffinity(0))), _prepare)
            try:
                args = (run, params, tuple(is_kept))
                made: Future[Processed] = self._pool.schedule(processed_for_another, args=args, timeout=LIMIT)
                return made
            except RuntimeError:  # the pool gives up for good when a worker dies that has nothing to do
                self.stop()
        raise RuntimeError("the worker processes cannot be started")

    def stop(self) -> None:
        """End the processes at once."""
        if self._pool is not None:
            self._pool.end()
            self._pool = None


_FROM_OUTSIDE = (signal.SIGTERM, signal.SIGKILL, signal.SIGHUP)


def why_not(error: BaseException) -> GliderwatchError:
    """Why a file could not be processed, from what its run ended with."""
    if isinstance(error, GliderwatchError):
        return error
    if isinstance(error, TimeoutError):
        return NotAssessed(f"cannot be assessed, please report it (took longer than {LIMIT:.0f} s)")
    killed = isinstance(error, ProcessExpired) and -error.exitcode in _FROM_OUTSIDE
    if killed or isinstance(error, NotBegun):
        return Retry("the process that assessed it was ended from outside")
    return NotAssessed(f"cannot be assessed, please report it ({type(error).__name__}: {error})")


def _prepare() -> None:
    """What a worker does first: nothing here gains from threads of linear algebra."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _frozen(value: Mapping[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(dict(value))


copyreg.pickle(MappingProxyType, lambda value: (_frozen, (dict(value),)))
