"""How long 50 viewers of `gliderwatch web` wait for a page while the service takes in files.

    python benchmarks/web.py [--gliders 50] [--viewers 50] [--seconds 60] [--speedup 600]

Each viewer keeps a page of a glider or that of all open, with its stream of news: when there is news of it,
it is loaded again as the page's script does it; besides, every ten seconds or so the viewer goes to another
page. Beside it the installed daemon takes in the files of ten of the gliders as they come, faster than at
sea, and writes pages as files too. The floor is a file of the same size as the page of a glider, packed,
from the same server (Starlette's `StaticFiles`): each viewer asks for it right before or after a page.
All viewers are in one process and speak HTTP over plain sockets, so that little of a wait is their own.
"""

from __future__ import annotations

import argparse
import asyncio
import gzip
import os
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path
from urllib.request import urlopen

from common import GLIDERWATCH
from pages import state_of

from gliderwatch.store.state_file import Status, Store

PORT = 8499
FLYING = 10
THINK = 10.0
"""Seconds that a viewer looks at a page, on average, before going to another."""
SERVER = """
import sys
from starlette.routing import Mount
from starlette.staticfiles import StaticFiles
from gliderwatch.cli.main import main
from gliderwatch.web import app
made, folder = app.application, sys.argv.pop()
def with_floor(*arguments):
    site = made(*arguments)
    site.router.routes.insert(0, Mount("/floor", StaticFiles(directory=folder)))
    return site
app.application = with_floor
main()
"""
"""`gliderwatch web`, which serves the file of the floor besides."""


@dataclass
class Waits:
    """Seconds that answers took, and how many pages were loaded again for news."""

    pages: list[float] = field(default_factory=list)
    floor: list[float] = field(default_factory=list)
    news: int = 0


