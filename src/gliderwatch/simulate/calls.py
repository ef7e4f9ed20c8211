"""The logs of the calls of a simulated glider, as a dockserver writes them. Pure.

No public log holds a whole abort: these are made of the lines that public logs and parsers hold.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from math import copysign
from pathlib import Path

import numpy as np

from gliderwatch.model import Array
from gliderwatch.simulate.ailments import DAY, Ailment, AilmentKind, of_kind
from gliderwatch.simulate.delivery import USUAL, Act, FileForm, Step, encoded, from_glider, make_calls
from gliderwatch.simulate.scenario import DiveTruth, Mission
from gliderwatch.simulate.telemetry import TIME, SegmentData

SERVER_AHEAD = 15.0
"""Seconds by which the server's clock, which names the logs, is ahead of the glider's."""
_LINES_A_SECOND = 4.0
_STATUS_EVERY = 20.0
"""Seconds after which the status is printed anew at the soonest (two public logs: 20 to 60)."""
_CUT = 0.4
"""Part of a call after which it is dropped."""


class Fate(StrEnum):
    """What becomes of a call."""

    USUAL = "usual"
    ABORT = "abort"
    LASTGASP = "lastgasp"
    GLIDER_DOS = "glider_dos"
    DROPPED = "dropped"
    NO_FILE = "no_file"


@dataclass(frozen=True, slots=True)
class CallRates:
    """Parts of 1: of the calls ``dropped``, without a file (``no_file``), and in which a pilot types
    (``typing``); of the lines ``garbled``.

    ``abort`` is the day of the mission from whose first call on an abort is printed (None: never), by
    ``cause``. From then on the glider waits at its prompt.
    """

    dropped: float = 0.0
    no_file: float = 0.0
    garbled: float = 0.0
    abort: float | None = None
    cause: str = "LEAK"
    typing: float = 0.0


@dataclass(frozen=True, slots=True)
class CallLog:
    """A log: its file ``name``, its ``lines`` with their ends, each with the time (s) when it is written.

    ``fate`` is what became of the call, ``pilot`` whether one typed in it.
    """

    name: str
    lines: tuple[tuple[float, bytes], ...]
    fate: Fate
    pilot: bool

    @property
    def begun(self) -> float:
        """When the call began (s)."""
        return self.lines[0][0]

    @property
    def sends(self) -> bool:
        """Whether files come in it."""
        return self.fate in (Fate.USUAL, Fate.DROPPED)


def call_logs(
    mission: Mission,
    rates: CallRates = CallRates(),
    form: FileForm = USUAL,
    ailments: tuple[Ailment, ...] = (),
) -> Iterator[CallLog]:
    """The log of each call of a mission, in order of time."""
    rng, typing, scenario = mission.scenario.rng(7), mission.scenario.rng(9), mission.scenario
    calls, closing = make_calls(mission), _Closing(mission)
    aborted: float | None = None
    for t, sendings in zip(calls.times, calls.sendings, strict=True):
        chance = rng.random(4)
        is_lost = rates.abort is not None and t >= scenario.start + rates.abort * DAY
        fate = _fate(rates, ailments, t, chance)
        if is_lost:
            fate = Fate.ABORT if aborted is None else Fate.GLIDER_DOS
            aborted = t if aborted is None else aborted
        files, pilot = [s.segment for s in sendings], bool(typing.random() < rates.typing)
        lines = [
            "Connection Event: Carrier Detect found.    Iridium console active and ready...",
            *_status(mission, t, fate, closing.before(t)),
            *_devices(scenario.start, t, ailments),
            *_aborted(rates, fate, aborted),
            *(_TYPED if pilot else ()),
            *(_transfers(files, scenario.glider, form) if fate in (Fate.USUAL, Fate.DROPPED) else ()),
        ]
        later = t + max(len(lines) / _LINES_A_SECOND, _STATUS_EVERY)
        lines += _status(mission, later, Fate.GLIDER_DOS if is_lost else fate, closing.before(t))
        lines += _devices(scenario.start, later, ailments)
        lines = lines[: int(_CUT * len(lines))] if fate is Fate.DROPPED else [*lines, *_end(fate, is_lost)]
        end = b"\r\n" if chance[2] < 0.5 else b"\n"
        name = _name(scenario.glider, t, modem=chance[3] < 0.5)
        yield CallLog(name, _written(lines, t, end, rates, rng), fate, pilot)


def _fate(rates: CallRates, ailments: tuple[Ailment, ...], t: float, chance: Array) -> Fate:
    """What becomes of a call at a time (s) of a glider that has not aborted."""
    if of_kind(ailments, AilmentKind.GLIDER_DOS, t):
        return Fate.GLIDER_DOS
    if of_kind(ailments, AilmentKind.LASTGASP, t):
        return Fate.LASTGASP
    if chance[0] < rates.dropped:
        return Fate.DROPPED
    return Fate.NO_FILE if chance[1] < rates.no_file else Fate.USUAL


_TYPED = ("^R", "^W", "!get u_alt_min_depth", "User typed Control-R, resuming")
"""What a log has of a pilot who types."""


class _Closing:
    """The segments of a mission by when they were closed."""

    def __init__(self, mission: Mission) -> None:
        self._segments = sorted(mission.segments, key=lambda s: s.closed)
        self._times = [s.closed for s in self._segments]

    def before(self, t: float) -> SegmentData | None:
        """The last one that was closed by a time (s)."""
        k = bisect_right(self._times, t)
        return self._segments[k - 1] if k else None


def _name(glider: str, t: float, *, modem: bool) -> str:
    """Both ways in which dockservers name logs."""
    stamp = datetime.fromtimestamp(t + SERVER_AHEAD, UTC).strftime("%Y%m%dT%H%M%S")
    return f"{glider}_modem_{stamp}.log" if modem else f"{glider}_{stamp}_network_net_0.log"


def _status(mission: Mission, t: float, fate: Fate, segment: SegmentData | None) -> list[str]:
    glider, start = mission.scenario.glider, mission.scenario.start
    dive = next((d for d in reversed(mission.truth) if d.t_surface <= t), None)
    now, head = datetime.fromtimestamp(t, UTC), list[str]()
    if fate is not Fate.GLIDER_DOS and segment is not None:
        header, short = segment.header, segment.header.short_name
        name = "lastgasp.mi" if fate is Fate.LASTGASP else "sim.mi"
        head = [
            f"Glider {glider} at surface.",
            "Because:timeout expired [behavior surface_4 start_when = 2.0]",
            f"MissionName:{name} MissionNum:{header.full_name} ({short[:4]}.{short[4:]})",
        ]
    return [
        *head,
        f"Vehicle Name: {glider}",
        f"Curr Time: {now:%a %b} {now.day:2d} {now:%H:%M:%S %Y} MT: {t - start:8.0f}",
        "GPS TooFar:   69696969.000 N 69696969.000 E measured     1e+308 secs ago",
        *([] if dive is None else [_fix(dive, t)]),
        *([] if segment is None else _sensors(segment, t)),
        "Megabytes available on c: = 7763.84",
        "report_heap_size(): M_FREE_HEAP=277.0K(283620 bytes)",
    ]


_PRINTED = (
    "m_battery",
    "m_coulomb_amphr_total",
    "m_digifin_leakdetect_reading",
    "m_leakdetect_voltage",
    "m_leakdetect_voltage_forward",
    "m_lithium_battery_relative_charge",
    "m_vacuum",
)
"""Sensors that a glider prints in a call, where its files have them too."""


def _sensors(segment: SegmentData, t: float) -> list[str]:
    """The last value of each sensor in the glider's last file, as it prints them."""
    columns = segment.sensors.columns
    times = segment.values[:, [sensor.name for sensor in columns].index(TIME)]
    lines = []
    for k, sensor in enumerate(columns):
        at = np.flatnonzero(~np.isnan(segment.values[:, k]))
        if sensor.name in _PRINTED and len(at) > 1:
            value, age = segment.values[at[-1], k], max(t - times[at[-1]], 0.1)
            lines.append(f"   sensor:{sensor.name}({sensor.unit})={value:.10g} {age:12.3f} secs ago")
    return lines


