"""What is simulated, faults included, and what is known of it: values only."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from enum import Enum, StrEnum
from itertools import chain
from math import prod

import numpy as np

from gliderwatch.model import Array
from gliderwatch.simulate.dinkum import Generation
from gliderwatch.simulate.flight import Airframe, Point, Thruster, Vector
from gliderwatch.simulate.ocean import Bottom, Sea, Water
from gliderwatch.simulate.telemetry import CADENCE, CYCLE, SCIENCE_CYCLE, SegmentData, sensor_list

# ----------------------------------------
# What goes wrong with a glider, or only seems to: onset, growth and size of each fault.

STRIKE = 240.0
"""s: how long a shark holds on: from 22:32 to 22:36 (000, USF-Gansett)."""


class FaultKind(StrEnum):
    """What goes wrong; `SIZES` says what the size of each is."""

    NONE = "none"
    REMORA = "remora"
    FOULING = "fouling"
    WING_LOSS = "wing_loss"
    SHARK_STRIKE = "shark_strike"
    NET = "net"
    LEAK_OF_OIL = "leak_of_oil"
    BALLAST = "ballast"
    COMPASS = "compass"
    DAC_WRONG = "dac_wrong"
    STRONG_CURRENT = "strong_current"


@dataclass(frozen=True, slots=True)
class Size:
    """What the size of a fault may be, what it means, and how long the fault usually takes to grow (s)."""

    least: float
    most: float
    meaning: str
    ramp: float = 0.0


SIZES = {
    FaultKind.NONE: Size(0.0, np.inf, "of no meaning"),
    FaultKind.REMORA: Size(1.0, 12.0, "the factor on the drag of the hull"),
    FaultKind.FOULING: Size(1.0, 12.0, "the factor on the drag of the hull", ramp=5 * 86400.0),
    FaultKind.WING_LOSS: Size(0.0, 0.9, "the part of the horizontal speed that is lost"),
    FaultKind.SHARK_STRIKE: Size(0.0, 0.9, "the part of the horizontal speed that is lost"),
    FaultKind.NET: Size(0.0, 0.98, "the part of all motion that is lost"),
    FaultKind.LEAK_OF_OIL: Size(0.0, 0.95, "the part of the volume that is lost on the climb"),
    FaultKind.BALLAST: Size(0.0, 0.95, "the part of the pump's volume that is lost"),
    FaultKind.COMPASS: Size(-np.pi, np.pi, "what the compass shows too much, in rad"),
    FaultKind.DAC_WRONG: Size(-2.0, 2.0, "the error of the reported current in m/s"),
    FaultKind.STRONG_CURRENT: Size(0.0, 3.0, "the speed of the added current in m/s", ramp=6 * 3600.0),
}
"""Remora and fouling slow the glider through the water and in depth. A lost or bent wing takes
horizontal speed at the same depth rate, and rolls the glider. A net holds it. A leak of oil makes
climbs weak, a failing pump dives and climbs. A compass that is off misleads both the steering and
the dead reckoning. A wrong current is reported to the left of the way made through the water: no
loss of speed can do that. A strong current sets against the way to the waypoint."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault that begins at ``onset`` (s) and has its whole ``size`` (see `SIZES`) ``ramp`` seconds later.

    Raises:
        ValueError: a size that cannot be, or a negative ramp.
    """

    kind: FaultKind
    onset: float
    size: float
    ramp: float = 0.0

    def __post_init__(self) -> None:
        bounds = SIZES[self.kind]
        if not bounds.least <= self.size <= bounds.most:
            raise ValueError(
                f"{self.kind} of size {self.size:g}: it is {bounds.meaning}, {bounds.least:g} "
                f"to {bounds.most:g}"
            )
        if not 0 <= self.ramp < np.inf:
            raise ValueError(f"{self.kind} with a ramp of {self.ramp:g} s: it grows in 0 s or more")

    def part(self, t: Array) -> Array:
        """How much of it is there at times ``t`` (s): 0 to 1."""
        if self.ramp == 0:
            return np.where(t >= self.onset, 1.0, 0.0)
        return np.asarray(np.clip((t - self.onset) / self.ramp, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Health:
    """The effect of all faults of a glider; times in s."""

    faults: tuple[Fault, ...]

    def _of(self, *kinds: FaultKind) -> Iterable[Fault]:
        return (fault for fault in self.faults if fault.kind in kinds)

    def _left(self, t: Array, *kinds: FaultKind) -> Array:
        """What is left, 0 to 1, of something that faults take parts of."""
        left = np.ones_like(t)
        for fault in self._of(*kinds):
            left *= 1 - fault.size * fault.part(t)
        return left

    def _sum(self, t: Array, *kinds: FaultKind) -> Array:
        total = np.zeros_like(t)
        for fault in self._of(*kinds):
            total += fault.size * fault.part(t)
        return total

    def drag(self, t: float) -> float:
        """Factor on the drag of the hull."""
        faults = self._of(FaultKind.REMORA, FaultKind.FOULING)
        return prod(1 + (fault.size - 1) * float(fault.part(np.array(t))) for fault in faults)

    def free(self, t: float) -> float:
        """The part of all motion that a net leaves."""
        return float(self._left(np.array(t), FaultKind.NET))

    def pumped(self, t: float) -> float:
        """The part of the volume that the pump still moves."""
        return float(self._left(np.array(t), FaultKind.BALLAST))

    def oil(self, t: float) -> float:
        """The part of the oil that is still there."""
        return float(self._left(np.array(t), FaultKind.LEAK_OF_OIL))

    def gliding(self, t: Array) -> Array:
        """The part of the horizontal speed that the wings still give."""
        return self._left(t, FaultKind.WING_LOSS, FaultKind.SHARK_STRIKE)

    def compass(self, t: Array) -> Array:
        """What the compass shows too much (rad)."""
        return self._sum(t, FaultKind.COMPASS)

    def dac(self, t: float) -> float:
        """Error of the reported current (m/s), to the left of the way made through the water."""
        return float(self._sum(np.array(t), FaultKind.DAC_WRONG))

    def stream(self, t: Array) -> Array:
        """Speed of the added current (m/s)."""
        return self._sum(t, FaultKind.STRONG_CURRENT)

    def roll(self, t: Array) -> Array:
        """Roll to the side of the lost wing (rad)."""
        return self._sum(t, FaultKind.WING_LOSS, FaultKind.SHARK_STRIKE) * 0.8

    def struck(self, t: Array) -> Array:
        """1 while a shark holds on, else 0."""
        held = np.zeros_like(t)
        for fault in self._of(FaultKind.SHARK_STRIKE):
            held = np.maximum(held, np.where((t >= fault.onset) & (t < fault.onset + STRIKE), 1.0, 0.0))
        return held

    def named(self, t: float) -> tuple[str, ...]:
        """The kinds of the faults that have begun."""
        return tuple(str(fault.kind) for fault in self.faults if fault.onset <= t)


# ----------------------------------------
# What is simulated, and what is known of it: values only.

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
    ``variation`` is m_gps_mag_var at launch (rad, west positive). ``pitch`` (rad) of each leg is normal with
    ``pitch_sigma``; ``drive`` is the volume moved from neutral (m^3), of which the
    water makes more or less by the part ``drive_sigma``, wandering within a day; ``allowed`` is the part of
    the loss by the angle of attack that the glider allows for when it reckons; ``depths`` (m) are the upper
    and lower turns, the lower one varying by ``bottom_sigma``. Where there is a ``bottom`` the glider
    turns ``altitude`` (m) above it. The glider comes up after ``interval`` (s), by
    ``interval_jitter`` (s) more or less on each dive; with an ``interval_range`` (s) each glider of
    a fleet has an interval of its own. It talks for a time between ``communications`` (s), adrift
    with ``wind_drift`` (m/s) over the current.
    ``heading_sigma`` (rad) is the error of the heading controller, ``gps_sigma`` (m) of
    a fix, a component. ``fix_in`` and ``surface_segments`` say how files are split: with the latter
    each stay at the surface has a short file of its own. ``cadence`` (s) says which sensors are sent,
    and how often at most, ``science`` the same of the science computer (empty: no tbd), and
    ``nth_yo`` which of all these are sent on every n-th yo only. ``full_rate`` asks for dbd and ebd.
    ``member`` is the number of the glider in its fleet, whose sea has its origin at ``origin``; with a
    ``spread`` (m) the gliders begin, and have their waypoints, anywhere in a square of this side whose
    south-western corner is ``place``.
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
    allowed: float = 0.0
    depths: tuple[float, float] = (4.0, 60.0)
    bottom_sigma: float = 1.0
    interval: float = 3 * 3600.0
    interval_jitter: float = 0.0
    interval_range: tuple[float, float] | None = None
    spread: float = 0.0
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


def _problems_of_fleet(scenario: Scenario) -> list[str]:
    """The same of what differs between the gliders of a fleet."""
    found = []
    if not 0 <= scenario.interval_jitter <= scenario.interval / 2:
        found.append("interval_jitter is 0 s to half of the interval")
    low, high = scenario.interval_range or (600.0, 86400.0)
    if not 600 <= low <= high <= 86400:
        found.append("interval_range is the shortest and the longest, 600 to 86400 s")
    if not 0 <= scenario.spread <= 500e3:
        found.append("spread is 0 to 500000 m")
    return found


def _problems(scenario: Scenario) -> list[str]:
    """What in a scenario cannot be, in words."""
    found = _problems_of_fleet(scenario)
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
    if not 0 <= scenario.allowed <= 1:
        found.append("allowed is a part, 0 to 1")
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
