"""Work on many missions or cells: on the cores at hand or on the workers of a scheduler, by Dask distributed.

Without Dask it is done here, one after another.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any, TypeVar

from gliderwatch.errors import GliderwatchError
from gliderwatch.score.work import version

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")
PATIENCE = "15s"
"""How long a scheduler that is named may take to answer, and to have a worker."""
START_PATIENCE = "10m"
"""How long a worker here may take to load all, on a machine that is busy with other work."""
_STEADY = {
    "distributed.comm.timeouts.connect": START_PATIENCE,
    "distributed.comm.timeouts.tcp": START_PATIENCE,
    "distributed.scheduler.worker-ttl": None,
    "distributed.deploy.lost-worker-timeout": START_PATIENCE,
}
"""On one machine a worker that is silent is only slow: given up after 15 or 30 s, it would never be replaced.
One that dies closes its connection, and is started again at once."""
START = "DASK_DISTRIBUTED__WORKER__DAEMON=False dask worker {} --nthreads 1"
"""How a worker is started: one thread, and free to decode in a process of its own."""


def run_all(
    work: Callable[[T], Any],
    tasks: Sequence[T],
    on_done: Callable[[T, Any], None],
    address: str | None = None,
    workers: int | None = None,
) -> list[str]:
    """Do `work` on all `tasks`; what went wrong, in words, each once.

    They are handed to the workers of the scheduler at `address`; None: to processes here, one a core or
    `workers` of them, or to this one where Dask is not installed. A task whose worker died is handed to
    another, up to five times. The order in which tasks end is that of chance: what `on_done` does must not
    depend on it.

    Raises GliderwatchError where no scheduler answers, has no worker, or a worker cannot do it.
    """
    if not tasks:
        return []
    failed = dict[str, None]()

    def ended(task: T, result: Callable[[], Any]) -> None:
        try:
            on_done(task, result())
        except GliderwatchError as error:
            failed[str(error)] = None

    if find_spec("distributed") is None:
        if address is not None or (workers or 1) > 1:
            raise GliderwatchError(
                "Dask is not installed: --cluster and --workers need the extra gliderwatch[archive], which "
                "the wheelhouse of docs/install.md holds. Without them one after another is done here"
            )
        for task in tasks:
            ended(task, partial(work, task))
        return list(failed)
    with client(address, min(workers or _cores(), len(tasks))) as hands:
        futures = {hands.submit(work, task, pure=False): task for task in tasks}
        for future in _as_completed(futures):
            task = futures.pop(future)
            ended(task, partial(_result, task, future))
    return list(failed)


def _as_completed(futures: Iterable[Future]) -> Iterator[Future]:
    from distributed import as_completed  # noqa: PLC0415

    yield from as_completed(list(futures))


def _result(task: object, future: Future) -> Any:
    """What a worker made. Raises GliderwatchError where it could not, or its workers died again and again."""
    try:
        return future.result()
    except GliderwatchError:
        raise
    except Exception as error:  # Dask has many words
        raise GliderwatchError(f"{task}: given up: {type(error).__name__}: {error}") from None


@contextmanager
def client(address: str | None, workers: int) -> Iterator[Client]:
    """A client of the scheduler at `address`; None: of a cluster of its own with so many `workers`.

    Raises GliderwatchError where no scheduler answers, has no worker, or one cannot do the work.
    """
    import dask  # noqa: PLC0415
    from distributed import Client, LocalCluster  # noqa: PLC0415

    # A worker is one process with one thread, and decodes in a process of its own, which a daemon may not.
    quiet = {
        "distributed.admin.tick.limit": "1h",
        "distributed.scheduler.allowed-failures": 5,
        "distributed.worker.daemon": False,
    }
    with dask.config.set(quiet):
        if address is not None:
            with _at(address) as remote:
                yield remote
            return
        with dask.config.set(_STEADY), _deaf():  # to Ctrl-C: this process ends them, without a word
            own = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",  # any port that is free, and none for others to see
                silence_logs=50,
            )
            here = Client(own)
        with own, here:
            try:
                here.wait_for_workers(1, timeout=START_PATIENCE)  # the others join when they are there
            except TimeoutError:
                raise GliderwatchError(
                    f"no worker process came up within {START_PATIENCE}: is there memory left? With "
                    "--workers 1 it takes least"
                ) from None
            yield here


@contextmanager
def _at(address: str) -> Iterator[Client]:
    from distributed import Client  # noqa: PLC0415

    start = START.format(address)
    try:
        remote = Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise GliderwatchError(
            f"no Dask scheduler answers at {address}: {error}. Start one by `dask scheduler`, and workers by "
            f"`{start}` with gliderwatch[archive] installed"
        ) from None
    with remote:
        try:
            remote.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise GliderwatchError(
                f"the scheduler at {address} has no worker: start some by `{start}` with "
                "gliderwatch[archive] installed"
            ) from None
        _check(remote, start)
        yield remote


def _check(remote: Client, start: str) -> None:
    """Raises GliderwatchError where a worker has other sources, or may start no process that decodes."""
    try:
        found = remote.run(ability)
    except Exception as error:
        raise GliderwatchError(
            f"a worker cannot load gliderwatch ({type(error).__name__}: {error}): start it in an environment "
            "with gliderwatch[archive]"
        ) from None
    for worker, (its, daemon) in found.items():
        if its != version():
            raise GliderwatchError(
                f"the worker at {worker} has another gliderwatch, so that its results could differ: install "
                "the same there, and start it again"
            )
        if daemon:
            raise GliderwatchError(
                f"the worker at {worker} may not start processes, which decoding needs: start it by `{start}`"
            )


def ability() -> tuple[str, bool]:
    """Of the process that is asked: the hash of its sources, and whether it is a daemon, which may start no
    processes."""
    return version(), multiprocessing.current_process().daemon


def _cores() -> int:
    return len(os.sched_getaffinity(0))


@contextmanager
def _deaf() -> Iterator[None]:
    """Threads and processes that begin inside do not hear Ctrl-C; this one hears it afterwards."""
    resource_tracker.ensure_running()  # the first process would start it, and hear Ctrl-C again after that
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
