"""The sensors that are simulated, and what of a glider's log goes into a file. Pure but for the log it
keeps."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gliderwatch.model import Array
from gliderwatch.simulate.dinkum import Header, Sensor, SensorList

# ----------------------------------------
# The sensors that are simulated: names, units, sizes, and what a glider usually sends of them.

TIME, SCIENCE_TIME = "m_present_time", "sci_m_present_time"
SECONDS, SCIENCE_SECONDS = "m_present_secs_into_mission", "sci_m_present_secs_into_mission"

_SIZES = {"lat": 8, "lon": 8, "timestamp": 8, "enum": 1}


def _sensors(table: str) -> tuple[Sensor, ...]:
    rows = sorted(row.split() for row in table.strip().splitlines())
    return tuple(Sensor(name, unit, _SIZES.get(unit, 4)) for name, unit in rows)


SENSORS = _sensors("""
    c_ballast_pumped cc
    c_de_oil_vol cc
    c_heading rad
    c_thruster_on %
    c_wpt_lat lat
    c_wpt_lon lon
    c_wpt_x_lmc m
    c_wpt_y_lmc m
    m_altitude m
    m_avg_speed m/s
    m_ballast_pumped cc
    m_battery volts
    m_battpos in
    m_coulomb_amphr_total amp-hrs
    m_de_oil_vol cc
    m_depth m
    m_depth_rate m/s
    m_digifin_leakdetect_reading nodim
    m_dr_time s
    m_final_water_vx m/s
    m_final_water_vy m/s
    m_fin rad
    m_gps_lat lat
    m_gps_lon lon
    m_gps_mag_var rad
    m_gps_status enum
    m_heading rad
    m_initial_water_vx m/s
    m_initial_water_vy m/s
    m_lat lat
    m_leakdetect_voltage volts
    m_leakdetect_voltage_forward volts
    m_leakdetect_voltage_science volts
    m_lithium_battery_relative_charge %
    m_lon lon
    m_pitch rad
    m_present_secs_into_mission sec
    m_present_time timestamp
    m_roll rad
    m_speed m/s
    m_thruster_power watt
    m_tot_num_inflections nodim
    m_vacuum inHg
    m_veh_temp degC
    m_water_depth m
    m_water_vx m/s
    m_water_vy m/s
    m_x_lmc m
    m_y_lmc m
    x_dr_state enum
""")
"""What the flight computer knows, in its order."""

SCIENCE_SENSORS = _sensors("""
    sci_ctd41cp_timestamp timestamp
    sci_m_present_secs_into_mission sec
    sci_m_present_time timestamp
    sci_water_cond s/m
    sci_water_pressure bar
    sci_water_temp degc
