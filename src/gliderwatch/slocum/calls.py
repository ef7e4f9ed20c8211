"""The log of one call, read as it grows: what it has told so far, and how far it was read.

A log is never read whole into memory and never twice: what is kept is a `Dialog`, a value of bounded size.
"""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from gliderwatch.errors import Quarantine
from gliderwatch.model import Aborts, Call, CallReading, Fix, Happened, Happening
from gliderwatch.slocum import folders
from gliderwatch.slocum import log_events as events
from gliderwatch.slocum.header import open_regular
from gliderwatch.slocum.log_events import Event
from gliderwatch.slocum.logs import LONGEST_LINE, parse_line
from gliderwatch.slocum.sensors import QUANTITIES, Quantity

LARGEST = 16_000_000
"""Bytes of a log that are read: the longest call of a glider makes some hundred kilobytes."""
_PIECE = 1 << 16
_HEAD = 512
_MOST = 50
"""Files, happenings and names kept of one log."""
_APART = 2 * 86400.0
"""Seconds by which the glider's clock may be off the server's; a time further off is garbled."""
_OLD = 1800.0
"""Seconds: a fix that was older when it was printed first may be that of before the dive (rule `fix`)."""
_ENDS = re.compile(rb"\r\n|\n|\r")
_PROMPT = re.compile(rb"GliderDos [AIN] -?\d{1,3} ?>\s*\Z")


@dataclass(frozen=True, slots=True)
class Dialog:
    """What the log of a call has told up to a byte (``offset``) of the file ``inode``, which begins as
    ``head`` (a checksum) says.

    ``call`` is that; ``names`` are the vehicle names read, with how often; ``t`` is the glider's time (s);
    ``aborts`` an abort history that is still being printed; ``by_pilot`` whether a pilot stopped the mission.
    """

    call: Call
    inode: int = 0
    head: int = 0
    offset: int = 0
    names: tuple[tuple[str, int], ...] = ()
    t: float = 0.0
    aborts: Aborts | None = None
    by_pilot: bool = False


def begun(name: str) -> Dialog:
    """The dialog of a log of which nothing is read."""
    t = folders.stamp(name) or 0.0
    return Dialog(Call("", name, t, t), t=t)


def read_log(path: Path, before: Dialog | None = None) -> Dialog:
    """What a log tells by now; only what came since `before` is read, if it is still the same file.

    Raises `Quarantine` for what is no regular file or too large, `Retry` if it cannot be read now.
    """
    with open_regular(path) as file:
        status = os.fstat(file.fileno())
        dialog = before
        if dialog is None or dialog.inode != status.st_ino or _head(file, dialog.offset) != dialog.head:
            dialog = replace(begun(path.name), inode=status.st_ino)
        if status.st_size > LARGEST:
            raise Quarantine(f"larger than {LARGEST / 1e6:.0f} MB: no log of one call")
        file.seek(dialog.offset)
        dialog = _read(file, dialog)
        return replace(dialog, head=_head(file, dialog.offset))


def _head(file: BinaryIO, offset: int) -> int:
    """A checksum of how a file begins, up to an offset; a new file may have the inode of one that is gone."""
    file.seek(0)
    return zlib.crc32(file.read(min(offset, _HEAD)))


def _read(file: BinaryIO, dialog: Dialog) -> Dialog:
    """The dialog after what follows in a file up to its last whole line, or a prompt that waits behind it."""
    offset, rest = dialog.offset, b""
    while piece := file.read(_PIECE):
        offset += len(piece)
        lines, rest = split(rest + piece)
        for line in lines:
            dialog = with_line(dialog, line)
    if _PROMPT.search(rest):
        return replace(with_line(dialog, rest), offset=offset)
    return replace(dialog, offset=offset - len(rest))


def split(data: bytes) -> tuple[list[bytes], bytes]:
    """The whole lines of some bytes, whatever ends them, and the beginning of the next, never a long one."""
    *lines, rest = _ENDS.split(data)
    if len(rest) > _PIECE:
        lines, rest = [*lines, rest[:LONGEST_LINE]], b""
    return lines, rest


