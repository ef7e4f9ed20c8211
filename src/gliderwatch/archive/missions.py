"""The missions of an archive: which files belong to which glider, and whether they are full or as sent."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path
from tempfile import TemporaryDirectory

import fsspec
from fsspec.implementations.local import LocalFileSystem

from gliderwatch.errors import GliderwatchError
from gliderwatch.service.replay_files import find_files
from gliderwatch.slocum.folders import kind
from gliderwatch.slocum.header import read_header


@dataclass(frozen=True, slots=True)
class Mission:
    """The files of one glider below one folder (or the address of one).

    ``place`` is that folder, ``glider`` the name in the headers, ``name`` that of the report. ``full`` says
    whether there are files of full rate, ``online`` whether there are some as they were sent.
    """

    name: str
    place: str
    glider: str
    full: bool
    online: bool


def find(places: Iterable[str]) -> list[Mission]:
    """The missions below some folders or addresses (`s3://...`), one for each glider of each.

    Raises GliderwatchError where one holds none, or cannot be read.
    """
    out = list[Mission]()
    for place in places:
        with local(place) as folder:
            kinds = _kinds(find_files([folder]))
        if not kinds:
            raise GliderwatchError(
                f"{place} holds no flight data (dbd, dcd, sbd, scd, mbd, mcd) that can be read: name the "
                "folder of a mission"
            )
        base = re.sub(r"[^\w.-]+", "-", place.rstrip("/").rpartition("/")[2]) or "mission"
        for glider, found in sorted(kinds.items()):
            name = base if len(kinds) == 1 else f"{base}-{glider}"
            out.append(Mission(_unlike(name, out), place, glider, True in found, False in found))
    return out


def _kinds(paths: Sequence[Path]) -> dict[str, set[bool]]:
    """Of each glider whether there are full files, and files as sent."""
    kinds: dict[str, set[bool]] = {}
    for path in paths:
        try:
            glider = read_header(path).id.glider
        except GliderwatchError:
            continue  # named by the replay, which says what is wrong with it
        kinds.setdefault(glider, set()).add(is_full(path))
    return kinds


def is_full(path: Path) -> bool:
    """Whether a file of flight data was read out of the glider after its recovery; others come while it
    flies."""
    return kind(path.name) == "dbd"


def _unlike(name: str, others: Iterable[Mission]) -> str:
    used = {one.name for one in others}
    return next(n for n in chain([name], (f"{name}-{i}" for i in count(2))) if n not in used)


@contextmanager
def local(place: str) -> Iterator[Path]:
    """A folder as it is, or a copy of what lies at an address, for as long as it is needed.

    Decoders read files, not streams, so that what lies elsewhere is copied. Raises GliderwatchError where it
    cannot be read.
    """
    try:
        system, path = fsspec.core.url_to_fs(place)
        if isinstance(system, LocalFileSystem):
            if not Path(path).is_dir():
                raise GliderwatchError(f"{place} is not a folder")
            yield Path(path)
            return
        with TemporaryDirectory(prefix="gliderwatch-archive-") as folder:
            target = Path(folder) / "mission"
            system.get(path.rstrip("/") + "/", f"{target}/", recursive=True)
            yield target
    except (OSError, ValueError, ImportError) as error:
        raise GliderwatchError(f"{place} cannot be read: {error}") from None
