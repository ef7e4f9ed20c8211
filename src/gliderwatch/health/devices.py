"""Rules of the glider's devices and computers, and of its calls. Pure.

Limits: operators' guide to aborts (20 warnings become an error), abort files, checklists.
"""

from __future__ import annotations

import numpy as np

from gliderwatch.health.constants import CRITICAL_DEVICES, DAY, LAST_CALLS
from gliderwatch.health.readings import History
from gliderwatch.health.rule import Finding, Limit, Limits, Rule, above, below, found, loudest
from gliderwatch.model import Severity

_MEGA = 1e6
_KILO = 1e3


def _devices(history: History, limits: Limits) -> Finding | None:
    findings = []
    for name in sorted(history.fresh):
        if not name.startswith("errors:") or (t := _growth(history, name, 1)) is None:
            continue
        device = name.removeprefix("errors:")
        severity = Severity.CRITICAL if device in CRITICAL_DEVICES else Severity.WARNING
        what = "a device" if device == "all" else f"device {device}"
        findings.append(found("devices", severity, t, f"a new error of {what}", history, name))
    most, burst = limits["warnings"], limits["oddities"]
    many = above(history, "warnings:all", most)
    if many is not None and most is not None:
        text = f"{many.v[-1]:.0f} warnings of devices in one segment, more than {most:.0f}"
        findings.append(found("devices", Severity.WARNING, float(many.t[0]), text, history, "warnings:all"))
    if burst is not None and (t := _growth(history, "oddities:all", burst)) is not None:
        text = f"more than {burst:.0f} oddities of devices at once"
        findings.append(found("devices", Severity.WARNING, t, text, history, "oddities:all"))
    return loudest(findings)


def _growth(history: History, name: str, least: float) -> float | None:
    """When (s) a count grew by so much at once, as two readings in a row show, of which one is fresh.

    One that falls was reset; a garbled digit is in one reading alone.
    """
    series, since = history.get(name), history.fresh_from(name)
    if len(series) < 3:
        return None
    before, first, second = series.v[:-2], series.v[1:-1], series.v[2:]
    grew = (first - before >= least) & (second - before >= least) & (series.t[2:] >= since)
    at = np.flatnonzero(grew)
    return float(series.t[1 + at[-1]]) if len(at) else None


def _mission_time(history: History, limits: Limits) -> Finding | None:
    for which, severity in (("critical", Severity.CRITICAL), ("warning", Severity.WARNING)):
        limit = limits[which]
        long = above(history, "mission_time", limit)
        if long is not None and limit is not None:
            days = f"{long.v[-1] / DAY:.1f} days, more than {limit / DAY:.0f}"
            text = f"the mission runs for {days}; it may abort at 45"
            return found("mission_time", severity, float(long.t[0]), text, history, "mission_time")
    return None


def _fix(history: History, limits: Limits) -> Finding | None:
    limit = limits["minutes"]
    old = above(history, "fix_age", limit)
    if old is None or limit is None:
        return None
    text = f"the fix is {old.v[-1] / 60:.0f} min old at a call, twice in a row above {limit / 60:.0f} min"
    return found("fix", Severity.WARNING, float(old.t[0]), text, history, "fix_age")


def _memory(history: History, limits: Limits) -> Finding | None:
    findings = []
    for name, which, severity in (
        ("heap_free", "heap_critical", Severity.CRITICAL),
        ("heap_free", "heap_warning", Severity.WARNING),
        ("disk_free", "disk", Severity.WARNING),
    ):
        limit = limits[which]
        low = below(history, name, limit)
        if low is not None and limit is not None:
            scale, unit = (_KILO, "kB") if name == "heap_free" else (_MEGA, "MB")
            what = "memory" if name == "heap_free" else "disk"
            text = f"{low.v[-1] / scale:.0f} {unit} of {what} free, twice in a row below {limit / scale:.0f}"
            findings.append(found("memory", severity, float(low.t[0]), text, history, name))
    return loudest(findings)


def _calls(history: History, limits: Limits) -> Finding | None:
    cut, most = history.earlier("call_cut"), limits["part"]  # the last call may go on
    if len(cut) < LAST_CALLS or most is None:
        return None
    part = float(np.mean(cut.v[-LAST_CALLS:]))
    if part <= most:
        return None
    text = f"{100 * part:.0f} % of the last {LAST_CALLS} calls were cut in the transfer of a file"
    return found("cut_calls", Severity.WARNING, float(cut.t[-LAST_CALLS]), text, history, "call_cut")


DEVICES = Rule(
    "devices",
    ("errors:", "warnings:all", "oddities:all"),
    _devices,
    (
        Limit("warnings", 10, "", 0, 1e6, "More warnings of devices in one segment are a warning."),
        Limit("oddities", 1000, "", 1, 1e9, "So many more oddities at once are a warning."),
    ),
    "Errors of devices, in the logs of calls: a new one is a warning, in one that flight needs critical.",
)
MISSION_TIME = Rule(
    "mission_time",
    ("mission_time",),
    _mission_time,
    (
        Limit("warning", 40, "days", 0, 1000, "More is a warning: OVERTIME is usual at 45.", DAY),
        Limit("critical", 44, "days", 0, 1000, "More is critical.", DAY),
    ),
    "How long the mission runs.",
)
FIX = Rule(
    "fix",
    ("fix_age",),
    _fix,
    (Limit("minutes", 30, "min", 1, 10000, "An older one at two calls in a row is a warning.", 60),),
    "The age of the satellite fix at a call.",
)
MEMORY = Rule(
    "memory",
    ("heap_free", "disk_free"),
    _memory,
    (
        Limit("heap_warning", 60, "kB", 0, 1e6, "Less free, twice in a row, is a warning.", _KILO),
        Limit("heap_critical", 50, "kB", 0, 1e6, "Less free, twice in a row, is critical.", _KILO),
        Limit("disk", 100, "MB", 0, 1e6, "Less free, twice in a row, is a warning.", _MEGA),
    ),
    "Memory and disk of the glider's computer.",
)
CUT_CALLS = Rule(
    "cut_calls",
    ("call_cut",),
    _calls,
    (Limit("part", 50, "%", 0, 100, "More of the last ten calls cut is a warning.", 0.01),),
    "Calls that end while a file is sent.",
)

RULES = (DEVICES, MISSION_TIME, MEMORY, FIX, CUT_CALLS)
"""In the order in which they are shown."""
