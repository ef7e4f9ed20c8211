"""A folder for scratch files that does not outlive its process for long, even after SIGKILL.

Its maker holds a lock on it; the next one removes those that nobody holds.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

_PREFIX = "gliderwatch-scratch-"


class Scratch:
    """A new empty folder below TMPDIR, private to this user."""

    def __init__(self) -> None:
        _sweep(Path(tempfile.gettempdir()))
        while True:
            self.name = tempfile.mkdtemp(prefix=_PREFIX)
            with suppress(OSError):  # another process may have swept it before it was locked
                self._lock = os.open(self.name, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
                fcntl.flock(self._lock, fcntl.LOCK_EX)
                if Path(self.name).is_dir():
                    return
                os.close(self._lock)

    def cleanup(self) -> None:
        """Remove it; may be called twice."""
        shutil.rmtree(self.name, ignore_errors=True)
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1


def _sweep(folder: Path) -> None:
    for left in folder.glob(_PREFIX + "*"):
        try:
            if left.lstat().st_uid != os.getuid():
                continue
            lock = os.open(left, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        except OSError:
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(left, ignore_errors=True)
        except OSError:  # somebody's
            pass
        finally:
            os.close(lock)
