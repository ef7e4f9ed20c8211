"""Sensor lists that came inside of files, kept for the files that leave them out.

A glider sends the list of sensors in one file and leaves it out of those that follow. So the format wants the
shore side to look for it in other files (dbd_file_format.txt, "A sensor list in ASCII"). Each list is kept
as a cache file in a folder of the state's, and is looked up there after the cache folders.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from gliderwatch.errors import GliderwatchError
from gliderwatch.ingest.caches import checksum
from gliderwatch.ingest.cycles import parse_sensor_list
from gliderwatch.ingest.header import Header, parse_header, plain, read_regular

MOST = 256
"""Lists that are kept. A glider makes a new one when its software or what it is to send changes."""
_LARGEST = 512 * 1024
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
        if text is None or len(text) > _LARGEST or checksum(text) != kept.stem:
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
