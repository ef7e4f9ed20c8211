"""The science file of a segment: from it comes the pressure that a flight file leaves out.

A glider writes tbd, nbd and ebd beside sbd, mbd and dbd, with the sensors of its science computer.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from gliderwatch.errors import GliderwatchError
from gliderwatch.slocum import folders
from gliderwatch.slocum.caches import candidates, read_list
from gliderwatch.slocum.header import Header
from gliderwatch.slocum.sensors import DEPTH, PRESSURES


def science_files(flight: Path) -> Iterator[Path]:
    """The science files of the same name beside a flight file, plain or compressed."""
    return _beside(flight, folders.science_of(flight.name))


def flight_files(science: Path) -> Iterator[Path]:
    """The flight files of the same name beside a science file, plain or compressed."""
    return _beside(science, folders.flight_of(science.name))


def _beside(path: Path, suffixes: tuple[str, ...]) -> Iterator[Path]:
    for suffix in suffixes:
        for name in (f"{path.stem}.{suffix}", f"{path.stem}.{suffix.upper()}"):
            other = path.with_name(name)
            if other.is_file() and not other.is_symlink():
                yield other


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
