"""Work on many missions: on the cores at hand or on the workers of a scheduler, by Dask distributed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import dask
from distributed import Client, LocalCluster, as_completed

from gliderwatch.errors import GliderwatchError

T = TypeVar("T")
PATIENCE = "15s"
"""How long a scheduler that is named may take to answer."""


@contextmanager
def client(address: str | None, workers: int | None = None) -> Iterator[Client]:
    """A client of the scheduler at `address`; None: of a cluster of its own, one worker a core or `workers`.

    Raises GliderwatchError where no scheduler answers.
    """
    # A worker is one process with one thread, and decodes in a process of its own, which a daemon may not.
    quiet = {
        "distributed.admin.tick.limit": "1h",
        "distributed.scheduler.allowed-failures": 5,
        "distributed.worker.daemon": False,
    }
    with dask.config.set(quiet):
        if address is not None:
            try:
                with Client(address, timeout=PATIENCE) as remote:
                    yield remote
                return
            except (OSError, ValueError) as error:
                raise GliderwatchError(
                    f"no Dask scheduler answers at {address}: {error}. Start one by `dask scheduler`, and "
                    f"workers by `DASK_DISTRIBUTED__WORKER__DAEMON=False dask worker {address} --nthreads 1` "
                    "with gliderwatch[archive] installed"
                ) from None
        n = workers or len(os.sched_getaffinity(0))
        with (
            LocalCluster(
                n_workers=n, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
            ) as own,
            Client(own) as here,
        ):
            yield here


def run_all(
    work: Callable[[T], Any],
    tasks: Sequence[T],
    cluster: Client,
    on_done: Callable[[T, Any], None],
) -> list[str]:
    """Do `work` on all `tasks`; what went wrong, in words.

    A task whose worker died is handed to another, up to five times. The order in which tasks end is that of
    chance: what `on_done` does must not depend on it.
    """
    futures = {cluster.submit(work, task, pure=False): task for task in tasks}
    failed = list[str]()
    for future in as_completed(list(futures)):
        task = futures[future]
        try:
            on_done(task, future.result())
        except GliderwatchError as error:
            failed.append(str(error))
        except Exception as error:  # a worker that dies again and again: Dask has many words
            failed.append(f"{task}: given up: {type(error).__name__}: {error}")
    return failed
