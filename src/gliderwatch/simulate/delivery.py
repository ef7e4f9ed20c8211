"""How the files of a mission come to shore and are written to a dockserver: order, names, how complete."""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum, StrEnum
from operator import attrgetter
from pathlib import Path

import numpy as np

from gliderwatch.model import Array
from gliderwatch.simulate.calls import CallLog
from gliderwatch.simulate.dinkum import Generation, compress, encode
from gliderwatch.simulate.scenario import Mission
from gliderwatch.simulate.telemetry import SegmentData

# ----------------------------------------
# How the files of a mission come to shore: in what order, under what names, how whole.

_BYTES_A_SECOND = 400.0
_BETWEEN_FILES = 4.0
_UNTIL_RENAMED = (120.0, 600.0)
_SHORTEST_PART = 0.02


class Names(Enum):
    """How files are named: in full, in the 8.3 way of the glider, or as the rates of the scenario say."""

    LONG = "long"
    SHORT = "short"
    AS_SENT = "as sent"


@dataclass(frozen=True, slots=True)
class FileForm:
    """What kind of files a glider makes of its segments."""

    names: Names = Names.LONG
    compressed: bool = False
    factored: bool = True
    generation: Generation = Generation.G3


USUAL = FileForm()


class Fate(StrEnum):
    """What became of a file on its way: it may have several."""

    LOST = "lost"
    LATE = "late"
    TRUNCATED = "truncated"
    MENDED = "mended"
    RESENT = "resent"


@dataclass(frozen=True, slots=True)
class Arrival:
    """A file that has all that comes of it on shore at ``time`` (s).

    Its transfer began at ``begun``; under an 8.3 name it grows from then on. If it gets another name
    later, that is ``renamed``, and the time ``renamed_at``. ``mtime`` is the time it carries, by the
    clock of the glider.
    """

    time: float
    name: str
    data: bytes
    begun: float
    mtime: float
    renamed: str = ""
    renamed_at: float = 0.0

    @property
    def final_name(self) -> str:
        """The name it has in the end."""
        return self.renamed or self.name


@dataclass(frozen=True, slots=True)
class Sending:
    """One try to send a segment: the part of it that came through; what `Names.AS_SENT` makes of it."""

    segment: SegmentData
    part: float
    grows: bool
    renamed_after: float | None


@dataclass(frozen=True, slots=True)
class Calls:
    """What comes in each call of the glider (``times``, s), in the order sent; and what became of files."""

    times: tuple[float, ...]
    sendings: tuple[tuple[Sending, ...], ...]
    fates: tuple[tuple[SegmentData, Fate], ...]


def make_calls(mission: Mission) -> Calls:
    """Draw the fate of every file. The same draws are made whatever the rates: one moves no other."""
    rates, rng = mission.scenario.rates, mission.scenario.rng(3)
    files = sorted((*mission.segments, *mission.science), key=attrgetter("sent", "closed"))
    times = sorted({file.sent for file in files})
    calls: list[list[Sending]] = [[] for _ in times]
    fates: list[tuple[SegmentData, Fate]] = []
    for file in files:
        chance = rng.random(9)
        here, last = times.index(file.sent), len(times) - 1
        if chance[0] < rates.lost:
            fates.append((file, Fate.LOST))
            continue
        due = min(here + (1 + int(chance[2] * rates.late_calls) if chance[1] < rates.late else 0), last)
        if due > here:
            fates.append((file, Fate.LATE))
        truncated = bool(chance[3] < rates.truncated)
        part = _SHORTEST_PART + (1 - _SHORTEST_PART) * float(chance[4]) ** 0.5 if truncated else 1.0
        calls[due].append(_sending(mission, file, part, chance))
        again = Fate.MENDED if truncated else Fate.RESENT
        if truncated:
            fates.append((file, Fate.TRUNCATED))
        if due < last and chance[5] < (rates.mended if truncated else rates.resent):
            fates.append((file, again))
            calls[due + 1].append(_sending(mission, file, 1.0, chance))
    newest = rng.random(len(times)) < rates.newest_first
    for call, is_newest in zip(calls, newest, strict=True):
        call.sort(key=lambda sending: sending.segment.closed, reverse=bool(is_newest))
    return Calls(tuple(times), tuple(map(tuple, calls)), tuple(fates))


