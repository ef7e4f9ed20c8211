"""Processes that work for the daemon: begun afresh, as a fork with threads is unsafe, and ended at once."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Lock
from typing import Any

from pebble import ProcessPool

NotBegun = BrokenProcessPool
"""What a job ends with whose process had died before it began it: nothing speaks against the job."""


class Workers(ProcessPool):
    """A pool of processes that `end` ends before what they speak through.

    Pebble closes that first: a process that is just being born then dies of its absence, with a traceback.
    """

    def __init__(self, most: int, initializer: Callable[..., None], initargs: Sequence[object] = ()) -> None:
        self._begun = _Begun()
        context: Any = _Context(self._begun)
        super().__init__(most, initializer=_born, initargs=(initializer, *initargs), context=context)

    def end(self) -> None:
        """End all of them at once, whatever they do. No job may be given to them any more."""
        self.stop()  # type: ignore[no-untyped-call]
        self._begun.end()
        self.join()


def _born(initializer: Callable[..., None], *arguments: object) -> None:
    """What each process does first. Pebble has it ignore what is typed at a terminal, and end in its own way
    when it is told to; it is to die at once, also inside foreign code."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    initializer(*arguments)


class _Begun:
    """The processes of one pool that were begun and may still live."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._processes: list[SpawnProcess] = []
        self._ended = False

    def begin(self, process: SpawnProcess, start: Callable[[], None]) -> None:
        """Start a process. Raises OSError after `end`."""
        with self._lock:
            if self._ended:
                raise OSError("the processes have been ended")
            start()
            self._processes = [*(one for one in self._processes if one.is_alive()), process]

    def end(self) -> None:
        """Kill all of them, and forget them: one that is remembered keeps two pipes open."""
        with self._lock:
            self._ended = True
            for process in self._processes:
                process.kill()
            self._processes = []


class _Process(SpawnProcess):
    def __init__(self, begun: _Begun, **made_of: Any) -> None:
        super().__init__(**made_of)
        self._begun_with = begun

    def __getstate__(self) -> dict[str, Any]:
        """What it takes along into its own life."""
        return {name: value for name, value in vars(self).items() if name != "_begun_with"}

    def start(self) -> None:
        """Start it, and have it remembered."""
        self._begun_with.begin(self, super().start)


class _Context(SpawnContext):
    def __init__(self, begun: _Begun) -> None:
        super().__init__()
        self._begun = begun

    def Process(self, **made_of: Any) -> _Process:  # type: ignore[override]  # noqa: N802 (multiprocessing)
        return _Process(self._begun, **made_of)
