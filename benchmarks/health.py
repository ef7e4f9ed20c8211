"""How soon simulated faults of health are reported, how often, and what healthy gliders are told.

    python benchmarks/health.py [--seeds 10] [--months 10] [--data ../shared/data]

Each fault begins on a glider of its own for each seed, with dropped calls, calls without a file, garbled
lines and pilots who type. Its files and logs go through a replay. Counted are the messages about it, and the
surfacings from its onset to the first of them. Healthy gliders fly for 30 days each. Of the real missions of
`--data` it is listed which rules had anything to look at, and what they found.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
from collections import Counter
from pathlib import Path
from statistics import median
from typing import NamedTuple

from gliderwatch.config import load
from gliderwatch.health.rules import RULES
from gliderwatch.model import Alert, Kind
from gliderwatch.service.replay import Request, replay
from gliderwatch.simulate.ailments import Ailment, AilmentKind
from gliderwatch.simulate.calls import CallRates
from gliderwatch.simulate.job import Job, run
from gliderwatch.simulate.ocean import Bottom
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.simulate.telemetry import CADENCE

DAY = 86400.0
SENT = {
    **CADENCE,
    "m_veh_temp": 1800.0,
    "m_lithium_battery_relative_charge": 1800.0,
    "m_digifin_leakdetect_reading": 1800.0,
    "m_altitude": 60.0,
}
"""What the gliders send: as usual, and what the rules look at."""
RATES = CallRates(dropped=0.03, no_file=0.02, garbled=0.002, typing=0.1)
NEVER = Ailment(AilmentKind.RESET, 4e9)
"""None: but the hull breathes as real ones do."""
SETTINGS = """\
dockserver: {roots: [gliders], cache: [cache]}
gliders:
  cora: {health: {altitude: {minimum: 4}}}
"""


class Fault(NamedTuple):
    """A fault: its ailment (None: it aborts), its size and day, and the message that is expected."""

    kind: AilmentKind | None
    size: float
    day: float
    expected: str


FAULTS = {
    "abort": Fault(None, 1.0, 1.2, "abort"),
    "GliderDos": Fault(AilmentKind.GLIDER_DOS, 1.0, 1.2, "abort"),
    "lastgasp": Fault(AilmentKind.LASTGASP, 1.0, 1.2, "abort"),
    "leak": Fault(AilmentKind.LEAK, 2.43, 1.2, "leak"),
    "slow leak, 0.5 inHg a week": Fault(AilmentKind.SLOW_LEAK, 0.5, 5.0, "slow_leak"),
    "battery ends in 6 days": Fault(AilmentKind.BATTERY, 6.0, 3.0, "battery_end"),
    "device error": Fault(AilmentKind.DEVICE_ERROR, 2.0, 1.2, "devices"),
    "low altitude": Fault(AilmentKind.LOW_ALTITUDE, 2.0, 1.2, "altitude"),
}


def scenario(seed: int, days: float) -> Scenario:
    """A glider over a bottom that it turns above."""
    return Scenario(seed=seed, glider="cora", days=days, cadence=SENT, bottom=Bottom(50.0), altitude=8.0)


def messages(
    seed: int, days: float, ailment: Ailment, rates: CallRates
) -> tuple[list[Alert], list[tuple[float, str]]]:
    """The messages about aborts and health of a replay; when its calls began, and what became of them."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        out = Path(folder)
        run(Job(out, [scenario(seed, days)], calls=rates, ailments=(ailment,)))
        facts = json.loads((out / "truth.json").read_text(encoding="utf-8"))["gliders"][0]
        settings = out / "gliderwatch.yml"
        settings.write_text(SETTINGS, encoding="utf-8")
        store = replay(Request((out / "gliders",), (out / "cache",), load(settings))).store
        found = [a for a in store.alerts() if a.kind in (Kind.ABORT, Kind.HEALTH)]
        store.close()
    return found, [(call["begun_seconds"], call["fate"]) for call in facts["calls"]]


def is_about(alert: Alert, expected: str) -> bool:
    """Whether a message is the one that is expected."""
    return f"/{expected}/" in alert.incident


def faults(name: str, fault: Fault, seeds: int) -> None:
    """Print what becomes of one fault over all seeds."""
    counts, surfacings, hours, others = list[int](), list[int](), list[float](), Counter[str]()
    for seed in range(seeds):
        start = scenario(seed, 1.0).start
        onset = start + (fault.day + 0.031 * seed) * DAY
        days = fault.day + (3.5 if fault.kind is AilmentKind.SLOW_LEAK else 0.8)
        ailment = NEVER if fault.kind is None else Ailment(fault.kind, onset, fault.size)
        abort = (onset - start) / DAY if fault.kind is None else None
        rates = CallRates(RATES.dropped, RATES.no_file, RATES.garbled, abort, "LEAK", RATES.typing)
        found, calls = messages(seed, days, ailment, rates)
        told = [a for a in found if is_about(a, fault.expected)]
        others.update(a.incident.split("/", 2)[-1].split("/")[0] for a in found if a not in told)
        counts.append(len(told))
        if told:
            hours.append((told[0].time - onset) / 3600)
            surfacings.append(sum(onset < t <= told[0].time + 2.0 for t, _ in calls))
    once, missed = sum(n == 1 for n in counts), sum(n == 0 for n in counts)
    print(f"{name}: {once} of {seeds} reported once, {missed} missed; surfacings until then", end=" ")
    print(dict(sorted(Counter(surfacings).items())), end="")
    if hours:
        print(f", hours: median {median(hours):.1f}, most {max(hours):.1f}", end="")
    print(f"; also {dict(others)}" if others else "", flush=True)


def healthy(months: int) -> None:
    """Print what healthy gliders are told of."""
    rates, told = CallRates(RATES.dropped, RATES.no_file, RATES.garbled, typing=RATES.typing), list[str]()
    for month in range(1, months + 1):
        found, _ = messages(99 + month, 30.0, NEVER, rates)
        told += [a.title for a in found]
        print(f"healthy, {month} months: {len(told)} messages {told}", flush=True)


def real(data: Path) -> None:
    """Print which rules could look at something on real missions, and the messages of health."""
    for folder in sorted(path for path in data.iterdir() if path.is_dir()):
        store = replay(Request((folder,), (folder / "cache",))).store
        gliders = [row[0] for row in store._db.execute("SELECT DISTINCT glider FROM health")]
        looked = {rule for glider in gliders for _, judged in store.health.judged(glider) for rule in judged}
        found = [alert.title for alert in store.alerts() if alert.kind is Kind.HEALTH]
        store.close()
        print(f"{folder.name}: {len(looked)} of {len(RULES)} rules could look, {len(found)} messages {found}")
        print(f"    {', '.join(rule.name for rule in RULES if rule.name in looked)}", flush=True)


def main() -> None:
    shape = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=shape)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--months", type=int, default=10)
    parser.add_argument("--data", type=Path)
    given = parser.parse_args()
    if given.data is not None:
        real(given.data)
    for name, fault in FAULTS.items():
        faults(name, fault, given.seeds)
    healthy(given.months)


if __name__ == "__main__":
    main()
