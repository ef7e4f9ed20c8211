"""Work handed to processes: all of it is done, whoever dies; the results are those of one process."""

from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from gliderwatch.archive import cluster
from gliderwatch.errors import GliderwatchError


def squared(n: int) -> int:
    if n == 3:
        raise GliderwatchError("three cannot be done")
    return n * n


def dies_once(mark: Path, n: int) -> int:
    """Ends the process that works on 2, the first time."""
    if n == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(n)


@pytest.mark.slow  # two starts of a process that imports all
def test_a_worker_that_dies_loses_nothing(tmp_path: Path) -> None:
    done: dict[int, int] = {}
    failed = cluster.run_all(partial(dies_once, tmp_path / "died"), range(6), done.__setitem__, workers=1)
    assert (tmp_path / "died").exists()
    assert failed == ["three cannot be done"]
    assert dict(sorted(done.items())) == {n: n * n for n in range(6) if n != 3}


def test_without_dask_this_process_does_it(monkeypatch) -> None:
    monkeypatch.setattr(cluster, "find_spec", lambda _name: None)
    done: dict[int, int] = {}
    assert cluster.run_all(squared, [1, 2, 3, 3], done.__setitem__) == ["three cannot be done"]
    assert done == {1: 1, 2: 4}
    with pytest.raises(GliderwatchError, match=r"need the extra gliderwatch\[archive\]"):
        cluster.run_all(squared, [1], done.__setitem__, workers=2)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", "0.2s")
    with pytest.raises(GliderwatchError, match="no Dask scheduler answers"):
        cluster.run_all(squared, [1], lambda _task, _result: None, "tcp://127.0.0.1:9")
