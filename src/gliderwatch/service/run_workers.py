"""Processes that process runs of segments: what a long list of files needs most of."""

from __future__ import annotations

import copyreg
import multiprocessing
import os
import signal
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from types import MappingProxyType
from typing import Any

from pebble import ProcessExpired, ProcessPool

from gliderwatch.errors import GliderwatchError, NotAssessed, Retry
from gliderwatch.params import GliderParams
from gliderwatch.service.run import Processed, Run, processed_for_another

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
        self._pool: ProcessPool | None = None

    def submit(self, run: Run, params: GliderParams, is_kept: Sequence[bool]) -> Future[Processed]:
        """A run to be processed as by `processed_for_another`."""
        for _ in range(2):
            if self._pool is None:
                context = multiprocessing.get_context("spawn")  # to fork a process with threads is unsafe
                most = min(MOST, len(os.sched_getaffinity(0)))
                self._pool = ProcessPool(max_workers=most, initializer=_prepare, context=context)
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
            self._pool.stop()  # type: ignore[no-untyped-call]
            self._pool.join()
            self._pool = None


def why_not(error: BaseException) -> GliderwatchError:
    """Why a file could not be processed, from what its run ended with."""
    if isinstance(error, GliderwatchError):
        return error
    if isinstance(error, TimeoutError):
        return NotAssessed(f"cannot be assessed, please report it (took longer than {LIMIT:.0f} s)")
    if isinstance(error, ProcessExpired) and -error.exitcode in (
        signal.SIGTERM,
        signal.SIGKILL,
        signal.SIGHUP,
    ):
        return Retry("the process that assessed it was ended from outside")
    return NotAssessed(f"cannot be assessed, please report it ({type(error).__name__}: {error})")


def _prepare() -> None:
    """What a worker does first: it dies at once when it is told to."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _frozen(value: Mapping[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(dict(value))


copyreg.pickle(MappingProxyType, lambda value: (_frozen, (dict(value),)))
