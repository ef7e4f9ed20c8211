"""The disk of a state, which can be full."""

from __future__ import annotations

import os
import resource
import subprocess
from pathlib import Path

from acceptance.support import Daemon

WRITABLE = 64 * 1024
"""Bytes to which files may grow where a full disk is only played."""


class Disk:
    """The disk of a state, which can be full: a small one of its own where this user may mount one, else
    no file of the daemon may grow beyond a limit, which SQLite meets in the same place."""

    def __init__(self, folder: Path, megabytes: int = 6) -> None:
        self.folder = folder
        folder.mkdir(exist_ok=True)
        mount = ["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "gliderwatch-test", str(folder)]
        self.is_real = (
            os.getuid() == 0 and subprocess.run(mount, capture_output=True, check=False).returncode == 0
        )

    def fill(self, daemon: Daemon) -> None:
        """No room any more."""
        if not self.is_real:
            resource.prlimit(daemon.pid, resource.RLIMIT_FSIZE, (WRITABLE, resource.RLIM_INFINITY))
            return
        with (self.folder / "filler").open("wb", buffering=0) as filler:
            try:
                while filler.write(bytes(4096)):
                    pass
            except OSError:
                return

    def free(self, daemon: Daemon) -> None:
        """Room again."""
        if self.is_real:
            (self.folder / "filler").unlink()
        else:
            unlimited = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
            resource.prlimit(daemon.pid, resource.RLIMIT_FSIZE, unlimited)

    def end(self) -> None:
        """Take it away."""
        if self.is_real:
            subprocess.run(["umount", "--lazy", str(self.folder)], check=True)
