"""The ASCII header of a Dinkum file: which segment it holds and how it is to be read.

A reader of its own, because dbdreader's never returns on a file that is cut inside its header,
and because every value here comes from outside: it is checked before anything is made of it.
"""

from __future__ import annotations

import calendar
import os
import re
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import lz4.block  # type: ignore[import-untyped]

from gliderwatch.errors import Quarantine, Retry
from gliderwatch.model import SegmentId
from gliderwatch.slocum import folders

_LABEL = b"dbd_label:"
_PEEK = 66 * 1024
"""Bytes: holds the header (under 1 kB), also where it is the first of the compressed blocks."""
_BLOCK = 32 * 1024
"""Bytes of one block when decompressed, as Slocum gliders write them."""
_MAX_TAGS = 64
_MAX_SENSORS = 20_000
_ENCODING = 5
_EARLIER = {
    "1": "of May to September 2001",
    "2": "of September 2001 to September 2002",
    "3": "of September 2002 to July 2003",
    "4": "that came in July 2003",
}
"""When gliders got the software that writes an encoding version (dbd_file_format.txt, its changes and HISTORY
OF RELEASED VERSIONS). There 5 is the version of a file of August 2008."""
_FIRST_YEAR, _LAST_YEAR = 1990, 2100
_NO_FILES = {
    stat.S_IFDIR: "a folder",
    stat.S_IFLNK: "a symbolic link, which is not followed: put the file itself there",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
}

_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_TIME = re.compile(r"[A-Z][a-z]{2}_+([A-Z][a-z]{2})_+(\d{1,2})_+(\d\d):(\d\d):(\d\d)_+(\d{4})", re.ASCII)
_PATTERNS = {
    "full_filename": r"[A-Za-z0-9][\w.-]{0,127}",
    "the8x3_filename": r"[\w.-]{1,16}",
    "filename_extension": r"[A-Za-z]{3}",
    "mission_name": r"[!-~]{1,64}",
    "fileopen_time": _TIME.pattern,
    "sensor_list_crc": r"[0-9A-Fa-f]{1,8}",
    "sensor_list_factored": r"[01]",
    "encoding_ver": r"\d{1,4}",
    "total_num_sensors": r"\d{1,5}",
    "sensors_per_cycle": r"\d{1,5}",
    "state_bytes_per_cycle": r"\d{1,5}",
}


@dataclass(frozen=True, slots=True)
class Header:
    """The header of one file.

    ``kind`` is sbd, mbd or dbd; ``crc`` (lower case) names the cache file where the sensor list is
    ``factored`` out; ``n_sensors`` are listed, ``n_held`` of them are in the file, ``length`` is
    the length of the header in bytes, before the sensor list if the file holds one.
    """

    id: SegmentId
    mission: str
    kind: str
    crc: str
    factored: bool
    n_sensors: int
    n_held: int
    length: int


def read_header(path: Path) -> Header:
    """The header of the file at `path`; reads at most 66 kB and never waits.

    Raises `Quarantine` for what is not a Slocum flight data file, `Retry` where it cannot be read now.
    """
    data, _ = read_regular(path, _PEEK, whole=False)
    return parse_header(plain(data, limit=_BLOCK))


def read_regular(
    path: Path, limit: int, *, whole: bool = True, links: bool = False
) -> tuple[bytes, os.stat_result]:
    """The first `limit` bytes of a regular file and its status; it is never waited for (FIFOs, devices).

    With `whole` the file must not be larger than `limit`, nor change while it is read. Only with `links`
    it may be a symbolic link: of a glider's file, one could lead out of the root.
    Raises `Quarantine` if it is no regular file or too large, `Retry` if it cannot be read now.
    """
    try:
        _check_regular(path.stat(follow_symlinks=links))  # to open a FIFO would let its writer go on
        with open(path, "rb", opener=_open_at_once if links else _open_itself) as file:
            before = os.fstat(file.fileno())
            _check_regular(before)
            if whole and before.st_size > limit:
                raise Quarantine(f"larger than {limit / 1e6:.0f} MB: no flight data of one segment")
            data = file.read(limit)
            after = os.fstat(file.fileno())
    except OSError as error:
        raise Retry(f"cannot be read: {error.strerror or error}") from error
    unchanged = (before.st_size, before.st_mtime_ns) == (after.st_size, after.st_mtime_ns)
    if whole and not (unchanged and len(data) == after.st_size):
        raise Retry("changed while it was read")
    return data, after


@contextmanager
def open_regular(path: Path) -> Iterator[BinaryIO]:
    """A regular file, open for reading; never a link, a FIFO or a device.

    Raises `Quarantine` if it is none, `Retry` if it cannot be read now, also inside.
    """
    try:
        _check_regular(path.stat(follow_symlinks=False))
        with open(path, "rb", opener=_open_itself) as file:
            _check_regular(os.fstat(file.fileno()))
            yield file
    except OSError as error:
        raise Retry(f"cannot be read: {error.strerror or error}") from error


def _check_regular(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = _NO_FILES.get(stat.S_IFMT(status.st_mode), "a device")
        raise Quarantine(f"not a regular file but {kind}")


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK | os.O_NOCTTY)


def _open_itself(path: str, flags: int) -> int:
    return _open_at_once(path, flags | os.O_NOFOLLOW)


