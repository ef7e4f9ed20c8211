"""Stand-ins for what the process that writes pages does: they hang, die, and fail, as drawing can."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

from gliderwatch.pages.writing import put
from gliderwatch.service.page_writer import PageJob


def misbehave(job: PageJob) -> None:
    """Does what the name of the glider says, else writes a file of that name."""
    match job.glider:
        case "hangs":
            time.sleep(600)
        case "dies":
            os.kill(os.getpid(), signal.SIGKILL)
        case "fails":
            raise ValueError("cannot draw this")
    put(job.folder / (job.glider or "all"), "whole")


def sign(job: PageJob) -> None:
    """Writes a file of the glider's name: which process it was."""
    put(job.folder / (job.glider or "all"), str(os.getpid()))


def process_of(_job: object) -> int:
    """Which process it is."""
    return os.getpid()


def write_for_ever(path: Path) -> None:
    """Writes one page after the other, each of one letter."""
    k = 0
    while True:
        put(path, "abcdefgh"[k % 8] * 400_000)
        k += 1


if __name__ == "__main__":
    write_for_ever(Path(sys.argv[1]))
