"""Random gliders with a fault, what is told of them, and where messages contradict each other."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gliderwatch.model import Alert, Kind
from gliderwatch.params import GliderParams
from gliderwatch.service import transaction
from gliderwatch.service.routing import NOBODY
from gliderwatch.simulate.delivery import FileForm, Names, arrivals, deliver, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import SIZES, Fault, FaultKind, Scenario
from gliderwatch.simulate.seas import SEAS, sea_mission, with_fault
from gliderwatch.slocum.decode import decode
from gliderwatch.store.database import MEMORY
from gliderwatch.store.state_file import File, Status, Store

HOUR, DAY = 3600.0, 86400.0
AGAIN = 24.0
"""Hours after the end of an incident in which another of its kind means that the end was not true."""
DRAWN = {
    FaultKind.REMORA: (2.0, 8.0),
    FaultKind.FOULING: (2.0, 6.0),
    FaultKind.WING_LOSS: (0.2, 0.6),
    FaultKind.SHARK_STRIKE: (0.2, 0.6),
    FaultKind.NET: (0.4, 0.9),
    FaultKind.LEAK_OF_OIL: (0.3, 0.8),
    FaultKind.BALLAST: (0.3, 0.8),
    FaultKind.COMPASS: (-1.0, 1.0),
    FaultKind.DAC_WRONG: (-0.4, 0.4),
}
"""Faults, and the sizes that are drawn: from ones that can just be seen to gross ones."""
TROUBLE = (Kind.ANOMALY, Kind.FALSE_ALARM)
_OF_NOBODY = (Kind.SURFACING, Kind.OPERATOR)


@dataclass(frozen=True)
class Told:
    """A message, and how many hours after the begin of the fault it was told."""

    hours: float
    alert: Alert


def drawn(seed: int, *, days: float, first: float, last: float) -> Scenario:
    """A glider in a random sea with a random fault from a day between ``first`` and ``last`` on."""
    rng = np.random.default_rng(seed)
    sea, kind = list(SEAS)[rng.integers(len(SEAS))], list(DRAWN)[rng.integers(len(DRAWN))]
    healthy = sea_mission(sea, 1000 + seed, days=days)
    size, onset = rng.uniform(*DRAWN[kind]), healthy.start + DAY * rng.uniform(first, last)
    return with_fault(healthy, Fault(kind, float(onset), float(size), SIZES[kind].ramp))


def told(scenario: Scenario) -> list[Told]:
    """All messages about a glider to its pilots, as its files and its silences lead to them."""
    glider, onset = scenario.glider, scenario.faults[0].onset
    store, clock, found = Store.open(MEMORY), scenario.start, list[Told]()
    store.segments.following = 1000  # of states kept in memory: no message depends on it

    def say(alerts: Sequence[Alert], now: float) -> None:
        wanted = [a for a in alerts if a.kind not in _OF_NOBODY]
        found.extend(Told((max(a.time, now) - onset) / HOUR, a) for a in wanted)

    mission = simulate(scenario)
    with tempfile.TemporaryDirectory(prefix="gliderwatch-wavering-") as name:
        folder = Path(name)
        write_cache(folder / "cache", mission)
        for arrival in arrivals(mission, FileForm(Names.LONG)):
            path = folder / arrival.final_name
            deliver(path, arrival.data)
            segment = decode(path, [folder / "cache"])
            path.unlink()
            tick = transaction.next_tick(store, glider, NOBODY, clock)
            while tick is not None and clock < tick <= arrival.time:
                say(transaction.tick(store, glider, NOBODY, (), tick), tick)
                clock, tick = tick, transaction.next_tick(store, glider, NOBODY, tick)
            clock = arrival.time
            file = File(segment.id.name, 0, 0, Status.WAITING, glider, segment.id.name)
            taken = transaction.process_file(store, file, segment, GliderParams(), NOBODY, clock)
            say(taken.alerts, clock)
    store.close()
    return found


def without_chance(scenario: Scenario, hours: float) -> Scenario:
    """The same mission with a surfacing every so many hours."""
    return replace(scenario, interval=HOUR * hours)


def count(messages: Sequence[Told], hours: float) -> int:
    """How many came within some hours of the begin of the fault."""
    return sum(0 <= each.hours <= hours for each in messages)


def words(pattern: str, text: str) -> bool:
    """Whether a text says something, its lines as one."""
    return re.search(pattern, " ".join(text.split())) is not None


CONFIGURED = f"{GliderParams().speed_min:.2f}-{GliderParams().speed_max:.2f}"
ABSURD = re.compile(r"normal \S+-1\.30|agree: \S+ m/s apart|is normal again")
CLEARED = re.compile(r"ALL CLEAR: (\S+) m/s \(normal (?:above )?([0-9.]+)")


def misstatements(messages: Sequence[Told]) -> list[str]:
    """Where a message contradicts itself, or names a range that no dive of this glider made."""
    found, is_learnt = list[str](), False
    for each in messages:
        text = " ".join(f"{each.alert.title}. {each.alert.body}".split())
        found += [f"{each.hours:.0f} h: {each.alert.title}: {m[0]}" for m in ABSURD.finditer(text)]
        if is_learnt and f"(normal {CONFIGURED})" in text:
            found.append(f"{each.hours:.0f} h: {each.alert.title}: the range of the configuration")
        is_learnt |= "(normal " in text and f"(normal {CONFIGURED})" not in text
        if (end := CLEARED.search(each.alert.title)) and float(end[1]) <= float(end[2]) + 0.005:
            found.append(f"{each.hours:.0f} h: {each.alert.title}: at its bound")
    return found


def wavers(messages: Sequence[Told]) -> list[str]:
    """Where a message contradicts itself, or one before without saying why, in words."""
    found, open_ones, over = misstatements(messages), dict[str, Alert](), dict[Kind, float]()
    found_by_rules = dict[str, Alert]()
    for hours, a in ((each.hours, each.alert) for each in messages):
        others = [each for thread, each in open_ones.items() if thread != a.incident]
        if a.kind in TROUBLE:
            if hours - over.get(a.kind, -np.inf) < AGAIN:
                found.append(f"{hours:.0f} h: {a.title}: {hours - over[a.kind]:.0f} h after it was over")
            if others and not a.body.count("more likely"):
                found.append(f"{hours:.0f} h: {a.title}: while another was open: {others[0].title}")
            open_ones[a.incident] = a
        elif a.kind is Kind.HEALTH:
            found_by_rules[a.incident] = a
        elif a.kind is Kind.REMINDER and a.incident.split("/")[1:2] in ([k.value] for k in TROUBLE):
            if a.incident not in open_ones:
                found.append(f"{hours:.0f} h: {a.title}: of what was not open")
        elif a.kind is Kind.ALL_CLEAR and found_by_rules.pop(a.incident, None) is not None:
            if others and "ALL CLEAR" in a.title:
                found.append(f"{hours:.0f} h: {a.title}: while another was open: {others[0].title}")
        elif a.kind is Kind.ALL_CLEAR and a.incident in open_ones:
            if others and "still open" not in a.title.lower():
                found.append(f"{hours:.0f} h: {a.title}: while another was open: {others[0].title}")
            over[open_ones.pop(a.incident).kind] = hours
        elif a.kind is Kind.CORRECTION and "withdrawn" in a.title and a.incident in open_ones:
            over[open_ones.pop(a.incident).kind] = hours
    return found