def _devices(start: float, t: float, ailments: tuple[Ailment, ...]) -> list[str]:
    """The counts of all devices, and of the digifin alone; a reset starts them at 0."""
    reset = of_kind(ailments, AilmentKind.RESET, t)
    since = start if reset is None else reset.onset
    found = of_kind(ailments, AilmentKind.DEVICE_ERROR, t)
    errors = 0 if found is None or found.onset < since else int(found.size)
    warned, odd = int((t - since) / DAY * 2), int((t - since) / DAY * 12)
    counts = f"errs: {errors:3d}/{errors:3d}/{errors:3d} warn: {warned:3d}/{warned:3d}/  1"
    return [
        f"devices:(t/m/s) {counts} odd: {odd:3d}/ 72/   4",
        f"14 digifin I u 3 20 5 0 [ {errors} {errors} {errors}] [ {warned} 5 1] [ {odd} 62 4]",
        *([":OOD: digifin: OUT OF DEADBAND"] if errors else ()),
    ]


def _fix(dive: DiveTruth, t: float) -> str:
    lat, lon = (_nmea(angle) for angle in (dive.end.lat, dive.end.lon))
    return f"GPS Location:  {lat} N {lon} E measured {t - dive.t_surface:10.3f} secs ago"


def _nmea(angle: float) -> str:
    """Degrees and minutes; thousandths of a minute as an integer, so that there are never 60."""
    degrees, rest = divmod(round(abs(angle) * 60_000), 60_000)
    return f"{copysign(degrees * 100 + rest / 1000, angle):9.3f}"


