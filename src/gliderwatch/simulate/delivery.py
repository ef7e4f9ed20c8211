"""How the files of a mission come to shore: in what order, under what names, how whole. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum, StrEnum
from operator import attrgetter

import numpy as np

from gliderwatch.model import Array
from gliderwatch.simulate.dinkum import Generation, compress, encode
from gliderwatch.simulate.scenario import Mission
from gliderwatch.simulate.telemetry import SegmentData

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
