"""What ails a simulated glider beside its flight: water in the hull, an empty battery, devices. Pure.

Ailments change the readings of files that a glider has made, so they move neither its way nor its chance.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from gliderwatch.errors import ConfigError
from gliderwatch.model import Array
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.telemetry import TIME, SegmentData

DAY = 86400.0
_INHG_AIR = 29.92
"""Pressure outside the hull when it was closed (inHg)."""
_KELVIN, _CLOSED_AT = 273.15, 288.0
_HULL_LAG = 1800.0
"""Seconds in which the inside of the hull follows the water."""
_BLADDER = 0.9
"""What the air bladder adds to the vacuum at the surface (inHg): measured 0.6 to 1.2."""
_USABLE = 90.0
"""Part of a battery's charge (%) that is used when it ends."""


class AilmentKind(StrEnum):
    """What ails a glider; `KINDS` says what the size of each is."""

    LEAK = "leak"
    SLOW_LEAK = "slow_leak"
    BATTERY = "battery"
    LOW_ALTITUDE = "low_altitude"
    DEVICE_ERROR = "device_error"
    GLIDER_DOS = "glider_dos"
    LASTGASP = "lastgasp"
    RESET = "reset"


class _Kind(NamedTuple):
    least: float
    most: float
    meaning: str


KINDS = {
    AilmentKind.LEAK: _Kind(0.0, 2.48, "what the aft leak detector shows (V)"),
    AilmentKind.SLOW_LEAK: _Kind(0.0, 10.0, "how fast the vacuum falls (inHg a week)"),
    AilmentKind.BATTERY: _Kind(0.1, 365.0, "the days that are left of its charge: cells have failed"),
    AilmentKind.LOW_ALTITUDE: _Kind(0.1, 100.0, "how near to the bottom it turns (m)"),
    AilmentKind.DEVICE_ERROR: _Kind(1.0, 100.0, "how many errors of its digifin"),
    AilmentKind.GLIDER_DOS: _Kind(0.0, np.inf, "of no meaning: it waits at its prompt"),
    AilmentKind.LASTGASP: _Kind(0.0, np.inf, "of no meaning: it runs lastgasp.mi"),
    AilmentKind.RESET: _Kind(0.0, np.inf, "of no meaning: its counters begin again"),
}


@dataclass(frozen=True, slots=True)
class Ailment:
    """What begins at ``onset`` (s), of a ``size`` as `KINDS` says.

    Raises:
        ValueError: a size that cannot be.
    """

    kind: AilmentKind
    onset: float
    size: float = 1.0

    def __post_init__(self) -> None:
        bounds = KINDS[self.kind]
        if not bounds.least <= self.size <= bounds.most:
            raise ValueError(
                f"{self.kind} of size {self.size:g}: it is {bounds.meaning}, {bounds.least:g} "
                f"to {bounds.most:g}"
            )


def ailment(text: str, start: float) -> Ailment:
    """An ailment given in short, `NAME:SIZE@DAY` or `NAME@DAY`, of a mission that begins at ``start`` (s).

    Raises `ConfigError` where it is none.
    """
    match = re.fullmatch(r"([a-z_]{1,40})(?::(\d+(?:\.\d+)?))?@(\d+(?:\.\d+)?)", text)
    if match is None or match[1] not in list(AilmentKind):
        kinds = ", ".join(AilmentKind)
        raise ConfigError(f"ailment {text}: not NAME:SIZE@DAY, as in slow_leak:0.5@3; names are {kinds}")
    try:
        return Ailment(AilmentKind(match[1]), start + float(match[3]) * DAY, float(match[2] or 1.0))
    except ValueError as error:
        raise ConfigError(f"ailment {text}: {error}") from None


def of_kind(ailments: Iterable[Ailment], kind: AilmentKind, t: float) -> Ailment | None:
    """The ailment of a kind that has begun by a time (s)."""
    return next((a for a in ailments if a.kind is kind and a.onset <= t), None)


def ailing(mission: Mission, ailments: tuple[Ailment, ...] = ()) -> Mission:
    """The mission with a hull that breathes as real ones do, and with its ailments in its files."""
    rng = mission.scenario.rng(8)
    drop = {a: _drop(mission, a) for a in ailments if a.kind is AilmentKind.BATTERY}
    segments = tuple(_changed(s, mission.scenario, ailments, drop, rng) for s in mission.segments)
    return replace(mission, segments=segments)


