"""Files of a simulated mission as they arrive on a dockserver, and as they are written there.

`arrivals` and `cache` are pure; `deliver`, `write_cache` and `write_mission` write. A caller that plays
a mission live takes the arrivals one by one and delivers each when its time has come.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from gliderwatch.simulate.dinkum import Generation, compress, encode
from gliderwatch.simulate.scenario import Mission
from gliderwatch.simulate.telemetry import SegmentData

_CHUNK = 1024


class Names(Enum):
    """How files are named: in full, or in the 8.3 way of the glider."""

    LONG = "long"
    SHORT = "short"


@dataclass(frozen=True, slots=True)
class FileForm:
    """What kind of files a glider makes of its segments."""

    names: Names = Names.LONG
    compressed: bool = False
    factored: bool = True
    generation: Generation = Generation.G3


@dataclass(frozen=True, slots=True)
class Arrival:
    """A file that is complete on shore at ``time`` (s)."""

    time: float
    name: str
    data: bytes


def arrivals(mission: Mission, form: FileForm = FileForm()) -> Iterator[Arrival]:
    """The files of a mission in order of arrival."""
    for segment in sorted(mission.segments, key=lambda segment: segment.sent):
        yield _arrival(segment, form)


def _arrival(segment: SegmentData, form: FileForm) -> Arrival:
    header, extension = segment.header, segment.header.extension
    data = encode(
        header,
        segment.sensors,
        segment.values,
        segment.updated,
        factored=form.factored,
        generation=form.generation,
    )
    stem = header.full_name if form.names is Names.LONG else header.short_name
    if form.compressed:
        data, extension = compress(data), f"{extension[0]}c{extension[2:]}"
    return Arrival(segment.sent, f"{stem}.{extension}", data)


def cache(mission: Mission) -> dict[str, bytes]:
    """Names and contents of the cache files that the files of a mission refer to."""
    return {f"{segment.sensors.crc}.cac": segment.sensors.text() for segment in mission.segments}


def write_cache(folder: Path, mission: Mission) -> None:
    """Write the cache files of a mission into ``folder``."""
    for name, text in cache(mission).items():
        deliver(folder / name, text)


def deliver(path: Path, data: bytes, pause: Callable[[], None] = lambda: None) -> None:
    """Write a file as a dockserver does.

    A file of an 8.3 name, all digits, grows in place while it is transferred: ``pause`` is called after
    each kilobyte. Any other is complete from the moment it has its name.
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
    partial.replace(path)


def from_glider(root: Path, mission: Mission) -> Path:
    """The folder below a dockserver's root into which a glider's files go."""
    return root / mission.scenario.glider / "from-glider"


def write_mission(
    root: Path, cache_folder: Path, mission: Mission, form: FileForm = FileForm()
) -> list[Path]:
    """Write all files of a mission and its cache, at once; the paths in order of arrival."""
    if form.factored:
        write_cache(cache_folder, mission)
    paths = []
    for arrival in arrivals(mission, form):
        paths.append(from_glider(root, mission) / arrival.name)
        deliver(paths[-1], arrival.data)
    return paths
