"""A replay that assessed nothing: why, in one line, and what to do about it."""

from __future__ import annotations

import os
import shlex
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path

from gliderwatch.messages.formatting import clean
from gliderwatch.slocum import folders
from gliderwatch.slocum.folders import is_log
from gliderwatch.store.state_file import File, Status, Store

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
