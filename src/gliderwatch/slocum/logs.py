"""What a glider says in the log of a call: one line of bytes in, typed events out. Pure.

A log is hostile text: lines are cut, garbled, glued together and interleaved with a file transfer. A line
that cannot be read is left out; nothing here raises. Source of the lines: public logs and the Slocum manuals.
"""

from __future__ import annotations

import re
from calendar import timegm
from collections.abc import Callable
from math import copysign, isfinite

from gliderwatch.slocum.log_events import (
    AbortCause,
    AbortCount,
    AbortNow,
    AbortPlace,
    AbortTime,
    Because,
    Carrier,
    Clock,
    Counts,
    Device,
    Diving,
    Emergency,
    Event,
    FellOut,
    HangUp,
    Housekeeping,
    LastMission,
    Mission,
    PilotThere,
    Position,
    Prompt,
    Reading,
    Sent,
    Transfer,
    Trouble,
    Unattended,
    Vehicle,
    Waypoint,
    WeightDropped,
)

LONGEST_LINE = 2000
"""Bytes of a line that are read; the rest of a longer one is noise."""
_NEVER = 1e8
"""Seconds: an age above is "never"; of a coordinate, 69696969 is."""
_MONTHS = "jan feb mar apr may jun jul aug sep oct nov dec"


def parse_line(line: bytes) -> tuple[Event, ...]:
    """The events of one line without its end; more than one where lines are glued together. Never raises."""
    text = line[:LONGEST_LINE].decode("latin-1")
    events: list[tuple[int, Event]] = []
    for pattern, make in _PATTERNS:
        for match in pattern.finditer(text):
            try:
                event = make(match)
            except (ValueError, OverflowError):
                continue  # garbled: a number that cannot be
            if event is not None:
                events.append((match.start(), event))
    return tuple(event for _, event in sorted(events, key=lambda item: item[0]))


def degrees_of(nmea: str) -> float:
    """Degrees of degrees and minutes as in `-6127.509`, with the sign on the number.

    Raises ValueError where it is no such number, as 69696969 is none.
    """
    value = _number(nmea)
    whole, minutes = divmod(abs(value), 100.0)
    if minutes >= 60.0 or whole > 360.0:
        raise ValueError("no degrees and minutes")
    return copysign(whole + minutes / 60.0, value)


def _number(text: str) -> float:
    value = float(text)
    if not isfinite(value):
        raise ValueError("not finite")
    return value


def _age(text: str) -> float:
    value = _number(text)
    if not 0.0 <= value <= _NEVER:
        raise ValueError("never")
    return value


def _place(lat: str, lon: str) -> tuple[float, float]:
    north, east = degrees_of(lat), degrees_of(lon)
    if abs(north) > 90.0:
        raise ValueError("no latitude")
    return north, east - copysign(360.0, east) if abs(east) > 180.0 else east


def _time(year: str, month: int, day: str, hour: str, minute: str, second: str) -> float:
    fields = (int(year), month, int(day), int(hour), int(minute), int(second))
    t = timegm((*fields, 0, 0, 0))
    limits = ((1990, 2100), (1, 12), (1, 31), (0, 23), (0, 59), (0, 60))
    if any(not low <= value <= high for value, (low, high) in zip(fields, limits, strict=True)):
        raise ValueError("no time")
    return float(t)


def _clock(m: re.Match[str]) -> Event:
    month = _MONTHS.index(m[1].lower()) / 4 + 1  # a ValueError where it is none
    if not month.is_integer():
        raise ValueError("no month")
    mission = None if m[7] is None else _number(m[7])
    return Clock(_time(m[6], int(month), m[2], m[3], m[4], m[5]), mission)


def _reading(m: re.Match[str]) -> Event:
    return Reading(m[1].lower(), _number(m[3]), m[2], _age(m[4]))


def _counts(m: re.Match[str]) -> Event:
    n = [int(m[k]) for k in range(1, 10)]
    return Counts((n[0], n[1], n[2]), (n[3], n[4], n[5]), (n[6], n[7], n[8]))


def _device(m: re.Match[str]) -> Event:
    n = [int(m[k]) for k in range(2, 11)]
    return Device(m[1].lower(), Counts((n[0], n[1], n[2]), (n[3], n[4], n[5]), (n[6], n[7], n[8])))


def _last_mission(m: re.Match[str]) -> Event:
    return LastMission(m[1].lower())


def _weight(m: re.Match[str]) -> Event | None:
    return WeightDropped() if _number(m[1]) >= 0.5 else None


_F = r"([-+]?\d[\d.]*(?:[eE][-+]?\d+)?)"
_LAST = r"(lastgasp|initial|LASTGASP|INITIAL)\.(?:mi|MI)"
_FILE = r"([\w-]{1,60}\.\w{3})"
_TRIPLE = r"\s*(\d+)\s*/\s*(\d+)\s*/\s*(\d+)"
_BRACKET = r"\s*\[\s*(\d+)\s+(\d+)\s+(\d+)\s*\]"

