"""The mission of one glider, or of a fleet in one sea, simulated with its truth. Pure given the seed of the
scenario."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Generator
from dataclasses import dataclass, field, replace

import numpy as np

from gliderwatch.simulate.dinkum import Header
from gliderwatch.simulate.dive import dive
from gliderwatch.simulate.flight import Point, displacement, offset
from gliderwatch.simulate.ocean import Ocean, make_ocean
from gliderwatch.simulate.scenario import DiveTruth, Mission, Scenario
from gliderwatch.simulate.surfacing import surface
from gliderwatch.simulate.telemetry import (
    CYCLE,
    SCIENCE_CYCLE,
    SCIENCE_SENSORS,
    SCIENCE_TIME,
    SENSORS,
    TIME,
    Log,
    SegmentData,
    Selection,
    everything,
    sensor_list,
)
from gliderwatch.simulate.vehicle import Glider, Yo

# ----------------------------------------
# One glider's mission, simulated with its truth. Pure given the seed of the scenario.
#
# The glider dives in a sawtooth towards its waypoints, surfaces at intervals, drifts while it
# communicates, and dives again. What it believes of all this goes into its log; the log becomes
# segments. Everything happens on the grid of the glider's cycle (4 s) since the start of the mission.

_SENDING = (60.0, 240.0)
_SCIENCE_LEAD = 5.0
"""The science computer opens its file so much before (s)."""
_PER_CYCLE = round(CYCLE / SCIENCE_CYCLE)


def simulate(scenario: Scenario) -> Mission:
    """Simulate a mission until the first surfacing after its ``days``; the last segment is at the surface.

    Raises:
        ValueError: no steady glide.
    """
    return deque(voyage(scenario), maxlen=1)[0]


def voyage(scenario: Scenario) -> Generator[Mission, tuple[Yo, ...] | None, None]:
    """The mission of `simulate` as far as it has come, each time that files were sent; at last the whole.

    The yos that are sent back are flown from the next dive on.

    Raises:
        ValueError: no steady glide.
    """
    glider = _launch(scenario)
    files, truth = _Files(glider), list[DiveTruth]()
    plan, _ = surface(glider, None)
    name, opened = files.next_name(), plan.opened
    while glider.time(glider.cycle) < scenario.start + 86400 * scenario.days:
        flown = dive(glider, name[1])
        plan, seen = surface(glider, flown)
        assert seen is not None
        truth.append(seen)
        files.close(name, opened, plan.closed)
        files.send(float(glider.rng.uniform(*_SENDING)))
        if plan.restart:
            files.restart(glider.time(plan.opened))
        if plan.own_file:
            files.close(files.next_name(), *plan.own_file)
        name, opened = files.next_name(), plan.opened
        glider.yos = (yield files.mission(tuple(truth))) or glider.yos
    files.close(name, opened, glider.cycle)
    files.send(float(glider.rng.uniform(*_SENDING)))
    yield files.mission(tuple(truth))


def _launch(scenario: Scenario) -> Glider:
    """The glider at its place at the start of the mission."""
    logs = [
        Log(
            scenario.start,
            dict.fromkeys((sensor.name for sensor in sensors), 0.0),
            step,
            clock,
            scenario.rates.clock_skew,
        )
        for sensors, step, clock in (
            (SENSORS, CYCLE, TIME),
            (SCIENCE_SENSORS, SCIENCE_CYCLE, SCIENCE_TIME),
        )
    ]
    place, origin = scenario.place, scenario.origin or scenario.place
    east, north = displacement(origin, place)
    ocean, chance = sea_of(scenario), (scenario.rng(1), scenario.rng(2))
    return Glider(scenario, ocean, *chance, logs[0], logs[1], place, place, place, east, north)


def sea_of(scenario: Scenario) -> Ocean:
    """The sea of the scenario, the same for all gliders of a fleet."""
    rng = np.random.default_rng(np.random.SeedSequence(scenario.seed, spawn_key=(0,)))
    end = scenario.start + 86400 * (scenario.days + 1) + 2 * scenario.interval
    lat = (scenario.origin or scenario.place).lat
    return make_ocean(scenario.sea, scenario.start, end, rng, lat=lat)


_Name = tuple[str, str]


@dataclass(slots=True)
class _Files:
    """The files of a mission as the glider makes them, named in the two ways of Slocums."""

    glider: Glider
    missions: int = 0
    count: int = 0
    day: str = ""
    kinds: tuple[list[SegmentData], ...] = field(default_factory=lambda: ([], [], []))
    unsent: list[tuple[int, SegmentData]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._begin(self.glider.scenario.start)

    def _begin(self, t: float) -> None:
        day = time.gmtime(t + self.glider.scenario.rates.clock_skew)
        self.day = f"{day.tm_year}-{day.tm_yday - 1}"

    def restart(self, t: float) -> None:
        """A new mission begins at ``t`` (s)."""
        self.missions, self.count = self.missions + 1, 0
        self._begin(t)

    def next_name(self) -> _Name:
        """The 8.3 and the full name of the next segment: missions and days are counted from 0."""
        scenario, number = self.glider.scenario, self.count
        self.count += 1
        short = f"{scenario.mission_number + self.missions:04d}{number:04d}"
        return short, f"{scenario.glider}-{self.day}-{self.missions}-{number}"

    def close(self, name: _Name, first: int, last: int) -> None:
        """Close the files of the segment between two cycles."""
        scenario, glider = self.glider.scenario, self.glider
        flight = [Selection(sensor_list(scenario.cadence), scenario.cadence, scenario.nth_yo)]
        science = [Selection(sensor_list(scenario.science, science=True), scenario.science, scenario.nth_yo)]
        if scenario.full_rate:
            flight.append(everything(SENSORS, CYCLE))
            science.append(everything(SCIENCE_SENSORS, SCIENCE_CYCLE))
        kinds = [("sbd", 0), ("dbd", 2)]
        self._close(glider.log, name, (first, last), flight, kinds)
        if scenario.science or scenario.full_rate:
            both = (_PER_CYCLE * first, _PER_CYCLE * last)
            self._close(glider.science, name, both, science, [("tbd", 1), ("ebd", 2)])

    def _close(
        self,
        log: Log,
        name: _Name,
        cycles: tuple[int, int],
        selections: list[Selection],
        kinds: list[tuple[str, int]],
    ) -> None:
        lead = _SCIENCE_LEAD if log.time == SCIENCE_TIME else 0.0
        end = log.start + log.step * cycles[1]
        tables = log.cut(*cycles, selections)
        for (extension, kind), selection, (values, updated) in zip(kinds, selections, tables, strict=False):
            opened = float(log.clock(cycles[0])) - lead
            header = Header(*name, extension, self.glider.scenario.mission, opened)
            segment = SegmentData(header, selection.sensors, values, updated, end, end)
            self.unsent.append((kind, segment))

    def send(self, delay: float) -> None:
        """Send what is closed and not sent yet, ``delay`` s after the last of it was closed."""
        time_sent = max(segment.closed for _, segment in self.unsent) + delay
        for kind, segment in self.unsent:
            self.kinds[kind].append(segment.sent_at(time_sent))
        self.unsent.clear()

    def mission(self, truth: tuple[DiveTruth, ...]) -> Mission:
        """All of it; science files only where they were asked for."""
        segments, science, full_rate = (tuple(kind) for kind in self.kinds)
        wanted = science if self.glider.scenario.science else ()
        return Mission(self.glider.scenario, segments, truth, wanted, full_rate)


# ----------------------------------------
# Several gliders in one sea.

_SPACING = 4000.0
_ROW = 5


def fleet(scenario: Scenario, n: int) -> list[Scenario]:
    """The scenarios of ``n`` gliders, 4 km apart in rows of five, each with waypoints of its own.

    They share the sea. The faults go to the gliders in turn: the first to the first glider, and so
    on; who gets none is healthy. One glider alone is the scenario itself.

    Raises:
        ValueError: not one glider.
    """
    if n < 1:
        raise ValueError("a fleet has at least one glider")
    if n == 1:
        return [scenario]
    return [_member(scenario, i, n) for i in range(n)]


def _member(scenario: Scenario, i: int, n: int) -> Scenario:
    east, north = np.array(_SPACING * (i % _ROW)), np.array(_SPACING * (i // _ROW))

    def moved(place: Point) -> Point:
        lat, lon = offset(place, east, north)
        return Point(float(lat), float(lon))

    return replace(
        scenario,
        glider=f"{scenario.glider}-{i + 1:02d}",
        member=i,
        place=moved(scenario.place),
        waypoints=tuple(map(moved, scenario.waypoints)),
        origin=scenario.place,
        faults=scenario.faults[i::n],
    )
