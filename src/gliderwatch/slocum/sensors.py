"""Slocum sensors become quantities: SI units, plausible values, increasing times. Pure but for the WMM.

`QUANTITIES` is the one table of what is read from a file; `docs/nomenclature.md` shows it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, reduce
from operator import and_, or_
from statistics import median

import numpy as np
from numpy.typing import NDArray
from pygeomag import GeoMag  # type: ignore[import-untyped]

from gliderwatch.model import Array, Segment, Series, readonly
from gliderwatch.slocum.header import Header

TIME = "m_present_time"
DEPTH = "m_depth"
PRESSURES = ("m_pressure", "sci_water_pressure")
"""Bar, above that of the air; the first that a file has stands in for a depth that is missing."""
_NO_FIX = 69696969.0
_POSITION = "DDMM.mmmm"
_UNITS = {
    _POSITION: ("degree", 1.0),
    "rad": ("rad", 1.0),
    "m": ("m", 1.0),
    "in": ("m", 0.0254),
    "m/s": ("m/s", 1.0),
    "s": ("s", 1.0),
    "cc": ("m3", 1e-6),
    "volts": ("V", 1.0),
    "amp-hrs": ("C", 3600.0),
    "%": ("1", 0.01),
    "watt": ("W", 1.0),
    "inHg": ("Pa", 3386.389),
    "degC": ("degC", 1.0),
    "sec": ("s", 1.0),
    "bytes": ("B", 1.0),
    "Mbytes": ("B", 1e6),
    "nodim": ("1", 1.0),
    "enum": ("1", 1.0),
    "degc": ("degC", 1.0),
    "s/m": ("S/m", 1.0),
    "bar": ("Pa", 1e5),
    "um": ("umol/l", 1.0),
}
"""SI unit and factor of each Slocum unit."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """One row of the table: the first of ``sensors`` that a file has, in ``slocum_unit``.

    Values outside ``low`` to ``high`` (SI) are dropped and counted; ``absent`` (Slocum unit) is
    what the glider writes where it has no value: dropped, not counted. The two of a ``pair`` share
    their times and are dropped together.
    """

    name: str
    sensors: tuple[str, ...]
    slocum_unit: str
    low: float
    high: float
    about: str
    pair: str = ""
    absent: float = math.nan

    @property
    def unit(self) -> str:
        """The SI unit of the values."""
        return _UNITS[self.slocum_unit][0]

    def to_si(self, raw: Array) -> Array:
        """Values in the SI unit (positions: degrees; NaN where minutes are 60 or more)."""
        if self.slocum_unit != _POSITION:
            return raw * _UNITS[self.slocum_unit][1]
        degrees, minutes = np.divmod(np.abs(raw), 100.0)
        return np.where(minutes < 60.0, np.copysign(degrees + minutes / 60.0, raw), np.nan)


def _q(name: str, sensors: str, unit: str, low: float, high: float, about: str, pair: str = "") -> Quantity:
    absent = {_POSITION: _NO_FIX}.get(unit, {"water_depth": -1.0, "altitude": 0.0}.get(name, math.nan))
    return Quantity(name, tuple(sensors.split()), unit, low, high, about, pair, absent)


_PI = math.pi
QUANTITIES = (
    _q("fix_lat", "m_gps_lat", _POSITION, -90, 90, "latitude of the satellite fix", "fix"),
    _q("fix_lon", "m_gps_lon", _POSITION, -180, 180, "longitude of the satellite fix", "fix"),
    _q("dr_lat", "m_lat", _POSITION, -90, 90, "dead-reckoned latitude", "dr"),
    _q("dr_lon", "m_lon", _POSITION, -180, 180, "dead-reckoned longitude", "dr"),
    _q("waypoint_lat", "c_wpt_lat", _POSITION, -90, 90, "latitude of the waypoint", "waypoint"),
    _q("waypoint_lon", "c_wpt_lon", _POSITION, -180, 180, "longitude of the waypoint", "waypoint"),
    _q("heading", "m_heading", "rad", 0, 2 * _PI, "heading, from magnetic north"),
    _q("heading_commanded", "c_heading", "rad", 0, 2 * _PI, "commanded heading, from magnetic north"),
    _q("pitch", "m_pitch", "rad", -_PI / 2, _PI / 2, "pitch, nose up positive"),
    _q("roll", "m_roll", "rad", -_PI, _PI, "roll, right side down positive"),
    _q("depth", "m_depth", "m", -20, 2000, "depth"),
    _q("depth_rate", "m_depth_rate", "m/s", -5, 5, "rate of depth, down positive"),
    _q("altitude", "m_altitude", "m", 0, 2000, "height above the bottom"),
    _q("water_depth", "m_water_depth", "m", 0, 12000, "depth of the water"),
    _q("speed_onboard", "m_avg_speed m_speed", "m/s", -0.5, 5, "horizontal speed through water, on board"),
    _q("current_x", "m_water_vx", "m/s", -5, 5, "current to magnetic east", "current"),
    _q("current_y", "m_water_vy", "m/s", -5, 5, "current to magnetic north", "current"),
    _q("current_initial_x", "m_initial_water_vx", "m/s", -5, 5, "first estimate of current_x", "initial"),
    _q("current_initial_y", "m_initial_water_vy", "m/s", -5, 5, "first estimate of current_y", "initial"),
    _q("current_final_x", "m_final_water_vx", "m/s", -5, 5, "corrected current_x", "final"),
    _q("current_final_y", "m_final_water_vy", "m/s", -5, 5, "corrected current_y", "final"),
    _q("magnetic_variation", "m_gps_mag_var", "rad", -_PI, _PI, "magnetic variation, west positive"),
    _q("gps_status", "m_gps_status", "enum", 0, 255, "state of the satellite receiver, 0 is good"),
    _q("dr_state", "x_dr_state", "enum", -1, 20, "state of dead reckoning"),
    _q("dr_time", "m_dr_time", "s", 0, 1e7, "time since the last fix"),
    _q("ballast", "m_ballast_pumped", "cc", -2e-3, 2e-3, "ballast volume of a shallow pump, up positive"),
    _q("oil_volume", "m_de_oil_vol", "cc", -2e-3, 2e-3, "oil volume of a deep pump, up positive"),
    _q("battery_position", "m_battpos", "in", -0.2, 0.2, "position of the pitch battery, forward positive"),
    _q("fin", "m_fin", "rad", -1.5, 1.5, "angle of the fin"),
    _q("inflections", "m_tot_num_inflections", "nodim", 0, 1e7, "number of inflections, whole life"),
    _q("thruster_on", "c_thruster_on", "%", 0, 1, "commanded thruster"),
    _q("thruster_power", "m_thruster_power", "watt", 0, 500, "power of the thruster"),
    _q("battery_voltage", "m_battery", "volts", 0, 60, "battery voltage"),
    _q("battery_charge", "m_lithium_battery_relative_charge", "%", 0, 1, "charge left, of a full battery"),
    _q("charge_used", "m_coulomb_amphr_total", "amp-hrs", 0, 1e7, "charge used"),
    _q("vacuum", "m_vacuum", "inHg", 0, 110e3, "vacuum inside the hull"),
    _q("leak_voltage", "m_leakdetect_voltage", "volts", 0, 5, "leak detector, aft"),
    _q("leak_voltage_forward", "m_leakdetect_voltage_forward", "volts", 0, 5, "leak detector, forward"),
    _q("leak_voltage_science", "m_leakdetect_voltage_science", "volts", 0, 5, "leak detector, science bay"),
    _q("digifin_leak", "m_digifin_leakdetect_reading", "nodim", 1, 1024, "leak reading of the digifin"),
    _q("vehicle_temperature", "m_veh_temp m_vehicle_temp", "degC", -5, 60, "temperature inside the hull"),
    _q("battery_position_commanded", "c_battpos", "in", -0.2, 0.2, "commanded position of the pitch battery"),
    _q("fin_commanded", "c_fin", "rad", -1.5, 1.5, "commanded angle of the fin"),
    _q("ballast_commanded", "c_ballast_pumped", "cc", -2e-3, 2e-3, "commanded volume of a shallow pump"),
    _q("oil_volume_commanded", "c_de_oil_vol", "cc", -2e-3, 2e-3, "commanded volume of a deep pump"),
    _q("mission_time", "m_present_secs_into_mission", "sec", 0, 1e8, "time since the mission began"),
    _q("heap_free", "m_free_heap", "bytes", 1, 1e9, "free memory of the flight computer"),
    _q("disk_free", "m_disk_free", "Mbytes", 1, 1e12, "free disk of the flight computer"),
    _q("temperature", "sci_water_temp", "degc", -5, 45, "temperature of the water"),
    _q("conductivity", "sci_water_cond", "s/m", 0.001, 9, "conductivity of the water"),
    _q(
        "science_pressure", "sci_water_pressure", "bar", -1e5, 2e7, "pressure at the CTD, that of the air off"
    ),
    _q("oxygen", "sci_oxy4_oxygen sci_oxy3835_oxygen", "um", 0, 800, "oxygen in the water"),
)
SCIENCE = ("temperature", "conductivity", "science_pressure", "oxygen")
"""Quantities of the science computer, which are read only where a field is to be made of them."""
SCIENCE_SENSORS = tuple(s for quantity in QUANTITIES if quantity.name in SCIENCE for s in quantity.sensors)
SENSORS = (
    TIME,
    *PRESSURES,
    *(sensor for quantity in QUANTITIES if quantity.name not in SCIENCE for sensor in quantity.sensors),
)
"""Slocum sensors that are read in any case where a file has them."""

_GROUPS = tuple(
    tuple(row for row in QUANTITIES if (row.pair or row.name) == group)
    for group in dict.fromkeys(row.pair or row.name for row in QUANTITIES)
)
_FIRST_WMM, _LAST_WMM = 2010, 2029
"""Years for which pygeomag has coefficients."""
_EARLIEST = datetime(1990, 1, 1, tzinfo=UTC).timestamp()
_BEFORE, _AFTER = 2 * 3600.0, 60 * 86400.0
"""Seconds around the opening of a file outside which a time stamp is absurd."""

Samples = Mapping[str, tuple[Array, Array]]


def build_segment(
    header: Header,
    samples: Samples,
    completeness: tuple[int, int, str],
    damaged: int = 0,
    *,
    science: bool = False,
) -> Segment:
    """A segment of what was read: `samples` are times (s) and values by Slocum sensor, in Slocum units.

    `damaged` bytes that could not be read are counted in ``Segment.dropped`` as ``bytes``; `science`: with
    the quantities of `SCIENCE`.
    """
    opened, samples = header.id.opened_at, _with_depth(samples)
    window = (max(opened - _BEFORE, _EARLIEST), opened + _AFTER)
    quantities: dict[str, Series] = {}
    dropped, notes = {"bytes": damaged}, list[str]()
    with np.errstate(all="ignore"):
        for rows in _GROUPS:
            if rows[0].name in SCIENCE and not science:
                continue
            kept, lost, corrected = _clean(rows, samples, window)
            quantities |= kept
            dropped |= lost
            notes += corrected
    declination, source = declination_of(quantities)
    cycles = samples[TIME][0] if TIME in samples else np.empty(0)
    ends = [series.t[-1] for series in quantities.values()]
    ends += cycles[_within(cycles, *window)].tolist()
    return Segment(
        id=header.id,
        mission=header.mission,
        kind=header.kind,
        last_t=float(max(ends, default=opened)),
        completeness=completeness,
        quantities=quantities,
        declination=declination,
        declination_source=source,
        dropped={name: n for name, n in dropped.items() if n},
        notes=tuple(notes),
    )


def cleaned(samples: tuple[Array, Array]) -> Series:
    """The finite samples of any sensor, one for each time, in order; its values as the glider sent them."""
    t, v = samples
    good = np.isfinite(t) & np.isfinite(v)
    times, first = np.unique(t[good], return_index=True)
    return Series(readonly(times), readonly(v[good][first]))


def _with_depth(samples: Samples) -> Samples:
    """The samples; with the depth that the pressure says where there is none."""
    t, bar = next((samples[name] for name in PRESSURES if _holds(samples, name)), (None, None))
    if _holds(samples, DEPTH) or t is None or bar is None:
        return samples
    return {**samples, DEPTH: (t, depth_of(bar))}


def tells_depth(samples: Samples) -> bool:
    """Whether there is a value of the depth, or of a pressure that stands in for it."""
    return any(_holds(samples, name) for name in (DEPTH, *PRESSURES))


def _holds(samples: Samples, name: str) -> bool:
    return name in samples and len(samples[name][0]) > 0


def depth_of(bar: Array) -> Array:
    """Depth (m) of a pressure above that of the air (bar), at latitude 45 degrees: elsewhere 0.3 % off.

    Saunders (1981), Practical conversion of pressure to depth, J. Phys. Oceanogr. 11, 573-574.

    >>> round(float(depth_of(np.array([500.0]))[0]), 1)
    4902.0
    """
    decibar = 10.0 * bar
    return (1 - 8.545e-3) * decibar - 2.21e-6 * decibar**2


def _clean(
    rows: tuple[Quantity, ...], samples: Samples, window: tuple[float, float]
) -> tuple[dict[str, Series], dict[str, int], list[str]]:
    """The good samples of one quantity or of a pair, how many were dropped of each, and notes."""
    found = [
        next((samples[s] for s in row.sensors if s in samples and len(samples[s][0])), None) for row in rows
    ]
    raw = [each for each in found if each is not None]
    if len(raw) < len(rows):
        return {}, {}, []
    t, columns = _together(raw)
    good, absent = _within(t, *window), _absent(rows, columns)
    if absent is not None:
        good &= ~absent
    values, far = [row.to_si(v) for row, v in zip(rows, columns, strict=True)], None
    if rows[0].slocum_unit == _POSITION:
        values, far = _wrapped(values)
    for row, v in zip(rows, values, strict=True):
        good &= _within(v, row.low, row.high)
    at = np.flatnonzero(good)
    if not (t[at[1:]] > t[at[:-1]]).all():
        at = at[np.unique(t[at], return_index=True)[1]]
    times = readonly(t[at])
    wanted = len(times) + (0 if absent is None else int(np.count_nonzero(absent)))
    lost = {row.name: len(each[0]) - wanted for row, each in zip(rows, raw, strict=True)}
    if not len(times):
        return {}, lost, []
    kept = {row.name: Series(times, readonly(v[at])) for row, v in zip(rows, values, strict=True)}
    n = 0 if far is None else int(np.count_nonzero(far & good))
    notes = [f"{n} values of {rows[-1].name} beyond 180 degrees brought back to -180 to 180"] if n else []
    return kept, lost, notes


def _absent(rows: tuple[Quantity, ...], columns: list[Array]) -> NDArray[np.bool_] | None:
    """Where there is what the glider writes that has no value; None where it writes nothing of the kind."""
    found = [v == row.absent for row, v in zip(rows, columns, strict=True) if not math.isnan(row.absent)]
    if rows[0].slocum_unit == _POSITION:  # what memory holds before the first fix: off Africa
        found.append(reduce(and_, [v == 0.0 for v in columns]))
    return reduce(or_, found) if found else None


def _wrapped(values: list[Array]) -> tuple[list[Array], NDArray[np.bool_]]:
    """Positions with longitudes of up to a turn brought back to -180 to 180, and where those were beyond.

    A glider counts on as it crosses the antimeridian.
    """
    lat, lon = values
    far = (np.abs(lon) > 180.0) & (np.abs(lon) <= 360.0)
    return [lat, np.where(far, lon - np.copysign(360.0, lon), lon)], far


def _together(raw: list[tuple[Array, Array]]) -> tuple[Array, list[Array]]:
    """Times of a quantity, or those at which both of a pair have a value, and the values there."""
    t, v = raw[0]
    if len(raw) == 1:
        return t, [v]
    t_other, other = raw[1]
    if np.array_equal(t, t_other):
        return t, [v, other]
    both, i, j = np.intersect1d(t, t_other, return_indices=True)
    return both, [v[i], other[j]]


def _within(values: Array, low: float, high: float) -> NDArray[np.bool_]:
    return (values >= low) & (values <= high)


# --------------------------------------------------------------------------- declination


def declination_of(quantities: Mapping[str, Series]) -> tuple[float | None, str]:
    """Declination (rad, east positive) that the glider reports, else the model's at its first position."""
    if "magnetic_variation" in quantities:
        variation = quantities["magnetic_variation"].v
        variation = variation[variation != 0.0]  # zero until the receiver has reported it
        if len(variation):
            return -median(variation.tolist()), "glider"
    for name in ("fix", "dr"):
        if f"{name}_lat" in quantities:
            lat, lon = quantities[f"{name}_lat"], quantities[f"{name}_lon"]
            return model_declination(float(lat.v[0]), float(lon.v[0]), float(lat.t[0]))
    return None, ""


def model_declination(lat: float, lon: float, t: float) -> tuple[float, str]:
    """Declination (rad, east positive) of the World Magnetic Model at sea level, and the model's name.

    `lat`, `lon` in degrees, `t` in s. The model of the five years that hold `t`; before the first
    and after the last of them the nearest one is extrapolated, and its name says so.

    >>> d, name = model_declination(28.4, -80.3, 1_568_000_000)
    >>> f"{math.degrees(d):.1f} {name}"
    '-7.1 WMM2015v2'
    """
    when = datetime.fromtimestamp(t, UTC)
    start, end = (datetime(year, 1, 1, tzinfo=UTC).timestamp() for year in (when.year, when.year + 1))
    model = _wmm(min(max(when.year, _FIRST_WMM), _LAST_WMM))
    decimal_year = when.year + (t - start) / (end - start)
    result = model.calculate(lat, lon, 0.0, decimal_year, allow_date_outside_lifespan=True)
    name = model.model.replace("-", "")
    return math.radians(result.d), name if _FIRST_WMM <= when.year <= _LAST_WMM else f"{name} extrapolated"


@cache
def _wmm(year: int) -> GeoMag:
    return GeoMag(base_year=year)
