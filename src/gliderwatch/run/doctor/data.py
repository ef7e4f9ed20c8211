"""The data: which files are there, which cache files they lack, which sensors the gliders leave out."""

from __future__ import annotations

import heapq
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from gliderwatch.config import Config, expand
from gliderwatch.errors import GliderwatchError, MissingCache
from gliderwatch.ingest.caches import Staging
from gliderwatch.ingest.cycles import parse_sensor_list
from gliderwatch.ingest.header import Header, parse_header, plain, read_header, read_regular
from gliderwatch.ingest.lists import lists_folder
from gliderwatch.ingest.scan import Found, find_places, scan
from gliderwatch.run.doctor.finding import Findings, error, note, ok, warning

MOST_SEEN = 200_000
"""Files that are looked at in folders, at the most."""
MOST_READ = 3000
"""Files whose header is read, at the most; the newest of each glider."""
_LIST_BYTES = 4 * 1024 * 1024
_SHOWN = 8

_ALL_LOST = "nothing can be assessed"
_NO_CURRENT = "no current of the glider's own: slower and less sure, no flag 2"
_PROVISIONAL = "the current of a dive stays provisional until the next file"
_NO_WAY = "the way of a dive is put together from heading alone"
NEEDED = {
    ("m_present_time",): _ALL_LOST,
    ("m_gps_lat",): _ALL_LOST,
    ("m_gps_lon",): _ALL_LOST,
    ("m_heading", "c_heading"): _ALL_LOST,
}
"""Without them there is no assessment; one of each is enough."""
WANTED = {
    ("m_heading",): "the commanded heading stands in; a compass fault goes unseen",
    ("m_water_vx", "m_initial_water_vx"): _NO_CURRENT,
    ("m_water_vy", "m_initial_water_vy"): _NO_CURRENT,
    ("m_depth", "m_pressure"): "drift is told from flight by pitch alone; no rate of dive and climb",
    ("m_pitch",): "no asymmetry of dive and climb; drift is told by depth alone",
    ("m_roll",): "no sign of a lost wing or of what hangs on one side",
}
"""Without them faults are found later, or taken for another; one of each is enough."""
USEFUL = {
    ("m_final_water_vx",): _PROVISIONAL,
    ("m_final_water_vy",): _PROVISIONAL,
    ("m_gps_mag_var",): "declination from the World Magnetic Model",
    ("m_lat",): _NO_WAY,
    ("m_lon",): _NO_WAY,
    ("m_avg_speed", "m_speed"): "no speed of the glider's own to compare with",
    ("m_ballast_pumped", "m_de_oil_vol"): "new ballast can be taken for a fault",
}
"""Without them a stand-in is used, or evidence is missing; one of each is enough."""


@dataclass(slots=True)
class Inventory:
    """What is there: files by glider folder, headers that could be read, and what could not be.

    ``strangers`` counts files by their folder and the glider that their header names, where that is not
    configured."""

    found: int = 0
    is_cut: bool = False
    newest: dict[Path, float] = field(default_factory=dict)
    headers: dict[Path, Header] = field(default_factory=dict)
    unreadable: list[str] = field(default_factory=list)
    strangers: Counter[tuple[str, str]] = field(default_factory=Counter)


