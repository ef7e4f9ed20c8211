"""Cache files: the sensor lists that factored headers leave out. Finding them, and a private copy of each.

The name of a cache file is the checksum of the list in it, so that a list that was changed, cut or given the
name of another one is known by it: `checksum`.
"""

from __future__ import annotations

import os
import tempfile
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from gliderwatch.errors import GliderwatchError, MissingCache, Retry
from gliderwatch.ingest.cycles import Sensors, parse_sensor_list
from gliderwatch.ingest.header import Header, decompress, read_regular

_LARGEST = 4 * 1024 * 1024
_CURE = "copy it from the glider or the dockserver again"
_SUFFIXES = (".cac", ".ccc")
_PADDING = b" \t\r\n\x00\x1a"
"""What transfers put after the last line (Ctrl-Z: XMODEM and YMODEM)."""


def checksum(text: bytes) -> str:
    """The checksum of a sensor list, as headers and the names of cache files give it (lower case).

    CRC-32 of the bytes of the list, its line ends included, without the complement that usually ends it.
    The specification says no more than "CRC32" (dbd_file_format.txt, `sensor_list_crc`).
    """
    return f"{zlib.crc32(text) ^ 0xFFFFFFFF:08x}"


def candidates(crc: str, folders: Iterable[Path]) -> Iterator[Path]:
    """All that has the name of the cache file of the sensor list `crc`, plain or compressed, in some folders.

    Gliders, dockservers and people write the name in any case. Sub-folders are not searched. Raises `OSError`
    after all others where a folder cannot be read.
    """
    stems = (crc.lower(), crc.lower().zfill(8))
    wanted = {stem + suffix for stem, suffix in product(stems, _SUFFIXES)}
    unread: OSError | None = None
    for folder in folders:
        try:
            names = sorted(os.listdir(folder))  # noqa: PTH208 (once for each file that comes: Path costs more)
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:
            unread = unread or error
            continue
        yield from (folder / name for name in names if name.lower() in wanted)
    if unread is not None:
        raise unread


def is_there(crc: str, folders: Iterable[Path]) -> bool:
    """Whether anything has the name of a cache file. Raises `OSError` where that cannot be said."""
    return next(candidates(crc, folders), None) is not None


@dataclass(frozen=True, slots=True)
class Staged:
    """A cache file as dbdreader wants it, plain and with a lower-case name in `folder`, and what it says."""

    folder: Path
    n_listed: int
    sensors: Sensors


@dataclass(slots=True)
class Staging:
    """Private copies of the cache files that were needed, each made once while its source stays the same."""

    _folder: tempfile.TemporaryDirectory[str] = field(default_factory=tempfile.TemporaryDirectory)
    _seen: dict[Path, tuple[tuple[int, int], Staged | str]] = field(default_factory=dict)

    def get(self, header: Header, folders: Iterable[Path]) -> Staged:
        """The sensor list of a file with this header: the first that is whole and the right one.

        Raises `MissingCache` where none of `folders` has it, `Retry` where what they have cannot be used,
        with what is wrong with each.
        """
        folders, wrong = tuple(folders), list[str]()
        try:
            for path in candidates(header.crc, folders):
                staged = self._look(header.crc, path)
                if isinstance(staged, Staged) and _fits(staged, header):
                    return staged
                reason = staged if isinstance(staged, str) else _misfit(staged, header)
                wrong.append(f"cache file {path} {reason}")
        except OSError as error:
            wrong.append(f"{error.filename} cannot be read: {error.strerror or error}")
        if not wrong:
            raise MissingCache(header.crc, folders)
        raise Retry("; ".join([*wrong, _CURE]))

    def _look(self, crc: str, path: Path) -> Staged | str:
        """A cache file, or what is wrong with it."""
        try:
            status = path.stat()
        except OSError as error:
            return f"cannot be read: {error.strerror or error}"
        state = (status.st_size, status.st_mtime_ns)
        seen = self._seen.get(path)
        if seen is None or seen[0] != state:
            seen = self._seen[path] = (state, self._stage(crc, path))
        return seen[1]

    def _stage(self, crc: str, path: Path) -> Staged | str:
        try:
            text, sensors = read_list(path, crc)
        except (ValueError, GliderwatchError) as error:
            return f"cannot be used: {error}"
        folder = Path(tempfile.mkdtemp(dir=self._folder.name))
        (folder / f"{crc}.cac").write_bytes(text)
        return Staged(folder, text.count(b"\n"), sensors)


def read_list(path: Path, crc: str) -> tuple[bytes, Sensors]:
    """The sensor list `crc` in a cache file, as text and as what it says.

    Raises `ValueError` or `GliderwatchError` with the reason where it is not that, or not whole.
    """
    content, _ = read_regular(path, _LARGEST, links=True)
    text = list_text(content, crc)
    sensors, _ = parse_sensor_list(text, 0, text.count(b"\n"))
    return text, sensors


def list_text(content: bytes, crc: str) -> bytes:
    """The sensor list `crc` in the content of its cache file: decompressed, with line ends as in the glider.

    Raises `ValueError` with the reason where it is another list, or is not whole.
    """
    if content and not content.startswith(b"s:"):
        content = decompress(content, _LARGEST)
    text = content.replace(b"\r\n", b"\n").rstrip(_PADDING) + b"\n"
    if not text.startswith(b"s:"):
        raise ValueError("no sensor list is in it" if content else "it is empty, or cut at its start")
    found = checksum(text)
    if int(found, 16) != int(crc, 16):
        raise ValueError(
            f"it is cut or changed, or is another list: the checksum of its content is {found}, not {crc}"
        )
    return text


def _fits(staged: Staged, header: Header) -> bool:
    return (len(staged.sensors.names), staged.n_listed) == (header.n_held, header.n_sensors)


def _misfit(staged: Staged, header: Header) -> str:
    return (
        f"does not fit: it lists {staged.n_listed} sensors and {len(staged.sensors.names)} of them as held,"
        f" the file's header says {header.n_sensors} and {header.n_held}"
    )
