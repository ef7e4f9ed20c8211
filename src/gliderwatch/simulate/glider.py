"""One glider's mission, simulated with its truth. Pure given the seed of the scenario.

The glider dives in a sawtooth towards its waypoints, surfaces at intervals, drifts while it
communicates, and dives again. What it believes of all this goes into its log; the log becomes
segments. Everything happens on the grid of the glider's cycle (4 s) since the start of the mission.
"""

from __future__ import annotations

import time

import numpy as np

from gliderwatch.simulate.dinkum import Header
from gliderwatch.simulate.dive import dive
from gliderwatch.simulate.ocean import make_ocean
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.surfacing import surface
from gliderwatch.simulate.telemetry import SENSORS, Log, SegmentData, sensor_list
from gliderwatch.simulate.vehicle import Glider

_SENDING = (60.0, 240.0)


def simulate(scenario: Scenario) -> Mission:
    """Simulate a mission until the first surfacing after its ``days``; the last segment is at the surface.

    Raises:
        ValueError: the scenario has a sensor that is not simulated, or no steady glide.
    """
    seas, flight = np.random.default_rng(scenario.seed).spawn(2)
    end = scenario.start + 86400 * scenario.days
    ocean = make_ocean(scenario.sea, scenario.start, end + 86400 + 2 * scenario.interval, seas)
    log = Log(scenario.start, dict.fromkeys((sensor.name for sensor in SENSORS), 0.0))
    glider = Glider(scenario, ocean, flight, log, scenario.place, scenario.place)
    segments: list[SegmentData] = []
    truth = []
    _, opened = surface(glider, None)
    while glider.time(glider.cycle) < end:
        flown = dive(glider, _name(scenario, len(segments)))
        closed, reopened = surface(glider, flown)
        segments.append(_segment(glider, len(segments), opened, closed))
        truth.append(flown.truth)
        opened = reopened
    segments.append(_segment(glider, len(segments), opened, glider.cycle))
    return Mission(scenario, tuple(segments), tuple(truth))


def _name(scenario: Scenario, number: int) -> str:
    """Full name of a segment: glider, year, day of the year counted from 0, mission, segment."""
    day = time.gmtime(scenario.start)
    return f"{scenario.glider}-{day.tm_year}-{day.tm_yday - 1}-0-{number}"


def _segment(glider: Glider, number: int, opened: int, closed: int) -> SegmentData:
    """The segment between two cycles, and when it has reached shore."""
    scenario = glider.scenario
    sensors = sensor_list(scenario.cadence)
    values, updated = glider.log.cut(opened, closed, sensors, scenario.cadence)
    header = Header(
        short_name=f"{scenario.mission_number:04d}{number:04d}",
        full_name=_name(scenario, number),
        extension="sbd",
        mission=scenario.mission,
        opened=glider.time(opened),
    )
    end = glider.time(closed)
    return SegmentData(header, sensors, values, updated, end, end + float(glider.rng.uniform(*_SENDING)))
