"""What is simulated, and what is known of it: values only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from itertools import chain

import numpy as np

from gliderwatch.simulate.dinkum import Generation
from gliderwatch.simulate.faults import Fault, FaultKind, Health
from gliderwatch.simulate.flight import Airframe, Thruster
from gliderwatch.simulate.ocean import Sea
from gliderwatch.simulate.onboard import Point, Vector
from gliderwatch.simulate.sensors import CADENCE, sensor_list
from gliderwatch.simulate.telemetry import CYCLE, SCIENCE_CYCLE, SegmentData
from gliderwatch.simulate.water import Bottom, Water

__all__ = ["DiveTruth", "Fault", "FaultKind", "FixIn", "Mission", "Rates", "Scenario"]


class FixIn(Enum):
    """Which file holds the fix that ends a dive and the provisional current."""

    OWN = "own"
    NEXT = "next"


@dataclass(frozen=True, slots=True)
class Rates:
    """How often something goes wrong on the way to shore: parts of 1.

    Of the files: ``lost`` for ever; ``late`` by one to ``late_calls`` calls; ``truncated``, of which
    ``mended`` come whole with a later call; ``resent`` whole once more. ``newest_first`` of the calls
    begin with the newest file. ``growing`` files grow under an 8.3 name, of which ``renamed`` get
    their long name minutes later. Of the surfacings: ``stale_fix`` report the old fix at first;
    ``restart`` begin a new mission, and ``dac_garbage`` of those report a current that is nonsense.
    ``clock_skew`` is what the glider's clock is ahead (s).
    """

    lost: float = 0.0
    late: float = 0.0
    truncated: float = 0.0
    mended: float = 0.5
    resent: float = 0.0
    newest_first: float = 0.0
    growing: float = 0.0
    renamed: float = 1.0
    stale_fix: float = 0.0
    restart: float = 0.0
    dac_garbage: float = 1.0
    clock_skew: float = 0.0
    late_calls: int = 8

    def __post_init__(self) -> None:
        for each in fields(self):
            rate = getattr(self, each.name)
            if each.name not in {"clock_skew", "late_calls"} and not 0 <= rate <= 1:
                raise ValueError(f"{each.name} is {rate:g}: a rate is 0 to 1")
        if self.late_calls < 1 or not abs(self.clock_skew) < 86400:
            raise ValueError("late_calls is at least 1, clock_skew less than a day of 86400 s")


@dataclass(frozen=True, slots=True)
class Scenario:
    """A mission to simulate.

    ``start`` (s since 1970) and ``days``; ``place`` of launch and ``waypoints``, gone to in turn;
    ``variation`` is m_gps_mag_var (rad, west positive). ``pitch`` (rad) of each leg is normal with
    ``pitch_sigma``; ``drive`` is the volume moved from neutral (m^3), of which the
    water makes more or less by the part ``drive_sigma``, wandering within a day; ``depths`` (m) are the upper
    and lower turns, the lower one varying by ``bottom_sigma``. Where there is a ``bottom`` the glider
    turns ``altitude`` (m) above it. The glider comes up after ``interval`` (s) and talks for a time
    between ``communications`` (s), adrift with ``wind_drift`` (m/s) over the current.
    ``heading_sigma`` (rad) is the error of the heading controller, ``gps_sigma`` (m) of
    a fix, a component. ``fix_in`` and ``surface_segments`` say how files are split: with the latter
    each stay at the surface has a short file of its own. ``cadence`` (s) says which sensors are sent,
    and how often at most, ``science`` the same of the science computer (empty: no tbd), and
    ``nth_yo`` which of all these are sent on every n-th yo only. ``full_rate`` asks for dbd and ebd.
    ``member`` is the number of the glider in its fleet, whose sea has its origin at ``origin``.
    """

    seed: int = 1
    glider: str = "sim"
    mission: str = "WATCH.MI"
    mission_number: int = 1
    start: float = 1714521600.0
    days: float = 3.0
    place: Point = Point(27.5, -84.0)
    waypoints: tuple[Point, ...] = (Point(27.9, -84.4), Point(27.3, -84.5), Point(27.5, -84.0))
    variation: float = 0.08
    sea: Sea = Sea()
    airframe: Airframe = Airframe()
    pitch: float = 0.45
    pitch_sigma: float = 0.015
    drive: float = 125e-6
    drive_sigma: float = 0.0
    depths: tuple[float, float] = (4.0, 60.0)
    bottom_sigma: float = 1.0
    interval: float = 3 * 3600.0
    communications: tuple[float, float] = (300.0, 2400.0)
    wind_drift: Vector = Vector(0.04, -0.03)
    heading_sigma: float = 0.1
    gps_sigma: float = 3.0
    fix_in: FixIn = FixIn.OWN
    faults: tuple[Fault, ...] = ()
    cadence: Mapping[str, float] = field(default_factory=lambda: dict(CADENCE))
    thruster: Thruster | None = None
    bottom: Bottom | None = None
    altitude: float = 5.0
    water: Water = Water()
    science: Mapping[str, float] = field(default_factory=dict)
    nth_yo: Mapping[str, int] = field(default_factory=dict)
    surface_segments: bool = False
    full_rate: bool = False
    generation: Generation = Generation.G3
    rates: Rates = Rates()
    member: int = 0
    origin: Point | None = None

    def __post_init__(self) -> None:
        for problem in _problems(self):
            raise ValueError(problem)

    @property
    def health(self) -> Health:
        """What the faults do."""
        return Health(self.faults)

    def rng(self, *key: int) -> np.random.Generator:
        """A stream of chance of its own for each key: what is drawn for one thing moves no other."""
        member = (self.member,) if self.member else ()
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(*key, *member)))


def _problems(scenario: Scenario) -> list[str]:
    """What in a scenario cannot be, in words."""
    found = []
    if not (0 < scenario.days <= 366 and 600 <= scenario.interval <= 86400):
        found.append("days are above 0 and at most 366, the interval is 600 to 86400 s")
    if not scenario.waypoints:
        found.append("a glider needs a waypoint")
    if not 0 < scenario.depths[0] < scenario.depths[1] <= 1500:
        found.append("depths are those of the upper and the lower turn, above 0 and at most 1500 m")
    if not 60 <= scenario.communications[0] <= scenario.communications[1] <= 6 * 3600:
        found.append("communications are the shortest and the longest, 60 to 21600 s")
    if not 0.1 <= scenario.pitch <= 1.2 or not 0 <= scenario.pitch_sigma <= scenario.pitch / 8:
        found.append("pitch is 0.1 to 1.2 rad, pitch_sigma not above an eighth of it")
    if not 0 < scenario.drive <= 1e-3:
        found.append("drive is above 0, at most 1e-3 m3")
    if not 0 <= scenario.drive_sigma <= 0.15:
        found.append("drive_sigma is a part, 0 to 0.15")
    for science, cadence in ((False, scenario.cadence), (True, scenario.science)):
        try:
            sensor_list(cadence, science=science)
        except ValueError as error:
            found.append(str(error))
    for step, cadence in ((CYCLE, scenario.cadence), (SCIENCE_CYCLE, scenario.science)):
        found += [
            f"{name} every {period} s: the cycle is {step} s"
            for name, period in cadence.items()
            if period < step
        ]
    sent = set(chain(scenario.cadence, scenario.science))
    found += [
        f"{name} is not sent at all, so not on some yos either"
        for name in scenario.nth_yo
        if name not in sent
    ]
    found += [
        f"{name} on every {n}-th yo: at least every first" for name, n in scenario.nth_yo.items() if n < 1
    ]
    return found


@dataclass(frozen=True, slots=True)
class DiveTruth:
    """What really happened on one dive, between leaving the surface and being back (s).

    ``segment`` is the full name of the dive's file. ``speed`` is the mean horizontal speed through the
    water and ``believed_speed`` what the glider took for it, ``depth_rate`` the mean of its
    magnitude; ``through_water`` and ``current`` are mean velocities, relative to true north (m/s).
    ``faults`` names those active when it ended. ``end`` is the place of surfacing, ``deepest`` the
    greatest depth (m). ``reported`` is the current that the glider published at last (m/s, true
    north; None: none), ``artefacts`` names what is wrong with its data.
    """

    segment: str
    t_dive: float
    t_surface: float
    speed: float
    believed_speed: float
    through_water: Vector
    current: Vector
    faults: tuple[str, ...]
    depth_rate: float = 0.0
    deepest: float = 0.0
    end: Point = Point(0.0, 0.0)
    reported: Vector | None = None
    artefacts: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Mission:
    """A simulated mission: what was asked for, what the glider sent, and the truth.

    ``segments`` are the flight computer's (sbd), ``science`` the science computer's (tbd), and
    ``full_rate`` what is read out of the glider after its recovery (dbd and ebd).
    """

    scenario: Scenario
    segments: tuple[SegmentData, ...]
    truth: tuple[DiveTruth, ...]
    science: tuple[SegmentData, ...] = ()
    full_rate: tuple[SegmentData, ...] = ()
