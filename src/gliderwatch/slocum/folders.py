"""Names and folders of a dockserver: what lies where, of which kind, and which files are complete. Nothing
is written there."""

from __future__ import annotations

import glob
import os
import re
import stat
from calendar import timegm
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath

# ----------------------------------------
# What the name of a file tells: its kind and whether it is complete, never which segment it holds.

_FLIGHT = {"sbd": "sbd", "mbd": "mbd", "dbd": "dbd", "scd": "sbd", "mcd": "mbd", "dcd": "dbd"}
_SCIENCE_OF = {"sbd": ("tbd", "tcd"), "mbd": ("nbd", "ncd"), "dbd": ("ebd", "ecd")}
_FLIGHT_OF = {"tbd": ("sbd", "scd"), "nbd": ("mbd", "mcd"), "ebd": ("dbd", "dcd")}
_CACHE = frozenset({"cac", "ccc"})
_RANKS = {"sbd": 0, "mbd": 1, "dbd": 2}
_STAMP = re.compile(r"(?<!\d)(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)(?!\d)", re.ASCII)
_SEGMENT = re.compile(r"(?P<glider>.+)-\d{4}-\d{1,3}-\d{1,5}-\d{1,5}", re.ASCII | re.DOTALL)


_UNDER_WAY = re.compile(r"[.~].*|.*(~|\.(tmp|temp|part|partial|filepart)(\..*)?)", re.IGNORECASE | re.DOTALL)
"""Names that programs give a file until all of it is there (rsync, WinSCP, browsers, `deliver`)."""


def is_under_way(name: str) -> bool:
    """Whether the name is that of a transfer under way, or of one that was given up: never of data.

    >>> is_under_way(".electa-2022-308-3-2.sbd"), is_under_way("92.tmp.sbd"), is_under_way("92.sbd")
    (True, True, False)
    """
    return _UNDER_WAY.fullmatch(name) is not None


def _suffix(name: str) -> str:
    return "" if is_under_way(name) else PurePath(name).suffix[1:].lower()


def kind(name: str) -> str | None:
    """The kind of flight data a file of this name holds, compressed or not: sbd, mbd or dbd; else None.

    >>> kind("01330000.SCD"), kind("usf-sam-2019-251-4-12.tbd"), kind("notes.txt")
    ('sbd', None, None)
    """
    return _FLIGHT.get(_suffix(name))


def is_science(name: str) -> bool:
    """Whether the name is that of science data (tbd, ebd, ...)."""
    return bool(flight_of(name))


def science_of(name: str) -> tuple[str, ...]:
    """The suffixes of the science files that belong to a flight file of this name; none for others.

    >>> science_of("00920000.SCD"), science_of("00920000.tbd")
    (('tbd', 'tcd'), ())
    """
    return _SCIENCE_OF.get(kind(name) or "", ())


def flight_of(name: str) -> tuple[str, ...]:
    """The suffixes of the flight files that belong to a science file of this name; none for others.

    >>> flight_of("00920000.tcd"), flight_of("00920000.sbd")
    (('sbd', 'scd'), ())
    """
    return _FLIGHT_OF.get(_suffix(name).replace("c", "b"), ())


def science_files(flight: Path) -> Iterator[Path]:
    """The science files of the same name beside a flight file, plain or compressed."""
    return _beside(flight, science_of(flight.name))


def flight_files(science: Path) -> Iterator[Path]:
    """The flight files of the same name beside a science file, plain or compressed."""
    return _beside(science, flight_of(science.name))


def _beside(path: Path, suffixes: tuple[str, ...]) -> Iterator[Path]:
    for suffix in suffixes:
        for name in (f"{path.stem}.{suffix}", f"{path.stem}.{suffix.upper()}"):
            other = path.with_name(name)
            if other.is_file() and not other.is_symlink():
                yield other


def is_cache(name: str) -> bool:
    """Whether the name is that of a cache file, the list of sensors of a factored header."""
    return _suffix(name) in _CACHE


