"""The experiment of paper 003 through the installed program: simulated files in, maps of the sea out.

    python benchmarks/fleet_program.py [--gliders 1 5 10 15 20] [--hours 1 2 3] [--days 7] [--seed 1]
        [--json out.json] [--figure out.svg]

Slocums fly in the box of `fleet_field.py` (whose sea, `gliderwatch.simulate.stand_in`, is their temperature),
with currents, fixes, CTD and files of theirs, at the 0.54 m/s of the paper. At each surfacing each goes on to
where the gradient of the mean variance leads, as the library says it of the samples so far. The files then go
through `gliderwatch run --replay` and `gliderwatch field --at`, and the maps are held against the sea: by
what was measured until then. The two other estimators get the batches that the program kept, in the order of
the surfacings. Cells that `--json` holds already are not flown again. Columns as in `fleet_field.py`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # beside other work two threads wait for each other

import numpy as np
from common import Cost, cost, machine
from fleet_field import HOUR, Cell, Nodes, Pooled, Result, draw, score, table
from netCDF4 import Dataset

from gliderwatch.fleet.advice import Box, Leg, gradient
from gliderwatch.fleet.scalar_field import Batch, FieldParams, inverse
from gliderwatch.simulate import stand_in
from gliderwatch.simulate.delivery import write_cache, write_mission
from gliderwatch.simulate.flight import Point, offset
from gliderwatch.simulate.following import fly
from gliderwatch.simulate.glider import fleet
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.scenario_files import find, load_scenario
from gliderwatch.store.state_file import Store

SIDE, SPEED, DRIVE, EVERY = 60e3, 0.54, 455e-6, 12
"""m; m/s through the water, and the drive (m3) that it takes; h between two maps."""
Scores = list[tuple[float, float]]


@dataclass(frozen=True)
class Experiment:
    """One fleet: gliders, mean time between surfacings (h), days, and chance."""

    gliders: int
    hours: float
    days: int
    seed: int

    @property
    def missions(self) -> list[Scenario]:
        """The fleet of `gliderwatch simulate --scenario field`, at the paper's speed and intervals."""
        base = load_scenario(find("field"))
        whole = replace(base, seed=self.seed, days=self.days, interval=self.hours * HOUR, interval_range=None)
        return fleet(replace(whole, drive=DRIVE, surface_segments=False), self.gliders)


def box_of(origin: Point) -> Box:
    """The box whose south-western corner is the origin."""
    lat, lon = offset(origin, np.array(SIDE), np.array(SIDE))
    return Box(origin.lat, origin.lon, float(lat), float(lon), 0.0, 100.0)


def write_files(folder: Path, missions: list[Scenario]) -> None:
    """Fly the fleet by the gradient and write its files."""
    box, params = box_of(missions[0].origin or missions[0].place), FieldParams()
    field, hours = Pooled(params), missions[0].interval

    def answer(sent: Mission) -> Point | None:
        write_mission(folder / "gliders", folder / "cache", sent)
        write_cache(folder / "cache", sent)
        batch = samples(sent, box)
        if batch is None:
            return None
        known = field.meet(batch)
        east, north = gradient(inverse(known.d), batch.place[-1, :2], params)
        at = batch.place[-1]
        lat = box.south + at[1] * (box.north - box.south)
        lon = box.west + at[0] * (box.east - box.west)
        leg = Leg(float(lat), float(lon), SPEED, hours)
        heading = math.atan2(east, north)
        for turn in np.arange(0, math.tau, 0.3):  # at the walls it turns back
            to = leg.end(heading + turn)
            place = box.place(np.array([to[0]]), np.array([to[1]]), np.array([0.0]))[0, :2]
            if ((place > 0.02) & (place < 0.98)).all():
                return Point(*leg_far(leg, heading + turn))
        return None

    for _ in fly(missions, answer):
        pass


def leg_far(leg: Leg, heading: float) -> tuple[float, float]:
    """A waypoint beyond the end of the leg: it is not reached before the next surfacing."""
    return Leg(leg.lat, leg.lon, leg.speed, 2 * leg.duration).end(heading)


def samples(sent: Mission, box: Box) -> Batch | None:
    """The samples of a dive by its dead-reckoned way, one a minute: where they are is what steers, not what
    they say."""
    flight = max(sent.segments, key=lambda each: len(each.values))
    columns = [sensor.name for sensor in flight.sensors.columns]
    t, lat, lon = (flight.values[:, columns.index(n)] for n in ("m_present_time", "m_lat", "m_lon"))
    good = np.isfinite(lat) & np.isfinite(lon) & np.isfinite(t) & (np.abs(lat) < 9001)
    if good.sum() < 2:
        return None
    every = np.arange(t[good][0], t[good][-1], 60.0)
    degrees = [np.trunc(x / 100) + np.fmod(x, 100) / 60 for x in (lat[good], lon[good])]
    depth = 100.0 * (np.arange(len(every)) * 0.61803 % 1.0)
    place = box.place(*(np.interp(every, t[good], x) for x in degrees), depth)
    stand, name = np.full(len(every), 60.0), sent.scenario.glider
    start = every - sent.scenario.start
    return Batch(f"{name}-{every[-1]:.0f}", name, start, place, np.zeros(len(every)), stand)


