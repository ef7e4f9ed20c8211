"""What layers cost at a surfacing, on the segments of real missions, in ms of a processor and of reading.

`python benchmarks/layers.py ../shared/data`: for each mission the time to find the casts of a segment, their
composite and layers, and the advice; that of both methods; and how long dbdreader takes to read the science
file alone, in the same run.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from common import one_core

from gliderwatch.errors import GliderwatchError
from gliderwatch.layers import flown
from gliderwatch.layers.advice import LayerParams, after
from gliderwatch.layers.band import Method, Tracking
from gliderwatch.layers.water import casts_of
from gliderwatch.model import Segment
from gliderwatch.slocum import folders
from gliderwatch.slocum.decode import decode_science
from gliderwatch.store import codec

MISSIONS = ("usf-sam-2019", "maria-2022", "electa-2022")
REPEATS = 5


def segments_of(mission: Path) -> tuple[list[Segment], float]:
    """The segments that have casts, in order of time, and the time to read one (s)."""
    out, begun, n = list[Segment](), time.process_time(), 0
    for path in sorted((mission / "from-glider").iterdir()):
        if folders.is_science(path.name):
            n += 1
            try:
                out.append(decode_science(path, [mission / "cache"]))
            except GliderwatchError:
                continue
    read = (time.process_time() - begun) / n
    return sorted((s for s in out if casts_of(s, "temperature")), key=lambda s: s.id), read


def surfacings(segments: list[Segment], method: Method, sensor: str) -> list[float]:
    """Seconds of each segment: from what is held to a row of the state file; the best of some runs."""
    params = LayerParams(sensor, 1000.0, 10.0, 10.0, method, 2)
    times = np.full((REPEATS, len(segments)), np.nan)
    for run in range(REPEATS):
        tracking = Tracking()
        for i, segment in enumerate(segments):
            begun = time.process_time()
            found = after(tracking, segment, params)
            if found is not None:
                codec.plain_encode(found)
                tracking = found.tracking
            times[run, i] = time.process_time() - begun
    return times.min(axis=0).tolist()


def main(data: Path) -> None:
    one_core()
    head = f"{'mission':<14}{'method':<12}{'sensor':<13}{'segments':>9}"
    print(f"{head}{'median ms':>11}{'most ms':>9}{'of reading':>12}")
    for name in MISSIONS:
        segments, read = segments_of(data / name)
        for method, sensor in ((Method.COMPOSITE, "temperature"), (Method.COMPOSITE, "density"),
                               (Method.FILTER, "temperature")):  # fmt: skip
            ms = 1e3 * np.array(surfacings(segments, method, sensor))
            print(f"{name:<14}{method:<12}{sensor:<13}{len(ms):>9}{np.median(ms):>11.2f}{ms.max():>9.2f}"
                  f"{np.median(ms) / 1e3 / read:>12.2f}")  # fmt: skip
        _compare(name, segments)


def _compare(name: str, segments: list[Segment]) -> None:
    found = flown.compare([casts_of(segment, "temperature") for segment in segments], "temperature")
    for method, flights in found.items():
        one = flown.total(flights)
        print(f"  {name:<14}{method:<32}coverage {one.coverage:.2f}, travel {one.travel:.2f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
