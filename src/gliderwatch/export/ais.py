"""The place of a submerged glider as AIS, for charts on board: a virtual aid to navigation (message 21), or a
vessel (message 1): the lines, and who gives them to a file or a UDP port of this machine.

002 proposes it: ships then see on their screen where a glider is that may come up. On the air it needs a
licence and a number (MMSI 99MIDxxxx) of the authority: nothing goes there from here.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import structlog

from gliderwatch.config import Config
from gliderwatch.errors import GliderwatchError
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.pages.reading import read_glider
from gliderwatch.pages.writing import put
from gliderwatch.store.state_file import Store

ACCURATE = 10.0
"""Metres below which ITU-R M.1371 calls a position accurate."""
AIDS = 990_000_000
"""The least number of an aid to navigation."""
LARGEST = 511
"""Metres from the position to each side that a message can hold."""


def lines(glider: str, area: DriftEllipse, mmsi: int, now: float) -> list[str]:
    """NMEA 0183 lines (VDM) of where a glider is with 95 % at `now` (s): message 21 of a number that begins
    with 99, as aids to navigation have, else message 1.

    Raises GliderwatchError where pyais is not installed, or the number is none.
    """
    try:
        from pyais.encode import encode_dict  # noqa: PLC0415 (an extra)
    except ImportError:
        raise GliderwatchError(
            "virtual AIS needs pyais, which is not installed: docs/install.md says how"
        ) from None
    if not 200_000_000 <= mmsi <= 999_999_999:
        raise GliderwatchError(f"{mmsi} is no number of AIS: it has nine digits and begins with 2 or more")
    fields = {
        "mmsi": mmsi,
        "accuracy": int(area.major < ACCURATE),
        "lon": area.lon,
        "lat": area.lat,
        "second": datetime.fromtimestamp(now, UTC).second,
        **(_aid(glider, area) if mmsi >= AIDS else _VESSEL),
    }
    return list(encode_dict(fields, talker_id="AI", sentence_type="VDM", radio_channel="A"))


_Fields = dict[str, str | int | float | bytes | bool]
_VESSEL: _Fields = {"type": 1, "status": 15, "turn": -128, "speed": 102.3, "course": 360.0, "heading": 511}
"""Of all that a vessel says beside its place, that it is not known."""


def _aid(glider: str, area: DriftEllipse) -> _Fields:
    """A virtual aid to navigation, as large as the ellipse."""
    half = min(round(area.major), LARGEST)
    return {
        "type": 21,
        "aid_type": 1,  # reference point
        "name": re.sub(r"[^A-Z0-9 ]", " ", f"GLIDER {glider.upper()}")[:20],
        "to_bow": half,
        "to_stern": half,
        "to_port": min(half, 63),
        "to_starboard": min(half, 63),
        "epfd": 0,
        "off_position": 0,
        "virtual_aid": 1,
    }


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
                yield from lines(name, area, glider.mmsi, now)

    def _give_out(self, config: Config, lines: list[str]) -> None:
        if config.ais.file is not None:
            put(Path(config.ais.file), "".join(f"{line}\r\n" for line in lines))
        if config.ais.udp_port is not None:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
                for line in lines:
                    out.sendto(f"{line}\r\n".encode("ascii"), ("127.0.0.1", config.ais.udp_port))
