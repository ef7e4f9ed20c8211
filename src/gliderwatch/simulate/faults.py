"""What goes wrong with a glider, or only seems to: onset, growth and size of each fault. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from math import prod

import numpy as np

from gliderwatch.model import Array

STRIKE = 40.0
"""How long a shark holds on (s)."""


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
        known = SIZES[self.kind]
        if not known.least <= self.size <= known.most:
            raise ValueError(
                f"{self.kind} of size {self.size:g}: it is {known.meaning}, {known.least:g} to {known.most:g}"
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
