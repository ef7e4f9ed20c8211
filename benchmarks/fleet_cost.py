"""What a surfacing of one of 15 gliders costs a field and its advice, and how much memory a field takes.

    python benchmarks/fleet_cost.py [--gliders 15] [--days 7] [--hours 2]

Batches of a fleet as in `fleet_field.py` are put into a state file. Then comes one surfacing after another,
as in the service: its batch is stored, the field brought up to its hour, advice found among all headings with
the legs of the others planned, all in one transaction. Told are the processor time of each of the last 100
surfacings, beside that of one inverse of a field's matrix in the same run (3 ms where the machine is quiet);
and of ten more what numpy and Python take at most meanwhile, and keep (tracemalloc).
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
import tracemalloc
from contextlib import closing
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from common import machine
from fleet_field import HOUR, JITTER, STEP, Glider

from gliderwatch.fleet.advice import Bounds, Box, Leg, advise, with_planned
from gliderwatch.fleet.constants import SAMPLE_STEP
from gliderwatch.fleet.scalar_field import Batch, FieldParams, at, inverse, prior
from gliderwatch.store.state_file import Store

BOX = Box(50.0, -30.0, 50.54, -29.16, 0.0, 100.0)
LAST, TRACED = 100, 10


def surfacings(gliders: int, days: float, hours: float) -> list[Batch]:
    """The batches of a fleet in the order of its surfacings."""
    rng = np.random.default_rng(1)
    fleet = [Glider(f"g{k}", np.random.default_rng([1, k])) for k in range(gliders)]
    due, out = rng.uniform(0.3, 1.0, gliders) * hours * HOUR, list[Batch]()
    while due.min() < days * 24 * HOUR:
        k = int(due.argmin())
        out.append(kept(fleet[k].fly(float(due[k]))))
        fleet[k].heading = rng.uniform(0, 2 * np.pi)
        due[k] += hours * HOUR + rng.uniform(-JITTER, JITTER)
    return out


def kept(batch: Batch) -> Batch:
    """A batch as the service keeps it: a sample for each minute."""
    every = slice(None, None, round(SAMPLE_STEP / STEP))
    t, place, value = batch.t[every], batch.place[every], batch.value[every]
    return Batch(batch.id, batch.glider, t, place, value, np.full(len(t), SAMPLE_STEP))


def surface(store: Store, batch: Batch, params: FieldParams, others: dict[str, Batch]) -> None:
    """What the service does with the field at a surfacing."""
    with store.transaction():
        store.fields.put("field", [batch])
        newest = store.fields.advance("field", params)
        assert newest is not None
        legs = [(leg_of(each), 1.0) for each in others.values()]
        known = with_planned(at(newest, float(batch.t[-1]), params), legs, BOX, params)
        advice = advise(known, leg_of(batch), BOX, Bounds(), params)
        store.fields.advise("field", batch.glider, float(batch.t[-1]), advice)


def leg_of(batch: Batch) -> Leg:
    """Two hours from the end of a batch."""
    east, north = np.clip(batch.place[-1, :2], 0.05, 0.95)
    return Leg(50.0 + 0.54 * float(north), -30.0 + 0.84 * float(east), 0.4, 2 * HOUR)


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gliders", type=int, default=15)
    parser.add_argument("--days", type=float, default=7.0)
    parser.add_argument("--hours", type=float, default=2.0)
    options = parser.parse_args()
    print(machine())
    batches, params = surfacings(options.gliders, options.days, options.hours), FieldParams()
    with tempfile.TemporaryDirectory() as folder, closing(Store.open(Path(folder) / "state.sqlite")) as store:
        others, took, floor = dict[str, Batch](), list[float](), list[float]()
        matrix = prior(params).d
        with store.transaction():
            store.fields.begin("field", "key")
            store.fields.put("field", batches[: -LAST - TRACED])
            store.fields.advance("field", params)
        for k, batch in enumerate(batches[-LAST - TRACED :]):
            if k == LAST:
                tracemalloc.start()
            begun = time.process_time()
            surface(store, batch, params, {g: each for g, each in others.items() if g != batch.glider})
            took.append(1e3 * (time.process_time() - begun))
            others[batch.glider] = batch
            begun = time.process_time()
            inverse(matrix)
            floor.append(1e3 * (time.process_time() - begun))
        kept, most = (each / 1e6 for each in tracemalloc.get_traced_memory())
    took = took[:LAST]
    median, high = np.median(took), np.quantile(took, 0.95)
    print(f"{len(batches)} surfacings of {options.gliders} gliders; of the last {LAST}: "
          f"median {median:.0f} ms, 95 % below {high:.0f} ms of processor time")  # fmt: skip
    least = np.median(floor[:LAST])
    print(f"an inverse: median {least:.1f} ms; a surfacing is {median / least:.1f} of them")
    print(f"memory of the field: {most:.1f} MB at most during a surfacing, {kept:.1f} MB kept")


if __name__ == "__main__":
    main()