def take_stock(config: Config, made: Inventory) -> None:
    """Find the files below the roots, and read the headers of the newest of each glider; bounded."""
    explicit = {name: glider.paths for name, glider in config.gliders.items()}
    closed: list[str] = []
    everything = list(islice(scan(find_places(config.dockserver.roots, explicit), closed), MOST_SEEN))
    by_folder: defaultdict[str, list[Found]] = defaultdict(list)
    for file in everything:
        by_folder[file.glider_folder].append(file)
    made.found, made.is_cut = len(everything), len(everything) == MOST_SEEN
    share = max(1, MOST_READ // max(1, len(by_folder)))
    for files in by_folder.values():
        newest = heapq.nlargest(share, files, key=lambda f: f.mtime_ns)
        made.is_cut |= len(newest) < len(files)
        made.newest[newest[0].path] = newest[0].mtime_ns / 1e9
        for file in newest:
            try:
                header = made.headers[file.path] = read_header(file.path)
            except GliderwatchError as problem:
                made.unreadable.append(f"{file.path}: {problem}")
            else:
                if header.id.glider not in config.gliders:
                    made.strangers[file.glider_folder, header.id.glider] += 1
    made.unreadable += closed


def names(config: Config, files: Inventory) -> Findings:
    """Files in the folder of a glider that is configured, of which the headers say another name."""
    for (folder, glider), n in sorted(files.strangers.items()):
        if folder in config.gliders:
            text = f"{n} files in the folder of {folder} are of {glider}, as they say themselves: not taken"
            yield error("files", text, f"name the glider {glider} in `gliders`, with the folder as `paths`")


def caches(config: Config, files: Inventory) -> Findings:
    """Cache files that are missing for the files that are there, or cannot be used."""
    folders, staging = _list_folders(config), Staging()
    own = {header.crc for header in files.headers.values() if not header.factored}
    lacking: Counter[str] = Counter()
    examples: dict[str, Path] = {}
    for path, header in files.headers.items():
        if header.factored and header.id.glider in config.gliders and header.crc not in own:
            lacking[header.crc] += 1
            examples.setdefault(header.crc, path)
    found: list[tuple[str, str]] = []
    for crc, n in lacking.items():
        try:
            staging.get(files.headers[examples[crc]], folders)
        except MissingCache:
            where = folders[0] if config.dockserver.cache else "a folder of dockserver.cache"
            text = f"{crc}.cac is missing for {n} files, such as {examples[crc]}"
            found.append((text, f"copy it from the dockserver or the glider to {where}"))
        except GliderwatchError as problem:
            wrong, _, cure = str(problem).rpartition("; ")
            found.append((f"{n} files wait, such as {examples[crc]}: {wrong}", cure))
    for text, cure in found[:_SHOWN]:
        yield error("caches", text, cure)
    if len(found) > _SHOWN:
        yield error("caches", f"and {len(found) - _SHOWN} more", "copy them in the same way")
    if not found:
        read = f"the newest {len(files.headers)}" if files.is_cut else str(len(files.headers))
        yield ok("caches", f"none is missing (headers of {read} files read)")
    for text in files.unreadable[:_SHOWN]:
        yield note("files", text)
    if len(files.unreadable) > _SHOWN:
        yield note("files", f"and {len(files.unreadable) - _SHOWN} more that are of no use")


def _list_folders(config: Config) -> tuple[Path, ...]:
    """Where the service looks for sensor lists."""
    return (*expand(config.dockserver.cache), lists_folder(Path(config.state.path)))


def sensors(config: Config, files: Inventory) -> Findings:
    """Sensors that the newest real-time file of each glider leaves out, and what is lost by it."""
    folders, staging = _list_folders(config), Staging()
    for name in sorted(config.gliders):
        own = {p: h for p, h in files.headers.items() if h.id.glider == name}
        if not own:
            yield note("sensors", f"{name}: no file yet")
            continue
        path = max(own, key=lambda p: (own[p].kind == "sbd", own[p].id))
        try:
            held = _held(path, own[path], folders, staging)
        except (GliderwatchError, OSError, ValueError) as problem:
            yield note("sensors", f"{name}: {path.name} cannot tell them ({problem})")
            continue
        yield from _judged(f"{name} ({own[path].id.name})", held)


def _held(path: Path, header: Header, folders: tuple[Path, ...], staging: Staging) -> set[str]:
    """The sensors that a file holds. Raises GliderwatchError, OSError or ValueError."""
    if header.factored:
        return set(staging.get(header, folders).sensors.names)
    data, _ = read_regular(path, _LIST_BYTES, whole=False)
    content = plain(data, _LIST_BYTES)
    header = parse_header(content)
    return set(parse_sensor_list(content, header.length, header.n_sensors)[0].names)


def _judged(who: str, held: set[str]) -> Findings:
    cure = "add them to sbdlist.dat of the glider"
    lost = {table: list(_lacking(rows, held)) for table, rows in _TABLES.items()}
    if lost["needed"]:
        names = ", ".join(sensor for sensor, _ in lost["needed"])
        yield error("sensors", f"{who} lacks {names}: {_ALL_LOST}", cure)
    if lost["wanted"]:
        yield warning("sensors", f"{who} lacks {_losses(lost['wanted'])}", cure)
    if lost["useful"]:
        yield note("sensors", f"{who} lacks {_losses(lost['useful'])}", cure)
    if not any(lost.values()):
        yield ok("sensors", f"{who} has all that is wanted")


_TABLES = {"needed": NEEDED, "wanted": WANTED, "useful": USEFUL}


def _lacking(rows: dict[tuple[str, ...], str], held: set[str]) -> Iterator[tuple[str, str]]:
    for names, loss in rows.items():
        if held.isdisjoint(names):
            yield " or ".join(names), loss


def _losses(lost: list[tuple[str, str]]) -> str:
    by_loss: defaultdict[str, list[str]] = defaultdict(list)
    for sensor, loss in lost:
        by_loss[loss].append(sensor)
    return "; ".join(f"{', '.join(sensors)} ({loss})" for loss, sensors in by_loss.items())