async def asked(path: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """Ask the server for something, by a connection of its own."""
    reader, writer = await asyncio.open_connection("127.0.0.1", PORT)
    writer.write(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept-Encoding: gzip\r\n\r\n".encode())
    return reader, writer


async def get(path: str) -> tuple[float, bytes]:
    """Ask for a page: how long it took (s), and its body."""
    begun = time.perf_counter()
    reader, writer = await asked(path)
    head = (await reader.readuntil(b"\r\n\r\n")).lower()
    length = re.search(rb"content-length: (\d+)", head)
    assert head.startswith(b"http/1.1 200") and length is not None, head
    body = await reader.readexactly(int(length[1]))
    writer.close()
    return time.perf_counter() - begun, body


async def news_of(page: bytes) -> None:
    """Wait for news of a page by its stream, and for the moment that its script waits then."""
    address = re.search(rb'data-live="([^"]+)"', gzip.decompress(page))
    assert address is not None
    reader, writer = await asked(f"/{unescape(address[1].decode())}")
    try:
        await reader.readuntil(b"event: news")
    finally:
        writer.close()
    await asyncio.sleep(random.random())


async def viewer(pages: list[str], waits: Waits, end: float, chance: random.Random) -> None:
    """Look at pages until a time."""
    await asyncio.sleep(chance.uniform(0, THINK))
    while time.monotonic() < end:
        page, leaves = chance.choice(pages), time.monotonic() + chance.expovariate(1 / THINK)
        is_first = chance.random() < 0.5
        if is_first:
            waits.floor.append((await get("/floor/page.html"))[0])
        seconds, body = await get(page)
        waits.pages.append(seconds)
        if not is_first:
            waits.floor.append((await get("/floor/page.html"))[0])
        while (left := min(leaves, end) - time.monotonic()) > 0:
            with suppress(TimeoutError):
                async with asyncio.timeout(left):
                    await news_of(body)
                    seconds, body = await get(page)
                    waits.pages.append(seconds)
                    waits.news += 1


async def watched(pages: list[str], viewers: int, seconds: float) -> Waits:
    """What so many viewers waited for so long."""
    waits = Waits()
    for page in pages:
        await get(page)
    end, chance = time.monotonic() + seconds, random.Random(2)
    await asyncio.gather(*(viewer(pages, waits, end, random.Random(chance.random())) for _ in range(viewers)))
    return waits


def served() -> None:
    """Wait until pages are served."""
    while True:
        with suppress(OSError), urlopen(f"http://127.0.0.1:{PORT}/", timeout=60):
            return
        time.sleep(0.1)


def taken_in(state: Path) -> int:
    """How many files the daemon has taken in."""
    store = Store.reading(state)
    try:
        return store.counts().get(Status.TAKEN, 0)
    finally:
        store.close()


def begin(stack: ExitStack, *words: str | Path) -> int:
    """Run a command until the stack is left; its process."""
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(words, stdout=quiet, stderr=quiet, start_new_session=True)

    def end() -> None:
        process.send_signal(signal.SIGTERM)
        process.wait(20)

    stack.callback(end)
    return process.pid


def processor(pid: int) -> tuple[float, float]:
    """Seconds of processor of who answers, and of who draws for it."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return _spent(str(pid)), sum(_spent(child) for child in children)


def _spent(pid: str) -> float:
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def report(waits: Waits, viewers: int) -> None:
    """Print what was waited for."""
    print(f"{viewers} viewers, {len(waits.pages)} pages, {waits.news} of them for news")
    found = {}
    for what, some in (("a page", sorted(waits.pages)), ("a file of the same size", sorted(waits.floor))):
        found[what] = statistics.median(some), some[int(0.99 * len(some))], some[-1]
        median, p99, longest = (1000 * seconds for seconds in found[what])
        print(f"{what}: median {median:.1f} ms, p99 {p99:.1f} ms, longest {longest:.0f} ms")
    page, floor = found.values()
    print(f"a page against the floor: median {page[0] / floor[0]:.2f}, p99 {page[1] / floor[1]:.2f} times")


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    for name, default in (("gliders", 50), ("viewers", 50), ("seconds", 60), ("speedup", 600)):
        parser.add_argument(f"--{name}", type=int, default=default)
    chosen = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder, config = Path(name), Path(name) / "gliderwatch.yml"
        state, sea, floor = folder / "state.sqlite", folder / "sea", folder / "floor"
        for each in (sea / "gliders", sea / "cache", floor):
            each.mkdir(parents=True)
        still = state_of(state, chosen.gliders - FLYING, 150, time.time())
        flying = [f"sim-{k:02d}" for k in range(1, FLYING + 1)]
        config.write_text(
            f"dockserver: {{roots: [{sea}/gliders], cache: [{sea}/cache], settle_seconds: 1}}\n"
            f"state: {{path: {state}}}\nweb: {{port: {PORT}}}\npages: {{folder: {folder}/pages}}\n"
            f"gliders: {{{', '.join(f'{each}: ' for each in flying)}}}\n"
        )
        begin(stack, GLIDERWATCH, "run", "-c", config)
        web = begin(stack, sys.executable, "-c", SERVER, "web", "-c", config, floor)
        live = ("--gliders", str(FLYING), "--days", "3", "--live", "--speedup", str(chosen.speedup))
        begin(stack, GLIDERWATCH, "simulate", sea, *live)
        while not taken_in(state):  # it simulates all before the first file comes
            time.sleep(0.5)
        served()
        with urlopen(f"http://127.0.0.1:{PORT}/{still[0]}.html") as answer:
            page = answer.read()
        (floor / "page.html").write_bytes(os.urandom(len(gzip.compress(page, 6))))
        before, spent, load = taken_in(state), processor(web), os.getloadavg()[0]
        pages = ["/", *(f"/{name}.html" for name in [*flying, *still[: 2 * FLYING]])]
        waits = asyncio.run(watched(pages, chosen.viewers, chosen.seconds))
        after, files = processor(web), taken_in(state) - before
        print(f"files that the daemon took in meanwhile: {files} in {chosen.seconds} s")
        cores, loads = os.cpu_count(), f"{load:.1f} before, {os.getloadavg()[0]:.1f} after"
        print(f"load of the machine of {cores} processors: {loads}")
        answered, drawn = (b - a for a, b in zip(spent, after, strict=True))
        print(f"processor: {answered:.1f} s to answer, {drawn:.1f} s to draw")
        report(waits, chosen.viewers)


if __name__ == "__main__":
    main()
