"""Processes that work for the daemon: how they are begun and ended."""

import gc
import multiprocessing
import os
import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest

from gliderwatch.processes import Workers


class Watched(Workers):
    """Keeps which of its processes live as its channels are closed; they have 20 s at most to die."""

    def __init__(self) -> None:
        self.others = multiprocessing.active_children()
        super().__init__(2, prepare)

    def own(self) -> list[multiprocessing.Process]:
        return [child for child in multiprocessing.active_children() if child not in self.others]

    def join(self, timeout: float | None = None) -> None:
        deadline = time.monotonic() + 20.0
        while self.own() and time.monotonic() < deadline:
            time.sleep(0.01)
        self.alive = self.own()
        super().join(timeout)


def prepare() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)


@pytest.mark.parametrize("seconds", [0.0, 0.1, 1.0])
def test_processes_end_before_what_they_speak_through_also_while_they_are_born(seconds):
    pool = Watched()
    assert pool.active
    assert len(pool.own()) == 2
    time.sleep(seconds)
    pool.end()
    assert pool.alive == []


def test_they_leave_no_pipe_open():
    """At once, not when the garbage is collected: a service that is watched for leaks counts them."""

    def begun_and_ended() -> int:
        pool = Watched()
        assert pool.schedule(os.getpid).result(timeout=60.0)
        pool.end()
        del pool
        return pipes()

    begun_and_ended()  # what multiprocessing itself keeps
    gc.collect()
    gc.disable()
    try:
        assert begun_and_ended() == begun_and_ended()
    finally:
        gc.enable()


def pipes() -> int:
    found = 0
    for fd in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # the one that the folder is read by
            found += str(fd.readlink()).startswith("pipe:")
    return found


def test_none_is_begun_once_they_have_ended():
    pool = Watched()
    assert pool.schedule(os.getpid).result(timeout=60.0) in [child.pid for child in pool.own()]
    pool.end()
    with pytest.raises(RuntimeError):
        pool.schedule(os.getpid)
    with pytest.raises(RuntimeError):  # as pebble's thread may just then
        pool._pool_manager.worker_manager.create_workers()
    assert pool.own() == []
