"""A month of real-time files, 300 of them, through the whole command on one core, start-up included.

python benchmarks/month_sbd.py [--files 300] [--runs 3]
"""

from __future__ import annotations

import argparse
import statistics
from dataclasses import replace
from pathlib import Path

from common import cost, floor, folder, machine, one_core

from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario


def write(where: Path, files: int) -> float:
    """Write a mission of so many files; their mean size (kB)."""
    mission = simulate(Scenario(glider="month", days=files / 6.5))
    mission = replace(mission, segments=mission.segments[:files])
    paths = write_mission(where / "gliders", where / "cache", mission)
    assert len(paths) == files, len(paths)
    return sum(path.stat().st_size for path in paths) / files / 1000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--files", type=int, default=300)
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    one_core()
    with folder() as where:
        size = write(where, arguments.files)
        bare, costs, starts = [], [], []
        for _ in range(arguments.runs):
            bare.append(floor(where / "gliders", where / "cache"))
            costs.append(cost("run", "--replay", where / "gliders", "--cache", where / "cache"))
            starts.append(cost("--version").wall)
    wall, cpu = (statistics.median(getattr(c, name) for c in costs) for name in ("wall", "cpu"))
    decoding = statistics.median(bare)
    print(machine())
    print(f"{arguments.files} sbd files of {size:.0f} kB, one core, median of {arguments.runs}")
    print(f"replay, start-up included: {wall:.2f} s ({1000 * wall / arguments.files:.1f} ms a file)")
    print(f"  of that the processor:   {cpu:.2f} s")
    print(f"dbdreader alone:           {decoding:.2f} s of processor; ratio {cpu / decoding:.1f}")
    print(f"`gliderwatch --version`:   {statistics.median(starts):.2f} s")


if __name__ == "__main__":
    main()
