"""What the pages of 50 gliders cost: processor per surfacing, and how long 50 viewers wait.

    python benchmarks/pages.py [--gliders 50] [--dives 150] [--viewers 50] [--seconds 15]

A surfacing has the page of all, and those of its glider, written anew; the floor is one plot by matplotlib.
Viewers ask `gliderwatch web` for the page of all or of one of ten gliders, once a second each, while somebody
writes to the state file every two seconds; their floor is an answer that is always the same.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import httpx
import numpy as np

from gliderwatch.figures import plots
from gliderwatch.figures.coast import world
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.model import Assessment, NextSurfacing, Segment, SegmentId
from gliderwatch.params import Attention
from gliderwatch.pipeline import GliderState, Outcome
from gliderwatch.service import page_writer
from gliderwatch.store.state_file import Store

HOUR = 3600.0
PORT = 8499
URL = f"http://127.0.0.1:{PORT}"


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
    name, times = f"{glider}-2026-1-0-0", (end - 3 * HOUR, end)
    return Assessment(glider, name, *times, *place, 0, "", *speeds, *current, 100, evidence, (), "")


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
            store.apply(name, Outcome(GliderState(), float("-inf"), flown, (), expected))
            store.keep_notified(name, NotificationState())
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
    t = np.arange(150.0) * 12600.0
    panel = plots.Panel("floor", "value (1)", "", (plots.Line("floor", t, np.sin(t)),))
    plots.svg(panel)  # the library is loaded before
    page_writer.write_fleet(store, folder, attention, now, world())
    floor = cost(lambda: plots.as_svg(plots._drawn(panel)))
    fleet = cost(lambda: page_writer.write_fleet(store, folder, attention, now, world()))
    one = cost(lambda: page_writer.write_glider(store, folder, names[0], attention[names[0]], now, world()))
    store.close()
    sizes = {file.name: file.stat().st_size for file in folder.iterdir()}
    print(f"{len(names)} gliders: processor for the page of all {fleet:.3f} s, for one glider's {one:.3f} s")
    print(f"a surfacing: {fleet + one:.3f} s, {(fleet + one) / floor:.1f} times one plot ({floor:.3f} s)")
    print(f"largest page {max(sizes.values()) / 1000:.0f} kB, index.html {sizes['index.html'] / 1000:.0f} kB")


async def watched(pages: list[str], viewers: int, seconds: float) -> list[float]:
    """Seconds that each page took, for so many viewers."""
    chance, waits = random.Random(2), list[float]()

    async def viewer() -> None:
        async with httpx.AsyncClient(base_url=URL, timeout=60) as client:
            await asyncio.sleep(chance.random())
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                page, begun = chance.choice(pages), time.monotonic()
                (await client.get(page)).raise_for_status()
                waits.append(time.monotonic() - begun)
                await asyncio.sleep(max(0.0, begun + 1.0 - time.monotonic()))

    async with httpx.AsyncClient(base_url=URL, timeout=60) as client:
        for page in pages:
            (await client.get(page)).raise_for_status()
    await asyncio.gather(*(viewer() for _ in range(viewers)))
    return sorted(waits)


def live(config: Path, state: Path, names: list[str], viewers: int, seconds: float) -> None:
    """Print how long viewers of `gliderwatch web` wait while the state changes."""
    over = threading.Event()

    def write() -> None:
        store, k = Store.open(state), 0
        while not over.wait(2.0):
            k += 1
            with store.transaction():
                store.notes.mute(names[k % len(names)], time.time() + 1.0, time.time())
        store.close()

    command = [str(Path(sys.executable).with_name("gliderwatch")), "web", "-c", str(config)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as server:
        while server.poll() is None:
            with suppress(httpx.TransportError):
                httpx.get(URL, timeout=60)
                break
            time.sleep(0.1)
        writer = threading.Thread(target=write)
        writer.start()
        bare = asyncio.run(watched(["/api/openapi.json"], viewers, seconds / 3))
        waits = asyncio.run(watched(["/", *(f"/{name}.html" for name in names[:10])], viewers, seconds))
        over.set()
        writer.join()
        server.terminate()
    for what, some in (("pages", waits), ("a fixed answer", bare)):
        median, p99 = (1000 * x for x in (statistics.median(some), some[int(0.99 * len(some))]))
        print(f"{viewers} viewers, {what}: median {median:.0f} ms, p99 {p99:.0f} ms")


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    for name, default in (("gliders", 50), ("dives", 150), ("viewers", 50), ("seconds", 15)):
        parser.add_argument(f"--{name}", type=int, default=default)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, now = Path(name), time.time()
        state, path = folder / "state.sqlite", folder / "gliderwatch.yml"
        names = state_of(state, chosen.gliders, chosen.dives, now)
        surfacing(state, folder / "pages", names, now)
        places = f"dockserver: {{roots: [{name}]}}\nstate: {{path: {state}}}\nweb: {{port: {PORT}}}\n"
        path.write_text(places)
        live(path, state, names, chosen.viewers, chosen.seconds)


if __name__ == "__main__":
    main()