def _sending(mission: Mission, file: SegmentData, part: float, chance: Array) -> Sending:
    rates = mission.scenario.rates
    wait = float(np.interp(chance[8], [0, 1], _UNTIL_RENAMED)) if chance[7] < rates.renamed else None
    return Sending(file, part, bool(chance[6] < rates.growing), wait)


def arrivals(mission: Mission, form: FileForm = USUAL) -> Iterator[Arrival]:
    """The files of a mission in order of arrival."""
    calls, found = make_calls(mission), []
    for call, sendings in zip(calls.times, calls.sendings, strict=True):
        end = call
        for i, sending in enumerate(sendings):
            data, extension = encoded(sending.segment, form)
            data = data[: max(int(sending.part * len(data)), 1)]
            duration = len(data) / _BYTES_A_SECOND
            end += _BETWEEN_FILES + duration if i else 0.0
            found.append(_arrival(mission, sending, form, data, extension, end, duration))
    return iter(sorted(found, key=attrgetter("time")))


def _arrival(
    mission: Mission,
    sending: Sending,
    form: FileForm,
    data: bytes,
    extension: str,
    end: float,
    duration: float,
) -> Arrival:
    header = sending.segment.header
    long, short = f"{header.full_name}.{extension}", f"{header.short_name}.{extension}"
    mtime = sending.segment.closed + mission.scenario.rates.clock_skew
    begun = end - duration
    if form.names is not Names.AS_SENT:
        return Arrival(end, long if form.names is Names.LONG else short, data, begun, mtime)
    if not sending.grows:
        return Arrival(end, long, data, begun, mtime)
    if sending.renamed_after is None:
        return Arrival(end, short, data, begun, mtime)
    return Arrival(end, short, data, begun, mtime, long, end + sending.renamed_after)


def encoded(segment: SegmentData, form: FileForm) -> tuple[bytes, str]:
    """The bytes of the file of a segment, and its extension without the dot."""
    extension = segment.header.extension
    data = encode(
        segment.header,
        segment.sensors,
        segment.values,
        segment.updated,
        factored=form.factored,
        generation=form.generation,
    )
    return (compress(data), f"{extension[0]}c{extension[2:]}") if form.compressed else (data, extension)


# ----------------------------------------
# Files of a simulated mission as they are written to a dockserver.
#
# `steps` says what is written when, and `play` does it: at once, or as time passes. `write_mission`
# leaves the names and the waiting out.

__all__ = [
    "Act",
    "Arrival",
    "FileForm",
    "Names",
    "Step",
    "arrivals",
    "as_called",
    "cache",
    "deliver",
    "from_glider",
    "log_steps",
    "play",
    "steps",
    "write_cache",
    "write_full_rate",
    "write_mission",
]

_CHUNK = 1024


def cache(mission: Mission) -> dict[str, bytes]:
    """Names and contents of the cache files that the files of a mission refer to."""
    files = (*mission.segments, *mission.science, *mission.full_rate)
    return {f"{sensors.crc}.cac": sensors.text() for sensors in {file.sensors for file in files}}


def write_cache(folder: Path, mission: Mission) -> None:
    """Write the cache files of a mission into ``folder``."""
    for name, text in sorted(cache(mission).items()):
        deliver(folder / name, text)


