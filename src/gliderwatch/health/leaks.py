"""Rules of water in the hull: leak detectors and vacuum. Pure.

Limits: operators' checklists, abort files, and the ranges measured on five healthy missions.
"""

from __future__ import annotations

import numpy as np

from gliderwatch.health.constants import (
    ATMOSPHERE,
    CLEAR_TREND_AFTER,
    COOL,
    DAY,
    HUBER,
    INHG,
    MOST_CORRELATION,
    OFF_LINE,
    ROBUST,
    TREND_COVERED,
    TREND_FILES,
    TREND_LEAST,
    TREND_SIGMA,
    TREND_WINDOWS,
    USUAL,
)
from gliderwatch.health.readings import History
from gliderwatch.health.rule import Finding, Limit, Limits, Rule, above, below, found, loudest, run
from gliderwatch.model import Array, Series, Severity, readonly

_WEEK = 7 * DAY


def _leak(history: History, limits: Limits) -> Finding | None:
    findings = []
    for name in LEAK.quantities:
        usual = history.earlier(name)
        tests = [(limits["critical"], Severity.CRITICAL), (limits["warning"], Severity.WARNING)]
        if len(usual) >= USUAL and (drop := limits["below_usual"]) is not None:
            tests.append((float(np.median(usual.v)) - drop, Severity.WARNING))
        for limit, severity in tests:
            low = below(history, name, limit)
            if low is not None:
                text = f"leak detector at {low.v.min():.3f} V, twice in a row below {limit:.3f} V"
                findings.append(found("leak", severity, float(low.t[0]), text, history, name))
    return loudest(findings)


def _digifin(history: History, limits: Limits) -> Finding | None:
    threshold = limits["threshold"]
    for which, severity in (("critical_readings", Severity.CRITICAL), ("warning_readings", Severity.WARNING)):
        if threshold is None or (n := limits[which]) is None:
            continue
        low = run(history, "digifin_leak", lambda v: v < threshold, int(n))
        if low is not None:
            text = f"{len(low)} leak readings of the digifin in a row below {threshold:.0f}"
            return found("digifin_leak", severity, float(low.t[0]), text, history, "digifin_leak")
    return None


def _vacuum(history: History, limits: Limits) -> Finding | None:
    low, high = limits["low"], limits["high"]
    near = limits["near_abort"] or 0.0
    abort_low, abort_high = limits["abort_low"], limits["abort_high"]
    bounds = (
        (None if abort_low is None else abort_low + near, -1, Severity.CRITICAL),
        (None if abort_high is None else abort_high - near, 1, Severity.CRITICAL),
        (low, -1, Severity.WARNING),
        (high, 1, Severity.WARNING),
    )
    for limit, side, severity in bounds:
        bad = (below if side < 0 else above)(history, "vacuum", limit)
        if bad is not None and limit is not None:
            word = "below" if side < 0 else "above"
            text = f"vacuum {bad.v[-1] / INHG:.2f} inHg, twice in a row {word} {limit / INHG:.2f} inHg"
            return found("vacuum", severity, float(bad.t[0]), text, history, "vacuum")
    return None


def _slow_leak(history: History, limits: Limits) -> Finding | None:
    """Gas density that rises: by more than `TREND_SIGMA` of its own standard error, at depth or surface."""
    least = limits["least"]
    for name in SLOW_LEAK.quantities:
        series = history.get(name)
        if name not in history.fresh or least is None:
            continue
        vacuum = Series(series.t, readonly(ATMOSPHERE - series.v * COOL))  # as if always at one temperature
        for window in TREND_WINDOWS:
            part = vacuum.between(float(vacuum.t[-1]) - window, np.inf)
            if len(part) <= TREND_FILES or part.t[-1] - part.t[0] < TREND_COVERED * window:
                continue
            slope, sigma, sure = trend(part.t, part.v)
            fewer = (trend(part.t[:n], part.v[:n]) for n in (len(part) - 1, len(part) - 2))
            falls = slope < -least and slope < -sure * sigma
            if falls and all(s < -least and s < -x * e for s, e, x in fewer):
                text = (
                    f"vacuum falls by {-slope * _WEEK / INHG:.2f} +- {sigma * _WEEK / INHG:.2f} inHg a week, "
                    "temperature accounted for"
                )
                return found("slow_leak", Severity.WARNING, float(part.t[0]), text, history, name)
    return None