def _changed(
    segment: SegmentData,
    scenario: Scenario,
    ailments: tuple[Ailment, ...],
    drop: dict[Ailment, float],
    rng: np.random.Generator,
) -> SegmentData:
    names = [sensor.name for sensor in segment.sensors.columns]
    values = segment.values.copy()
    t = values[:, names.index(TIME)]
    noise = rng.standard_normal((3, len(t)))

    def change(name: str, new: Callable[[Array], Array]) -> None:
        if name in names:
            k = names.index(name)
            there = ~np.isnan(values[:, k])
            values[there, k] = new(values[:, k])[there]

    depth = _filled(values[:, names.index("m_depth")]) if "m_depth" in names else np.zeros_like(t)
    inside = _temperature(t, depth, scenario.start)
    change("m_veh_temp", lambda v: inside + 0.1 * noise[0])
    leak = _since(ailments, AilmentKind.SLOW_LEAK, t) / (7 * DAY)
    at_depth = 7.5 + 0.04 * float(noise[2, 0]) - leak  # volume of the pump: another at each dive
    change("m_vacuum", lambda v: _vacuum(at_depth, inside, depth) + 0.03 * noise[1])
    change("m_digifin_leakdetect_reading", lambda v: np.where(noise[2] > 3.3, 886.0, 1022.0))
    for a in ailments:
        begun = t >= a.onset
        if a.kind is AilmentKind.LEAK:
            change("m_leakdetect_voltage", lambda v, a=a, b=begun: np.where(b, a.size, v))  # type: ignore[misc]
        elif a.kind is AilmentKind.LOW_ALTITUDE:
            change("m_altitude", lambda v, a=a, b=begun: np.where(b, _lowered(v, a.size), v))  # type: ignore[misc]
        elif a.kind is AilmentKind.BATTERY:
            change(
                "m_lithium_battery_relative_charge",
                lambda v, d=drop[a], b=begun: np.where(b, np.maximum(v - d, 0.0), v),  # type: ignore[misc]
            )
    return replace(segment, values=values)


def _filled(values: Array) -> Array:
    """Values with the last known one where there is none."""
    at = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(len(values))))
    return np.nan_to_num(values[at])


def _temperature(t: Array, depth: Array, start: float) -> Array:
    """Inside the hull (degrees C): that of the water, some 20 at the surface and 12 below, a while later."""
    water = 12.0 + 8.0 * np.exp(-depth / 40.0) + 1.5 * np.sin(2 * np.pi * (t - start) / (11 * DAY))
    out, before = np.empty_like(water), float(np.mean(water))
    steps = np.diff(t, prepend=t[0])
    for k, value in enumerate(water):
        before += (value - before) * min(steps[k] / _HULL_LAG, 1.0)
        out[k] = before
    return out


def _vacuum(at_depth: Array, inside: Array, depth: Array) -> Array:
    """Vacuum (inHg) of gas of a density that is ``at_depth`` (inHg) when it is as cold as it was closed."""
    pressure = (_INHG_AIR - at_depth - np.where(depth < 2.0, _BLADDER, 0.0)) / _CLOSED_AT
    return np.asarray(_INHG_AIR - pressure * (_KELVIN + inside))


def _since(ailments: Iterable[Ailment], kind: AilmentKind, t: Array) -> Array:
    """Size by time since onset (s) of the ailments of a kind."""
    total = np.zeros_like(t)
    for a in ailments:
        if a.kind is kind:
            total += a.size * np.maximum(t - a.onset, 0.0)
    return total


def _lowered(altitude: Array, least: float) -> Array:
    """Altitudes by as much lower as the lowest is above the least."""
    low = np.nanmin(altitude) if not np.isnan(altitude).all() else least
    return np.maximum(altitude - max(low - least, 0.0), least)


def _drop(mission: Mission, a: Ailment) -> float:
    """By how much (%) the charge falls at once, so that at the mission's use it ends so many days later."""
    t, charge = _column(mission, "m_lithium_battery_relative_charge")
    if len(t) < 2:
        return 0.0
    use = (charge[0] - charge[-1]) / (t[-1] - t[0])
    return float(np.interp(a.onset, t, charge)) - (100.0 - _USABLE) - a.size * DAY * float(use)


def _column(mission: Mission, name: str) -> tuple[Array, Array]:
    """Times (s) and values of a sensor in all files of a mission."""
    parts = []
    for segment in mission.segments:
        names = [sensor.name for sensor in segment.sensors.columns]
        if name in names:
            v = segment.values[1:, names.index(name)]
            there = ~np.isnan(v)
            parts.append(np.stack([segment.values[1:, names.index(TIME)][there], v[there]]))
    joined = np.concatenate(parts, axis=1) if parts else np.empty((2, 0))
    return joined[0], joined[1]
