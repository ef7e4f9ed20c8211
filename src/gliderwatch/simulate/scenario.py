"""What is simulated, and what is known of it: values only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, StrEnum

from gliderwatch.simulate.flight import Airframe
from gliderwatch.simulate.ocean import Sea
from gliderwatch.simulate.onboard import Point, Vector
from gliderwatch.simulate.telemetry import CADENCE, SegmentData


class FaultKind(StrEnum):
    """What goes wrong.

    ``remora``: drag of the hull times ``size`` (at least 1): slower through the water and in depth.
    ``wing_loss``: the part ``size`` (0 to 1) of the horizontal speed is lost at the same depth rate.
    ``dac_wrong``: the reported current is off by ``size`` m/s, to the left of the way made through the
    water: a slow glider cannot cause that.
    ``none``: nothing.
    """

    NONE = "none"
    REMORA = "remora"
    WING_LOSS = "wing_loss"
    DAC_WRONG = "dac_wrong"


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a size (see `FaultKind`) from a time on (s).

    Raises:
        ValueError: a size that cannot be.
    """

    kind: FaultKind
    onset: float
    size: float

    def __post_init__(self) -> None:
        if self.kind is FaultKind.REMORA and self.size < 1:
            raise ValueError(f"remora of size {self.size}: it is a factor on drag, at least 1")
        if self.kind is FaultKind.WING_LOSS and not 0 <= self.size < 1:
            raise ValueError(f"wing_loss of size {self.size}: it is a part of the speed, 0 to 1")


class FixIn(Enum):
    """Which file holds the fix that ends a dive and the provisional current."""

    OWN = "own"
    NEXT = "next"


@dataclass(frozen=True, slots=True)
class Scenario:
    """A mission to simulate.

    ``start`` (s since 1970) and ``days``; ``place`` of launch and ``waypoints``, gone to in turn;
    ``variation`` is m_gps_mag_var (rad, west positive). ``pitch`` (rad) of each leg is normal with
    ``pitch_sigma``; ``drive`` is the volume moved from neutral (m^3); ``depths`` (m) are the upper
    and lower turns, the lower one varying by ``bottom_sigma``. The glider comes up after ``interval``
    (s) and talks for a time between ``communications`` (s), adrift with ``wind_drift`` (m/s) over the
    current. ``heading_sigma`` (rad) is the error of the heading controller, ``gps_sigma`` (m) of
    a fix, a component. ``cadence`` (s) says which sensors are sent, and how often at most.
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

    def sizes(self, kind: FaultKind, t: float) -> list[float]:
        """Sizes of the faults of a kind that are there at time ``t`` (s)."""
        return [fault.size for fault in self.faults if fault.kind is kind and fault.onset <= t]


@dataclass(frozen=True, slots=True)
class DiveTruth:
    """What really happened on one dive, between leaving the surface and being back (s).

    ``segment`` is the full name of the dive's file. ``speed`` is the mean horizontal speed through the
    water and ``believed_speed`` what the glider took for it; ``through_water`` and ``current`` are
    mean velocities, relative to true north (m/s). ``faults`` names those active when it ended.
    """

    segment: str
    t_dive: float
    t_surface: float
    speed: float
    believed_speed: float
    through_water: Vector
    current: Vector
    faults: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Mission:
    """A simulated mission: what was asked for, what the glider sent, and the truth."""

    scenario: Scenario
    segments: tuple[SegmentData, ...]
    truth: tuple[DiveTruth, ...]