""")
"""What the science computer knows."""

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

SCIENCE_CADENCE: Mapping[str, float] = {
    "sci_water_cond": 12,
    "sci_water_pressure": 12,
    "sci_water_temp": 12,
}
"""Which of the science sensors are usually sent, and how often at most (s)."""


def sensor_list(cadence: Mapping[str, float], *, science: bool = False) -> SensorList:
    """The list of sensors of files that hold those in ``cadence`` (s), and time.

    Raises:
        ValueError: a sensor that is not simulated.
    """
    sensors = SCIENCE_SENSORS if science else SENSORS
    names = [sensor.name for sensor in sensors]
    for name in cadence:
        if name not in names:
            close = difflib.get_close_matches(name, names, n=1)
            cure = f"did you mean {close[0]}?" if close else f"choose from {', '.join(names)}"
            raise ValueError(f"{name} is not simulated: {cure}")
    return SensorList(sensors, frozenset(cadence) | {SCIENCE_TIME if science else TIME})


# ----------------------------------------
# What of a glider's log goes into a file. Pure but for the log it keeps.
#
# On board every sensor is updated when it is measured; a real-time file takes each sensor at its own
# cadence, some only on every n-th yo, and has a line only where some sensor is due.

__all__ = ["CADENCE", "CYCLE", "SCIENCE_CYCLE", "Log", "SegmentData", "Selection", "everything"]

CYCLE = 4.0
"""Seconds between two cycles of the flight computer."""
SCIENCE_CYCLE = 2.0
"""Seconds between two cycles of the science computer."""


@dataclass(frozen=True, slots=True)
class SegmentData:
    """One segment as it goes into a file.

    ``values`` and ``updated`` have shape (cycles, sensors sent); the first row is the state of the
    glider just before the segment. ``closed`` is when the glider ended it, ``sent`` when it may
    be on shore at the earliest (s, true time).
    """

    header: Header
    sensors: SensorList
    values: Array
    updated: NDArray[np.bool_]
    closed: float
    sent: float

    def sent_at(self, time: float) -> SegmentData:
        """The same segment, sent at another time (s)."""
        return replace(self, sent=time)


@dataclass(frozen=True, slots=True)
class Selection:
    """What a kind of file takes of a log.

    ``cadence`` is the least time (s) between two values of a sensor, at least a cycle; ``nth_yo`` says of
    some that they are sent on every n-th yo of a dive only.
    """

    sensors: SensorList
    cadence: Mapping[str, float]
    nth_yo: Mapping[str, int] = field(default_factory=dict)


def everything(sensors: tuple[Sensor, ...], step: float) -> Selection:
    """All sensors whenever they are updated, as in a full-rate file; ``step`` is the cycle (s)."""
    names = [sensor.name for sensor in sensors]
    return Selection(SensorList(sensors, frozenset(names)), dict.fromkeys(names, step))


Table = tuple[Array, NDArray[np.bool_]]


@dataclass(slots=True)
class Log:
    """The log of one computer: updates of sensors at numbered cycles of ``step`` s, from ``start`` (s) on.

    ``time`` names its sensor of time and ``skew`` is the error of its clock (s). ``state`` holds the last
    value of every sensor before the updates that are still pending. ``yos`` holds the cycle at which
    each yo began and its number in its dive. ``missions`` are the cycles at which missions began.
    """

    start: float
    state: dict[str, float]
    step: float
    time: str
    skew: float = 0.0
    missions: list[int] = field(default_factory=lambda: [0])
    yos: list[tuple[int, int]] = field(default_factory=lambda: [(0, 0)])
    pending: dict[str, list[tuple[NDArray[np.int64], Array]]] = field(default_factory=dict)

    def add(self, name: str, cycles: ArrayLike, values: ArrayLike) -> None:
        """Add updates of a sensor; ``values`` broadcasts to ``cycles``."""
        at = np.atleast_1d(np.asarray(cycles, dtype=np.int64))
        row = np.broadcast_to(np.asarray(values, dtype=np.float64), at.shape)
        self.pending.setdefault(name, []).append((at, row))

    def clock(self, cycles: ArrayLike) -> Array:
        """What the clock of the computer shows at some cycles (s)."""
        return np.asarray(self.start + self.skew + self.step * np.asarray(cycles))

    def cut(self, first: int, last: int, selections: Sequence[Selection]) -> list[Table]:
        """The tables of files from cycle ``first`` to ``last``; updates up to there become `state`.

        Returns:
            For each selection values and updated flags as in `SegmentData`.
        """
        before, updates = dict(self.state), {}
        for name, parts in self.pending.items():
            at, row = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
            order = np.argsort(at, kind="stable")
            at, row = at[order], row[order]
            i, j = np.searchsorted(at, [first, last + 1])
            if i:
                before[name] = float(row[i - 1])
            if j:
                self.state[name] = float(row[j - 1])
            updates[name] = at[i:j], row[i:j]
            self.pending[name] = [(at[j:], row[j:])]
        return [self._select(first, selection, before, updates) for selection in selections]

    def _select(
        self,
        first: int,
        selection: Selection,
        before: Mapping[str, float],
        updates: Mapping[str, tuple[NDArray[np.int64], Array]],
    ) -> Table:
        due = {}
        for name, (at, row) in updates.items():
            if name not in selection.cadence or not len(at):
                continue
            kept = self._is_on_yo(at, selection.nth_yo.get(name, 1))
            period = round(selection.cadence[name] / self.step)
            due[name] = _first_of_each(at[kept], row[kept], first, period)
        cycles = np.unique(np.concatenate([np.empty(0, np.int64), *(at for at, _ in due.values())]))
        mission = max((each for each in self.missions if each <= first), default=self.missions[0])
        for name, zero in ((self.time, None), (SECONDS, mission), (SCIENCE_SECONDS, mission)):
            if name == self.time or name in selection.cadence:
                origin = 0.0 if zero is None else float(self.clock(zero))
                before = {**before, name: float(self.clock(first - 1)) - origin}
                due[name] = cycles, self.clock(cycles) - origin
        return _table(selection.sensors, before, cycles, due)

    def _is_on_yo(self, at: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
        """Where a sensor is sent that is so on every n-th yo."""
        if n == 1:
            return np.ones(len(at), dtype=bool)
        begun, number = np.array(self.yos).T
        return np.asarray(number[np.searchsorted(begun, at, "right") - 1] % n == 0)


def _first_of_each(
    at: NDArray[np.int64], row: Array, first: int, period: int
) -> tuple[NDArray[np.int64], Array]:
    """The first update of each ``period`` cycles; updates of one cycle count as one, the last of them."""
    at, last = at[::-1], row[::-1]
    at, index = np.unique(at, return_index=True)
    row = last[index]
    _, index = np.unique((at - first) // period, return_index=True)
    return at[index], row[index]


def _table(
    sensors: SensorList,
    state: Mapping[str, float],
    cycles: NDArray[np.int64],
    due: Mapping[str, tuple[NDArray[np.int64], Array]],
) -> Table:
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