def deliver(
    path: Path, data: bytes, pause: Callable[[], None] = lambda: None, *, mtime: float | None = None
) -> None:
    """Write a file as a dockserver does.

    A file of an 8.3 name, all digits, grows in place while it is transferred: ``pause`` is called after
    each kilobyte. Any other is complete from the moment it has its name, and its time ``mtime`` (s).
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.stem.isdigit():
        with path.open("wb") as file:
            for i in range(0, len(data), _CHUNK):
                file.write(data[i : i + _CHUNK])
                file.flush()
                pause()
        return
    partial = path.with_name(f".{path.name}.part")
    partial.write_bytes(data)
    if mtime is not None:
        os.utime(partial, (mtime, mtime))
    partial.replace(path)


def from_glider(root: Path, mission: Mission) -> Path:
    """The folder below a dockserver's root into which a glider's files go."""
    return root / mission.scenario.glider / "from-glider"


def write_mission(root: Path, cache_folder: Path, mission: Mission, form: FileForm = USUAL) -> list[Path]:
    """Write all files of a mission and its cache, at once; the paths in order of arrival."""
    if form.factored:
        write_cache(cache_folder, mission)
    paths = []
    for arrival in arrivals(mission, form):
        paths.append(from_glider(root, mission) / arrival.final_name)
        deliver(paths[-1], arrival.data)
    return paths


def write_full_rate(folder: Path, mission: Mission, form: FileForm = USUAL) -> list[Path]:
    """Write the full-rate files of a mission, as they are read out of the glider after its recovery."""
    paths = []
    for segment in mission.full_rate:
        data, extension = encoded(segment, form)
        paths.append(folder / mission.scenario.glider / f"{segment.header.full_name}.{extension}")
        deliver(paths[-1], data)
    return paths


class Act(Enum):
    """What is done to a file: written whole, begun, gone on with, or renamed."""

    PUT = "put"
    BEGIN = "begin"
    APPEND = "append"
    RENAME = "rename"


@dataclass(frozen=True, slots=True)
class Step:
    """One act at ``time`` (s). ``data`` are written to ``path``; a file that is renamed goes to ``target``.

    ``mtime`` (s), if given, is the time that the file is to carry from then on; ``ends`` is true of the
    last act on a file but for a renaming.
    """

    time: float
    act: Act
    path: Path
    data: bytes = b""
    target: Path | None = None
    mtime: float | None = None

    @property
    def ends(self) -> bool:
        """Whether all that comes of the file has come."""
        return self.mtime is not None


def steps(root: Path, mission: Mission, form: FileForm = USUAL) -> Iterator[Step]:
    """What happens to the files of one glider, in no order across files."""
    folder = from_glider(root, mission)
    for arrival in arrivals(mission, form):
        path = folder / arrival.name
        if not path.stem.isdigit():
            yield Step(arrival.time, Act.PUT, path, arrival.data, mtime=arrival.mtime)
            continue
        n = max(-(-len(arrival.data) // _CHUNK), 1)
        for i in range(n):
            t = arrival.begun + (i + 1) / n * (arrival.time - arrival.begun)
            chunk = arrival.data[i * _CHUNK : (i + 1) * _CHUNK]
            act, mtime = Act.APPEND if i else Act.BEGIN, arrival.mtime if i == n - 1 else None
            yield Step(t, act, path, chunk, mtime=mtime)
        if arrival.renamed:
            yield Step(arrival.renamed_at, Act.RENAME, path, target=folder / arrival.renamed)


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


def play(order: Iterable[Step], wait: Callable[[float], None] = lambda t: None) -> Iterator[Step]:
    """Do the steps one after another, each when ``wait`` has returned for its time; yield each when done."""
    for step in order:
        wait(step.time)
        _do(step)
        yield step


def _do(step: Step) -> None:
    if step.act is Act.PUT:
        deliver(step.path, step.data, mtime=step.mtime)
    elif step.act is Act.RENAME and step.target is not None:
        if step.path.exists():  # a copy that was sent again may have been renamed already
            step.path.replace(step.target)
    else:
        step.path.parent.mkdir(parents=True, exist_ok=True)
        with step.path.open("wb" if step.act is Act.BEGIN else "ab") as file:
            file.write(step.data)
        if step.mtime is not None:
            os.utime(step.path, (step.mtime, step.mtime))
