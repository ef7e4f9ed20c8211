"""What a simulated mission tells from its files alone, as a shore-side program would find it."""

from typing import NamedTuple

import numpy as np

from gliderwatch.simulate.flight import Point, displacement
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.telemetry import CADENCE

DAY = 86400.0
EVERY_CYCLE = dict.fromkeys(CADENCE, 4.0)
STRAIGHT = Scenario(days=2.0, waypoints=(Point(30.0, -84.0),), variation=0.28, cadence=EVERY_CYCLE)
ONSET = STRAIGHT.start + DAY


class Closure(NamedTuple):
    """A dive as known from its files alone: mean velocities (m/s, true north) between the fixes."""

    t_dive: float
    ground: np.ndarray
    own: np.ndarray
    current: np.ndarray
    known: np.ndarray
    """The current as another source would know it: the true one."""

    @property
    def misfit(self) -> float:
        return float(np.hypot(*(self.ground - self.own - self.current)))

    @property
    def along(self) -> float:
        return float((self.ground - self.current) @ self.own / np.hypot(*self.own))

    @property
    def across(self) -> float:
        way = self.own / np.hypot(*self.own)
        return float((self.ground - self.current) @ [-way[1], way[0]])

    @property
    def across_known(self) -> float:
        way = self.own / np.hypot(*self.own)
        return float((self.ground - self.known) @ [-way[1], way[0]])

    @property
    def over_ground(self) -> float:
        return float(np.hypot(*self.ground))


def samples(mission: Mission, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a sensor in all files, first lines left out as readers do."""
    t, v = [], []
    for segment in mission.segments:
        names = [sensor.name for sensor in segment.sensors.columns]
        rows = 1 + np.flatnonzero(segment.updated[1:, names.index(name)])
        t.append(segment.values[rows, names.index("m_present_time")])
        v.append(segment.values[rows, names.index(name)])
    return np.concatenate(t), np.concatenate(v)


def degrees(values: np.ndarray) -> np.ndarray:
    whole = np.trunc(values / 100)
    return whole + (values - 100 * whole) / 60


def east_north(east: float, north: float, clockwise: float) -> np.ndarray:
    c, s = np.cos(clockwise), np.sin(clockwise)
    return np.array([east * c + north * s, north * c - east * s])


def closures(mission: Mission, variation: float, kind: str = "final") -> list[Closure]:
    """Ground velocity, dead-reckoned velocity and reported current of every dive.

    Speed is depth rate over tan(pitch) of the whole legs, so it shares nothing with the on-board filter.
    """
    t_fix, lat = samples(mission, "m_gps_lat")
    lon = degrees(samples(mission, "m_gps_lon")[1])
    new = np.r_[True, (np.diff(lat) != 0) | (np.diff(lon) != 0)]
    t_fix, lat, lon = t_fix[new], degrees(lat)[new], lon[new]
    t, depth = samples(mission, "m_depth")
    sensors = {name: samples(mission, name) for name in ("m_pitch", "m_heading")}
    t_water, east = samples(mission, f"m_{kind}_water_vx")
    _, north = samples(mission, f"m_{kind}_water_vy")
    found = []
    for dive in mission.truth[:-1]:
        i = np.searchsorted(t_fix, dive.t_dive, "right") - 1
        j = np.searchsorted(t_fix, dive.t_surface, "right")
        way = displacement(Point(lat[i], lon[i]), Point(lat[j], lon[j]))
        under = (t >= dive.t_dive) & (t <= dive.t_surface)
        pitch, heading = (np.interp(t[under], at, np.unwrap(values)) for at, values in sensors.values())
        steep = np.abs(pitch) > 0.3
        rate = -np.gradient(depth[under], t[under])
        speed = np.median(rate[steep] / np.tan(pitch[steep]))
        unit = np.array([np.sin(heading - variation).mean(), np.cos(heading - variation).mean()])
        between = t_fix[j] - t_fix[i]
        k = np.searchsorted(t_water, dive.t_surface)
        found.append(
            Closure(
                dive.t_dive,
                np.array(way) / between,
                speed * unit * (dive.t_surface - dive.t_dive) / between,
                east_north(east[k], north[k], -variation),
                np.array(dive.current),
            )
        )
    return found


def medians(mission: Mission, name: str, onset: float = ONSET) -> tuple[float, float]:
    """Median of a property of `Closure` before and after the onset of the fault."""
    found = closures(mission, mission.scenario.variation)
    before = [getattr(dive, name) for dive in found if dive.t_dive < onset - 4 * 3600]
    after = [getattr(dive, name) for dive in found if dive.t_dive > onset]
    return float(np.median(before)), float(np.median(after))
