"""The experiment of paper 003 through the installed program: simulated files in, maps of the sea out.

    python benchmarks/fleet_program.py [--gliders 15] [--hours 2] [--days 7] [--seed 1] [--json out.json]

Slocums fly in the box of `fleet_field.py` (whose sea, `gliderwatch.simulate.stand_in`, is their temperature),
with currents, fixes, CTD and files of theirs, at about 0.4 m/s. At each surfacing each goes on to where the
gradient of the mean variance leads, as the library says it of the samples so far. The files then go through
`gliderwatch run --replay` and `gliderwatch field --at`, and the maps are held against the sea. The other two
estimators get the batches that the program kept, in the order of the surfacings. Columns as in
`fleet_field.py`; and what the replay cost.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import cost, machine
from fleet_field import DAY, HOUR, Nodes, Pooled, score
from netCDF4 import Dataset

from gliderwatch.fleet.advice import Box, Leg, gradient
from gliderwatch.fleet.scalar_field import Batch, FieldParams, inverse
from gliderwatch.model import Array
from gliderwatch.simulate import stand_in
from gliderwatch.simulate.delivery import write_cache, write_mission
from gliderwatch.simulate.flight import Point, offset
from gliderwatch.simulate.following import fly
from gliderwatch.simulate.glider import fleet
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.scenario_files import find, load_scenario
from gliderwatch.store.state_file import Store

SIDE, SPEED, EVERY = 60e3, 0.4, 12


def scenarios(gliders: int, hours: float, days: float, seed: int) -> list[Scenario]:
    """The fleet, as `gliderwatch simulate --scenario field` has it, but for its intervals."""
    base = load_scenario(find("field"))
    return fleet(replace(base, seed=seed, days=days, interval=hours * HOUR, interval_range=None), gliders)


def box_of(origin: Point) -> Box:
    """The box whose south-western corner is the origin."""
    lat, lon = offset(origin, np.array(SIDE), np.array(SIDE))
    return Box(origin.lat, origin.lon, float(lat), float(lon), 0.0, 100.0)


def write_files(folder: Path, missions: list[Scenario]) -> None:
    """Fly the fleet by the gradient and write its files."""
    box, params = box_of(missions[0].origin), FieldParams()
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


def maps(folder: Path, times: list[float], start: float, state: str) -> list[tuple[float, float]]:
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


def others(batches: list[Batch], times: list[float], start: float) -> dict[str, list[tuple[float, float]]]:
    """Consensus and literal by the same batches."""
    out: dict[str, list[tuple[float, float]]] = {}
    for method in ("consensus", "literal"):
        params = FieldParams("literal") if method == "literal" else FieldParams()
        nodes, left, out[method] = Nodes(params), list(batches), []
        for t in times:
            while left and left[0].t[-1] <= t:
                batch = left.pop(0)
                shifted = Batch(batch.id, batch.glider, batch.t - start, batch.place,
                                batch.value - stand_in.MEAN, batch.stand)  # fmt: skip
                nodes.meet(shifted)
            out[method].append(score(nodes.at(t - start), t - start, params))
    return out


def settled(found: list[tuple[float, float]], times: list[float], start: float) -> Array:
    """Means of error and NEES from the first day on."""
    return np.mean([pair for pair, t in zip(found, times, strict=True) if t >= start + DAY], axis=0)


def main() -> None:
    """Fly, replay, score, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gliders", type=int, default=15)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--days", type=float, default=7.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    print(machine())
    with tempfile.TemporaryDirectory(prefix="gliderwatch-benchmark-") as name:
        folder = Path(name)
        missions = scenarios(options.gliders, options.hours, options.days, options.seed)
        write_files(folder, missions)
        n = len(list((folder / "gliders").rglob("*.sbd")))
        print(f"{n} flight files written", flush=True)
        box, start = box_of(missions[0].origin), missions[0].start
        (folder / "g.yml").write_text(
            f"dockserver: {{roots: [{folder / 'gliders'}], cache: [{folder / 'cache'}]}}\n"
            f"state: {{path: {folder / 'state.sqlite'}}}\ndefaults: {{neighbours: false}}\n"
            f"fields: {{upper: {{box: {{south: {box.south}, west: {box.west}, north: {box.north}, "
            f"east: {box.east}}}, depth: [0, 100]}}}}\n"
            f"gliders: {{{', '.join(f'{m.glider}: {{}}' for m in missions)}}}\n"
        )
        took = cost("run", "-c", folder / "g.yml", "--replay", folder / "gliders", "--out", folder / "out")
        print(f"replay: {took.cpu:.0f} s of processor, {1e3 * took.cpu / n:.0f} ms a surfacing", flush=True)
        times = [start + h * HOUR for h in range(EVERY, int(options.days * 24) + 1, EVERY)]
        state = str(folder / "out" / "replay.sqlite")
        found = {"pooled": maps(folder, times, start, state)}
        found |= others(kept_batches(Path(state)), times, start)
    print("method     gliders  hours  error 24 h   at the end   24 h on    NEES 24 h on")
    for method, pairs in found.items():
        late, nees = settled(pairs, times, start)
        day, end = pairs[int(24 / EVERY) - 1][0], pairs[-1][0]
        print(f"{method:9}  {options.gliders:7d}  {options.hours:5.1f}  {day:10.3f}  {end:11.3f}  {late:8.3f}"
              f"  {nees:13.2f}", flush=True)  # fmt: skip
    if options.json:
        hours = [(t - start) / HOUR for t in times]
        options.json.write_text(json.dumps({"options": vars(options) | {"json": ""}, "t": hours, **found}))


if __name__ == "__main__":
    main()