def with_line(dialog: Dialog, line: bytes) -> Dialog:
    """The dialog after one more line."""
    for event in parse_line(line):
        dialog = after(dialog, event)
    return dialog


def after(dialog: Dialog, event: Event) -> Dialog:
    """The dialog after one more event."""
    dialog = _happening(_aborts(dialog, event), event)
    match event:
        case events.Clock():
            timed = _timed(dialog, event.t)
            return (
                timed if timed is dialog else replace(timed, call=with_readings(timed.call, event, event.t))
            )
        case events.Vehicle():
            return _named(dialog, event.name)
        case events.PilotThere():
            return replace(dialog, by_pilot=dialog.by_pilot or event.ends)
    return replace(dialog, call=_with_event(dialog.call, event, dialog.t))


def _with_event(call: Call, event: Event, t: float) -> Call:
    """The call after an event at a time (s)."""
    match event:
        case events.Position():
            fix = Fix(t - event.age, event.lat, event.lon)
            first = fix if call.surfaced is None and event.age <= _OLD else call.surfaced
            call = replace(call, fix=fix, surfaced=first)
        case events.Carrier():
            call = replace(call, over=not event.found)
        case events.HangUp():
            call = replace(call, calls_back=call.calls_back or event.minutes is not None)
        case events.Mission():
            short = event.short.replace(".", "")
            call = replace(call, mission=event.name, mission_t=t, segment=event.segment, short=short)
        case events.Because():
            call = replace(call, reason=event.reason)
        case events.Waypoint():
            call = replace(call, waypoint=(event.lat, event.lon))
        case events.Transfer():
            call = _transferred(call, event)
    return with_readings(call, event, t) if t else call


def _timed(dialog: Dialog, t: float) -> Dialog:
    """The dialog at a time (s) of the glider; one that cannot be is garbled."""
    call, at = dialog.call, folders.stamp(dialog.call.log)
    if at is not None and abs(t - at) > _APART:
        return dialog
    first = dialog.t == call.began == call.last_t == (at or 0.0)
    began = t if first else min(call.began, t)
    return replace(
        dialog, t=t, call=replace(call, began=began, last_t=max(t, began if first else call.last_t))
    )


def _named(dialog: Dialog, name: str) -> Dialog:
    """The glider is the one that is named most often: a line of it may be garbled."""
    counts = dict(dialog.names)
    if name in counts or len(counts) < _MOST:
        counts[name] = counts.get(name, 0) + 1
    best = max(counts, key=lambda n: counts[n])
    return replace(dialog, names=tuple(counts.items()), call=replace(dialog.call, glider=best))


def _transferred(call: Call, event: events.Transfer) -> Call:
    announced, sent = call.announced, call.sent
    if event.file not in announced:
        announced = (*announced, event.file)[-_MOST:]
    if event.done and event.file not in sent:
        sent = (*sent, event.file)[-_MOST:]
    return replace(call, announced=announced, sent=sent)


def _aborts(dialog: Dialog, event: Event) -> Dialog:
    """Put the abort history together, whose lines follow each other; it counts once it is whole."""
    pending = dialog.aborts
    match event:
        case events.AbortCount() if event.count > 0:
            return replace(_printed(dialog), aborts=Aborts(event.count, dialog.t))
        case events.AbortCount():
            return _printed(replace(_printed(dialog), aborts=Aborts(0, dialog.t)))
        case events.AbortCause() if pending is not None:
            return replace(dialog, aborts=replace(pending, cause=event.cause))
        case events.AbortTime() if pending is not None:
            return _printed(replace(dialog, aborts=replace(pending, t=event.t)))
    return dialog if pending is None else _printed(dialog)


