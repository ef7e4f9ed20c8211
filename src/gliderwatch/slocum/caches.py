"""Cache files (the sensor lists that factored headers leave out): found, checked by their checksum, kept in
the folder of the state, and copied to a private folder for the decoder."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from gliderwatch.errors import GliderwatchError, MissingCache, Retry
from gliderwatch.slocum.cycles import Sensors, parse_sensor_list
from gliderwatch.slocum.header import Header, decompress, parse_header, plain, read_regular
from gliderwatch.slocum.sensors import DEPTH, PRESSURES

# ----------------------------------------
# Cache files: the sensor lists that factored headers leave out, and scratch copies of them that no other
# process shares.

# ----------------------------------------
# Cache files: the sensor lists that factored headers leave out. Finding them, and a private copy of each.
#
# The name of a cache file is the checksum of the list in it, so that a list that was changed, cut or given
# the name of another one is known by it: `checksum`.

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
    """Whether anything has the name of a cache file. Raises `OSError` where that cannot be found out."""
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


# ----------------------------------------
# A folder for scratch files that does not outlive its process for long, even after SIGKILL.
#
# Its maker holds a lock on it; the next one removes those that nobody holds.

_PREFIX = "gliderwatch-scratch-"


class Scratch:
    """A new empty folder below TMPDIR, private to this user."""

    def __init__(self) -> None:
        _sweep(Path(tempfile.gettempdir()))
        while True:
            self.name = tempfile.mkdtemp(prefix=_PREFIX)
            with suppress(OSError):  # another process may have swept it before it was locked
                self._lock = os.open(self.name, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
                fcntl.flock(self._lock, fcntl.LOCK_EX)
                if Path(self.name).is_dir():
                    return
                os.close(self._lock)

    def cleanup(self) -> None:
        """Remove it; may be called twice."""
        shutil.rmtree(self.name, ignore_errors=True)
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1


def _sweep(folder: Path) -> None:
    for left in folder.glob(_PREFIX + "*"):
        try:
            if left.lstat().st_uid != os.getuid():
                continue
            lock = os.open(left, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        except OSError:
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(left, ignore_errors=True)
        except OSError:  # somebody's
            pass
        finally:
            os.close(lock)


# ----------------------------------------
# Sensor lists that came inside of files, kept for the files that leave them out.
#
# A glider sends the list of sensors in one file and leaves it out of those that follow. So the format wants
# the shore side to look for it in other files (dbd_file_format.txt, "A sensor list in ASCII"). Each list is
# kept as a cache file in a folder of the state's, and is looked up there after the cache folders.

MOST = 256
"""Lists that are kept. A glider makes a new one when its software or what it is to send changes."""
_LONGEST_LIST = 512 * 1024
"""Bytes of one; those of gliders have up to 118 kB."""
_READ = 4 * 1024 * 1024
_PART = ".part"


def lists_folder(state: Path) -> Path:
    """Where the lists are that were seen by the owner of a state file."""
    return state.with_name(state.name + ".lists")


class SensorLists:
    """The lists that are kept in a folder, which is made if need be; the newest `MOST`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def keep(self, path: Path, header: Header) -> Path | None:
        """Keep the list of the file at `path`, with this header: where it is kept, if it is a new one.

        None where the file has none, or has one that is not whole or already kept. Raises OSError where it
        cannot be written.
        """
        kept = self.folder / f"{header.crc.zfill(8)}.cac"
        if header.factored or kept.exists():
            return None
        text = _own_list(path)
        if text is None or len(text) > _LONGEST_LIST or checksum(text) != kept.stem:
            return None
        self.folder.mkdir(exist_ok=True)
        part = kept.with_name(kept.name + _PART)
        try:
            with part.open("wb") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())  # after a power cut it is whole, or not there
            part.replace(kept)
        except OSError:
            with suppress(OSError):
                part.unlink()
            raise
        self._forget_oldest()
        return kept

    def _forget_oldest(self) -> None:
        kept = sorted(self.folder.glob("*.cac"), key=lambda path: path.stat().st_mtime_ns)
        for path in kept[:-MOST]:
            path.unlink(missing_ok=True)


def _own_list(path: Path) -> bytes | None:
    """The sensor list inside of a file; None where there is none, or it is damaged."""
    try:
        data, _ = read_regular(path, _READ, whole=False)
        content = plain(data, _READ)
        header = parse_header(content)
        _, end = parse_sensor_list(content, header.length, header.n_sensors)
    except (GliderwatchError, ValueError):
        return None
    return content[header.length : end]


def needs_science(header: Header, folders: Sequence[Path]) -> bool:
    """Whether the list of sensors of a flight file names nothing that tells the depth.

    False where the list is not known: then the file waits for it, or holds it, and is dealt with later.
    """
    with suppress(OSError):
        for path in candidates(header.crc, folders):
            with suppress(GliderwatchError, ValueError):
                _, sensors = read_list(path, header.crc)
                return set(sensors.names).isdisjoint((DEPTH, *PRESSURES))
    return False
