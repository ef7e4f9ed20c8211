"""Numbers, times and places as a pilot reads them. Pure."""

from __future__ import annotations

from datetime import UTC, datetime
from math import atan2, degrees, hypot, isfinite

from gliderwatch.model import Kind

UNKNOWN = "unknown"
INCIDENTS = {Kind.ANOMALY: "anomaly", Kind.FALSE_ALARM: "disagreement of measurements"}
"""Kinds of incidents for pilots. The papers' word for the second, false alarm, would read as "ignore"."""


def clean(text: str, limit: int = 200) -> str:
    """One printable line of `text`: names and notes come from files and may hold anything.

    Everything not printable (control characters, line ends, writing direction marks, lone
    surrogates) becomes a space, runs of spaces one; longer than `limit` characters is cut.

    >>> clean("electa\\r\\nBcc: x\\x1b[31m")
    'electa Bcc: x [31m'
    """
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return line if len(line) <= limit else line[: limit - 3] + "..."


def finite(value: float | None) -> float | None:
    """The value, or None where it is missing or not a number."""
    return value if value is not None and isfinite(value) else None


def utc(t: float) -> str:
    """Seconds since 1970 as date and minute.

    >>> utc(1667651640.0)
    '2022-11-05 12:34 UTC'
    """
    return datetime.fromtimestamp(t, UTC).strftime("%Y-%m-%d %H:%M UTC")


def duration(seconds: float) -> str:
    """A span of time with the unit that fits it.

    >>> duration(2400), duration(12240), duration(260000)
    ('40 min', '3.4 h', '3.0 days')
    """
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 172800 else f"{seconds / 86400:.1f} days"


def speed(value: float | None) -> str:
    """A speed (m/s) to the centimetre per second.

    >>> speed(-0.001), speed(None)
    ('0.00 m/s', 'unknown')
    """
    value = finite(value)
    return UNKNOWN if value is None else f"{round(value, 2) + 0.0:.2f} m/s"


def flow(u: float | None, v: float | None) -> str:
    """A current (east, north; m/s) as speed and the direction it sets to.

    >>> flow(0.1, 0.1), flow(-0.001, 0.3)
    ('0.14 m/s towards 045° true', '0.30 m/s towards 000° true')
    """
    u, v = finite(u), finite(v)
    if u is None or v is None:
        return UNKNOWN
    return f"{hypot(u, v):.2f} m/s towards {round(degrees(atan2(u, v))) % 360:03d}° true"


def place(lat: float | None, lon: float | None) -> str:
    """A position in degrees and decimal minutes, and in decimal degrees.

    >>> place(24.20575, -83.0205667)
    "24° 12.345' N, 083° 01.234' W (24.20575, -83.02057)"
    >>> place(None, 1.0)
    'unknown'
    """
    lat, lon = finite(lat), finite(lon)
    if lat is None or lon is None:
        return UNKNOWN
    north, east = _minutes(lat, "N", "S", 2), _minutes(lon, "E", "W", 3)
    return f"{north}, {east} ({lat:.5f}, {lon:.5f})"


def short_place(lat: float | None, lon: float | None) -> str:
    """A position in degrees and decimal minutes alone.

    >>> short_place(24.20575, -83.0205667)
    "24° 12.345' N, 083° 01.234' W"
    """
    return place(lat, lon).partition(" (")[0]


def _minutes(angle: float, positive: str, negative: str, width: int) -> str:
    # thousandths of a minute as an integer, so that 59.9996' becomes the next degree and not 60.000'
    full, rest = divmod(round(abs(angle) * 60_000), 60_000)
    return f"{full:0{width}d}° {rest / 1000:06.3f}' {positive if angle >= 0 else negative}"


def map_link(lat: float | None, lon: float | None) -> str:
    """A map with a marker at the position, short enough for one line of a mail or terminal; empty where it is
    unknown."""
    lat, lon = finite(lat), finite(lon)
    if lat is None or lon is None:
        return ""
    return f"https://www.openstreetmap.org/?mlat={lat:.5f}&mlon={lon:.5f}&zoom=9"


def angle(radians: float) -> str:
    """An angle in whole degrees, with its sign.

    >>> angle(-0.4538)
    '-26 degrees'
    """
    whole = round(degrees(radians))
    return f"{whole} degree" if abs(whole) == 1 else f"{whole} degrees"
