"""What the doctor looks at in the data and in the service."""

from __future__ import annotations

import heapq
import os
import textwrap
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import islice
from pathlib import Path
from typing import Any

from gliderwatch.config import Config, Problem, expand
from gliderwatch.delivery.channels import DeliveryError
from gliderwatch.delivery.mqtt import reach
from gliderwatch.errors import ConfigError, DamagedError, GliderwatchError, MissingCache, StateError
from gliderwatch.messages import notice_text
from gliderwatch.messages.formatting import clean, duration
from gliderwatch.messages.samples import sample
from gliderwatch.model import Alert, Kind, Severity
from gliderwatch.service.liveness import STALE, is_held, seconds_silent
from gliderwatch.service.relays import relay_settings
from gliderwatch.slocum.caches import Staging, lists_folder
from gliderwatch.slocum.cycles import parse_sensor_list
from gliderwatch.slocum.folders import Found, find_places, scan
from gliderwatch.slocum.header import Header, parse_header, plain, read_header, read_regular
from gliderwatch.store.database import SCHEMA
from gliderwatch.store.relays import exchange
from gliderwatch.store.watch_health import Failing, failing, quick_check, schema_version

# ----------------------------------------
# What the doctor found, and how it reads.

WIDTH = 80
_INDENT = 9


class Level(IntEnum):
    """How bad it is: as it should be, worth knowing, to be looked at, to be cured."""

    OK = 0
    NOTE = 1
    WARNING = 2
    ERROR = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at: ``text`` says how it is, ``cure`` what to do about it."""

    level: Level
    topic: str
    text: str
    cure: str = ""


Findings = Iterator[Finding]


def ok(topic: str, text: str) -> Finding:
    """As it should be."""
    return Finding(Level.OK, topic, text)


def note(topic: str, text: str, cure: str = "") -> Finding:
    """Worth knowing; nothing need be done."""
    return Finding(Level.NOTE, topic, text, cure)


def warning(topic: str, text: str, cure: str) -> Finding:
    """The service works, but not as well as it could."""
    return Finding(Level.WARNING, topic, text, cure)


def error(topic: str, text: str, cure: str) -> Finding:
    """The service, or the watch of some glider, does not work."""
    return Finding(Level.ERROR, topic, text, cure)


def exit_code(findings: Iterable[Finding]) -> int:
    """0: nothing to do, 1: warnings, 2: errors.

    >>> exit_code([note("a", "b")]), exit_code([ok("a", "b"), error("a", "b", "c")])
    (0, 2)
    """
    return max(0, max((f.level for f in findings), default=Level.OK) - Level.NOTE)


def as_lines(f: Finding) -> list[str]:
    """A finding in lines of at most 80 columns; names from files and folders are made printable."""
    label = f.level.name if f.level > Level.NOTE else f.level.name.lower()
    lines = _wrapped(f"{label:<{_INDENT - 1}} ", f"{f.topic}: {f.text}")
    return lines + (_wrapped(" " * _INDENT, f"-> {f.cure}") if f.cure else [])


def summary(findings: Iterable[Finding]) -> str:
    """How many errors and warnings there are."""
    levels = [f.level for f in findings]
    return f"{levels.count(Level.ERROR)} errors, {levels.count(Level.WARNING)} warnings"


def report(findings: Iterable[Finding]) -> dict[str, Any]:
    """All findings for machines."""
    found = list(findings)
    return {
        "result": ("ok", "warnings", "errors")[exit_code(found)],
        "findings": [
            {"level": f.level.name.lower(), "topic": f.topic, "text": f.text, "cure": f.cure or None}
            for f in found
        ],
    }


def _wrapped(start: str, text: str) -> list[str]:
    return textwrap.wrap(
        clean(text, 2000),
        WIDTH,
        initial_indent=start,
        subsequent_indent=" " * _INDENT,
        break_on_hyphens=False,
    )


# ----------------------------------------
# The data: which files are there, which cache files they lack, which sensors the gliders leave out.

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


# ----------------------------------------
# The service: its configuration, state file, channels, and whether it runs.

_START = "systemctl start gliderwatch; journalctl -u gliderwatch tells why it ended"
_STUCK = "systemctl restart gliderwatch; please report it, with its log"


def of_check(topic: str, problems: Iterable[Problem], *keys: str) -> list[Finding]:
    """What `gliderwatch check` found of keys that begin so."""
    return [
        Finding(
            Level.ERROR if p.severity == "error" else Level.WARNING,
            topic,
            f"line {p.where.rpartition(':')[2]}: {p.text}",
            p.cure,
        )
        for p in problems
        if p.text.startswith(keys)
    ]


def state(config: Config, problems: Iterable[Problem]) -> Findings:
    """Whether the state file opens, is whole, and of a schema that is known."""
    found = of_check("state", problems, "state.")
    yield from found
    path = Path(config.state.path)
    if any(f.level == Level.ERROR for f in found):
        return
    if not path.exists():
        yield note("state", f"{path} is not there yet: the service makes it at its first start")
        return
    try:
        version, pages = schema_version(path), quick_check(path)
    except DamagedError as problem:
        pages, version = str(problem), SCHEMA
    except StateError as problem:
        yield error("state", str(problem), "ask as the user of the service; else see docs/state-file.md")
        return
    if pages != "ok":
        cure = "stop the service, move the file away, start: all is made again from the files"
        yield error("state", f"{path} is damaged: {pages}", cure)
    elif version < SCHEMA:
        yield note("state", f"{path} is whole; schema {version} becomes {SCHEMA} at the next start")
    else:
        yield ok("state", f"{path} is whole, schema {version}")


def channels(config: Config, problems: Iterable[Problem], send: bool) -> Findings:
    """Whether channels can be reached and do deliver; with `send`, a test message goes through each."""
    problems = list(problems)
    yield from of_check("channels", problems, "channels", "recipients")
    urls = {name: f"channels.{name}.url: " for name in config.channels}
    bad = {name for name, key in urls.items() if any(p.text.startswith(key) for p in problems)}
    waiting = _failing(Path(config.state.path))
    for name in config.channels:
        trouble = waiting.get(name)
        if name in bad:
            continue
        how, refused = ("took a test message", try_channel(config, name)) if send else _reached(config, name)
        if refused is not None:
            cure = "compare its URL; can this machine reach the server?"
            yield error("channels", f"{name} cannot be used: {refused}", cure)
        elif trouble is not None:
            late = duration(max(0.0, time.time() - trouble.since))
            text = (
                f"{name}: {trouble.messages} messages not delivered, the oldest for {late}: {trouble.error}"
            )
            yield warning("channels", text, f"gliderwatch test-alert --channel {name}")
        else:
            yield ok("channels", f"{name} {how}")


def _failing(path: Path) -> dict[str, Failing]:
    """Channels that fail, as the state file tells; none where it cannot: `state` says why."""
    try:
        return failing(path, time.time()) if path.exists() else {}
    except StateError:
        return {}


def sign(config: Config, problems: Iterable[Problem]) -> Findings:
    """Whether a sign of life can be given to a dead man's switch."""
    settings, found = config.heartbeat, of_check("heartbeat", problems, "heartbeat.")
    if settings.file is not None:
        file = Path(settings.file)
        if not os.access(file if file.exists() else file.parent, os.W_OK):
            found.append(error("heartbeat", f"{file} cannot be written by this user", "name another file"))
    if not found and (settings.url is not None or settings.file is not None):
        found = [ok("heartbeat", f"every {settings.minutes:g} min while all is well")]
    yield from found


