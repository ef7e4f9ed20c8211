"""The panels of a glider's health: what its files and calls show beside the flight, over time. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import degrees, isfinite

import numpy as np

from gliderwatch.figures.plots import Line, Panel
from gliderwatch.health.battery import End
from gliderwatch.health.constants import ATMOSPHERE, COOL, DAY, FULL, HOUR, INHG
from gliderwatch.health.readings import Readings
from gliderwatch.model import Call, Series

MOST_DEVICES = 4
"""Devices whose errors are shown: those with most, as many as lines can be told apart."""
_LEAK = (
    ("forward", "leak_voltage_forward"),
    ("aft", "leak_voltage"),
    ("science", "leak_voltage_science"),
)
_CHARGES: dict[str, tuple[str, float]] = {
    "battery_charge": ("charge (%)", 100.0),
    "charge_used": ("used (Ah)", 1 / FULL),
    "battery_voltage": ("battery (V)", 1.0),
}
"""How a battery is shown by each quantity: label of the axis, and by what the value is multiplied."""


def panels(readings: Readings, battery: End | None = None, calls: Sequence[Call] = ()) -> list[Panel]:
    """All panels for which a glider has readings; ``battery`` is when it ends, as foreseen."""
    made = [*_charge(readings, battery), *(found for one in _PANELS for found in one(readings))]
    made += _calls(calls)
    return [panel for panel in made if any(np.isfinite(line.v).any() for line in panel.lines)]


def _charge(readings: Readings, battery: End | None) -> Iterator[Panel]:
    """The battery by the quantity that its end is reckoned from, with the end; else by the first there is."""
    names = [battery.quantity] if battery is not None else []
    name = next((n for n in (*names, *_CHARGES) if n in readings), None)
    if name is None:
        return
    unit, by = _CHARGES[name]
    series, is_used = readings[name], name == "charge_used"
    lines, band = [Line("measured", series.t, by * series.v, joined=False)], None
    shows = "What is left in the battery."
    if is_used:
        shows = "What has been drawn from the battery."
    if battery is not None and len(series) > 1:
        t = np.array([battery.t, battery.t + battery.left])
        last, end = _ends(series, battery)
        lines.append(Line("at this use", t, by * np.array([last, end])))
        late = battery.latest if isfinite(battery.latest) else 3 * battery.left
        shows += (
            f" At the use of the last days it is empty in {battery.left / DAY:.0f} days (dashed; 95 % from "
            f"{battery.earliest / DAY:.0f} to {_days(late, battery)})."
        )
    yield Panel("Battery", unit, shows, tuple(lines), band, zero=not is_used and name != "battery_voltage")


def _ends(series: Series, battery: End) -> tuple[float, float]:
    """The last value, and that at the end, on the line of the last days of use."""
    recent = series.between(battery.t - 10 * DAY, battery.t + 1.0)
    last = float(series.v[-1])
    if len(recent) < 2 or recent.t[-1] <= recent.t[0]:
        return last, last
    rate = (recent.v[-1] - recent.v[0]) / (recent.t[-1] - recent.t[0])
    return last, float(last + rate * battery.left)


def _days(seconds: float, battery: End) -> str:
    return f"{seconds / DAY:.0f}" if isfinite(battery.latest) else "never"


def _volts(readings: Readings) -> Iterator[Panel]:
    if "battery_charge" in readings or "charge_used" in readings:
        yield _one(
            readings,
            "Battery voltage",
            "battery (V)",
            "The voltage of the battery: it falls under load and, near the end, for good.",
            (("volts", "battery_voltage", 1.0),),
        )


def _leaks(readings: Readings) -> Iterator[Panel]:
    yield _one(
        readings,
        "Leak detectors",
        "leak (V)",
        "The leak detectors: 2.5 V when dry; a fall is water, and one wet reading alone is none.",
        tuple((label, name, 1.0) for label, name in _LEAK),
    )
    yield _one(
        readings,
        "Leak detector of the digifin",
        "leak (counts)",
        "The leak detector in the fin: 1023 when dry.",
        (("digifin", "digifin_leak", 1.0),),
    )


def _vacuum(readings: Readings) -> Iterator[Panel]:
    lines = []
    if (raw := readings.get("vacuum")) is not None:
        lines.append(Line("as measured", raw.t, raw.v / INHG, joined=False))
    if (gas := readings.get("gas_density")) is not None:
        lines.append(Line("in flight, at 15 °C", gas.t, (ATMOSPHERE - COOL * gas.v) / INHG))
    shows = (
        "The vacuum in the hull. It goes with temperature and bladder; at one temperature (line) only a leak "
        "of air or water makes it fall."
    )
    yield Panel("Vacuum", "vacuum (inHg)", shows, tuple(lines))


def _devices(readings: Readings) -> Iterator[Panel]:
    """Errors by device, those with most first, and the warnings of all."""
    errors = sorted(
        (name for name in readings if name.startswith("errors:") and readings[name].v.max() > 0),
        key=lambda name: (-float(readings[name].v.max()), name),
    )
    names = [*errors, *(n for n in ("warnings:all", "oddities:all") if n in readings)]
    lines = tuple(
        Line(_device(name), readings[name].t, readings[name].v, joined=False) for name in names[:MOST_DEVICES]
    )
    shows = (
        "How often devices had errors, warnings and oddities since they were last reset, as the glider "
        "counts them at its calls: a count that grows is news, one that stays is history."
    )
    yield Panel("Devices", "count (1)", shows, lines, zero=True)


def _device(name: str) -> str:
    what, _, device = name.partition(":")
    return what if device == "all" else f"{what} of {device.replace('_', ' ')}"


def _motors(readings: Readings) -> Iterator[Panel]:
    yield _one(
        readings,
        "Battery position",
        "off (mm)",
        "How far the battery pack is from where it is commanded, in flight: it sets the pitch.",
        (("off", "battery_position_error", 1e3),),
    )
    yield _one(
        readings,
        "Fin",
        "off (degrees)",
        "How far the fin is from where it is commanded, in flight.",
        (("off", "fin_error", degrees(1)),),
    )


def _fixes(readings: Readings) -> Iterator[Panel]:
    yield _one(
        readings,
        "Age of the fix",
        "age (min)",
        "How old the fix was at each call: an old one is an aerial under water, or no satellites.",
        (("age", "fix_age", 1 / 60),),
        zero=True,
    )


def _calls(calls: Sequence[Call]) -> Iterator[Panel]:
    """Hours from call to call; connections a few minutes apart are one surfacing."""
    began = np.array([call.began for call in calls])
    if len(began) < 2:
        return
    gaps = np.diff(began) / HOUR
    shows = (
        "Hours from one call to the next: short ones are connections that were cut, a long one a missed call."
    )
    yield Panel(
        "Calls", "interval (h)", shows, (Line("call to call", began[1:], gaps, joined=False),), zero=True
    )


_PANELS: tuple[Callable[[Readings], Iterator[Panel]], ...] = (
    _volts,
    _leaks,
    _vacuum,
    _devices,
    _motors,
    _fixes,
)


def _one(
    readings: Readings,
    name: str,
    unit: str,
    shows: str,
    lines: Sequence[tuple[str, str, float]],
    *,
    zero: bool = False,
) -> Panel:
    found = tuple(
        Line(label, readings[key].t, by * readings[key].v, joined=False)
        for label, key, by in lines
        if key in readings
    )
    return Panel(name, unit, shows, found, zero=zero)
