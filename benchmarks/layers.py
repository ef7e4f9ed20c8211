"""What layers cost at a surfacing, on the segments of real missions, in ms of a processor and of reading.

`python benchmarks/layers.py ../shared/data`: for each mission the time to find the casts of a segment, their
composite and layers, and the advice; that of both methods; and how long dbdreader takes to read the science
file alone, in the same run. Then coverage and travel of each method on the water of the mission, beside those
of a prototype.
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
from gliderwatch.layers.casts import casts_of
from gliderwatch.model import Segment
from gliderwatch.slocum import folders
from gliderwatch.slocum.decode import decode_science
from gliderwatch.store import codec

MISSIONS = ("usf-sam-2019", "maria-2022", "electa-2022")
REPEATS = 5
REFERENCE = {
    "usf-sam-2019": "0.99, 1.00; 0.99, 0.92; 0.28, 0.53; 0.50, 0.60; 0.47, 0.51; 0.98, 0.75; 0.99, 0.76",
    "maria-2022": "1.00, 1.00; 0.74, 0.12; 0.77, 0.21; 0.84, 0.26; 0.76, 0.32; 0.83, 0.37; 0.99, 0.83",
    "electa-2022": "1.00, 1.00; 0.90, 0.27; 0.93, 0.35; 0.93, 0.75; 0.92, 0.35; 0.99, 0.43; 1.00, 0.64",
}
"""Coverage and travel that a prototype had on the same missions, in the order of `flown.methods`; its
extensions are not on record."""


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
    """Each method beside the reference: `near` where the coverage is at least that less 0.02, and the travel
    at most that and 0.05."""
    found = flown.compare([casts_of(segment, "temperature") for segment in segments], "temperature")
    for (method, flights), reference in zip(found.items(), REFERENCE[name].split("; "), strict=True):
        one = flown.total(flights)
        coverage, travel = map(float, reference.split(", "))
        near = round(one.coverage, 2) >= coverage - 0.02 and round(one.travel, 2) <= travel + 0.05
        print(
            f"  {name:<14}{method:<28}coverage, travel {one.coverage:.2f}, {one.travel:.2f}"
            f"   reference {reference}{'   near' if near else ''}"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
