"""What people read of a rule of health: what it found, the rule, and the last readings as a small plot. Pure.

The guides' first advice is to look at the plot before believing the trigger.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gliderwatch.health.constants import ATMOSPHERE, COOL, FULL, INHG
from gliderwatch.health.rule import Finding
from gliderwatch.health.rules import RULES
from gliderwatch.incidents.notices import HealthFound, HealthIncident, HealthOver, HealthReminder
from gliderwatch.messages.formatting import clean, duration, short_place, utc
from gliderwatch.messages.phrases import map_of, name_of, next_call, still_open_ones, take_on_thread
from gliderwatch.messages.template import Page, Text, sentence, titled
from gliderwatch.model import Fix

_BLOCKS = "▁▂▃▄▅▆▇█"
_CHECKS = {
    "leak": ("the log: does it abort? A leak in the science bay leaves time, one in the pump does not",),
    "slow_leak": ("the vacuum of the last weeks, at depth alone", "where it can be recovered, and how soon"),
    "battery_end": ("what was switched on: thruster, science, calls", "move the recovery, or save power"),
    "devices": ("the listing of devices in the log (`use`)", "does the device answer to a `put ... 1`?"),
    "altitude": ("the altimeter, and the depth of the water there", "`u_alt_min_depth`, the depth of the yo"),
    "roll": ("a lost wing or a load: speed and steering",),
    "cut_calls": ("the quality of the connection; the other number",),
    "mission_time": ("end the mission and start it again before it aborts by OVERTIME",),
}
"""What to look at for some rules, beside the plot."""


class _Shown(NamedTuple):
    """How a quantity is shown: times a factor, plus an offset, with a unit and so many decimals."""

    factor: float = 1.0
    offset: float = 0.0
    unit: str = ""
    decimals: int = 2


_SHOWN = {
    "vacuum": _Shown(1 / INHG, unit=" inHg"),
    "gas_density": _Shown(-COOL / INHG, ATMOSPHERE / INHG, " inHg at 15 degrees C"),
    "gas_density_surface": _Shown(-COOL / INHG, ATMOSPHERE / INHG, " inHg at 15 degrees C"),
    "leak_voltage": _Shown(unit=" V", decimals=3),
    "leak_voltage_forward": _Shown(unit=" V", decimals=3),
    "leak_voltage_science": _Shown(unit=" V", decimals=3),
    "digifin_leak": _Shown(decimals=0),
    "battery_voltage": _Shown(unit=" V"),
    "battery_charge": _Shown(100.0, unit=" %", decimals=1),
    "charge_used": _Shown(1 / FULL, unit=" Ah", decimals=1),
    "mission_time": _Shown(1 / 86400, unit=" days", decimals=1),
    "heap_free": _Shown(1e-3, unit=" kB", decimals=0),
    "disk_free": _Shown(1e-6, unit=" MB", decimals=0),
    "fix_age": _Shown(1 / 60, unit=" min", decimals=0),
    "call_cut": _Shown(decimals=0),
    "altitude": _Shown(unit=" m", decimals=1),
    "roll_in_flight": _Shown(float(np.degrees(1)), unit=" degrees", decimals=0),
    "battery_position_error": _Shown(1e3, unit=" mm", decimals=1),
    "fin_error": _Shown(float(np.degrees(1)), unit=" degrees", decimals=1),
    "ballast_error": _Shown(1e6, unit=" cc", decimals=0),
    "oil_volume_error": _Shown(1e6, unit=" cc", decimals=0),
}


def found(glider: str, content: HealthFound) -> Text:
    """A rule found something, or something worse than before."""
    incident, name = content.incident, name_of(glider)
    finding = incident.worst if content.is_worse else incident.last
    again = "is worse now, " if content.is_worse else ""
    first = f"{name}: {again}{finding.text}, since {utc(incident.since)}."
    short = finding.text.partition(",")[0]
    checks = tuple(sentence(f"{line}.") for line in _CHECKS.get(incident.rule, ()))
    todo = ("Plot more of these values before you believe it.", *checks)
    fix = content.fix
    links = (*(() if fix is None else map_of(fix.lat, fix.lon)), *take_on_thread(glider))
    lead = (first, _where(fix), next_call(content.situation.expected))
    return titled(glider, _title(incident), f": {short}"), Page(
        lead, _numbers(incident, finding), do=todo[:3], links=links
    )


def reminder(glider: str, content: HealthReminder) -> Text:
    """It is still so: five lines."""
    incident, name = content.incident, name_of(glider)
    since = duration(3600 * content.hours)
    (label, take), *_ = take_on_thread(glider)
    last = plot(incident.last) if incident.last.last else "no values"
    how = "Less bad than at its worst" if incident.last.severity < incident.worst.severity else "Not better"
    page = Page(
        (
            f"{name}: still so after {since}, since {utc(incident.since)}: {incident.last.text}.",
            f"{how}; last values {last}.",
            _where(content.fix),
            next_call(content.situation.expected),
            f"{label}, if nobody has: {take}",
        )
    )
    return titled(glider, f"STILL {_title(incident)}", f" after {since}"), page


def over(glider: str, content: HealthOver) -> Text:
    """It is over, or data that came late have shown that it was never so."""
    incident, name = content.incident, name_of(glider)
    what = "was not so: data that came late show it" if content.is_withdrawn else "is over"
    title = _title(incident).lower()
    first = f"{name}: {title} {what}. It was reported {utc(incident.since)}: {incident.last.text}."
    short, others = "was not so" if content.is_withdrawn else "is over", still_open_ones(content.situation)
    if others:
        still = " and ".join(f"the {each} since {utc(since)}" for each, since in others)
        first += f" But not all is well: {still} is still open."
    todo = "Go on with what is still open." if others else "Nothing."
    page = Page((first, _where(content.fix)), _numbers(incident, incident.last), do=(todo,))
    if others:
        return titled(glider, f"{others[0][0]} STILL OPEN", f", {title} {short}"), page
    return titled(glider, f"ALL CLEAR: {title} {short}"), page


def _title(incident: HealthIncident) -> str:
    return incident.rule.replace("_", " ").upper()


def _where(fix: Fix | None) -> str:
    return "Place not known." if fix is None else f"Last at {short_place(fix.lat, fix.lon)}, {utc(fix.t)}."


def _numbers(incident: HealthIncident, finding: Finding) -> tuple[tuple[str, str], ...]:
    about = next((rule.about for rule in RULES if rule.name == incident.rule), "")
    return (
        *((("Last values", plot(finding)),) if finding.last else ()),
        ("Rule", f"{about} Its limits: `health.{incident.rule}` in the configuration"),
    )


def plot(finding: Finding) -> str:
    """The last readings of a finding as a line of blocks, with the first, the last, and their times."""
    shown = _SHOWN.get(finding.quantity, _Shown(decimals=0))
    values = [value * shown.factor + shown.offset for _, value in finding.last]
    first, last = (f"{v:.{shown.decimals}f}{shown.unit}" for v in (values[0], values[-1]))
    times = f"{utc(finding.last[0][0])} to {utc(finding.last[-1][0])}"
    what = finding.quantity.replace("_", " ").replace(":", " of ")
    return f"{blocks(values)} {clean(what, 60)} {first} to {last}, {times}"


def blocks(values: Sequence[float]) -> str:
    """Values as block characters: the lowest is the lowest block, the highest the highest.

    >>> blocks([0.0, 1.0, 2.0, 7.0])
    '▁▂▃█'
    >>> blocks([5.0, 5.0])
    '▄▄'
    """
    low, high = min(values), max(values)
    if high <= low:
        return _BLOCKS[3] * len(values)
    top = len(_BLOCKS) - 1
    return "".join(_BLOCKS[round((v - low) / (high - low) * top)] for v in values)