def replayed(folder: Path, missions: list[Scenario]) -> Cost:
    """Let the installed program take all files."""
    box = box_of(missions[0].origin or missions[0].place)
    (folder / "g.yml").write_text(
        f"dockserver: {{roots: [{folder / 'gliders'}], cache: [{folder / 'cache'}]}}\n"
        f"state: {{path: {folder / 'state.sqlite'}}}\ndefaults: {{neighbours: false}}\n"
        f"fields: {{upper: {{box: {{south: {box.south}, west: {box.west}, north: {box.north}, "
        f"east: {box.east}}}, depth: [0, 100]}}}}\n"
        f"gliders: {{{', '.join(f'{m.glider}: {{}}' for m in missions)}}}\n"
    )
    return cost("run", "-c", folder / "g.yml", "--replay", folder / "gliders", "--out", folder / "out")


def maps(folder: Path, times: list[float], start: float, state: str) -> Scores:
    """Relative error and NEES of the maps that the program writes."""
    out = []
    for t in times:
        at = np.datetime64(int(t), "s").astype(str).replace("T", " ")[:16]
        name = folder / "map.nc"
        cost("field", "upper", "-c", folder / "g.yml", "--state", state, "--at", at, "--out", name)
        with Dataset(name) as file:
            found, error = file["temperature"][0].data, file["temperature_error"][0].data
            moment = float(file["time"][0])
        z, y, x = np.meshgrid(*(np.linspace(0, 1, n) for n in found.shape), indexing="ij")
        truth = stand_in.temperature(np.stack([x, y, z], -1), moment - start)
        off = found - stand_in.MEAN - truth
        relative = float(np.sqrt(np.mean(off**2) / np.mean(truth**2)))
        out.append((relative, float(np.mean(np.square(off / error)))))
    return out


def kept_batches(path: Path) -> list[Batch]:
    """The batches of the field that the program kept, in the order of the surfacings."""
    with Store.looking(path) as store:
        found = store.fields.batches("upper")
    return sorted(found, key=lambda each: each.t[-1])


def others(method: str, batches: list[Batch], times: list[float], start: float) -> Scores:
    """Consensus or literal by the same batches."""
    params = FieldParams("literal") if method == "literal" else FieldParams()
    nodes, left, out = Nodes(params), list(batches), []
    for t in times:
        while left and left[0].t[-1] <= t:
            batch = left.pop(0)
            shifted = replace(batch, t=batch.t - start, value=batch.value - stand_in.MEAN)
            nodes.meet(shifted)
        out.append(score(nodes.at(t - start), t - start, params))
    return out


def run(experiment: Experiment) -> Iterator[Result]:
    """One fleet: what came of it by each of the three."""
    with tempfile.TemporaryDirectory(prefix="gliderwatch-benchmark-") as name:
        folder, missions = Path(name), experiment.missions
        write_files(folder, missions)
        n, start = len(list((folder / "gliders").rglob("*.sbd"))), missions[0].start
        took = replayed(folder, missions)
        print(f"{experiment}: {n} surfacings, {1e3 * took.cpu / n:.0f} ms of processor each", flush=True)
        times = [start + h * HOUR for h in range(EVERY, experiment.days * 24 + 1, EVERY)]
        state = str(folder / "out" / "replay.sqlite")
        batches = kept_batches(Path(state))
        for method in ("pooled", "consensus", "literal"):
            pooled = method == "pooled"
            found = maps(folder, times, start, state) if pooled else others(method, batches, times, start)
            error, nees = zip(*found, strict=True)
            cell = Cell(experiment.gliders, experiment.hours, experiment.days, method, experiment.seed)
            yield Result(cell, tuple((t - start) / HOUR for t in times), error, nees)


def results_of(path: Path | None) -> list[Result]:
    """The results that an earlier run left."""
    if path is None or not path.exists():
        return []
    rows = json.loads(path.read_text())
    return [Result(Cell(**row["cell"]), *map(tuple, (row["t"], row["error"], row["nees"]))) for row in rows]


def main() -> None:
    """Fly, replay, score, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gliders", type=int, nargs="+", default=[1, 5, 10, 15, 20])
    parser.add_argument("--hours", type=float, nargs="+", default=[1.0, 2.0, 3.0])
    parser.add_argument("--days", type=int, default=7)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    print(machine())
    results = results_of(options.json)
    done = {(r.cell.gliders, r.cell.hours, r.cell.days, r.cell.seed) for r in results}
    for hours, gliders in product(options.hours, options.gliders):
        if (gliders, hours, options.days, options.seed) in done:
            continue
        results += run(Experiment(gliders, hours, options.days, options.seed))
        if options.json:
            options.json.write_text(json.dumps([asdict(result) for result in results]))
    results.sort(key=lambda r: (("pooled", "consensus", "literal").index(r.cell.method), r.cell.hours,
                                r.cell.gliders))  # fmt: skip
    print("\n".join(table(results)))
    if options.figure:
        draw(results, options.figure)


if __name__ == "__main__":
    main()
