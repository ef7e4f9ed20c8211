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
    underway = Underway(scenario)
    while underway.time < scenario.start + 86400 * scenario.days:
        underway.fly()
        underway.fly_yos((yield underway.so_far()) or ())
    yield underway.mission()


class Underway:
    """A mission that goes on: one dive with the surfacing after it at a time."""

    def __init__(self, scenario: Scenario) -> None:
        self._glider = _launch(scenario)
        self._files, self._truth, self._handed_over = _Files(self._glider), list[DiveTruth](), [0, 0, 0]
        plan, _ = surface(self._glider, None)
        self._name, self._opened = self._files.next_name(), plan.opened

    @property
    def glider(self) -> str:
        """Its name."""
        return self._glider.scenario.glider

    @property
    def time(self) -> float:
        """When its last stay at the surface ended (s)."""
        return self._glider.time(self._glider.cycle)

    def fly(self) -> None:
        """Dive, come up, and send. Raises ValueError where there is no steady glide."""
        files, glider = self._files, self._glider
        flown = dive(glider, self._name[1])
        plan, seen = surface(glider, flown)
        assert seen is not None
        self._truth.append(seen)
        files.close(self._name, self._opened, plan.closed)
        files.send(float(glider.rng.uniform(*_SENDING)))
        if plan.restart:
            files.restart(glider.time(plan.opened))
        if plan.own_file:
            files.close(files.next_name(), *plan.own_file)
        self._name, self._opened = files.next_name(), plan.opened

    def head_for(self, waypoint: Point) -> None:
        """Go to a waypoint from the next dive on, and on to it once it is reached."""
        self._glider.scenario = replace(self._glider.scenario, waypoints=(waypoint,))
        self._glider.waypoint = 0

    def fly_yos(self, yos: tuple[Yo, ...]) -> None:
        """Fly these yos from the next dive on; none: those of before."""
        self._glider.yos = yos or self._glider.yos

    def so_far(self) -> Mission:
        """What it has sent."""
        return self._files.mission(tuple(self._truth))

    def mission(self) -> Mission:
        """All of it, as if it ended here: the last segment is at the surface."""
        self._files.close(self._name, self._opened, self._glider.cycle)
        self._files.send(float(self._glider.rng.uniform(*_SENDING)))
        return self.so_far()

    def news(self) -> Mission:
        """What it sent since this was asked last, as a mission of its own."""
        kinds = [tuple(kind[n:]) for kind, n in zip(self._files.kinds, self._handed_over, strict=True)]
        self._handed_over = [len(kind) for kind in self._files.kinds]
        science = kinds[1] if self._glider.scenario.science else ()
        return Mission(self._glider.scenario, kinds[0], (), science, kinds[2])


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
_WAYPOINTS = 40


def fleet(scenario: Scenario, n: int) -> list[Scenario]:
    """The scenarios of ``n`` gliders, 4 km apart in rows of five, each with waypoints of its own.

    With a `spread` they are anywhere in its square instead. They share the sea. The faults go to the gliders
    in turn: the first to the first glider, and so on; who gets none is healthy. One glider alone is the
    scenario itself, but for such a place.

    Raises:
        ValueError: not one glider.
    """
    if n < 1:
        raise ValueError("a fleet has at least one glider")
    if n == 1 and not scenario.spread:
        return [scenario]
    member = _member_anywhere if scenario.spread else _member
    return [_with_interval(member(scenario, i, n)) for i in range(n)]


def _with_interval(scenario: Scenario) -> Scenario:
    """A glider with an interval of its own, where they are drawn."""
    if scenario.interval_range is None:
        return scenario
    return replace(scenario, interval=float(scenario.rng(6).uniform(*scenario.interval_range)))


def _member_anywhere(scenario: Scenario, i: int, n: int) -> Scenario:
    """A glider that begins, and has its waypoints, anywhere in the square of the fleet."""
    member = replace(scenario, glider=f"{scenario.glider}-{i + 1:02d}", member=i, origin=scenario.place)
    rng = member.rng(10)

    def anywhere() -> Point:
        east, north = rng.uniform(0.05, 0.95, (2, 1)) * scenario.spread
        lat, lon = offset(scenario.place, east, north)
        return Point(float(lat[0]), float(lon[0]))

    waypoints = tuple(anywhere() for _ in range(_WAYPOINTS))
    return replace(member, place=anywhere(), waypoints=waypoints, faults=scenario.faults[i::n])


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
