"""Tidal constituents, and what a surfacing interval hides of them. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum

from gliderwatch.sea.constants import FAINT, NEAR, OFTEN

HOUR = 3600.0


class Constituent(StrEnum):
    """A tidal constituent of the currents.

    >>> round(Constituent.M2.period / 3600, 4)
    12.4206
    """

    M2 = "M2"
    S2 = "S2"
    N2 = "N2"
    K1 = "K1"
    O1 = "O1"
    M4 = "M4"

    @property
    def omega(self) -> float:
        """Angular speed (rad/s)."""
        return math.radians(DEGREES_AN_HOUR[self]) / HOUR

    @property
    def period(self) -> float:
        """Period (s)."""
        return 360.0 / DEGREES_AN_HOUR[self] * HOUR


DEGREES_AN_HOUR = {
    Constituent.M2: 28.9841042,
    Constituent.S2: 30.0,
    Constituent.N2: 28.4397295,
    Constituent.K1: 15.0410686,
    Constituent.O1: 13.9430356,
    Constituent.M4: 57.9682084,
}


def smoothing(omega: float, duration: float) -> float:
    """Part of an oscillation at ``omega`` (rad/s) left in its mean over ``duration`` s: sin(x)/x.

    >>> round(smoothing(Constituent.M2.omega, 3 * HOUR), 4)
    0.9068
    """
    half = omega * duration / 2
    return math.sin(half) / half if half else 1.0


def aliasing(constituents: Sequence[Constituent], interval: float, duration: float) -> tuple[str, ...]:
    """What a pilot should know of tides that a surfacing ``interval`` (s) hides, dives lasting ``duration``.

    A tide is seen once an interval. At a whole number of its half periods the same phase is seen again and
    again, and the part a right angle away never; above half a period it passes for a slower current.

    >>> aliasing([Constituent.M2], 3 * HOUR, 3 * HOUR)
    ()
    >>> aliasing([Constituent.M2], 6.2 * HOUR, 6 * HOUR)[0].partition(":")[0]
    'surfacing every 6.2 h shows only one half of the M2 tide'
    """
    kinds = {each: _hidden(each, interval, duration) for each in constituents}
    every, notes = f"surfacing every {interval / HOUR:.1f} h", []
    for kind in dict.fromkeys(kind for kind in kinds.values() if kind):
        some = [each for each in constituents if kinds[each] == kind]
        names = " and ".join(", ".join(some).rsplit(", ", 1))
        often = OFTEN * min(each.period for each in some) / HOUR
        notes.append(
            f"{every} {kind.format(names)}: to tell it, surface every {often:.1f} h or more often"
            + ("" if kind is _AWAY else ", or at uneven intervals")
        )
    return tuple(notes)


_AWAY = "averages the {} tide away"
_HALF = "shows only one half of the {} tide"
_SLOW = "makes the {} tide look like a slower current"


def _hidden(each: Constituent, interval: float, duration: float) -> str:
    """How an interval (s) hides a tide; empty: not at all."""
    if abs(smoothing(each.omega, duration)) < FAINT:
        return _AWAY
    halves = interval / (each.period / 2)
    if round(halves) and abs(halves - round(halves)) < NEAR:
        return _HALF
    return _SLOW if halves > 1 else ""
