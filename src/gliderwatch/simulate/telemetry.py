"""What of a glider's log goes into a real-time file. Pure but for the log it keeps.

On board every sensor is updated when it is measured; a real-time file takes each sensor at its own
cadence, and has a line only where some sensor is due.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.dinkum import Header, Sensor, SensorList

CYCLE = 4.0
TIME = "m_present_time"

_UNITS = {
    "c_ballast_pumped": "cc",
    "c_heading": "rad",
    "c_wpt_lat": "lat",
    "c_wpt_lon": "lon",
    "m_ballast_pumped": "cc",
    "m_battery": "volts",
    "m_coulomb_amphr_total": "amp-hrs",
    "m_depth": "m",
    "m_depth_rate": "m/s",
    "m_final_water_vx": "m/s",
    "m_final_water_vy": "m/s",
    "m_gps_lat": "lat",
    "m_gps_lon": "lon",
    "m_gps_mag_var": "rad",
    "m_gps_status": "enum",
    "m_heading": "rad",
    "m_initial_water_vx": "m/s",
    "m_initial_water_vy": "m/s",
    "m_lat": "lat",
    "m_leakdetect_voltage": "volts",
    "m_lon": "lon",
    "m_pitch": "rad",
    TIME: "timestamp",
    "m_roll": "rad",
    "m_speed": "m/s",
    "m_vacuum": "inHg",
    "m_water_vx": "m/s",
    "m_water_vy": "m/s",
}
_SIZES = {"lat": 8, "lon": 8, "timestamp": 8, "enum": 1}

SENSORS = tuple(Sensor(name, unit, _SIZES.get(unit, 4)) for name, unit in _UNITS.items())

CADENCE: Mapping[str, float] = {
    "c_heading": 600,
    "c_wpt_lat": 600,
    "c_wpt_lon": 600,
    "m_ballast_pumped": 600,
    "m_battery": 1800,
    "m_coulomb_amphr_total": 1800,
    "m_depth": 32,
    "m_final_water_vx": 4,
    "m_final_water_vy": 4,
    "m_gps_lat": 4,
    "m_gps_lon": 4,
    "m_gps_mag_var": 30,
    "m_gps_status": 30,
    "m_heading": 64,
    "m_lat": 600,
    "m_leakdetect_voltage": 1800,
    "m_lon": 600,
    "m_pitch": 64,
    "m_roll": 128,
    "m_vacuum": 1800,
    "m_water_vx": 4,
    "m_water_vy": 4,
}
"""Which sensors a coastal glider sends, and how often at most (s)."""


@dataclass(frozen=True, slots=True)
class SegmentData:
    """One segment as it goes into a file.

    ``values`` and ``updated`` have shape (cycles, sensors sent); the first row is the state of the
    glider just before the segment. ``closed`` is when the glider ended it, ``sent`` when it has
    reached shore (s).
    """

    header: Header
    sensors: SensorList
    values: Array
    updated: NDArray[np.bool_]
    closed: float
    sent: float


def sensor_list(cadence: Mapping[str, float]) -> SensorList:
    """The list of sensors of files that hold those in ``cadence``, and time.

    Raises:
        ValueError: a sensor that is not simulated, or a cadence shorter than a cycle.
    """
    for name, period in cadence.items():
        if name not in _UNITS:
            raise ValueError(f"{name} is not simulated: choose from {', '.join(_UNITS)}")
        if period < CYCLE:
            raise ValueError(f"{name} every {period} s: the glider's cycle is {CYCLE} s")
    return SensorList(SENSORS, frozenset(cadence) | {TIME})


@dataclass(slots=True)
class Log:
    """The log on board: updates of sensors at numbered cycles, from ``start`` (s) on.

    ``state`` holds the last value of every sensor before the updates that are still pending.
    """

    start: float
    state: dict[str, float]
    pending: dict[str, list[tuple[NDArray[np.int64], Array]]] = field(default_factory=dict)

    def add(self, name: str, cycles: ArrayLike, values: ArrayLike) -> None:
        """Add updates of a sensor; ``values`` broadcasts to ``cycles``."""
        at = np.atleast_1d(np.asarray(cycles, dtype=np.int64))
        row = np.broadcast_to(np.asarray(values, dtype=np.float64), at.shape)
        self.pending.setdefault(name, []).append((at, row))

    def cut(
        self, first: int, last: int, sensors: SensorList, cadence: Mapping[str, float]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """The table of a file from cycle ``first`` to ``last``; updates up to there become `state`.

        Returns:
            Values and updated flags as in `SegmentData`.
        """
        before, due = dict(self.state), {}
        for name, parts in self.pending.items():
            at, row = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
            order = np.argsort(at, kind="stable")
            at, row = at[order], row[order]
            i, j = np.searchsorted(at, [first, last + 1])
            if i:
                before[name] = float(row[i - 1])
            if j:
                self.state[name] = float(row[j - 1])
            if name in cadence:
                due[name] = _first_of_each(at[i:j], row[i:j], first, round(cadence[name] / CYCLE))
            self.pending[name] = [(at[j:], row[j:])]
        cycles = np.unique(np.concatenate([at for at, _ in due.values()]))
        before[TIME] = self.start + CYCLE * (first - 1)
        values, updated = _table(sensors, before, cycles, due)
        time_column = [sensor.name for sensor in sensors.columns].index(TIME)
        values[1:, time_column], updated[1:, time_column] = self.start + CYCLE * cycles, True
        return values, updated


def _first_of_each(
    at: NDArray[np.int64], row: Array, first: int, period: int
) -> tuple[NDArray[np.int64], Array]:
    """The first update of each ``period`` cycles."""
    _, index = np.unique((at - first) // period, return_index=True)
    return at[index], row[index]


def _table(
    sensors: SensorList,
    state: Mapping[str, float],
    cycles: NDArray[np.int64],
    due: Mapping[str, tuple[NDArray[np.int64], Array]],
) -> tuple[Array, NDArray[np.bool_]]:
    """The state as first row, then the updates that are due, one row a cycle."""
    values = np.full((len(cycles) + 1, len(sensors.columns)), np.nan)
    updated = np.zeros(values.shape, dtype=bool)
    for j, sensor in enumerate(sensors.columns):
        values[0, j], updated[0, j] = state[sensor.name], True
        if sensor.name in due:
            at, row = due[sensor.name]
            rows = 1 + np.searchsorted(cycles, at)
            values[rows, j], updated[rows, j] = row, True
    return values, updated
