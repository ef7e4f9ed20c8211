"""Rules of the battery: volts, charge, and when it ends. Pure.

Limits: a public tool for the end date (20 and 15 %), abort files (10 V, 10 %). Days are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from gliderwatch.health.constants import BLOCK, CONFIDENCE, DAY, FIT, FULL, LEAST_BLOCKS, THRUSTER
from gliderwatch.health.readings import History
from gliderwatch.health.rule import Finding, Limit, Limits, Rule, below, found
from gliderwatch.model import Array, Series, Severity, readonly


@dataclass(frozen=True, slots=True)
class End:
    """When a battery ends: seconds from its last reading at ``t`` (s), the likeliest (``left``), the earliest
    and the latest of a 95 % interval, by the readings of ``quantity``; ``thruster`` is the part of the last
    days with the thruster, ``idle`` the seconds left without it (None: the same)."""

    t: float
    left: float
    earliest: float
    latest: float
    quantity: str
    thruster: float = 0.0
    idle: float | None = None


def _volts(history: History, limits: Limits) -> Finding | None:
    for which, severity in (("critical", Severity.CRITICAL), ("warning", Severity.WARNING)):
        limit = limits[which]
        low = below(history, "battery_voltage", limit)
        if low is not None:
            text = f"battery at {low.v[-1]:.2f} V, twice in a row below {limit:.2f} V"
            return found("battery_voltage", severity, float(low.t[0]), text, history, "battery_voltage")
    return None


def _charge(history: History, limits: Limits) -> Finding | None:
    for which, severity in (("critical", Severity.CRITICAL), ("warning", Severity.WARNING)):
        limit = limits[which]
        low = below(history, "battery_charge", limit)
        if low is not None:
            text = f"charge {100 * low.v[-1]:.1f} %, twice in a row below {100 * (limit or 0):.0f} %"
            return found("battery_charge", severity, float(low.t[0]), text, history, "battery_charge")
    return None


def _battery_end(history: History, limits: Limits) -> Finding | None:
    end = battery_end(history, limits)
    if end is None:
        return None
    days = f"{end.left / DAY:.1f} days ({end.earliest / DAY:.1f} to {_days(end.latest)})"
    text = f"battery ends in {days} at the use of the last days"
    if end.idle is not None:
        text += f", without the thruster in {end.idle / DAY:.1f}"
    recovery, severity = limits["recovery"], None
    if recovery is not None and end.t + end.earliest < recovery:
        text += f"; the planned recovery is in {(recovery - end.t) / DAY:.1f} days"
        severity = Severity.CRITICAL if end.t + end.left < recovery else Severity.WARNING
    for which, level in (("critical_days", Severity.CRITICAL), ("warning_days", Severity.WARNING)):
        limit = limits[which]
        # where a recovery is planned it says what is soon enough, but for the last days
        if limit is not None and end.left < limit and (recovery is None or level is Severity.CRITICAL):
            severity = level if severity is None else max(severity, level)
    if severity is None:
        return None
    return found("battery_end", severity, end.t, text, history, end.quantity)


def _days(seconds: float) -> str:
    return "never" if seconds == inf else f"{seconds / DAY:.1f}"


def battery_end(history: History, limits: Limits) -> End | None:
    """When the battery ends, by charge, coulombs or volts, whichever comes first here and can be had.

    None where none of them tells: too few days, or it does not fall.
    """
    reserve = limits["reserve"] or 0.0
    charge, used = history.get("battery_charge"), without_resets(history.get("charge_used"))
    ways: list[tuple[str, Series, float]] = [("battery_charge", charge, reserve)]
    if (capacity := limits["capacity"]) is not None:
        left = Series(used.t, readonly(capacity - used.v))
        ways.append(("charge_used", left, reserve * capacity))
    if (volts := limits["volts"]) is not None:
        ways.append(("battery_voltage", history.get("battery_voltage"), volts))
    thruster = history.get("thruster_use")
    for name, series, threshold in ways:
        end = _fit(name, series, threshold, thruster)
        if end is not None:
            return end
    return None


def without_resets(used: Series) -> Series:
    """A counter of what is used, which goes on from where it was after a reset.

    A fall is a reset: at sea nobody puts a fresh battery in.
    """
    if len(used) < 2:
        return used
    steps = np.diff(used.v)
    steps = np.where(steps < 0, np.maximum(used.v[1:], 0.0) * (used.v[1:] < 0.5 * used.v[:-1]), steps)
    return Series(used.t, readonly(used.v[0] + np.concatenate([[0.0], np.cumsum(steps)])))


def _fit(name: str, series: Series, threshold: float, thruster: Series) -> End | None:
    """The end by the use in blocks of half a day of the last days, those with the thruster apart.

    Use in blocks of one kind is normal about its mean; the coming days have the part of the thruster that the
    last had. The interval has both the error of the means and the variation of days to come.
    """
    if len(series) < 2 * LEAST_BLOCKS:
        return None
    part = series.between(float(series.t[-1]) - FIT, inf)
    times, rates = _blocks(part)
    if len(rates) < LEAST_BLOCKS:
        return None
    with_thruster = _is_with(times, thruster)
    share = float(np.mean(with_thruster))
    mean = variance = 0.0
    idle: float | None = None
    for kind, weight in ((with_thruster, share), (~with_thruster, 1 - share)):
        if not kind.any():
            continue
        rate, sigma = _mean(rates[kind])
        mean += weight * rate
        variance += weight * sigma**2 * (weight / kind.sum() + 1 / max(len(rates), 1))
        idle = rate if weight < 1 and kind is not with_thruster else idle
    left = float(np.median(part.v[-3:])) - threshold
    if mean <= 0:
        return None
    from scipy.special import stdtrit  # noqa: PLC0415 (slow; every command loads this module)

    reach = float(stdtrit(len(rates) - 1, CONFIDENCE)) * sqrt(variance)
    left = max(left, 0.0)
    return End(
        float(part.t[-1]),
        left / mean,
        left / (mean + reach),
        left / (mean - reach) if mean > reach else inf,
        name,
        share,
        left / idle if idle is not None and idle > 0 else None,
    )


def _blocks(series: Series) -> tuple[Array, Array]:
    """Middle (s) and use (units a second) of each block of half a day that readings bound."""
    n = int((series.t[-1] - series.t[0]) / BLOCK)
    if n < 1:
        return np.empty(0), np.empty(0)
    edges = series.t[-1] - BLOCK * np.arange(n, -1, -1)
    values = np.interp(edges, series.t, series.v)
    return (edges[1:] + edges[:-1]) / 2, -np.diff(values) / BLOCK


def _is_with(times: Array, thruster: Series) -> NDArray[np.bool_]:
    """At which blocks the thruster was used."""
    if not len(thruster):
        return np.zeros(len(times), dtype=np.bool_)
    use = [thruster.between(t - BLOCK / 2, t + BLOCK / 2).v for t in times.tolist()]
    return np.array([len(u) > 0 and float(np.mean(u)) > THRUSTER for u in use], dtype=np.bool_)


def _mean(rates: Array) -> tuple[float, float]:
    """Mean and standard deviation of rates, without those that are none: a jump of the gauge is no use."""
    middle = float(np.median(rates))
    kept = rates[np.abs(rates - middle) <= max(3 * abs(middle), 1e-12)]
    kept = kept if len(kept) else rates
    return float(np.mean(kept)), float(np.std(kept, ddof=1)) if len(kept) > 1 else abs(middle) / 2


VOLTS = Rule(
    "battery_voltage",
    ("battery_voltage",),
    _volts,
    (
        Limit("warning", 11.0, "V", 0, 60, "Two readings in a row below are a warning."),
        Limit("critical", 10.5, "V", 0, 60, "Two readings in a row below are critical; gliders abort at 10."),
    ),
    "The voltage of the battery. What is low depends on its chemistry: set it, the usual limits are the "
    "abort's alone.",
)
CHARGE = Rule(
    "battery_charge",
    ("battery_charge",),
    _charge,
    (
        Limit("warning", 20, "%", 0, 100, "Two readings in a row below are a warning.", 0.01),
        Limit("critical", 15, "%", 0, 100, "Two readings in a row below are critical; aborts at 10.", 0.01),
    ),
    "The charge of a lithium battery, as the glider reckons it.",
)
END = Rule(
    "battery_end",
    ("battery_charge", "charge_used", "battery_voltage"),
    _battery_end,
    (
        Limit(
            "warning_days", 14, "days", 0, 1000, "Less left is a warning, where no recovery is planned.", DAY
        ),
        Limit("critical_days", 7, "days", 0, 1000, "Less left is critical.", DAY),
        Limit("reserve", 10, "%", 0, 100, "The battery ends at this part of its charge.", 0.01),
        Limit("capacity", None, "Ah", 1, 10000, "Of a full battery; null: coulombs are not used.", FULL),
        Limit(
            "volts", None, "V", 0, 60, "Voltage at its end; null: as `battery` says, 11 where it is alkaline."
        ),
    ),
    "When the battery ends, by the use of the last days; held against the planned `recovery`.",
)

RULES = (VOLTS, CHARGE, END)
"""In the order in which they are shown."""
