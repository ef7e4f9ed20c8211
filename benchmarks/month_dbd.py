"""A month of recovered files, all sensors every 4 s: the whole replay against dbdreader alone.

Like real ones the files list 1700 sensors, of which some 120 change in a cycle; gliderwatch reads
those that are in it of its own. Needs 500 MB of disk.

    python benchmarks/month_dbd.py [--days 30] [--runs 3]
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path

import numpy as np
from common import cost, floor, folder, machine

from gliderwatch.simulate.delivery import deliver
from gliderwatch.simulate.dinkum import Sensor, SensorList, encode
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.simulate.telemetry import SegmentData

LISTED, CHANGING = 1700, 80


def write(where: Path, days: float) -> tuple[int, float]:
    """Write a mission as dbd; how many files and MB."""
    mission = simulate(Scenario(glider="month", days=days, full_rate=True))
    rng = np.random.default_rng(1)
    files = [_write(where, data, rng) for data in mission.full_rate if data.header.extension == "dbd"]
    return len(files), sum(files) / 1e6


def _write(where: Path, data: SegmentData, rng: np.random.Generator) -> int:
    """Write one file, with the sensors of a real one that are not simulated; its size."""
    extra = tuple(Sensor(f"x_other_{i:04d}", "nodim", 4) for i in range(LISTED - len(data.sensors.sensors)))
    names = frozenset(sensor.name for sensor in extra)
    sensors = SensorList((*data.sensors.sensors, *extra), data.sensors.sent | names)
    n = len(data.values)
    values = np.zeros((n, len(extra)))
    updated = np.zeros(values.shape, dtype=bool)
    updated[0], updated[:, :CHANGING] = True, True
    values[:, :CHANGING] = rng.normal(size=(n, CHANGING))
    content = encode(
        data.header,
        sensors,
        np.concatenate([data.values, values], axis=1),
        np.concatenate([data.updated, updated], axis=1),
    )
    deliver(where / "cache" / f"{sensors.crc}.cac", sensors.text())
    deliver(where / "files" / f"{data.header.full_name}.dbd", content)
    return len(content)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--days", type=float, default=30.0)
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    with folder() as where:
        files, size = write(where, arguments.days)
        bare, costs = [], []
        for _ in range(arguments.runs):
            bare.append(floor(where / "files", where / "cache"))
            costs.append(cost("run", "--replay", where / "files", "--cache", where / "cache"))
    cpu, decoding = statistics.median(c.cpu for c in costs), statistics.median(bare)
    print(machine())
    print(f"{files} dbd files of {arguments.days:g} days, {size:.0f} MB, median of {arguments.runs}")
    print(f"dbdreader alone: {decoding:.2f} s of processor")
    print(f"replay:          {cpu:.2f} s of processor, start-up included; ratio {cpu / decoding:.2f}")
    print(f"                 {statistics.median(c.wall for c in costs):.2f} s on the clock")


if __name__ == "__main__":
    main()