def plain(data: bytes, limit: int) -> bytes:
    """The content of a data file, decompressed if it is compressed (its name may not tell).

    Raises `Quarantine` if it is neither.
    """
    if data.startswith(_LABEL):
        return data
    content = decompress(data, limit)
    if not content.startswith(_LABEL):
        raise Quarantine("not a Slocum data file, or damaged at its start" if data else "the file is empty")
    return content


def decompress(data: bytes, limit: int) -> bytes:
    """LZ4 blocks, each after two bytes with its size, as gliders write them; at most about `limit` bytes.

    A file that ends inside a block gives the blocks before it: a part of a file is still a file.
    """
    parts, start, length = [], 0, 0
    while start + 2 < len(data) and length < limit:
        end = start + 2 + int.from_bytes(data[start : start + 2], "big")
        if end > len(data):
            break
        try:
            parts.append(lz4.block.decompress(data[start + 2 : end], uncompressed_size=_BLOCK))
        except (lz4.block.LZ4BlockError, ValueError):
            break
        length += len(parts[-1])
        start = end
    return b"".join(parts)


def parse_header(data: bytes, *, science: bool = False) -> Header:
    """The header at the start of `data`, what `plain` gives, of a flight file or of one of `science`.

    Raises `Quarantine` with the reason in words.
    """
    tags, length = _tags(data)
    name = f"x.{tags['filename_extension']}"
    kind = folders.kind(name) if not science else "".join(folders.flight_of(name)[:1])
    if not kind:
        raise Quarantine(f"holds {tags['filename_extension']} data, not flight data (sbd, mbd, dbd)")
    full_name = tags["full_filename"]
    glider = folders.glider_of(full_name)
    if glider is None:
        raise Quarantine(f"full_filename {full_name} is not GLIDER-YEAR-DAY-MISSION-SEGMENT")
    n_sensors, n_held = int(tags["total_num_sensors"]), int(tags["sensors_per_cycle"])
    if (
        not 1 <= n_held <= n_sensors <= _MAX_SENSORS
        or int(tags["state_bytes_per_cycle"]) != (n_held + 3) // 4
    ):
        raise Quarantine("the numbers of sensors in the header contradict each other")
    return Header(
        id=SegmentId(_opened_at(tags["fileopen_time"]), sys.intern(glider), full_name),
        mission=sys.intern(tags["mission_name"].lower()),  # one of a hundred thousand files that say so
        kind=kind,
        crc=sys.intern(tags["sensor_list_crc"].lower()),
        factored=tags["sensor_list_factored"] == "1",
        n_sensors=n_sensors,
        n_held=n_held,
        length=length,
    )


def _tags(data: bytes) -> tuple[dict[str, str], int]:
    """The tags of the header, each required one there, once and of its form; and the header's length."""
    tags: dict[str, str] = {}
    start, n = 0, 3  # num_ascii_tags is the third
    while len(tags) < n:
        end = data.find(b"\n", start, start + 512)
        if end < 0 or not data[start:end].isascii():
            raise Quarantine(f"cut or damaged inside its header, line {len(tags) + 1}")
        key, _, value = data[start:end].decode("ascii").partition(":")
        if key in tags:
            raise Quarantine("damaged: a line of the header is there twice")
        tags[key] = value.strip()
        if key == "encoding_ver":  # at once: others may have other lines
            _check_version(tags[key])
        if key == "num_ascii_tags":
            n = int(value) if re.fullmatch(r" *\d{1,3}\s*", value, re.ASCII) else 0
        start = end + 1
    if not len(_PATTERNS) < n <= _MAX_TAGS:
        raise Quarantine("damaged: num_ascii_tags is missing or wrong")
    for key, pattern in _PATTERNS.items():
        if not re.fullmatch(pattern, tags.get(key, ""), re.ASCII):
            raise Quarantine(f"damaged: {key} in the header is missing or wrong")
    return tags, start


def _check_version(text: str) -> None:
    """Raises Quarantine for an encoding version that cannot be read, with the software it belongs to."""
    if not re.fullmatch(_PATTERNS["encoding_ver"], text, re.ASCII) or int(text) == _ENCODING:
        return  # what is no number is damage, reported later
    version = str(int(text))
    if version in _EARLIER:
        raise Quarantine(
            f"encoding version {version} belongs to glider software {_EARLIER[version]}; only version "
            f"{_ENCODING} (all software since 2008) can be read: update the software of the glider"
        )
    if version == "0":
        raise Quarantine("encoding version 0 was reserved for converted files: no glider writes it")
    raise Quarantine(
        f"encoding version {version} belongs to glider software newer than this gliderwatch, which reads "
        f"version {_ENCODING}: look for a newer gliderwatch"
    )


def _opened_at(text: str) -> float:
    """Seconds since 1970 of a time like `Sat_Sep__7_19:32:03_2024` (UTC), whatever the locale."""
    match = _TIME.fullmatch(text)
    if match is None or match[1] not in _MONTHS:
        raise Quarantine("damaged: fileopen_time in the header is wrong")
    month = _MONTHS.index(match[1]) + 1
    day, hour, minute, second, year = map(int, match.groups()[1:])
    if not _FIRST_YEAR <= year < _LAST_YEAR:
        raise Quarantine(f"opened in the year {year}: the glider's clock was wrong")
    if not 1 <= day <= calendar.monthrange(year, month)[1] or hour > 23 or minute > 59 or second > 60:
        raise Quarantine("damaged: fileopen_time in the header is wrong")
    return float(calendar.timegm((year, month, day, hour, minute, second)))
