"""Cache files: the sensor lists that factored headers leave out. Finding them, and a private copy of each."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from gliderwatch.errors import GliderwatchError, MissingCache, Retry
from gliderwatch.ingest.cycles import Sensors, parse_sensor_list
from gliderwatch.ingest.header import Header, decompress, read_regular

_LARGEST = 4 * 1024 * 1024
_CURE = "copy it from the glider or the dockserver again"


def find_cache(crc: str, folders: Iterable[Path]) -> Path | None:
    """The cache file of the sensor list `crc`, plain or compressed, in the first of `folders` that has it.

    Gliders and dockservers write the name in either case. Sub-folders are not searched.
    Raises `OSError` where a folder cannot be read.
    """
    stems = dict.fromkeys((crc.lower(), crc.upper()))
    suffixes = (".cac", ".CAC", ".ccc", ".CCC")
    candidates = (folder / (stem + suffix) for folder, suffix, stem in product(folders, suffixes, stems))
    return next((path for path in candidates if path.is_file()), None)


@dataclass(frozen=True, slots=True)
class Staged:
    """A cache file as dbdreader wants it, plain and with a lower-case name in `folder`, and what it says."""

    source: tuple[Path, int, int]
    folder: Path
    n_listed: int
    sensors: Sensors


@dataclass(slots=True)
class Staging:
    """Private copies of the cache files that were needed, each made once while its source stays the same."""

    _folder: tempfile.TemporaryDirectory[str] = field(default_factory=tempfile.TemporaryDirectory)
    _known: dict[str, Staged] = field(default_factory=dict)

    def get(self, header: Header, folders: Iterable[Path]) -> Staged:
        """The sensor list of a file with this header.

        Raises `MissingCache` where none of `folders` has it, `Retry` where it is not whole or
        not the right one, `OSError` where it cannot be read.
        """
        folders = tuple(folders)
        path = find_cache(header.crc, folders)
        if path is None:
            raise MissingCache(header.crc, folders)
        status = path.stat()
        source = (path, status.st_size, status.st_mtime_ns)
        staged = self._known.get(header.crc)
        if staged is None or staged.source != source:
            staged = self._known[header.crc] = self._stage(header.crc, path, source)
        if (len(staged.sensors.names), staged.n_listed) != (header.n_held, header.n_sensors):
            raise Retry(
                f"cache file {path} does not fit: it lists {staged.n_listed} sensors and"
                f" {len(staged.sensors.names)} of them as held, the file's header says {header.n_sensors}"
                f" and {header.n_held}; {_CURE}"
            )
        return staged

    def _stage(self, crc: str, path: Path, source: tuple[Path, int, int]) -> Staged:
        try:
            content, _ = read_regular(path, _LARGEST, links=True)
            if not content.startswith(b"s:"):
                content = decompress(content, _LARGEST)
            content = content.rstrip() + b"\n"
            n_listed = content.count(b"\n")
            sensors, _ = parse_sensor_list(content, 0, n_listed)
        except (ValueError, GliderwatchError) as error:
            raise Retry(f"cache file {path} is not whole ({error}); {_CURE}") from error
        folder = Path(self._folder.name)
        (folder / f"{crc}.cac").write_bytes(content)
        return Staged(source, folder, n_listed, sensors)