def rank(kind: str) -> int:
    """How full a kind is: the higher replaces the lower of the same segment. `KeyError` for others."""
    return _RANKS[kind]


def glider_of(full_name: str) -> str | None:
    """The glider, lower case, of `<glider>-<year>-<yearday>-<mission>-<segment>`; None if it is no such name.

    >>> glider_of("usf-sam-2019-251-4-12"), glider_of("Maria_997-2022-164-7-0"), glider_of("00920000")
    ('usf-sam', 'maria_997', None)
    """
    match = _SEGMENT.fullmatch(full_name)
    return match["glider"].lower() if match else None


def is_long(name: str) -> bool:
    """Whether a file has its long name, which a dockserver gives only to complete files.

    >>> is_long("electa-2022-308-3-2.sbd"), is_long("00930002.sbd")
    (True, False)
    """
    return glider_of(PurePath(name).stem) is not None


def is_log(name: str) -> bool:
    """Whether a file of this name is the log of a call.

    >>> is_log("unit_1033_20250126T072155_network_net_0.log"), is_log("notes.log")
    (True, False)
    """
    return name.lower().endswith(".log") and stamp(name) is not None


def stamp(name: str) -> float | None:
    """The server's time (s) in the name of a log; None where there is none."""
    match = _STAMP.search(name)
    if match is None:
        return None
    year, month, day, hour, minute, second = (int(group) for group in match.groups())
    if not (1990 <= year <= 2100 and 1 <= month <= 12 and 1 <= day <= 31 and hour < 24 and minute < 60):
        return None
    return float(timegm((year, month, day, hour, minute, second, 0, 0, 0)))


# ----------------------------------------
# Where the data of gliders lie on a dockserver, and what is there now. Nothing is ever written there.
#
# Files count when they lie below a folder `from-glider` of a root, or `logs` beside it, as in
# `ROOT/GLIDER/from-glider` or `ROOT/GROUP/gliders/GLIDER/from-glider`, or below an explicit path of
# a glider. Symbolic links below these are not followed; the paths themselves may be links. What has the name
# of flight data and is no regular file (a link, a FIFO, a folder) is found too: to be named, never opened.

FROM_GLIDER = "from-glider"
LOGS = "logs"
"""Folder beside `from-glider` with the logs of calls."""
IGNORED = frozenset({"unknown", "archive"})
"""Folders whose files are noise, or old."""
_NOT_OURS = "lost+found"
"""Folder of the file system itself, closed to all but root."""
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
        folder = LOGS if is_log(path.name) else FROM_GLIDER
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
    """Whether a folder is there; False too where that is not known, as on a share that is away."""
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

    What disappears meanwhile is left out; what cannot be read is named in `unread`.
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
            yield from (found for found in below if is_log(found.path.name) == (name == LOGS))
    elif depth < _DEEPEST:
        for name in sorted(folders):
            if not is_left_out(name):
                yield from _scan(folder / name, glider_folder, depth + 1, seen, unread)


@dataclass(frozen=True, slots=True)
class Link:
    """A symbolic link at ``path`` where the files of a glider should be; it leads to those in ``target``."""

    path: Path
    target: Path

    def __str__(self) -> str:
        return f"{self.path} is a symbolic link, and links are not followed: its files are not seen"

    @property
    def cure(self) -> str:
        """What to write into the configuration, below the glider."""
        return f"write `paths: [{self.target}]` below the glider"


@dataclass(slots=True)
class Survey:
    """What lies below some roots: folders `from-glider` by glider, folders on the way to them that are
    closed, and by glider the links in place of its folder or of its `from-glider`."""

    gliders: dict[str, list[Path]] = field(default_factory=dict)
    closed: list[Path] = field(default_factory=list)
    links: dict[str, Link] = field(default_factory=dict)


def survey(roots: Iterable[Path]) -> Survey:
    """The folders of gliders below some roots, found as `scan` finds them; no file is looked at."""
    found = Survey()
    for root in roots:
        _survey(root, 0, found)
    return found


