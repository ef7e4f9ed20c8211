"""Virtual AIS of gliders that have a number for it: lines to a file or a UDP port of this machine, again and
again. Nothing goes on the air from here."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import structlog

from gliderwatch.config import Config
from gliderwatch.errors import GliderwatchError
from gliderwatch.export import ais
from gliderwatch.pages.reading import read_glider
from gliderwatch.pages.writing import put
from gliderwatch.store.state_file import Store

log = structlog.get_logger(__name__)


class VirtualAis:
    """Gives the lines out when they are due. Used in the daemon's thread."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._config: Config | None = None
        self._next = float("-inf")
        self._trouble = ""

    def use(self, config: Config) -> None:
        """Go by these settings."""
        self._config, self._next = config, float("-inf")

    def turn(self, now: float, monotonic: float) -> None:
        """Give out where gliders are at `now` (s), if that is wanted and due. Raises StateError."""
        config = self._config
        if config is None or monotonic < self._next or (config.ais.file, config.ais.udp_port) == (None, None):
            return
        self._next = monotonic + config.ais.seconds
        try:
            self._give_out(config, list(self._lines(config, now)))
            trouble = ""
        except (GliderwatchError, OSError) as error:
            trouble = str(error)
        if trouble and trouble != self._trouble:
            log.warning("virtual AIS not given out", reason=trouble)
        self._trouble = trouble

    def _lines(self, config: Config, now: float) -> Iterator[str]:
        known = set(self._store.gliders())
        for name, glider in config.gliders.items():
            if glider.mmsi is None or name not in known:
                continue
            view = read_glider(self._store, name, config.attention(name), now, dives=1, whole=False)
            area = view.whereabouts()
            if area is not None:
                yield from ais.lines(name, area, glider.mmsi, now)

    def _give_out(self, config: Config, lines: list[str]) -> None:
        if config.ais.file is not None:
            put(Path(config.ais.file), "".join(f"{line}\r\n" for line in lines))
        if config.ais.udp_port is not None:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
                for line in lines:
                    out.sendto(f"{line}\r\n".encode("ascii"), ("127.0.0.1", config.ais.udp_port))
