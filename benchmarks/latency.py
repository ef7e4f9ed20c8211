"""From a file's last name to the mail that a local server has accepted, against sending such a mail alone.

python benchmarks/latency.py [--files 50]
"""

from __future__ import annotations

import argparse
import smtplib
import statistics
import threading
import time
from pathlib import Path
from typing import Any

from aiosmtpd.controller import Controller
from common import configure, daemon, folder, machine, taken, wait_taken

from gliderwatch.simulate.delivery import arrivals, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario

WARM = 4
PORT = 18025


class Mailbox:
    """Notes when it took the last mail, and its content."""

    def __init__(self) -> None:
        self.came = threading.Event()
        self.accepted, self.content = 0.0, b""

    async def handle_DATA(self, _server: Any, _session: Any, envelope: Any) -> str:  # noqa: N802 (aiosmtpd)
        self.accepted, self.content = time.monotonic(), envelope.content
        self.came.set()
        return "250 accepted"

    def wait(self) -> float:
        """Wait for a mail; when it was accepted."""
        if not self.came.wait(30):
            raise SystemExit("no mail came")
        self.came.clear()
        return self.accepted


def measure(where: Path, box: Mailbox, files: int) -> list[float]:
    """Seconds from the name to the mail."""
    mission = simulate(Scenario(glider="angus", days=(files + WARM) / 6.0))
    url = f"mailto://127.0.0.1:{PORT}?from=gliderwatch@a.org&to=pilot@b.org"
    recipients = {"pilot": {"channels": ["mail"], "surfacing": ["angus"]}}
    config = configure(where, ["angus"], channels={"mail": {"url": url}}, recipients=recipients)
    write_cache(where / "cache", mission)
    target = where / "gliders" / "angus" / "from-glider"
    target.mkdir(parents=True)
    seconds = []
    with daemon(config):
        wait_taken(config, 0)
        for number, file in enumerate(list(arrivals(mission))[: files + WARM]):
            partial, already = target / f".{file.name}.part", taken(config)
            partial.write_bytes(file.data)
            begun = time.monotonic()
            partial.rename(target / file.name)
            wait_taken(config, already + 1)
            if number >= WARM:
                seconds.append(box.wait() - begun)
            elif number == WARM - 1:
                time.sleep(1.0)
                box.came.clear()
    return seconds


def floor(box: Mailbox, times: int) -> float:
    """Median seconds to hand such a mail to the server, connection included."""
    seconds = []
    for _ in range(times):
        begun = time.monotonic()
        with smtplib.SMTP("127.0.0.1", PORT, "localhost") as server:
            server.sendmail("gliderwatch@a.org", ["pilot@b.org"], box.content)
        seconds.append(box.wait() - begun)
    return statistics.median(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--files", type=int, default=50)
    arguments = parser.parse_args()
    box = Mailbox()
    server = Controller(box, hostname="127.0.0.1", port=PORT)
    server.start()
    try:
        with folder() as where:
            seconds = measure(where, box, arguments.files)
            alone = floor(box, arguments.files)
    finally:
        server.stop()
    median, late = statistics.median(seconds), statistics.quantiles(seconds, n=20)[-1]
    print(machine())
    print(
        f"{len(seconds)} files: median {1000 * median:.0f} ms, 95 % {1000 * late:.0f} ms, "
        f"least {1000 * min(seconds):.0f} ms, most {1000 * max(seconds):.0f} ms"
    )
    print(f"a mail alone: median {1000 * alone:.0f} ms; ratio {median / alone:.1f}")


if __name__ == "__main__":
    main()