def _survey(folder: Path, depth: int, found: Survey) -> None:
    try:
        with os.scandir(folder) as entries:
            listed = list(entries)
            inside = sorted(entry.name for entry in listed if entry.is_dir(follow_symlinks=False))
            links = sorted(entry.name for entry in listed if entry.is_symlink())
    except OSError:
        found.closed.append(folder)
        return
    for name in links:
        link = folder / name
        if name == FROM_GLIDER and is_folder(link):
            found.links.setdefault(folder.name.lower(), Link(link, link.resolve()))
        elif is_folder(link / FROM_GLIDER):
            found.links.setdefault(name.lower(), Link(link, (link / FROM_GLIDER).resolve()))
    if FROM_GLIDER in inside:
        found.gliders.setdefault(folder.name.lower(), []).append(folder / FROM_GLIDER)
    elif depth < _DEEPEST:
        for name in inside:
            if name != _NOT_OURS and not is_left_out(name):
                _survey(folder / name, depth + 1, found)


def _files(entries: Iterable[os.DirEntry[str]], glider_folder: str) -> Iterator[Found]:
    for entry in entries:
        if kind(entry.name) is None and not is_log(entry.name):
            continue
        try:
            status = entry.stat(follow_symlinks=False)
        except FileNotFoundError:
            continue
        yield Found(Path(entry.path), glider_folder, status.st_size, status.st_mtime_ns)


# ----------------------------------------
# Which files are complete: a file still growing must not be taken. Pure: time is an argument.


@dataclass(slots=True)
class _Entry:
    size: int
    mtime_ns: int
    due: float


class Settling:
    """Holds files back until they are complete, and lets each state of a file pass once.

    A long name is complete at once, and a log is read as it grows; an 8.3 name when size and mtime have
    been still for `settle_seconds`. What mtime says is never compared with a clock, for it is the glider's.
    `now` is in seconds of any clock that does not jump (monotonic). Of a hundred thousand files it keeps the
    names as text: a `Path` takes four times as much.
    """

    def __init__(self, settle_seconds: float) -> None:
        self.settle_seconds = settle_seconds
        self._waiting: dict[str, _Entry] = {}
        self._passed: dict[str, tuple[int, int]] = {}

    def observe(self, path: Path, size: int, mtime_ns: int, now: float) -> None:
        """Takes note of a file as a scan or an event shows it; a change of state begins the wait again."""
        state, name = (size, mtime_ns), str(path)
        entry = self._waiting.get(name)
        if self._passed.get(name) == state or (entry and (entry.size, entry.mtime_ns) == state):
            return
        self._passed.pop(name, None)
        at_once = is_long(path.name) or is_log(path.name)
        wait = 0.0 if at_once else self.settle_seconds
        self._waiting[name] = _Entry(size, mtime_ns, now + wait)

    def ready(self, now: float) -> list[Path]:
        """The files that are complete now, those that waited longest first; each state of a file once."""
        due = sorted((name for name, entry in self._waiting.items() if entry.due <= now), key=self._order)
        for name in due:
            entry = self._waiting.pop(name)
            self._passed[name] = (entry.size, entry.mtime_ns)
        return list(map(Path, due))

    def passed(self, path: Path) -> tuple[int, int] | None:
        """Size and mtime (ns) with which a file passed last."""
        return self._passed.get(str(path))

    def forget(self, path: Path) -> None:
        """Knows nothing of a file any more: it is gone, or is to be let pass once more."""
        self._waiting.pop(str(path), None)
        self._passed.pop(str(path), None)

    def only(self, there: Container[str]) -> None:
        """Forgets the files that passed and are not `there` any more; one that comes back passes again."""
        self._passed = {name: state for name, state in self._passed.items() if name in there}

    def next_deadline(self, now: float) -> float | None:
        """Seconds from `now` until the next file may be complete; None when none waits."""
        due = min((entry.due for entry in self._waiting.values()), default=None)
        return None if due is None else max(due - now, 0.0)

    def _order(self, name: str) -> tuple[float, str]:
        return self._waiting[name].due, name
