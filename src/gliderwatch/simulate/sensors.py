"""The sensors that are simulated: names, units, sizes, and what a glider usually sends of them."""

from __future__ import annotations

import difflib
from collections.abc import Mapping

from gliderwatch.simulate.dinkum import Sensor, SensorList

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
    known = SCIENCE_SENSORS if science else SENSORS
    names = [sensor.name for sensor in known]
    for name in cadence:
        if name not in names:
            close = difflib.get_close_matches(name, names, n=1)
            cure = f"did you mean {close[0]}?" if close else f"choose from {', '.join(names)}"
            raise ValueError(f"{name} is not simulated: {cure}")
    return SensorList(known, frozenset(cadence) | {SCIENCE_TIME if science else TIME})
