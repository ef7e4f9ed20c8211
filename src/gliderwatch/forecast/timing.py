"""When a glider comes up next, from when it came up before. Pure.

A glider surfaces by a timer, or after so many dives, and its pilot changes that every now and then: most
intervals are like the last one, some are short by a mishap, and a few begin a new habit. So the errors have
a long tail, and their spread is a quantile, not a standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median

KEPT = 4
"""Intervals that count for the next."""
MEMORY = 0.92
"""What is left of the weight of an error after each further dive."""
FIRST_ERRORS = (0.01, 0.02, 0.04, 0.12, 0.6)
"""Errors (logarithm of a ratio) that stand for those of missions in general, and their weight each."""
FIRST_WEIGHT = 0.2
LONGEST_ERROR = 1.0
"""An error above this counts as this much."""
FEW = 1.1
"""By how much a quantile of few errors is too small, about."""
OFTEN = 0.95
"""Part of errors within 1.96 standard errors."""


def usual(intervals: Sequence[float]) -> float:
    """The next interval (s) from the last ones, which are at least one; the latest counts threefold.

    After a change it goes half the way at once and all of it the next time; one odd interval that is
    followed by the usual ones leaves no trace.

    >>> usual([100.0, 101.0, 99.0, 200.0]), usual([101.0, 99.0, 200.0, 202.0])
    (150.5, 201.0)
    """
    last = list(intervals[-KEPT:])
    return median([last[-1]] * 2 + last)


def quantile(errors: Sequence[float], usual_ones: Sequence[float], weight: float, memory: float) -> float:
    """The value below which `OFTEN` of errors are: of those made, the latest last, and of usual ones.

    Errors lose weight with age by ``memory`` a dive; ``weight`` is that of each usual one.

    >>> quantile([0.0] * 60, [1.0], 0.2, 0.9)
    0.0
    >>> quantile([0.0] * 60, [1.0], 1.0, 0.9)
    1.0
    """
    weights = [memory**age for age in reversed(range(len(errors)))] + [weight] * len(usual_ones)
    pairs = sorted(zip([*errors, *usual_ones], weights, strict=True))
    left = (1 - OFTEN) * sum(weights)
    for value, share in reversed(pairs):
        left -= share
        if left < 0:
            return value
    return pairs[0][0]


def error(interval: float, expected: float) -> float:
    """How far an interval (s) was from the expected one: the size of the logarithm of their ratio."""
    return min(abs(math.log(interval / expected)), LONGEST_ERROR)


def spread(errors: Sequence[float]) -> float:
    """Standard error of the next interval as a part of it, from the `error` of those before."""
    return FEW * quantile(errors, FIRST_ERRORS, FIRST_WEIGHT, MEMORY) / 1.96
