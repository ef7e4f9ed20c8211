"""When a glider comes up next, from when it came up before. Pure.

A glider surfaces by a timer, or after so many dives, and its pilot changes that every now and then: most
intervals are like the last one, some are short by a mishap, and a few begin a new habit. So the errors have
a long tail, and their spread is a quantile, not a standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from statistics import median

from gliderwatch.forecast.constants import (
    COVERED,
    ERROR_MEMORY,
    FEW_ERRORS,
    FIRST_ERRORS,
    FIRST_WEIGHT,
    INTERVALS_KEPT,
    LATEST_AGAIN,
    LONGEST_ERROR,
    NORMAL_COVERED,
)


def usual(intervals: Sequence[float]) -> float:
    """The next interval (s) from the last ones, which are at least one; the latest counts threefold.

    After a change it goes half the way at once and all of it the next time; one odd interval that is
    followed by the usual ones leaves no trace.

    >>> usual([100.0, 101.0, 99.0, 200.0]), usual([101.0, 99.0, 200.0, 202.0])
    (150.5, 201.0)
    """
    last = list(intervals[-INTERVALS_KEPT:])
    return median([last[-1]] * LATEST_AGAIN + last)


def quantile(errors: Sequence[float], usual_ones: Sequence[float], weight: float, memory: float) -> float:
    """The value below which `COVERED` of errors are: of those made, the latest last, and of usual ones.

    Errors lose weight with age by ``memory`` a dive; ``weight`` is that of each usual one.

    >>> quantile([0.0] * 60, [1.0], 0.2, 0.9)
    0.0
    >>> quantile([0.0] * 60, [1.0], 1.0, 0.9)
    1.0
    """
    weights = _weights(len(errors), len(usual_ones), weight, memory)
    pairs = sorted(zip([*errors, *usual_ones], weights, strict=True))
    left = (1 - COVERED) * sum(weights)
    for value, share in reversed(pairs):
        left -= share
        if left < 0:
            return value
    return pairs[0][0]


@lru_cache(maxsize=256)
def _weights(errors: int, usual_ones: int, weight: float, memory: float) -> tuple[float, ...]:
    return (*(memory**age for age in reversed(range(errors))), *[weight] * usual_ones)


def error(interval: float, expected: float) -> float:
    """How far an interval (s) was from the expected one: the size of the logarithm of their ratio."""
    return min(abs(math.log(interval / expected)), LONGEST_ERROR)


def spread(errors: Sequence[float]) -> float:
    """Standard error of the next interval as a part of it, from the `error` of those before."""
    return FEW_ERRORS * quantile(errors, FIRST_ERRORS, FIRST_WEIGHT, ERROR_MEMORY) / NORMAL_COVERED
