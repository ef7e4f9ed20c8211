"""The files of an ocean model, read again when they change."""

from __future__ import annotations

from pathlib import Path

import structlog

from gliderwatch.config import Config, expand
from gliderwatch.errors import GliderwatchError
from gliderwatch.sea.ocean_field import Field

log = structlog.get_logger(__name__)


class OceanCache:
    """The field of the `ocean:` section; nothing is read while no glider is compared with it."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._seen: tuple[tuple[str, int, int], ...] | None = None
        self._field: Field | None = None

    def field(self, glider: str) -> Field | None:
        """The field to compare a glider with; None where none is wanted or the files cannot be read."""
        if self._config.glider(glider).reference != "model":
            return None
        seen = tuple(_state(path) for path in expand(self._config.ocean.files))
        if seen != self._seen:
            self._seen, self._field = seen, self._read()
        return self._field

    def _read(self) -> Field | None:
        from gliderwatch.sea.ocean_files import Box, read_field  # noqa: PLC0415 (xarray is slow to load)

        ocean = self._config.ocean
        area = None if ocean.area is None else Box(**dict(ocean.area))
        try:
            return read_field(ocean.files, area, ocean.stale_hours * 3600)
        except GliderwatchError as error:
            log.warning(
                "ocean model cannot be read: dives get no reference flow",
                paths=list(ocean.files),
                reason=str(error),
            )
            return None


def _state(path: Path) -> tuple[str, int, int]:
    try:
        status = path.stat()
    except OSError:
        return str(path), 0, 0
    return str(path), status.st_size, status.st_mtime_ns
