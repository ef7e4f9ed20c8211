"""What the pages of 50 gliders cost: processor per surfacing.

    python benchmarks/pages.py [--gliders 50] [--dives 150]

A surfacing has the page of all, and those of its glider, written anew; the floor is one plot by matplotlib
as in a mail.
"""

from __future__ import annotations

import argparse
import random
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gliderwatch.figures import plots
from gliderwatch.figures.coast import world
from gliderwatch.health.readings import Readings
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.model import Assessment, NextSurfacing, Segment, SegmentId, Series, readonly
from gliderwatch.params import Attention
from gliderwatch.pipeline import GliderState, Outcome
from gliderwatch.service import page_writer
from gliderwatch.store.state_file import Store

HOUR = 3600.0


def dive(glider: str, end: float, chance: random.Random) -> Assessment:
    """A dive of three hours."""
    evidence = {
        "duration_h": 3.0, "speed_sigma": 0.02, "own_speed": 0.3, "across_misfit": chance.gauss(0, 0.03),
        "across_sigma": 0.03, "depth_max": 190.0, "pitch_dive": -0.45, "pitch_climb": 0.44, "roll_mean": 0.03,
        "roll_std": 0.02, "ballast_dive": -2.4e-4, "ballast_climb": 2.4e-4, "depth_rate_dive": 0.15,
        "depth_rate_climb": -0.14, "vacuum": 23000.0,
    }  # fmt: skip
    place = (24.0 + chance.gauss(0, 0.5), -83.0 + chance.gauss(0, 0.5))
    current = (0.1, 0.05, 0.1, 0.04, True, 0.02, 0.3, None, None)
    speeds = (0.25 + chance.gauss(0, 0.02), 0.2, 0.32)
    name, times = f"{glider}-2026-1-0-{end:.0f}", (end - 3 * HOUR, end)
    return Assessment(glider, name, *times, *place, 0, "", *speeds, *current, 100, evidence, (), "")


def readings(end: float, chance: random.Random) -> Readings:
    """What a dive shows of the glider's health: one value a quantity and twenty minutes."""
    t = readonly(end - 1200.0 * np.arange(9.0)[::-1])
    usual = {"leak_voltage": 2.49, "leak_voltage_forward": 2.5, "vacuum": 25000.0, "battery_voltage": 14.8}
    found = {name: Series(t, readonly([v * chance.gauss(1, 0.002) for _ in t])) for name, v in usual.items()}
    falling = [1.5 - (end + x) / 3e9 for x in range(9)]
    return found | {"battery_charge": Series(t, readonly(falling))}


def state_of(path: Path, gliders: int, dives: int, now: float) -> list[str]:
    """A state file of so many gliders with so many dives each; their names."""
    chance, store = random.Random(1), Store.open(path)
    names = [f"unit_{k:04d}" for k in range(gliders)]
    with store.transaction():
        for name in names:
            flown = tuple(dive(name, now - (dives - k) * 3.5 * HOUR, chance) for k in range(dives))
            identity = SegmentId(flown[-1].t_dive, name, flown[-1].segment)
            store.segments.put(Segment(identity, "m", "sbd", flown[-1].t_surface, (1, 1, ""), {}))
            store.record_sign(identity, flown[-1].t_surface, now)
            last = flown[-1]
            expected = NextSurfacing(
                last.t_surface, now + HOUR, 900.0, last.lat, last.lon, 1e6, 0.0, 1e6, "bench"
            )
            for one in flown:
                store.health.put(name, one.segment, one.t_surface, readings(one.t_surface, chance))
            store.apply(name, Outcome(GliderState(), float("-inf"), flown, (), expected))
            store.keep_notified(name, NotificationState(), (), now)
    store.close()
    return names


def cost(work: Callable[[], object], times: int = 5) -> float:
    """Median seconds of processor that some work takes."""
    taken = []
    for _ in range(times):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return statistics.median(taken)


def surfacing(path: Path, folder: Path, names: list[str], now: float) -> None:
    """Print what the pages of one surfacing cost."""
    store, attention = Store.reading(path), {name: Attention() for name in names}
    batteries = {name: page_writer.battery_limits(None, name) for name in names}
    t = np.arange(150.0) * 12600.0
    panel = plots.Panel("floor", "value (1)", "", (plots.Line("floor", t, np.sin(t)),))
    plots.png(panel)  # the library is loaded before
    page_writer.write_fleet(store, folder, attention, batteries, now, world())
    floor = cost(lambda: plots.png(panel))
    fleet = cost(lambda: page_writer.write_fleet(store, folder, attention, batteries, now, world()))
    one = cost(
        lambda: page_writer.write_glider(
            store, folder, names[0], attention[names[0]], batteries[names[0]], now, world(), {}
        )
    )
    store.close()
    sizes = {file.name: file.stat().st_size for file in folder.iterdir()}
    print(f"{len(names)} gliders: processor for the page of all {fleet:.3f} s, for one glider's {one:.3f} s")
    print(f"a surfacing: {fleet + one:.3f} s, {(fleet + one) / floor:.1f} times one plot ({floor:.3f} s)")
    print(f"largest page {max(sizes.values()) / 1000:.0f} kB, index.html {sizes['index.html'] / 1000:.0f} kB")


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    for name, default in (("gliders", 50), ("dives", 150)):
        parser.add_argument(f"--{name}", type=int, default=default)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, now = Path(name), time.time()
        state = folder / "state.sqlite"
        names = state_of(state, chosen.gliders, chosen.dives, now)
        surfacing(state, folder / "pages", names, now)


if __name__ == "__main__":
    main()
