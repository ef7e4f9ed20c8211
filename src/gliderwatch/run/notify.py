"""What systemd is told: ready, status, reloading, still alive (sd_notify(3)).

The protocol is one datagram; the packages for it are unkept, or need a compiler.
"""

from __future__ import annotations

import os
import socket
import time


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
