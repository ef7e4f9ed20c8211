"""Rules of how the glider lies in the water and moves its parts. Pure.

What is usual is learnt from the mission's own files: no limit fits all gliders (measured: the roll of one
healthy mission is 0.1 to 0.67 rad).
"""

from __future__ import annotations

import numpy as np

from gliderwatch.health.constants import BEYOND, MOVED, USUAL_FILES
from gliderwatch.health.readings import COMMANDED, History
from gliderwatch.health.rule import Finding, Limit, Limits, Rule, below, found, loudest, spread
from gliderwatch.model import Array, Severity

_DEGREE = float(np.radians(1))


def _altitude(history: History, limits: Limits) -> Finding | None:
    least, factor = limits["minimum"], limits["factor"]
    if least is None or factor is None:
        return None
    low = below(history, "altitude", factor * least)
    if low is None:
        return None
    limit = f"{factor:g} x the minimum of {least:g} m"
    text = f"{low.v.min():.1f} m above the bottom, at two turns in a row below {limit}"
    return found("altitude", Severity.WARNING, float(low.t[0]), text, history, "altitude")


def _roll(history: History, limits: Limits) -> Finding | None:
    step = limits["step"]
    return (
        None if step is None else _step(history, "roll", "roll_in_flight", "roll", np.degrees(1), "deg", step)
    )


def _motors(history: History, limits: Limits) -> Finding | None:
    beyond = limits["beyond"]
    if beyond is None:
        return None
    scales = {"battery_position": (1e3, "mm"), "fin": (float(np.degrees(1)), "deg")}
    findings = []
    for name in COMMANDED:
        scale, unit = scales.get(name, (1e6, "cc"))
        one = _step(
            history,
            "motors",
            f"{name}_error",
            f"{name.replace('_', ' ')} measured less commanded",
            scale,
            unit,
            MOVED[name],
            beyond,
        )
        findings += [] if one is None else [one]
    return loudest(findings)


def _step(
    history: History,
    rule: str,
    quantity: str,
    what: str,
    scale: float,
    unit: str,
    least: float,
    beyond: float = BEYOND,
) -> Finding | None:
    """A value that is twice in a row beyond the usual ones of the files before by ``least`` (SI) or more, or
    was at a time before and has been so ever since."""
    series = history.get(quantity)
    if quantity not in history.fresh or len(series) < USUAL_FILES + 2:
        return None
    for n in _row_lengths(series.v, least):
        middle, sigma = spread(series.v[:-n], least / beyond)
        limit = max(beyond * sigma, least)
        off = series.v[-n:] - middle
        if (off > limit).all() or (off < -limit).all():
            text = (
                f"{what} {series.v[-1] * scale:.1f} {unit}, twice in a row {abs(off[-1]) * scale:.1f} off "
                f"the usual {middle * scale:.1f}"
            )
            return found(rule, Severity.WARNING, float(series.t[-n]), text, history, quantity)
    return None


def _row_lengths(values: Array, least: float) -> list[int]:
    """How many of the last values, two and more, may be off by ``least`` from those before them, longest row
    first: all of them are beyond the lowest, or below the highest, of these."""
    ends = values[::-1]
    lowest, highest = np.minimum.accumulate(values), np.maximum.accumulate(values)
    n = np.arange(2, len(values) - USUAL_FILES + 1)
    head = len(values) - n - 1
    risen = np.minimum.accumulate(ends)[n - 1] - lowest[head] > least
    fallen = highest[head] - np.maximum.accumulate(ends)[n - 1] > least
    return [int(each) for each in n[risen | fallen][::-1]]


ALTITUDE = Rule(
    "altitude",
    ("altitude",),
    _altitude,
    (
        Limit("minimum", None, "m", 0.1, 1000, "Below where it is meant to turn; null: the rule is off."),
        Limit("factor", 1.5, "", 1, 100, "Two turns in a row below so many times that are a warning."),
    ),
    "The height above the bottom where it turns.",
)
ROLL = Rule(
    "roll",
    ("roll_in_flight",),
    _roll,
    (Limit("step", 15, "degree", 1, 180, "Two dives in a row so far off are a warning.", _DEGREE),),
    "A step of the roll against the mission's own: a lost wing, a load.",
)
MOTORS = Rule(
    "motors",
    tuple(f"{name}_error" for name in COMMANDED),
    _motors,
    (
        Limit(
            "beyond",
            BEYOND,
            "",
            2,
            100,
            "Robust standard deviations of the usual difference, twice in a row.",
        ),
    ),
    "Ballast, oil, battery position and fin: measured against commanded.",
)

RULES = (ALTITUDE, ROLL, MOTORS)
"""In the order in which they are shown."""
