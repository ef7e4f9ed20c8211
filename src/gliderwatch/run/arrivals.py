"""What to do with a file that is complete: known already, to wait, to leave alone, or to decode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from gliderwatch.errors import MissingCache, Quarantine, Retry
from gliderwatch.ingest.caches import find_cache
from gliderwatch.ingest.header import read_header
from gliderwatch.run.backlog import Job
from gliderwatch.store.sqlite import File, Status, Store

DONE = (Status.TAKEN, Status.DUPLICATE, Status.QUARANTINED)


def seen(path: Path) -> File:
    """The file as it lies there now, not judged yet; without size and time where it is gone."""
    try:
        status = path.stat()
    except OSError:
        return File(str(path), 0, 0, Status.WAITING)
    return File(str(path), status.st_size, status.st_mtime_ns, Status.WAITING)


def judge(
    file: File, store: Store, caches: Sequence[Path], is_known: Callable[[str], bool]
) -> Job | File | None:
    """A job where the file is to be decoded, a row for the ledger where not, None where nothing is new.

    Reads nothing but the header, which takes well under a millisecond.
    """
    before = store.file(file.path)
    if before is not None and (before.size, before.mtime_ns) == (file.size, file.mtime_ns):
        if before.status in DONE or (before.crc and find_cache(before.crc, caches) is None):
            return None
        if before.status == Status.UNKNOWN and before.glider and not is_known(before.glider):
            return None
    try:
        header = read_header(Path(file.path))
    except (Quarantine, Retry) as error:
        return failed(file, error)
    file = replace(file, glider=header.id.glider, segment=header.id.name)
    if not is_known(header.id.glider):
        reason = f"glider {header.id.glider} is not in the configuration"
        return replace(file, status=Status.UNKNOWN, reason=reason)
    if header.factored and find_cache(header.crc, caches) is None:
        return failed(file, MissingCache(header.crc))
    return Job(file, header)


def failed(file: File, error: Exception) -> File:
    """The row of a file that could not be decoded."""
    if isinstance(error, MissingCache):
        return replace(file, status=Status.WAITING, reason=str(error), crc=error.crc)
    if isinstance(error, Retry):
        return replace(file, status=Status.WAITING, reason=str(error), crc="")
    return replace(file, status=Status.QUARANTINED, reason=str(error), crc="")
