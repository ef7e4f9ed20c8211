"""Memory of the daemon with many gliders: worker processes included, while it takes files and after.

python benchmarks/memory.py [--gliders 50] [--days 5]
"""

from __future__ import annotations

import argparse
import threading
from dataclasses import dataclass, field

from common import configure, daemon, folder, machine, memory, taken, tree, wait_taken

from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario

SMALLEST_WAIT = 0.2


@dataclass(slots=True)
class Highest:
    """Looks at the memory of a process and its descendants until told to end."""

    pid: int
    pss: float = 0.0
    end: threading.Event = field(default_factory=threading.Event)

    def watch(self) -> None:
        while not self.end.wait(SMALLEST_WAIT):
            self.pss = max(self.pss, memory(tree(self.pid))[1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--gliders", type=int, default=50)
    parser.add_argument("--days", type=float, default=5.0)
    arguments = parser.parse_args()
    names = [f"glider-{number:02d}" for number in range(arguments.gliders)]
    with folder() as where:
        config = configure(where, names)
        with daemon(config) as pid:
            wait_taken(config, 0)
            highest = Highest(pid)
            thread = threading.Thread(target=highest.watch)
            thread.start()
            files = 0
            for seed, name in enumerate(names):
                mission = simulate(Scenario(seed=seed, glider=name, days=arguments.days))
                files += len(write_mission(where / "gliders", where / "cache", mission))
            wait_taken(config, files)
            highest.end.set()
            thread.join()
            processes = tree(pid)
            rss, pss = memory(processes)
            own = memory([pid])
        assert taken(config) == files
    print(machine())
    print(f"{arguments.gliders} gliders, {arguments.days:g} days, {files} files, {len(processes)} processes")
    print(f"after: PSS {pss:.0f} MB (RSS {rss:.0f} MB), of it the daemon itself {own[1]:.0f} MB")
    print(f"most while taking files: PSS {highest.pss:.0f} MB")


if __name__ == "__main__":
    main()
