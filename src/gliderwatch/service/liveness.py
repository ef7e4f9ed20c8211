"""The file that a daemon locks so that it is alone, and touches as a sign of life; and what systemd is told
(sd_notify(3))."""

from __future__ import annotations

import fcntl
import os
import socket
import time
from pathlib import Path
from typing import BinaryIO

from gliderwatch.errors import StateError

# ----------------------------------------
# The file beside the state file that a daemon locks, so that it is alone, and touches as a sign of life.

BEAT = 10.0
"""Seconds between two signs of life."""
STALE = 6 * BEAT
"""Seconds without a sign of life after which a daemon is taken for stuck."""
_PATIENCE = 1.0
"""Seconds for which a lock is tried: `is_held` takes it for a moment."""


class PidLock:
    """The lock of a state file, held from now on. Raises StateError where another daemon holds it."""

    def __init__(self, state: Path) -> None:
        self._folder, self._file = state.parent, _open(alive_path(state))
        deadline = time.monotonic() + _PATIENCE
        while not _try(self._file, fcntl.LOCK_EX):
            if time.monotonic() > deadline:
                self._file.close()
                raise StateError(f"another gliderwatch uses the state file {state}: stop it first")
            time.sleep(0.05)

    def beat(self) -> None:
        """Give a sign of life. Raises StateError where its folder cannot be written any more."""
        try:
            os.utime(self._file.fileno())
        except OSError as error:
            raise StateError(
                f"folder {self._folder} cannot be written: {error.strerror}. "
                "Let the user of the service write there, on a disk that is not mounted read-only"
            ) from None

    def end(self) -> None:
        """Let go of the lock."""
        self._file.close()


def alive_path(state: Path) -> Path:
    """The file that the daemon with this state file locks and touches."""
    return state.with_name(state.name + ".alive")


def is_held(state: Path) -> bool:
    """Whether a daemon has this state file now."""
    try:
        with alive_path(state).open("rb") as file:
            return not _try(file, fcntl.LOCK_SH)
    except OSError:
        return False


def seconds_silent(state: Path) -> float | None:
    """Seconds since the last sign of life of a daemon with this state file; None: there was never one."""
    try:
        return max(0.0, time.time() - alive_path(state).stat().st_mtime)
    except OSError:
        return None


def _open(path: Path) -> BinaryIO:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("ab")
    except OSError as error:
        raise StateError(
            f"{path} cannot be written: {error.strerror}. "
            "Choose another state.path, or let the user of the service write there"
        ) from None


def _try(file: BinaryIO, kind: int) -> bool:
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


# ----------------------------------------
# Messages to systemd: ready, status, reloading, still alive (sd_notify(3)).
#
# The protocol is one datagram; the packages for it are unkept, or need a compiler.


def notify(*lines: str) -> None:
    """Send lines like ``READY=1`` to the service manager; nothing happens where there is none."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")):
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sock:
        try:
            sock.connect("\0" + address[1:] if address.startswith("@") else address)
            sock.sendall("\n".join(lines).encode())
        except OSError:  # the service manager is away: the daemon has better things to do than to fail
            return


def reloading() -> None:
    """Tell that the configuration is read again; `notify("READY=1")` ends it."""
    notify("RELOADING=1", f"MONOTONIC_USEC={time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000}")


def watchdog_seconds() -> float | None:
    """How often to send ``WATCHDOG=1``: half of what the service manager allows; None: it does not ask."""
    wanted = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
    micros = os.environ.get("WATCHDOG_USEC", "")
    return int(micros) / 2e6 if wanted and micros.isdigit() and int(micros) > 0 else None
