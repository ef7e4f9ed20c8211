"""The readings of a glider's health: what one file or one call shows, and all so far. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gliderwatch.health.constants import (
    APPROACH,
    ATMOSPHERE,
    BINS,
    FEWEST,
    FLIGHT,
    KELVIN,
    KEPT,
    OUT_OF_RANGE,
    PAUSE,
    REMEMBERED,
    SAME_READING,
    SHOWN,
    SURFACE,
)
from gliderwatch.model import EMPTY, Array, Call, Segment, Series, readonly

Readings = Mapping[str, Series]
"""What one file or call shows: times (s) and values (SI) by quantity, in order of time."""

LOWEST = ("leak_voltage", "leak_voltage_forward", "leak_voltage_science", "digifin_leak")
"""Quantities of which low values are bad: of many readings the lowest count, but for single ones."""
PLAIN = ("vacuum", "battery_voltage", "heap_free", "disk_free")
LATEST = ("battery_charge", "charge_used", "mission_time")
"""Quantities of which the first and the last reading of a file are enough."""
COMMANDED = {
    "battery_position": "battery_position_commanded",
    "fin": "fin_commanded",
    "ballast": "ballast_commanded",
    "oil_volume": "oil_volume_commanded",
}
"""What a motor does, and what it was told to do."""


@dataclass(frozen=True, slots=True)
class History:
    """The readings of a glider up to a file or a call, ``fresh``; ``before`` are those of the files and calls
    before it, in order of time. What several rules ask for is joined once, in ``_joined``."""

    before: tuple[Readings, ...]
    fresh: Readings
    _joined: dict[str, Series] = field(default_factory=dict, init=False, repr=False, compare=False)

    def get(self, name: str) -> Series:
        """All readings of a quantity, in order of time, none twice."""
        found = self._joined.get(name)
        if found is None:
            found = joined([one[name] for one in (*self.before, self.fresh) if name in one])
            self._joined[name] = found
        return found

    def is_later(self, name: str) -> bool:
        """Whether all fresh readings of a quantity are later than those before, as nearly always."""
        since = self.fresh_from(name)
        return all(one[name].t[-1] < since for one in self.before if name in one)

    def fresh_from(self, name: str) -> float:
        """The time (s) of the first fresh reading of a quantity; infinite where there is none."""
        series = self.fresh.get(name, EMPTY)
        return float(series.t[0]) if len(series) else float("inf")

    def earlier(self, name: str) -> Series:
        """The readings of a quantity that are older than the fresh ones."""
        series = self.get(name)
        return series.between(float("-inf"), np.nextafter(self.fresh_from(name), float("-inf")))


def joined(parts: Sequence[Series]) -> Series:
    """Several series as one, in order of time; of readings within `SAME_READING` the first counts."""
    if len(parts) < 2:
        return parts[0] if parts else EMPTY
    t, v = np.concatenate([p.t for p in parts]), np.concatenate([p.v for p in parts])
    if (t[1:] - t[:-1] > SAME_READING).all():  # as nearly always: files follow each other
        return Series(readonly(t), readonly(v))
    order = np.argsort(t, kind="stable")
    t, v = t[order], v[order]
    fresh = np.concatenate([[True], np.diff(t) > SAME_READING])
    return Series(readonly(t[fresh]), readonly(v[fresh]))


def recent(rows: Sequence[tuple[float, Readings]]) -> tuple[Readings, ...]:
    """Of rows in order of time (s), all but the last, those of the deployment of the last that are young
    enough to be looked back on."""
    kept: list[Readings] = []
    end = t = rows[-1][0]
    for at, readings in reversed(rows[:-1]):
        if end - at > REMEMBERED or t - at > PAUSE:
            break
        kept.append(readings)
        t = at
    return tuple(reversed(kept))


# ----------------------------------------
# From a segment or a call to its readings.


def of_segment(segment: Segment) -> Readings:
    """The readings that a segment holds, few enough to be kept for weeks."""
    get, out = segment.get, dict[str, Series]()
    depth = get("depth")
    for name in LOWEST:
        _put(out, name, _thinned(get(name), np.min))
    _put(out, "altitude", _turns(get("altitude")))
    for name in PLAIN:
        _put(out, name, _thinned(get(name), np.median))
    for name in LATEST:
        series = get(name)
        _put(out, name, series if len(series) < 3 else _at(series, np.array([0, len(series) - 1])))
    for name, command in COMMANDED.items():
        error = _where(_error(get(name), get(command)), depth, lambda d: d > FLIGHT)
        if len(error) >= FEWEST:
            _put(out, f"{name}_error", _median(error, segment.last_t))
    roll = _where(get("roll"), depth, lambda d: d > FLIGHT)
    _put(out, "roll_in_flight", _median(roll, segment.last_t))
    _put(out, "thruster_use", _use(segment))
    out |= _vacuum(get("vacuum"), get("vehicle_temperature"), depth, segment.last_t)
    return MappingProxyType(out)


def of_call(call: Call) -> Readings:
    """The readings that a glider printed in a call."""
    out = dict[str, Series]()
    for name in sorted({r.name for r in call.readings}):
        pairs = sorted((r.t, r.value) for r in call.readings if r.name == name)
        _put(out, name, joined([_series([t], [v]) for t, v in pairs]))
    if call.fix is not None:
        _put(out, "fix_age", _series([call.last_t], [max(call.last_t - call.fix.t, 0.0)]))
    if call.announced:
        _put(out, "call_cut", _series([call.last_t], [float(_is_cut(call))]))
    if "vacuum" in out:
        out |= _vacuum(out["vacuum"], out.pop("vehicle_temperature", EMPTY), EMPTY, call.last_t)
    return MappingProxyType(out)


def _is_cut(call: Call) -> bool:
    """Whether the transfer of a file began in a call and was not done."""
    return bool(set(call.announced) - set(call.sent))


def _turns(altitude: Series) -> Series:
    """The lowest altitude of each approach of the bottom.

    A glider is near the bottom for some seconds a yo: of a file with one sample a minute two in a row are
    never both low.
    """
    if not len(altitude):
        return EMPTY
    from scipy.signal import find_peaks  # noqa: PLC0415 (slow; every command loads this module)

    lowest: list[int] = []
    edges = [0, *(1 + np.flatnonzero(np.diff(altitude.t) > OUT_OF_RANGE)).tolist(), len(altitude)]
    for i, j in pairwise(edges):
        v = altitude.v[i:j]
        far = float(v.max()) + APPROACH
        at, _ = find_peaks(-np.concatenate([[far], v, [far]]), prominence=APPROACH)
        lowest += (at - 1 + i).tolist()
    return _at(altitude, np.array(lowest[-KEPT:], dtype=np.intp))


def _vacuum(vacuum: Series, temperature: Series, depth: Series, t: float) -> Readings:
    """Density of the gas in the hull by its pressure and temperature, apart for depth and surface.

    Pascal a kelvin: p / T, which only a leak changes (and the bladder, which fills at the surface). One value
    a file, the median; none where no temperature is sent. Where no depth is sent (in a call) it is that of
    the surface.
    """
    if not len(vacuum) or not len(temperature):
        return {}
    kelvin = KELVIN + np.interp(vacuum.t, temperature.t, temperature.v)
    density = Series(vacuum.t, readonly((ATMOSPHERE - vacuum.v) / kelvin))
    out: dict[str, Series] = {}
    _put(out, "gas_density", _median(_where(density, depth, lambda d: d > FLIGHT), t))
    above = _where(density, depth, lambda d: d < SURFACE) if len(depth) else density
    _put(out, "gas_density_surface", _median(above, t))
    return out


def _use(segment: Segment) -> Series:
    """The part of the time (0 to 1) that the thruster is on, as one value a file."""
    power = segment.get("thruster_power")
    series = power if len(power) else segment.get("thruster_on")
    return _series([segment.last_t], [float(np.mean(series.v > 0.0))]) if len(series) else EMPTY


def _error(measured: Series, commanded: Series) -> Series:
    """Measured less commanded.

    A motor may be on its way, and both are sent at times of their own: of the commands before and after a
    measurement the nearer one counts.
    """
    if not len(measured) or not len(commanded):
        return EMPTY
    after = np.searchsorted(commanded.t, measured.t, "right")
    last = len(commanded) - 1
    off = [measured.v - commanded.v[np.clip(at, 0, last)] for at in (after - 1, after)]
    return Series(measured.t, readonly(np.where(np.abs(off[0]) <= np.abs(off[1]), *off)))


def _where(series: Series, depth: Series, is_there: Callable[[Array], NDArray[np.bool_]]) -> Series:
    """The readings at which the depth is as wanted."""
    if not len(series) or not len(depth):
        return EMPTY
    return _at(series, np.flatnonzero(is_there(np.interp(series.t, depth.t, depth.v))))


def _median(series: Series, t: float) -> Series:
    return _series([t], [float(np.median(series.v))]) if len(series) else EMPTY


def _thinned(series: Series, of_bin: Callable[[Array], float]) -> Series:
    """A series of at most `BINS` and `SHOWN` readings: of many, one a bin and the last ones as they are.

    Before, each is replaced by the median of it and its neighbours: a single wild reading is no reading.
    """
    if len(series) <= KEPT:
        return series
    v = series.v
    smooth = np.median(np.stack([v[:-2], v[1:-1], v[2:]]), axis=0)
    smooth = np.concatenate([smooth[:1], smooth, smooth[-1:]])
    first = len(v) - SHOWN
    edges = np.linspace(0, first, BINS + 1).astype(int)
    t = [float(series.t[j - 1]) for j in edges[1:]]
    bins = [float(of_bin(smooth[i:j])) for i, j in pairwise(edges)]
    return _series([*t, *series.t[first:]], [*bins, *v[first:]])


def _series(t: Sequence[float], v: Sequence[float]) -> Series:
    return Series(readonly(t), readonly(v))


def _at(series: Series, at: NDArray[np.intp]) -> Series:
    return Series(readonly(series.t[at]), readonly(series.v[at]))


def _put(out: dict[str, Series], name: str, series: Series) -> None:
    if len(series):
        out[name] = series