def _printed(dialog: Dialog) -> Dialog:
    new, call = dialog.aborts, dialog.call
    if new is None:
        return dialog
    last = call.aborts[-1] if call.aborts else None
    if last is None or (last.count, last.cause, last.t) != (new.count, new.cause, new.t):
        call = replace(call, aborts=(*call.aborts, new)[-_MOST:])
    return replace(dialog, aborts=None, call=call)


def _happening(dialog: Dialog, event: Event) -> Dialog:
    found: tuple[Happening, str] | None = None
    match event:
        case events.AbortNow():
            found = Happening.ABORTING, event.cause
        case events.FellOut():
            found = Happening.FELL_OUT, ""
        case events.LastMission():
            found = Happening.LAST_MISSION, event.name
        case events.Prompt():
            found = Happening.GLIDER_DOS, f"{event.end} {event.code}"
        case events.Emergency():
            found = Happening.EMERGENCY, ""
        case events.WeightDropped():
            found = Happening.WEIGHT_DROPPED, ""
        case events.Reading(sensor="m_weight_drop", value=value) if value >= 0.5:
            found = Happening.WEIGHT_DROPPED, ""
    call = dialog.call
    if found is None or any((h.what, h.cause) == found for h in call.happened):
        return dialog
    happened = (*call.happened, Happened(found[0], dialog.t, found[1], dialog.by_pilot))
    return replace(dialog, call=replace(call, happened=happened[:_MOST]))


EACH = 10
"""Last readings of one quantity that are kept of a call: as many as a message shows."""
MOST = 600
"""Readings that are kept of a call in all: a hostile log may name any number of devices."""
SAME = 1.5
"""Seconds within which two printed times of one reading differ: the clock in a log has whole seconds."""
_BY_SENSOR = {sensor: q for q in reversed(QUANTITIES) for sensor in q.sensors if not q.pair}
_HOUSEKEEPING = {"disk_megabytes": ("disk_free", 1e6), "heap_bytes": ("heap_free", 1.0)}


def with_readings(call: Call, event: Event, t: float) -> Call:
    """The call after what an event at a time (s) reads, if it reads anything."""
    for new in _readings(event, t):
        call = replace(call, readings=_kept(call.readings, new))
    return call


def _readings(event: Event, t: float) -> Iterator[CallReading]:
    match event:
        case events.Reading() if event.age is not None and (q := _BY_SENSOR.get(event.sensor)) is not None:
            value = _si(q, event.value)
            if value is not None:
                yield CallReading(q.name, t - event.age, value)
        case events.Counts():
            yield CallReading("errors:all", t, float(event.errors[0]))
            yield CallReading("warnings:all", t, float(event.warnings[2]))
            yield CallReading("oddities:all", t, float(event.oddities[0]))
        case events.Device():
            yield CallReading(f"errors:{event.name}", t, float(event.counts.errors[0]))
        case events.Clock() if event.mission_time is not None:
            yield CallReading("mission_time", event.t, event.mission_time)
        case events.Housekeeping() if event.name in _HOUSEKEEPING:
            name, scale = _HOUSEKEEPING[event.name]
            if event.value > 0:
                yield CallReading(name, t, event.value * scale)


def _si(quantity: Quantity, raw: float) -> float | None:
    """A value in SI; None where it is none, or cannot be."""
    value = float(quantity.to_si(np.array(raw)))
    return value if raw != quantity.absent and quantity.low <= value <= quantity.high else None


def _kept(readings: tuple[CallReading, ...], new: CallReading) -> tuple[CallReading, ...]:
    """The readings with a new one, of its quantity the last `EACH`; one that is printed again is one."""
    same = [r for r in readings if r.name == new.name]
    if any(abs(r.t - new.t) <= SAME for r in same):
        return readings
    if len(same) >= EACH:
        oldest = min(same, key=lambda r: r.t)
        if new.t < oldest.t:
            return readings
        readings = tuple(r for r in readings if r is not oldest)
    return (*readings, new) if len(readings) < MOST else readings