def relays(config: Config, problems: Iterable[Problem]) -> Findings:
    """Whether the broker of the relays lets this one in, and how the exchange stands."""
    found = of_check("relays", problems, "relays.", "fields.")
    yield from found
    if config.relays.broker is None or any(f.level == Level.ERROR for f in found):
        return
    settings = relay_settings(config)
    assert settings is not None
    place, path = settings.broker.place, Path(config.state.path)
    try:
        refused = reach(settings.broker)
    except GliderwatchError as problem:
        refused = str(problem)
    if refused is not None:
        cure = "does the broker run there, and do user, password and certificate suit it?"
        yield error("relays", f"{place} lets nobody in: {refused}", cure)
    else:
        yield ok("relays", f"{place} answers; this relay is {settings.name}")
    others = exchange(path).others if path.exists() else {}
    for name, (_, other) in others.items():
        for apart in other.apart:
            text = f"field {apart} has other settings at {name}, or is not here: it is not exchanged"
            yield warning("relays", text, "give box, depth, sensor and estimator alike at all relays")


def sample_for(kind: str) -> Alert:
    """A whole message of a kind, as it would come now."""
    return sample(Kind(kind), time.time())


def try_channel(config: Config, name: str, alert: Alert | None = None) -> str | None:
    """Send a test message, or an `alert`; why it was not delivered, None when it was."""
    try:
        config.channel(name).send(alert or _test(name, time.time()))
    except (DeliveryError, ConfigError) as problem:
        return str(problem)
    return None


def _test(name: str, now: float) -> Alert:
    return notice_text.operator(
        "test of a channel",
        f"If you can read this, the channel {name} of gliderwatch works.",
        now,
        alert_id=f"test/{name}/{now:.3f}",
        severity=Severity.INFO,
        audience=Severity.INFO,
    )


def _reached(config: Config, name: str) -> tuple[str, str | None]:
    """What is known of a channel to which nothing is sent, and why it cannot be used (None: it can)."""
    try:
        answers = config.channel(name).reach()
    except (DeliveryError, ConfigError) as problem:
        return "", str(problem)
    return "has a server that answers" if answers else "has a good URL (tried only with --send)", None


def daemon(config: Config) -> Findings:
    """Whether the service runs and gives signs of life."""
    path = Path(config.state.path)
    last, runs = seconds_silent(path), is_held(path)
    if not runs:
        since = "" if last is None else f" (last sign of life {duration(last)} ago)"
        yield warning("service", f"does not run{since}", _START)
    elif last is None or last >= STALE:
        yield error("service", f"runs, but gives no sign of life for {duration(last or 0.0)}", _STUCK)
    else:
        yield ok("service", f"runs, last sign of life {last:.0f} s ago")