def trend(t: Array, v: Array) -> tuple[float, float, float]:
    """Slope of a line through values ``v`` at times ``t`` (s), its standard error (units a second), and of
    how many of these it has to be to be as sure as `TREND_SIGMA` of a normal one, looked for in all windows.

    Least squares after what is wild is drawn in (Huber); the error is that of
    residuals that follow each other: with their correlation r there are as many independent values as
    n (1 - r) / (1 + r), and Student's t of those.
    """
    from scipy.special import ndtr, stdtrit  # noqa: PLC0415 (slow; every command loads this module)

    x = t - t.mean()
    weights = np.ones_like(v)
    for _ in range(5):
        total = weights.sum()
        mean_x, mean_v = (x * weights).sum() / total, (v * weights).sum() / total
        spread_x = float((weights * (x - mean_x) ** 2).sum())
        slope = float((weights * (x - mean_x) * (v - mean_v)).sum()) / spread_x
        rest = v - mean_v - slope * (x - mean_x)
        scale = max(ROBUST * float(np.median(np.abs(rest))), OFF_LINE / 10)
        weights = np.minimum(1.0, HUBER * scale / np.maximum(np.abs(rest), 1e-9))
    variance = max(float(np.sum(weights * rest**2)) / (len(v) - 2), (OFF_LINE / 5) ** 2)
    r = float(np.sum(rest[1:] * rest[:-1]) / max(float(np.sum(rest**2)), 1e-12))
    # that of residuals of a line is too low by about 1 / n
    r = min(max(r + 1 / len(v), 0.0), MOST_CORRELATION)
    independent = len(v) * (1 - r) / (1 + r)
    chance = float(ndtr(-TREND_SIGMA)) / len(TREND_WINDOWS)
    surely = -float(stdtrit(max(independent - 2, 1.0), chance))
    return slope, (variance / spread_x * (1 + r) / (1 - r)) ** 0.5, surely


LEAK = Rule(
    "leak",
    ("leak_voltage", "leak_voltage_forward", "leak_voltage_science"),
    _leak,
    (
        Limit("warning", 2.45, "V", 0, 5, "Two readings in a row below are a warning."),
        Limit("critical", 2.40, "V", 0, 5, "Two readings in a row below are critical."),
        Limit("below_usual", 0.03, "V", 0, 5, "So far below its own median is a warning."),
    ),
    "The leak detectors (aft, forward, science bay).",
)
DIGIFIN = Rule(
    "digifin_leak",
    ("digifin_leak",),
    _digifin,
    (
        Limit("threshold", 1018, "", 0, 1024, "Readings below count."),
        Limit("warning_readings", 3, "", 2, 100, "So many in a row are a warning."),
        Limit("critical_readings", 5, "", 2, 100, "So many in a row are critical: the glider aborts at 5."),
    ),
    "The leak reading of the digifin; single low ones are a known glitch.",
)
VACUUM = Rule(
    "vacuum",
    ("vacuum",),
    _vacuum,
    (
        Limit("low", 6.0, "inHg", 0, 30, "Two readings in a row below are a warning.", INHG),
        Limit("high", 12.5, "inHg", 0, 30, "Two readings in a row above are a warning.", INHG),
        Limit("abort_low", 4.0, "inHg", 0, 30, "The glider aborts below.", INHG),
        Limit("abort_high", 12.0, "inHg", 0, 30, "The glider aborts above.", INHG),
        Limit("near_abort", 0.5, "inHg", 0, 30, "So near to one of these is critical.", INHG),
    ),
    "The vacuum in the hull.",
)
SLOW_LEAK = Rule(
    "slow_leak",
    ("gas_density", "gas_density_surface"),
    _slow_leak,
    (
        Limit(
            "least",
            TREND_LEAST * _WEEK / INHG,
            "inHg/week",
            0.01,
            10,
            "A fall of the vacuum that is slower is not told; it must also be 3 of its standard errors.",
            INHG / _WEEK,
        ),
    ),
    "The trend of the vacuum, by the density of the gas in the hull, at depth and at the surface apart.",
    clear_after=CLEAR_TREND_AFTER,
)

RULES = (LEAK, DIGIFIN, VACUUM, SLOW_LEAK)
"""In the order in which they are shown."""
