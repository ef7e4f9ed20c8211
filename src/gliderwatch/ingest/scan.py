"""Where the data of gliders lie on a dockserver, and what is there now. Nothing is ever written there.

Files count when they lie below a folder `from-glider` of a root, or `logs` beside it, as in
`ROOT/GLIDER/from-glider` or `ROOT/GROUP/gliders/GLIDER/from-glider`, or below an explicit path of
a glider. Symbolic links below these are not followed; the paths themselves may be links. What has the name
of flight data and is no regular file (a link, a FIFO, a folder) is found too: to be named, never opened.
"""

from __future__ import annotations

import glob
import os
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gliderwatch.ingest import names

FROM_GLIDER = "from-glider"
LOGS = "logs"
"""Folder beside `from-glider` with the logs of calls."""
IGNORED = frozenset({"unknown", "archive"})
"""Folders whose files are noise, or old."""
_DEEPEST = 6
"""Folders between a root and `from-glider`, so that a wrong root does not mean the whole disk."""


def is_left_out(folder: str) -> bool:
    """Whether a folder of this name holds no data: noise, archives, hidden ones (rsync's `.~tmp~`)."""
    return folder.startswith(".") or folder.lower() in IGNORED


@dataclass(frozen=True, slots=True)
class Place:
    """A folder to look in: a root, or where ``glider`` is not empty an explicit path of that glider."""

    path: Path
    glider: str = ""

    def glider_folder(self, path: Path) -> str | None:
        """The glider folder of a file, by its path alone; None if it is no file of a glider in this place."""
        if not path.is_relative_to(self.path):
            return None
        parts = path.relative_to(self.path).parts[:-1]
        if any(is_left_out(part) for part in parts):
            return None
        if self.glider:
            return self.glider
        folder = LOGS if names.is_log(path.name) else FROM_GLIDER
        return (self.path.name, *parts)[parts.index(folder)] if folder in parts else None


@dataclass(frozen=True, slots=True)
class Found:
    """What has the name of flight data; ``glider_folder``: its folder, or the glider of an explicit path."""

    path: Path
    glider_folder: str
    size: int
    mtime_ns: int


def expand(patterns: Iterable[str | Path]) -> list[Path]:
    """The paths of patterns, links resolved, each once; one without wildcards also where nothing is there."""
    found: dict[Path, None] = {}
    for pattern in map(str, patterns):
        matches = sorted(glob.glob(pattern)) if glob.has_magic(pattern) else [pattern]  # noqa: PTH207
        found |= {Path(os.path.realpath(match)): None for match in matches}
    return list(found)


def is_folder(path: Path) -> bool:
    """Whether a folder is there; False too where it cannot be told, as on a share that is away."""
    try:
        return stat.S_ISDIR(path.stat().st_mode)
    except OSError:
        return False


def find_places(roots: Sequence[str | Path], explicit: Mapping[str, Sequence[str | Path]]) -> list[Place]:
    """The places of a configuration now; explicit ones first, so that they decide for their files."""
    places = [Place(path, glider) for glider, paths in explicit.items() for path in expand(paths)]
    beside = [Place(p.path.with_name(LOGS), p.glider) for p in places if p.path.name == FROM_GLIDER]
    places += [place for place in beside if is_folder(place.path)]
    return places + [Place(path) for path in expand(roots)]


def scan(places: Iterable[Place], unread: list[str]) -> Iterator[Found]:
    """All files of flight data in the places, each once, folder by folder.

    What disappears meanwhile is left out; what cannot be read is told in `unread`.
    """
    seen: set[tuple[int, int]] = set()
    for place in places:
        yield from _scan(place.path, place.glider, 0, seen, unread)


def _scan(
    folder: Path, glider_folder: str, depth: int, seen: set[tuple[int, int]], unread: list[str]
) -> Iterator[Found]:
    """With `glider_folder` all files below `folder`; without it those below a `from-glider` in it."""
    try:
        status = folder.stat()
        with os.scandir(folder) as listing:
            entries = sorted(listing, key=lambda entry: entry.name)
    except FileNotFoundError:
        return
    except OSError as error:
        unread.append(f"{folder} cannot be read: {error.strerror or error}")
        return
    if (status.st_dev, status.st_ino) in seen:
        return
    seen.add((status.st_dev, status.st_ino))
    if glider_folder:
        yield from _files(entries, glider_folder)
    folders = {entry.name for entry in entries if entry.is_dir(follow_symlinks=False)}
    if FROM_GLIDER in folders and not glider_folder:
        for name in sorted(folders & {FROM_GLIDER, LOGS}):
            below = _scan(folder / name, folder.name, depth + 1, seen, unread)
            yield from (found for found in below if names.is_log(found.path.name) == (name == LOGS))
    elif depth < _DEEPEST:
        for name in sorted(folders):
            if not is_left_out(name):
                yield from _scan(folder / name, glider_folder, depth + 1, seen, unread)


def _files(entries: Iterable[os.DirEntry[str]], glider_folder: str) -> Iterator[Found]:
    for entry in entries:
        if names.kind(entry.name) is None and not names.is_log(entry.name):
            continue
        try:
            status = entry.stat(follow_symlinks=False)
        except FileNotFoundError:
            continue
        yield Found(Path(entry.path), glider_folder, status.st_size, status.st_mtime_ns)
