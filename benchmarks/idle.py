"""What the daemon costs while nothing happens: share of a core, and growth of memory.

python benchmarks/idle.py [--minutes 10] [--gliders 10] [--observer inotify|polling]
"""

from __future__ import annotations

import argparse
import time

from common import busy, configure, daemon, folder, machine, memory, tree, wait_taken

from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario

SETTLE = 20.0
"""Seconds after the last file before it is measured."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--gliders", type=int, default=10)
    parser.add_argument("--observer", choices=["inotify", "polling"], default="inotify")
    arguments = parser.parse_args()
    names = [f"glider-{number:02d}" for number in range(arguments.gliders)]
    with folder() as where:
        files = 0
        for seed, name in enumerate(names):
            mission = simulate(Scenario(seed=seed, glider=name, days=5.0))
            files += len(write_mission(where / "gliders", where / "cache", mission))
        places = {"roots": [str(where / "gliders")], "cache": [str(where / "cache")]}
        config = configure(where, names, dockserver=places | {"observer": arguments.observer})
        with daemon(config) as pid:
            wait_taken(config, files)
            time.sleep(SETTLE)
            processes = tree(pid)
            rss, cpu, begun = memory(processes)[0], busy(processes), time.monotonic()
            time.sleep(60 * arguments.minutes)
            share = (busy(processes) - cpu) / (time.monotonic() - begun)
            grown = memory(processes)[0] - rss
            assert tree(pid) == processes, "a process ended, or came"
    print(machine())
    print(f"{arguments.gliders} gliders, {files} files taken, {arguments.observer}, then nothing")
    print(f"{arguments.minutes:g} min: {100 * share:.3f} % of a core; {rss:.1f} MB RSS, {grown:+.2f} MB")


if __name__ == "__main__":
    main()
