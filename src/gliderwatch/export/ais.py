"""The place of a submerged glider as a virtual aid to navigation (AIS message 21), for charts on board. Pure.

002 proposes it: ships then see on their screen where a glider is that may come up. On the air it needs a
licence and a number (MMSI 99MIDxxxx) of the authority; here it is made as text, and sent nowhere.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime

from gliderwatch.errors import GliderwatchError
from gliderwatch.incidents.notices import DriftEllipse

ACCURATE = 10.0
"""Metres below which ITU-R M.1371 calls a position accurate."""
LARGEST = 511
"""Metres from the position to each side that a message can hold."""


def lines(glider: str, area: DriftEllipse, mmsi: int, now: float) -> list[str]:
    """NMEA 0183 lines (VDM) of where a glider is with 95 % at `now` (s).

    Raises GliderwatchError where pyais is not installed, or the number is none of a virtual aid.
    """
    try:
        from pyais.encode import encode_dict  # noqa: PLC0415 (an extra)
    except ImportError:
        raise GliderwatchError(
            "virtual AIS needs pyais, which is not installed: docs/install.md says how"
        ) from None
    if not 990_000_000 <= mmsi <= 999_999_999:
        raise GliderwatchError(
            f"{mmsi} is not the number of an aid to navigation: it has nine digits and begins with 99"
        )
    half = min(round(area.major), LARGEST)
    fields: dict[str, str | int | float | bytes | bool] = {
        "type": 21,
        "mmsi": mmsi,
        "aid_type": 1,  # reference point
        "name": re.sub(r"[^A-Z0-9 ]", " ", f"GLIDER {glider.upper()}")[:20],
        "accuracy": int(area.major < ACCURATE),
        "lon": area.lon,
        "lat": area.lat,
        "to_bow": half,
        "to_stern": half,
        "to_port": min(half, 63),
        "to_starboard": min(half, 63),
        "epfd": 0,
        "second": datetime.fromtimestamp(now, UTC).second,
        "off_position": 0,
        "virtual_aid": 1,
    }
    return list(encode_dict(fields, talker_id="AI", sentence_type="VDM", radio_channel="A"))