def _aborted(rates: CallRates, fate: Fate, t: float | None) -> list[str]:
    """What a call says of the abort at a time (s; None: there was none)."""
    fell = ["Mission completed ABNORMALLY", "SEQUENCE: Running lastgasp.mi on try 0"]
    if t is None:
        return [*(fell if fate is Fate.LASTGASP else ()), "ABORT HISTORY: total since reset: 0"]
    history = [
        "ABORT HISTORY: total since reset: 1",
        f"ABORT HISTORY: last abort cause: MS_ABORT_{rates.cause}",
        f"ABORT HISTORY: last abort time: {datetime.fromtimestamp(t, UTC):%Y-%m-%dT%H:%M:%S}",
    ]
    if fate is Fate.ABORT:
        now = [
            f"62.87 28 behavior ?_-1: abort_the_mission(1): (24)MS_ABORT_{rates.cause}",
            "drop_the_weight = 0",
            "Mission completed ABNORMALLY",
        ]
        return [*now, *history]
    return history


def _transfers(files: list[SegmentData], glider: str, form: FileForm) -> list[str]:
    lines = ["START", "**B00000000000000"]
    for file in files:
        data, extension = encoded(file, form)
        name = f"{file.header.short_name}.{extension}"
        lines.append(f"Starting zModem transfer of {name} to/from {glider} size is {len(data)}")
        lines += [f"Total Bytes sent/received: {n}" for n in range(1024, len(data), 1024)]
        lines.append(f"zModem transfer DONE for file {name}")
    return [*lines, "GLD: SUCCESS"]


def _end(fate: Fate, is_lost: bool) -> list[str]:
    if fate in (Fate.ABORT, Fate.GLIDER_DOS):
        prompt = "A 24" if is_lost else "N -1"
        return [f"GliderDos {prompt} >Connection Event: Carrier Detect lost."]
    if fate in (Fate.NO_FILE, Fate.LASTGASP):
        return [
            "behavior surface_4: TIMED OUT WAITING FOR A CHARACTER",
            "Connection Event: Carrier Detect lost.",
        ]
    return ["User typed Control-R, resuming", "Connection Event: Carrier Detect lost."]


def _written(
    lines: list[str], t: float, end: bytes, rates: CallRates, rng: np.random.Generator
) -> tuple[tuple[float, bytes], ...]:
    """The lines as bytes, some of them garbled, as they come one after another from a time (s) on."""
    out = []
    for k, line in enumerate(lines):
        data = bytearray(line.encode())
        garbled, at, noise = rng.random(), rng.integers(len(data)), rng.integers(128, 256)
        if garbled < rates.garbled:
            data[at] = noise
        out.append((t + k / _LINES_A_SECOND, bytes(data) + end))
    return tuple(out)


def as_called(order: Iterable[Step], logs: Sequence[CallLog]) -> Iterator[Step]:
    """The steps but for those of calls in which no file is sent: what was to come then never comes."""
    times = [log.begun for log in logs]
    for step in order:
        k = bisect_right(times, step.time) - 1
        if k < 0 or logs[k].sends:
            yield step


def log_steps(root: Path, mission: Mission, logs: Iterable[CallLog]) -> Iterator[Step]:
    """How the logs of the calls of one glider grow, line by line, in no order across files."""
    folder = from_glider(root, mission).with_name("logs")
    for log in logs:
        last = len(log.lines) - 1
        for k, (t, line) in enumerate(log.lines):
            act, mtime = Act.APPEND if k else Act.BEGIN, t if k == last else None
            yield Step(t, act, folder / log.name, line, mtime=mtime)
