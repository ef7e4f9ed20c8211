"""Readings that a glider prints in a call become quantities: SI units, plausible values. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gliderwatch.model import Call, CallReading
from gliderwatch.slocum import log_events as events
from gliderwatch.slocum.log_events import Event
from gliderwatch.slocum.sensors import QUANTITIES, Quantity

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
