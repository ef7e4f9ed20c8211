"""Stand-ins for `decode` that run in a worker process and do what damaged files have made dbdreader do."""

from __future__ import annotations

import ctypes
import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path

from gliderwatch.errors import Quarantine
from gliderwatch.ingest.decode import decode


def misbehave(path: Path, cache_folders: Sequence[Path]) -> object:
    """Does what the file's name says, else decodes it."""
    match path.stem:
        case "hang":
            _hang()
        case "hang-in-c":
            ctypes.PyDLL(None).sleep(60)  # keeps the interpreter's lock, as foreign code does
        case "crash":
            ctypes.string_at(0)
        case "exit":
            os._exit(3)
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "memory":
            return bytearray(8 * 1024**3)
        case "error":
            raise IndexError("index 9 is out of bounds")
        case "exits":
            raise SystemExit(1)
        case "program":
            return _Program(path)
        case "slow":
            time.sleep(0.2)
            raise Quarantine("slow")
        case "pid":
            raise Quarantine(str(os.getpid()))
        case _:
            return decode(path, cache_folders)
    return None


class _Program:
    """Writes a file beside another when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> object:
        return Path.touch, (self._path.with_suffix(".written"),)


def _hang() -> None:
    while True:
        pass
