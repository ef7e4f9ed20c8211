"""What the name of a file tells: its kind and whether it is complete, never which segment it holds. Pure."""

from __future__ import annotations

import re
from calendar import timegm
from pathlib import PurePath

_FLIGHT = {"sbd": "sbd", "mbd": "mbd", "dbd": "dbd", "scd": "sbd", "mcd": "mbd", "dcd": "dbd"}
_SCIENCE_OF = {"sbd": ("tbd", "tcd"), "mbd": ("nbd", "ncd"), "dbd": ("ebd", "ecd")}
_FLIGHT_OF = {"tbd": ("sbd", "scd"), "nbd": ("mbd", "mcd"), "ebd": ("dbd", "dcd")}
_CACHE = frozenset({"cac", "ccc"})
_RANKS = {"sbd": 0, "mbd": 1, "dbd": 2}
_STAMP = re.compile(r"(?<!\d)(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)(?!\d)", re.ASCII)
_SEGMENT = re.compile(r"(?P<glider>.+)-\d{4}-\d{1,3}-\d{1,5}-\d{1,5}", re.ASCII | re.DOTALL)


_UNDER_WAY = re.compile(r"[.~].*|.*(~|\.(tmp|temp|part|partial|filepart)(\..*)?)", re.IGNORECASE | re.DOTALL)
"""Names that programs give a file until all of it is there (rsync, WinSCP, browsers, `deliver`)."""


def is_under_way(name: str) -> bool:
    """Whether the name is that of a transfer under way, or of one that was given up: never of data.

    >>> is_under_way(".electa-2022-308-3-2.sbd"), is_under_way("92.tmp.sbd"), is_under_way("92.sbd")
    (True, True, False)
    """
    return _UNDER_WAY.fullmatch(name) is not None


def _suffix(name: str) -> str:
    return "" if is_under_way(name) else PurePath(name).suffix[1:].lower()


def kind(name: str) -> str | None:
    """The kind of flight data a file of this name holds, compressed or not: sbd, mbd or dbd; else None.

    >>> kind("01330000.SCD"), kind("usf-sam-2019-251-4-12.tbd"), kind("notes.txt")
    ('sbd', None, None)
    """
    return _FLIGHT.get(_suffix(name))


def is_science(name: str) -> bool:
    """Whether the name is that of science data (tbd, ebd, ...)."""
    return bool(flight_of(name))


def science_of(name: str) -> tuple[str, ...]:
    """The suffixes of the science files that belong to a flight file of this name; none for others.

    >>> science_of("00920000.SCD"), science_of("00920000.tbd")
    (('tbd', 'tcd'), ())
    """
    return _SCIENCE_OF.get(kind(name) or "", ())


def flight_of(name: str) -> tuple[str, ...]:
    """The suffixes of the flight files that belong to a science file of this name; none for others.

    >>> flight_of("00920000.tcd"), flight_of("00920000.sbd")
    (('sbd', 'scd'), ())
    """
    return _FLIGHT_OF.get(_suffix(name).replace("c", "b"), ())


def is_cache(name: str) -> bool:
    """Whether the name is that of a cache file, the list of sensors of a factored header."""
    return _suffix(name) in _CACHE


def rank(kind: str) -> int:
    """How full a kind is: the higher replaces the lower of the same segment. `KeyError` for others."""
    return _RANKS[kind]


def glider_of(full_name: str) -> str | None:
    """The glider, lower case, of `<glider>-<year>-<yearday>-<mission>-<segment>`; None if it is no such name.

    >>> glider_of("usf-sam-2019-251-4-12"), glider_of("Maria_997-2022-164-7-0"), glider_of("00920000")
    ('usf-sam', 'maria_997', None)
    """
    match = _SEGMENT.fullmatch(full_name)
    return match["glider"].lower() if match else None


def is_long(name: str) -> bool:
    """Whether a file has its long name, which a dockserver gives only to complete files.

    >>> is_long("electa-2022-308-3-2.sbd"), is_long("00930002.sbd")
    (True, False)
    """
    return glider_of(PurePath(name).stem) is not None


def is_log(name: str) -> bool:
    """Whether a file of this name is the log of a call.

    >>> is_log("unit_1033_20250126T072155_network_net_0.log"), is_log("notes.log")
    (True, False)
    """
    return name.lower().endswith(".log") and stamp(name) is not None


def stamp(name: str) -> float | None:
    """The server's time (s) in the name of a log; None where there is none."""
    match = _STAMP.search(name)
    if match is None:
        return None
    year, month, day, hour, minute, second = (int(group) for group in match.groups())
    if not (1990 <= year <= 2100 and 1 <= month <= 12 and 1 <= day <= 31 and hour < 24 and minute < 60):
        return None
    return float(timegm((year, month, day, hour, minute, second, 0, 0, 0)))
