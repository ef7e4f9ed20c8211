"""The files and logs of calls that a replay finds, in the order of their sending; and where none of them was
assessed, why, and what to do about it."""

from __future__ import annotations

import os
import shlex
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gliderwatch.messages.formatting import clean
from gliderwatch.model import Segment
from gliderwatch.navigation.clock import Stamp, corrections, is_same, numbered
from gliderwatch.service import judgement
from gliderwatch.service.backlog import Job
from gliderwatch.slocum import folders
from gliderwatch.slocum.calls import Dialog
from gliderwatch.slocum.folders import is_log, kind
from gliderwatch.store.state_file import File, Status, Store

LONGEST = 2 * 86400.0
"""Seconds after which a file is sent at the latest: if the next is opened later, there was a pause."""


ARCHIVES = {".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".7z"}
"""How names of archives end."""


def find_files(folders: Iterable[Path]) -> list[Path]:
    """All flight data files below some folders, each once.

    The folders may be links. Below them a link is treated as the service does: a file that is one is named
    and left alone, a folder that is one is not looked into.
    """
    found = {
        path: None
        for path in _below(folders)
        if kind(path.name) is not None and (path.is_symlink() or not path.is_dir())
    }
    return list(found)


def packed(folders: Iterable[Path]) -> Path | None:
    """An archive at or below some folders, which may hold what was looked for; None: there is none."""
    return next((path for path in _below(folders) if path.suffix.lower() in ARCHIVES), None)


def _below(folders: Iterable[Path], names: str = "*") -> Iterator[Path]:
    """What lies below some folders, in order of their names; of one that is a file, that."""
    for folder in folders:
        yield from sorted([folder] if folder.is_file() else folder.rglob(names))


def correct_clocks(jobs: Sequence[Job]) -> None:
    """Give the files of a glider whose clock fell back their turn: when they were sent, not years before."""
    missions: dict[tuple[str, str], dict[str, list[list[Job]]]] = {}
    for job in jobs:
        mission = job.header.id.glider, numbered(job.header.id.name)[0]
        segments = missions.setdefault(mission, {}).setdefault(job.header.id.name, [])
        copies = next((s for s in segments if is_same(s[0].header.id, job.header.id)), None)
        if copies is None:
            segments.append([job])
        else:
            copies.append(job)
    for by_name in missions.values():
        segments = [copies for found in by_name.values() for copies in found]
        opened = [(copies[0].header.id.name, copies[0].header.id.opened_at) for copies in segments]
        stamps = [Stamp(numbered(name)[1], t, t) for name, t in opened]
        for copies, correction in zip(segments, corrections(stamps), strict=True):
            for job in copies:
                job.offset = correction.offset


class ReplayOrder:
    """Puts decoded jobs, which come as their files were opened, into the order of their sending."""

    def __init__(self, jobs: Iterable[Job]) -> None:
        self._coming: dict[str, deque[float]] = {}
        self._ready: dict[str, deque[Job]] = {}
        for job in jobs:
            self._coming.setdefault(job.header.id.glider, deque()).append(job.opened_at)
            self._ready[job.header.id.glider] = deque()

    def after(self, job: Job) -> Iterator[tuple[Job, float]]:
        """The jobs whose turn it is once one more is decoded, each with the time (s) of its sending."""
        self._coming[job.header.id.glider].popleft()
        self._ready[job.header.id.glider].append(job)
        while heads := [(self._sent(glider), glider) for glider, ready in self._ready.items() if ready]:
            sent, first = min(heads)
            if any(c and c[0] < sent and not self._ready[g] for g, c in self._coming.items()):
                return  # a file that was opened before may have been sent before
            yield self._ready[first].popleft(), sent

    def _sent(self, glider: str) -> float:
        """When the first file that is ready was sent: at its end, else before the next was opened."""
        job, *later = self._ready[glider]
        if isinstance(job.result, Segment):
            return job.result.last_t + job.offset
        opened = job.opened_at
        coming = [*(j.opened_at for j in later), *self._coming[glider]]
        return min(next(iter(coming), opened), opened + LONGEST)


@dataclass(frozen=True, slots=True)
class Log:
    """A log as it was read; ``dialog`` is None where it could not be."""

    file: File
    dialog: Dialog | None

    @property
    def sent(self) -> float:
        """When the call was over (s); a log that tells nothing comes first."""
        return 0.0 if self.dialog is None else self.dialog.call.last_t


def find_logs(folders: Iterable[Path]) -> list[Path]:
    """All logs of calls below some folders, each once."""
    found = {
        path.resolve() if path.is_symlink() else path: None
        for path in _below(folders, "*.[lL][oO][gG]")
        if is_log(path.name) and not path.is_dir()
    }
    return list(found)


def read_logs(paths: Iterable[Path], store: Store, is_wanted: Callable[[str], bool]) -> list[Log]:
    """The logs at some paths, in the order in which the calls were over."""
    found = (judgement.judge_log(path, store, is_wanted) for path in paths)
    return sorted((Log(*one) for one in found if one is not None), key=lambda log: (log.sent, log.file.path))


_ABOVE = 4
"""Folders above the one replayed in which cache files are looked for, with the folders beside these."""
_MOST = 2000
"""Entries of a folder that are looked at."""
_SHOWN = 3


def unassessed(store: Store, folders: Iterable[Path]) -> str | None:
    """Why the replay of `folders` assessed no dive, with the cure; None where it assessed one, or where logs
    are all there is, and one was read."""
    if any(store.extent(glider)[1] for glider in store.gliders()):
        return None
    is_of_calls = all(is_log(Path(file.path).name) for file in store.files(*Status))
    if is_of_calls and store.files(Status.TAKEN):
        return None
    left_out = {s: store.files(s) for s in (Status.WAITING, Status.UNKNOWN, Status.QUARANTINED)}
    status = max(left_out, key=lambda s: len(left_out[s]))
    files = left_out[status]
    if not files:
        return "nothing was assessed: the files were read, but none holds a dive"
    explain = {Status.WAITING: _waiting, Status.UNKNOWN: _unknown_gliders, Status.QUARANTINED: _bad}[status]
    return f"nothing was assessed: {explain(files, folders)}"


def _waiting(files: Sequence[File], folders: Iterable[Path]) -> str:
    wanted = {file.crc.lower() for file in files if file.crc}
    if not wanted:
        return f"{_number(files)} cannot be read: {clean(files[0].reason, 500)}; then replay again"
    place = nearby(wanted, folders)
    cure = "name its folder: --cache FOLDER" if place is None else f"add --cache {shlex.quote(_short(place))}"
    lacking = _some(f"{crc}.cac" for crc in wanted)
    return f"{_number(files)} {'wait' if len(files) > 1 else 'waits'} for {lacking}: {cure}"


def _unknown_gliders(files: Sequence[File], _folders: Iterable[Path]) -> str:
    gliders = {file.glider for file in files}
    return (
        f"{_number(files)} of {_some(gliders)}, not in the configuration: "
        "add the name under `gliders`, or leave -c out"
    )


def _bad(files: Sequence[File], _folders: Iterable[Path]) -> str:
    return (
        f"{_number(files)} cannot be used ({clean(files[0].reason)}): "
        "name a folder with flight data of a glider (sbd, scd, mbd, mcd, dbd, dcd)"
    )


def _number(files: Sequence[File]) -> str:
    return "1 file" if len(files) == 1 else f"{len(files)} files"


def _some(words: Iterable[str]) -> str:
    found = sorted(words)
    more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return ", ".join(clean(word, 60) for word in found[:_SHOWN]) + more


def _short(path: Path) -> str:
    """A path as one would type it here."""
    relative = os.path.relpath(path)
    return relative if len(relative) < len(str(path)) else str(path)


def nearby(crcs: Collection[str], folders: Iterable[Path]) -> Path | None:
    """The folder that holds most of the cache files of some checksums (lower case), in, above or beside the
    `folders`; None where none is found."""
    held = Counter({place: n for place in _places(folders) if (n := len(_caches(place) & set(crcs)))})
    return held.most_common(1)[0][0] if held else None


def _places(folders: Iterable[Path]) -> Iterator[Path]:
    for folder in folders:
        start = folder.resolve()
        for above in (start, *start.parents)[: _ABOVE + 1]:
            yield above
            yield from (Path(entry.path) for entry in _entries(above) if entry.is_dir())


def _caches(folder: Path) -> set[str]:
    """The checksums of the cache files in a folder, as their names tell."""
    return {Path(entry.name).stem.lower() for entry in _entries(folder) if folders.is_cache(entry.name)}


def _entries(folder: Path) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as found:
            return [entry for entry, _ in zip(found, range(_MOST), strict=False)]
    except OSError:
        return []
