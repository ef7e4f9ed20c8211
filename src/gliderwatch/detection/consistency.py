"""Do the fixes, the compass and the current of a dive agree, and who is wrong if they do not? Pure.

Ground velocity minus current is the way that the glider believes to have made through the water: along its
heading, at any speed. What is left across the heading has no other cause than a measurement that is
wrong: the current, the fixes, or the headings (compass, declination). A current that is wrong on many dives
alike stays where it is when the glider turns; a heading that is wrong turns with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from gliderwatch.model import Array

KEPT = 8
"""Dives back over which a current is told from a compass."""
CLEARLY = 6.0
"""By how much the chi-square of one explanation has to be below that of the other."""
TURNED = math.radians(45)
"""By how much the glider must have turned before the two can differ."""


class Blame(StrEnum):
    """What is wrong."""

    CURRENT = "the current is wrong"
    COMPASS = "the compass or the declination is wrong"
    UNCLEAR = "the current or the compass is wrong, it cannot be told which"


@dataclass(frozen=True, slots=True)
class Misfit:
    """One dive: ``rest`` is ground velocity minus current (m/s, (2,): east, north), ``along`` its part
    along the heading, ``across`` that across it, left positive, with its standard error ``sigma`` (m/s);
    ``heading`` (rad, counter-clockwise from east) the direction of the mean heading vector."""

    along: float
    across: float
    sigma: float
    heading: float

    @property
    def ratio(self) -> float:
        """The part across in standard errors."""
        return self.across / self.sigma


def misfit(rest: Array, heading: Array, across: tuple[float, float]) -> Misfit:
    """The misfit of a dive: ``rest`` (m/s, (2,)) and mean ``heading`` vector ((2,)), east and north."""
    length = math.hypot(*heading)
    return Misfit(
        along=float(rest @ heading) / length,
        across=across[0],
        sigma=across[1],
        heading=math.atan2(heading[1], heading[0]),
    )


def disagrees(each: Misfit, gate: float, least: float) -> bool:
    """Whether what is across is more than ``gate`` standard errors, and more than ``least`` (m/s).

    >>> disagrees(Misfit(along=0.3, across=0.1, sigma=0.01, heading=0.0), gate=4.0, least=0.05)
    True
    """
    return abs(each.across) > max(gate * each.sigma, least)


def blame(history: tuple[Misfit, ...], gate: float, least: float) -> Blame:
    """Who is wrong on the last of some dives, oldest first; the last one `disagrees`.

    A current is wrong on single dives; a compass that was right before and is right after would be strange.
    Dives in a row that disagree are held against both explanations.
    """
    row = []
    for each in reversed(history):
        if not disagrees(each, gate, least):
            break
        row.append(each)
    if len(row) < 2:
        return Blame.CURRENT if len(history) > 1 else Blame.UNCLEAR
    angles = np.array([each.heading for each in row])
    if np.abs(np.angle(np.exp(1j * (angles[:, None] - angles)))).max() < TURNED:
        return Blame.UNCLEAR
    turned, shifted = _chi_squares(row, angles)
    if shifted + 2 < turned - CLEARLY:
        return Blame.CURRENT
    return Blame.COMPASS if turned < shifted + 2 - CLEARLY else Blame.UNCLEAR


def _chi_squares(row: list[Misfit], angles: Array) -> tuple[float, float]:
    """What is left of the misfits by one turn of all headings (a number), and by one error of all currents
    (two numbers): sums of squares in standard errors."""
    across, sigma = np.array([each.across for each in row]), np.array([each.sigma for each in row])
    along = np.array([[each.along] for each in row])
    aside = np.column_stack([-np.sin(angles), np.cos(angles)])
    return _left(along, across, sigma), _left(aside, across, sigma)


def _left(shape: Array, across: Array, sigma: Array) -> float:
    scaled = shape / sigma[:, None]
    fitted = scaled @ np.linalg.lstsq(scaled, across / sigma)[0]
    return float(np.sum((across / sigma - fitted) ** 2))
