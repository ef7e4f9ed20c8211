"""All cells on all cores; what is done stays done."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path

from gliderwatch.errors import GliderwatchError
from gliderwatch.score.grid import Cell
from gliderwatch.score.record import Record
from gliderwatch.score.work import Task, read_result, result_path, work


def to_do(cells: Iterable[Cell], estimators: Sequence[str], out: Path) -> list[Task]:
    """The cells of which a result is still missing."""
    tasks = []
    for cell in cells:
        paths = {e: result_path(out, cell, e) for e in estimators}
        missing = {e: path for e, path in paths.items() if read_result(path) is None}
        if missing:
            tasks.append(Task(cell, tuple(missing), tuple(missing.values())))
    return tasks


def run_all(tasks: Sequence[Task], on_done: Callable[[], None]) -> list[str]:
    """Run tasks in worker processes, as many as cores; what went wrong, in words.

    Stopped from the keyboard, it leaves the results of what was done.
    """
    if not tasks:
        return []
    cores = len(os.sched_getaffinity(0))
    context = multiprocessing.get_context("spawn")  # to fork a process with threads is unsafe
    failed: dict[str, None] = {}  # of one mission all cells fail alike
    with ProcessPoolExecutor(min(cores, len(tasks)), mp_context=context) as pool:
        with _deaf():  # to Ctrl-C, for good: it is this process that ends them, without a word of theirs
            futures = [pool.submit(work, task) for task in tasks]
        try:
            for future in as_completed(futures):
                try:
                    future.result()
                except GliderwatchError as error:
                    failed[str(error)] = None
                on_done()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise
    return list(failed)


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes that begin inside do not hear Ctrl-C; this one hears it afterwards."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def results(cells: Iterable[Cell], estimators: Iterable[str], out: Path) -> list[Record]:
    """The results that there are, estimator by estimator, in the order of the cells."""
    cells = list(cells)
    found = (read_result(result_path(out, cell, e)) for e in estimators for cell in cells)
    return [record for record in found if record is not None]