_PATTERNS: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], Event | None]], ...] = tuple(
    (re.compile(pattern, re.ASCII), make)
    for pattern, make in (
        (r"Connection Event: Carrier Detect (found|lost)", lambda m: Carrier(m[1].lower() == "found")),
        (r"disabling Iridium console", lambda m: Carrier(found=False)),
        (r"Vehicle Name:\s*([A-Za-z0-9][\w-]{0,39})\s*$", lambda m: Vehicle(m[1].lower())),
        (
            r"Curr Time: \w{3} (\w{3})\s+(\d{1,2}) (\d\d):(\d\d):(\d\d) (\d{4})(?:\s+MT:\s*(\d{1,10}))?",
            _clock,
        ),
        (
            rf"GPS Location:\s*{_F} N\s+{_F} E measured\s+{_F} secs ago",
            lambda m: Position(*_place(m[1], m[2]), _age(m[3])),
        ),
        (rf"sensor:(\w{{1,60}})\(([^)]{{0,20}})\)={_F}\s+{_F} secs ago", _reading),
        (r"^\s*Because:\s*([^\[]{1,200})", lambda m: Because(" ".join(m[1].split()))),
        (
            r"MissionName:\s*(\S{1,60})\s+MissionNum:\s*([\w-]{1,60})(?:\s+\((\d{4}\.\d{4})\))?",
            lambda m: Mission(m[1].lower(), m[2], m[3] or ""),
        ),
        (rf"devices:\(t/m/s\) errs:{_TRIPLE} warn:{_TRIPLE} odd:{_TRIPLE}", _counts),
        (
            rf"^\s*\d+\s+(\w{{1,40}})\s+\S\s+\S(?:\s+-?\d+){{2,6}}{_BRACKET}{_BRACKET}{_BRACKET}",
            _device,
        ),
        (r"ABORT HISTORY: total since reset:\s*(\d{1,6})\s*$", lambda m: AbortCount(int(m[1]))),
        (r"ABORT HISTORY: last abort cause:\s*(?:MS_ABORT_)?(\w{1,60})", lambda m: AbortCause(m[1].upper())),
        (
            r"ABORT HISTORY: last abort time:\s*(\d{4})-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)",
            lambda m: AbortTime(_time(m[1], int(m[2]), m[3], m[4], m[5], m[6])),
        ),
        (
            r"ABORT HISTORY: last abort (segment|mission):\s*(\S{1,60})",
            lambda m: AbortPlace(m[1].lower(), m[2]),
        ),
        (r"abort_the_mission\(\d+\):\s*\(\d+\)\s*MS_ABORT_(\w{1,60})", lambda m: AbortNow(m[1].upper())),
        (rf"drop_the_weight\s*=\s*{_F}", _weight),
        (rf"m_weight_drop\(bool\)[ =]+{_F}", _weight),
        (r"Mission completed ABNORMALLY", lambda m: FellOut()),
        (rf"SEQUENCE:\s+(?:About to run|Running)\s+{_LAST}", _last_mission),
        (rf"Starting Mission:\s*{_LAST}", _last_mission),
        (r"GliderDos ([AIN]) (-?\d{1,3}) ?>", lambda m: Prompt(m[1].upper(), int(m[2]))),
        (r"HARDWARE IN EMERGENCY MODE", lambda m: Emergency()),
        (rf"Waypoint:\s*\({_F},\s*{_F}\)", lambda m: Waypoint(*_place(m[1], m[2]))),
        (rf"Time until diving is:\s*{_F} secs", lambda m: Diving(_age(m[1]))),
        (
            rf"Starting zModem transfer of {_FILE} to/from \S+ size is (\d{{1,10}})",
            lambda m: Transfer(m[1].lower(), int(m[2]), done=False),
        ),
        (rf"zModem transfer DONE for file {_FILE}", lambda m: Transfer(m[1].lower(), None, done=True)),
        (r"\b(GLD|SCI): SUCCESS", lambda m: Sent(m[1].upper())),
        (r"User typed Control-R|^RESUMING MISSION", lambda m: PilotThere(ends=False)),
        (r"I heard a Control-C", lambda m: PilotThere(ends=True)),
        (r"TIMED OUT WAITING FOR A CHARACTER", lambda m: Unattended()),
        (r"I am going to hangup the Iridium", lambda m: HangUp(None)),
        (rf"I will call you back in {_F} minutes", lambda m: HangUp(_age(m[1]))),
        (r"DRIVER_(ERROR|WARNING|ODDITY)", lambda m: Trouble(m[1].lower(), m.string.strip()[:200])),
        (r":OOD:.{0,100}OUT OF DEADBAND", lambda m: Trouble("deadband", m.string.strip()[:200])),
        (
            rf"Megabytes available on (c): = {_F}",
            lambda m: Housekeeping("disk_megabytes", _number(m[2])),
        ),
        (r"\bM_FREE_HEAP=\S*\((\d{1,12}) bytes\)", lambda m: Housekeeping("heap_bytes", float(m[1]))),
        (rf"^\s+([mfsx]_\w{{1,60}})\([^)]{{0,20}}\) {_F}\s*$", lambda m: Housekeeping(m[1], _number(m[2]))),
    )
)
