"""Files of a simulated mission as they are written to a dockserver.

`steps` says what is written when, and `play` does it: at once, or as time passes. `write_mission`
leaves the names and the waiting out.
"""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from gliderwatch.simulate.calls import CallLog
from gliderwatch.simulate.delivery import USUAL, Arrival, FileForm, Names, arrivals, encoded
from gliderwatch.simulate.scenario import Mission

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
