"""How long 50 viewers of `gliderwatch web` wait for a page while the service takes in files.

    python benchmarks/web.py [--gliders 50] [--viewers 50] [--seconds 20]

Each viewer asks once a second for the page of all or that of one of ten gliders. Beside it the installed
daemon takes in the files of ten simulated gliders as they come, an hour in two seconds; each changes the
state, so that pages are made anew. The floor is an answer that is always the same, in the same minute.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import signal
import statistics
import subprocess
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import httpx
from common import GLIDERWATCH
from pages import state_of

from gliderwatch.store.state_file import Status, Store

PORT = 8499
URL = f"http://127.0.0.1:{PORT}"
SPEEDUP = 1800


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


def served() -> None:
    """Wait until pages are served."""
    while True:
        with suppress(httpx.TransportError):
            httpx.get(URL, timeout=60)
            return
        time.sleep(0.1)


def taken_in(state: Path) -> int:
    """How many files the daemon has taken in."""
    store = Store.reading(state)
    try:
        return store.counts().get(Status.TAKEN, 0)
    finally:
        store.close()


def begin(stack: ExitStack, *words: str | Path) -> None:
    """Run a command until the stack is left."""
    quiet = subprocess.DEVNULL
    process = subprocess.Popen([GLIDERWATCH, *words], stdout=quiet, stderr=quiet, start_new_session=True)

    def end() -> None:
        process.send_signal(signal.SIGTERM)
        process.wait(20)

    stack.callback(end)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    for name, default in (("gliders", 50), ("viewers", 50), ("seconds", 20)):
        parser.add_argument(f"--{name}", type=int, default=default)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder, config = Path(name), Path(name) / "gliderwatch.yml"
        state, sea = folder / "state.sqlite", folder / "sea"
        (sea / "gliders").mkdir(parents=True)
        (sea / "cache").mkdir()
        names = state_of(state, chosen.gliders, 150, time.time())
        config.write_text(
            f"dockserver: {{roots: [{sea}/gliders], cache: [{sea}/cache], settle_seconds: 1}}\n"
            f"state: {{path: {state}}}\nweb: {{port: {PORT}}}\npages: {{folder: {folder}/pages}}\n"
            f"gliders: {{{', '.join(f'sim-{k:02d}: ' for k in range(1, 11))}}}\n"
        )
        begin(stack, "run", "-c", config)
        begin(stack, "web", "-c", config)
        served()
        live = ("--gliders", "10", "--days", "4", "--live", "--speedup", str(SPEEDUP))
        begin(stack, "simulate", sea, *live)
        while not taken_in(state):  # it simulates all before the first file comes
            time.sleep(0.5)
        before = taken_in(state)
        bare = asyncio.run(watched(["/api/openapi.json"], chosen.viewers, chosen.seconds / 3))
        pages = ["/", *(f"/{name}.html" for name in names[:10])]
        waits = asyncio.run(watched(pages, chosen.viewers, chosen.seconds))
        print(f"files that the daemon took in meanwhile: {taken_in(state) - before}")
    for what, some in (("pages", waits), ("a fixed answer", bare)):
        median, p99 = (1000 * x for x in (statistics.median(some), some[int(0.99 * len(some))]))
        print(f"{chosen.viewers} viewers, {what}: median {median:.0f} ms, p99 {p99:.0f} ms")


if __name__ == "__main__":
    main()
