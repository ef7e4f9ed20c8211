"""What a file that has come is to be: read by its header alone, or a log to its end so far.

A flight file is to be decoded, waits, or is left alone; a log of a call is read at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from gliderwatch.errors import MissingCache, NotAssessed, Quarantine, Retry
from gliderwatch.model import Hindrance
from gliderwatch.service.backlog import Job
from gliderwatch.slocum.caches import is_there, needs_science
from gliderwatch.slocum.calls import Dialog, read_log
from gliderwatch.slocum.folders import science_files
from gliderwatch.slocum.header import read_header
from gliderwatch.store.codec import plain_decode
from gliderwatch.store.state_file import File, Status, Store

DONE = (Status.TAKEN, Status.DUPLICATE, Status.QUARANTINED)


def state(path: Path) -> tuple[int, int] | None:
    """Size (bytes) and time of change (ns) of a file; None where there is none, zeros where it is closed."""
    try:
        status = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError:
        return 0, 0
    return status.st_size, status.st_mtime_ns


def is_as_judged(path: Path, store: Store) -> bool:
    """Whether a file was looked at before, and is as it was."""
    before = store.file(_text(path))
    return before is not None and (before.size, before.mtime_ns) == state(path)


def lacks_depth(flight: Path, store: Store, caches: Sequence[Path]) -> bool:
    """Whether a flight file that was looked at before, and is as it was, names no sensor of the depth."""
    if not is_as_judged(flight, store):
        return False
    try:
        return needs_science(read_header(flight), caches)
    except (Quarantine, Retry):
        return False


def newer_science(flight: Path, store: Store) -> list[Path]:
    """The science files beside a flight file that came after it was looked at, by this machine's clock."""
    noted = store.noted_at(_text(flight))
    if noted is None:
        return []
    try:
        return [path for path in science_files(flight) if path.stat().st_ctime > noted]
    except OSError:
        return []


def judge(
    path: Path,
    store: Store,
    caches: Sequence[Path],
    is_known: Callable[[str], bool],
    *,
    again: bool = False,
) -> Job | File | None:
    """A job where the file is to be decoded, a row for the ledger where not, None where nothing is new.

    Reads nothing but the header, which takes well under a millisecond. `again`: also one that is done with.
    """
    now, before = state(path), store.file(_text(path))
    if now is None:
        return _gone(before, store, is_known)
    is_same = before is not None and (before.size, before.mtime_ns) == now
    if before is not None and is_same and not again and _is_settled(before, caches, is_known):
        return None
    file = File(_text(path), *now, Status.WAITING)
    try:
        header = read_header(_plain(path))
    except (Quarantine, Retry) as error:
        return failed(file, error)
    file = replace(file, glider=header.id.glider, segment=header.id.name, opened_at=header.id.opened_at)
    if not is_known(header.id.glider):
        reason = f"glider {header.id.glider} is not in the configuration"
        return replace(file, status=Status.UNKNOWN, reason=reason)
    if header.factored and _is_missing(header.crc, caches):
        return failed(file, MissingCache(header.crc, caches))
    return Job(file, header)


def judge_log(path: Path, store: Store, is_known: Callable[[str], bool]) -> tuple[File, Dialog | None] | None:
    """The row of a log for the ledger, and what it tells by now if it could be read; None: nothing is new."""
    now, name = state(path), _text(path)
    before = store.file(name)
    if now is None:
        if before is not None and before.status not in DONE:
            return replace(before, status=Status.DUPLICATE, reason="is gone"), None
        return None
    was_unknown = before is not None and before.status == Status.UNKNOWN and is_known(before.glider)
    if before is not None and (before.size, before.mtime_ns) == now and not was_unknown:
        return None
    file, kept = File(name, *now, Status.TAKEN), store.calls.dialog(name)
    try:
        dialog = read_log(_plain(path), None if kept is None else plain_decode(kept, Dialog))
    except (Quarantine, Retry) as error:
        return failed(file, error), None
    return _of_glider(file, dialog.call.glider, is_known), dialog


def _of_glider(file: File, glider: str, is_known: Callable[[str], bool]) -> File:
    """The row of a log that was read, of the glider that it names."""
    if not glider:
        reason = "is a log in which no line `Vehicle Name:` says yet of which glider"
        return replace(file, status=Status.WAITING, reason=reason)
    if not is_known(glider):
        reason = f"glider {glider} is not in the configuration"
        return replace(file, status=Status.UNKNOWN, glider=glider, reason=reason)
    return replace(file, glider=glider)


def _is_settled(before: File, caches: Sequence[Path], is_known: Callable[[str], bool]) -> bool:
    """Whether nothing more can be done for a file that has not changed."""
    if before.status == Status.UNKNOWN:
        return bool(before.glider) and not is_known(before.glider)
    if before.hindrance is Hindrance.RENAMED:  # it was not read: if it comes back, it is to be
        return False
    return before.status in DONE or (bool(before.crc) and _is_missing(before.crc, caches))


def _plain(path: Path) -> Path:
    """The path, if its name can be kept. Raises Quarantine."""
    if str(path) != _text(path):
        raise Quarantine("its name is not UTF-8 text: give it another one")
    return path


def failed(file: File, error: Exception) -> File:
    """The row of a file that could not be decoded."""
    status, why = Status.QUARANTINED, Hindrance.DAMAGED
    if isinstance(error, MissingCache):
        status, why = Status.WAITING, Hindrance.NO_CACHE
    elif isinstance(error, Retry):
        status, why = Status.WAITING, Hindrance.UNREADABLE
    elif isinstance(error, NotAssessed):
        why = Hindrance.NOT_ASSESSED
    crc = error.crc if isinstance(error, MissingCache) else ""
    return replace(file, status=status, reason=str(error), crc=crc, hindrance=why)


def _gone(before: File | None, store: Store, is_known: Callable[[str], bool]) -> File | None:
    """A file that waited and is not there any more: it was renamed, or taken away."""
    if before is None or before.status in DONE:
        return None
    if before.status == Status.UNKNOWN and not is_known(before.glider):
        return None
    if not store.segments.is_held(before.glider, before.segment):
        reason = "is not there any more, and its segment has not come under another name"
        return replace(before, status=Status.WAITING, reason=reason, crc="", hindrance=Hindrance.GONE)
    return replace(before, status=Status.DUPLICATE, reason="was renamed", crc="", hindrance=Hindrance.RENAMED)


def _is_missing(crc: str, caches: Sequence[Path]) -> bool:
    """Whether a cache file is in none of the folders; where one cannot be read, the decoder tells why."""
    try:
        return not is_there(crc, caches)
    except OSError:
        return False


def _text(path: Path) -> str:
    """The path as text that can be kept, whatever bytes are in its name."""
    return str(path).encode("utf-8", "backslashreplace").decode()
