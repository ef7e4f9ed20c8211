"""What `gliderwatch simulate` does: flies a fleet, writes its files as time passes or at once, and the truth
beside them."""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from gliderwatch.errors import ConfigError, GliderwatchError
from gliderwatch.simulate.ailments import Ailment, ailing, ailment
from gliderwatch.simulate.calls import CallLog, CallRates, as_called, call_logs, log_steps
from gliderwatch.simulate.delivery import (
    Act,
    FileForm,
    Names,
    Step,
    from_glider,
    make_calls,
    play,
    steps,
    write_cache,
    write_full_rate,
)
from gliderwatch.simulate.flight import Point
from gliderwatch.simulate.following import by_files, fly
from gliderwatch.simulate.glider import fleet, simulate
from gliderwatch.simulate.scenario import DiveTruth, FaultKind, Mission, Scenario
from gliderwatch.simulate.scenario_files import fault_line, find, load_scenario

# ----------------------------------------
# What is true of simulated missions, beside the files that came of them: `truth.nc` and `truth.json`.

_FAULTS = [kind for kind in FaultKind if kind is not FaultKind.NONE]


class _Variable(NamedTuple):
    """One number of each dive: name, unit, standard name (CF) or none, what it is, how to get it."""

    name: str
    units: str
    standard: str
    about: str
    get: Callable[[DiveTruth], float]


_TIME = "seconds since 1970-01-01T00:00:00Z"
_VARIABLES = (
    _Variable("time", _TIME, "time", "surfacing at the end of the dive", lambda d: d.t_surface),
    _Variable("lat", "degrees_north", "latitude", "place of surfacing", lambda d: d.end.lat),
    _Variable("lon", "degrees_east", "longitude", "place of surfacing", lambda d: d.end.lon),
    _Variable("speed", "m s-1", "", "horizontal speed through the water", lambda d: d.speed),
    _Variable(
        "believed_speed", "m s-1", "", "what the glider took for that speed", lambda d: d.believed_speed
    ),
    _Variable("depth_rate", "m s-1", "", "mean magnitude of the depth rate", lambda d: d.depth_rate),
    _Variable("deepest", "m", "", "greatest depth", lambda d: d.deepest),
    _Variable(
        "through_water_u", "m s-1", "", "eastward velocity through the water", lambda d: d.through_water[0]
    ),
    _Variable(
        "through_water_v", "m s-1", "", "northward velocity through the water", lambda d: d.through_water[1]
    ),
    _Variable(
        "u", "m s-1", "eastward_sea_water_velocity", "mean current along the dive", lambda d: d.current[0]
    ),
    _Variable(
        "v", "m s-1", "northward_sea_water_velocity", "mean current along the dive", lambda d: d.current[1]
    ),
    _Variable(
        "reported_u", "m s-1", "", "eastward current that the glider published", lambda d: _reported(d)[0]
    ),
    _Variable(
        "reported_v", "m s-1", "", "northward current that the glider published", lambda d: _reported(d)[1]
    ),
)


def _reported(dive: DiveTruth) -> tuple[float, float]:
    return dive.reported if dive.reported is not None else (np.nan, np.nan)


def write_truth(
    folder: Path,
    missions: Sequence[Mission],
    logs: Mapping[str, Sequence[CallLog]] = MappingProxyType({}),
    ailments: Sequence[Ailment] = (),
) -> tuple[Path, Path]:
    """Write `truth.nc`, one row a dive, and `truth.json`, the faults, artefacts and calls; their paths.

    ``logs`` are those of the calls of each glider, where they are written; the ``ailments`` are the last
    glider's.
    """
    folder.mkdir(parents=True, exist_ok=True)
    table, facts = folder / "truth.nc", folder / "truth.json"
    _write_table(table, missions)
    gliders = [_facts(mission) | _calls(logs.get(mission.scenario.glider, ())) for mission in missions]
    if gliders and ailments:
        gliders[-1]["ailments"] = [
            {"kind": a.kind, "onset": _iso(a.onset), "onset_seconds": a.onset, "size": a.size}
            for a in ailments
        ]
    text = json.dumps({"gliders": gliders}, indent=1)
    facts.write_text(text + "\n", encoding="utf-8")
    return table, facts


def _calls(logs: Sequence[CallLog]) -> dict[str, Any]:
    """What became of each call."""
    calls = [
        {"log": log.name, "begun_seconds": log.begun, "fate": str(log.fate), "pilot_types": log.pilot}
        for log in logs
    ]
    return {"calls": calls} if calls else {}


def _write_table(path: Path, missions: Sequence[Mission]) -> None:
    """A contiguous ragged array of trajectories (CF 1.11, 9.3.3): a glider is one, a dive one row of it."""
    import netCDF4  # noqa: PLC0415 (slow to load, and only simulations need it)

    dives = [dive for mission in missions for dive in mission.truth]
    with netCDF4.Dataset(path, "w", format="NETCDF3_64BIT_OFFSET") as file:
        file.setncatts(
            {
                "Conventions": "CF-1.11",
                "featureType": "trajectory",
                "title": "What is true of simulated glider missions, one row a dive",
                "source": "gliderwatch simulate",
            }
        )
        file.createDimension("glider", len(missions))
        file.createDimension("dive", len(dives))
        file.createDimension("bounds", 2)
        _write_text(file, "glider_name", "glider", [m.scenario.glider for m in missions]).setncatts(
            {"long_name": "name of the glider", "cf_role": "trajectory_id"}
        )
        rows = file.createVariable("row_size", "i4", ("glider",))
        rows.setncatts({"long_name": "number of dives", "sample_dimension": "dive", "units": "1"})
        rows[:] = [len(mission.truth) for mission in missions]
        _write_text(file, "segment", "dive", [d.segment for d in dives]).setncatts(
            {"long_name": "full name of the segment of the dive", "coordinates": "time lat lon"}
        )
        for variable in _VARIABLES:
            _write_variable(file, variable, dives)
        _write_flags(file, dives)


def _write_text(file: Any, name: str, dimension: str, words: list[str]) -> Any:
    from netCDF4 import stringtochar  # noqa: PLC0415

    length = max(map(len, words), default=1)
    file.createDimension(f"{name}_length", length)
    variable = file.createVariable(name, "S1", (dimension, f"{name}_length"))
    variable[:] = stringtochar(np.array(words, dtype=f"S{length}"))
    return variable


def _write_variable(file: Any, variable: _Variable, dives: Sequence[DiveTruth]) -> None:
    made = file.createVariable(variable.name, "f8", ("dive",))
    made.setncatts({"units": variable.units, "long_name": variable.about})
    if variable.standard:
        made.standard_name = variable.standard
    made[:] = [variable.get(dive) for dive in dives]
    if variable.name == "time":
        made.setncatts({"calendar": "standard", "axis": "T", "bounds": "time_bounds"})
        bounds = file.createVariable("time_bounds", "f8", ("dive", "bounds"))
        bounds[:] = [(dive.t_dive, dive.t_surface) for dive in dives]
    elif variable.name not in {"lat", "lon"}:
        made.coordinates = "time lat lon"
        made.cell_methods = "time: maximum" if variable.name == "deepest" else "time: mean"


def _write_flags(file: Any, dives: Sequence[DiveTruth]) -> None:
    """Which faults had begun when a dive ended, as CF 3.5 has it: one bit each."""
    made = file.createVariable("faults", "i4", ("dive",))
    bits = {str(kind): 1 << i for i, kind in enumerate(_FAULTS)}
    made.setncatts(
        {
            "long_name": "faults that had begun",
            "flag_masks": np.array(list(bits.values()), dtype="i4"),
            "flag_meanings": " ".join(bits),
            "coordinates": "time lat lon",
        }
    )
    made[:] = [sum(bits.get(name, 0) for name in set(dive.faults)) for dive in dives]


def _facts(mission: Mission) -> dict[str, Any]:
    scenario, fates = mission.scenario, make_calls(mission).fates
    files: dict[str, list[str]] = {}
    for segment, fate in fates:
        files.setdefault(f"{segment.header.full_name}.{segment.header.extension}", []).append(fate)
    return {
        "glider": scenario.glider,
        "seed": scenario.seed,
        "start": _iso(scenario.start),
        "days": scenario.days,
        "variation": scenario.variation,
        "clock_skew": scenario.rates.clock_skew,
        "faults": [
            {
                "kind": fault.kind,
                "onset": _iso(fault.onset),
                "onset_seconds": fault.onset,
                "size": fault.size,
                "ramp_seconds": fault.ramp,
            }
            for fault in scenario.faults
        ],
        "dives": len(mission.truth),
        "artefacts": {d.segment: list(d.artefacts) for d in mission.truth if d.artefacts},
        "files": files,
    }


def _iso(t: float) -> str:
    return datetime.fromtimestamp(t, UTC).isoformat().replace("+00:00", "Z")


# ----------------------------------------
# What `gliderwatch simulate` does: flies a fleet and writes its files, at once or as time passes.

PATIENCE = 30.0
"""s for which a glider waits at the surface for advice, by the clock of this machine."""
Logs = Mapping[str, Sequence[CallLog]]
"""The logs of the calls of each glider, in order of time."""


@dataclass(frozen=True, slots=True)
class Outage:
    """That a dockserver (0 is the first) cannot be called from ``start`` to ``end`` (s)."""

    relay: int
    start: float
    end: float

    def holds(self, relay: int, t: float) -> bool:
        """Whether it is off at a time (s)."""
        return relay == self.relay and self.start <= t < self.end


@dataclass(frozen=True, slots=True)
class Job:
    """Where to write the files of which gliders, whether compressed, and how much faster than time
    (None: at once). ``calls``: how the calls go whose logs are written (None: none are); it is the last
    glider that aborts, and has the ``ailments``. With several ``relays`` gliders call several dockservers,
    which have ``outages``; with ``advice`` they follow that which a service writes into this folder."""

    out: Path
    scenarios: Sequence[Scenario]
    compressed: bool = False
    speedup: float | None = None
    calls: CallRates | None = None
    ailments: tuple[Ailment, ...] = ()
    relays: int = 1
    outages: tuple[Outage, ...] = ()
    advice: Path | None = None

    @property
    def dockserver(self) -> Path:
        """The folder of the gliders' folders, of the first dockserver."""
        return self.out / "gliders"

    def root(self, relay: int) -> Path:
        """The same of each of the dockservers (0 is the first)."""
        return self.dockserver if self.relays == 1 else self.out / f"relay-{relay + 1}" / "gliders"

    def relay_of(self, member: int, t: float) -> int:
        """The dockserver that a glider calls at a time (s): its own, or the next that is not off."""
        order = [(member + k) % self.relays for k in range(self.relays)]
        up = (relay for relay in order if not any(each.holds(relay, t) for each in self.outages))
        return next(up, order[0])


def gliders(
    name: str, n: int, days: float | None, seed: int | None, faults: Sequence[str], full_rate: bool
) -> list[Scenario]:
    """The scenarios of ``n`` gliders: one by name or file, and what is to be different from it.

    Raises `ConfigError` for a scenario or a fault that is none.
    """
    scenario = load_scenario(find(name))
    scenario = replace(
        scenario,
        days=scenario.days if days is None else days,
        seed=scenario.seed if seed is None else seed,
        full_rate=scenario.full_rate or full_rate,
        faults=(*scenario.faults, *(fault_line(text).fault(scenario.start) for text in faults)),
    )
    return fleet(scenario, n)


def call_rates(abort: str | None) -> CallRates:
    """How calls go: as usual, now and then dropped or without a file; with an abort as in `LEAK@2`, if any.

    Raises `ConfigError` for an abort that is none.
    """
    usual = CallRates(dropped=0.03, no_file=0.03, garbled=0.002, typing=0.1)
    if abort is None:
        return usual
    match = re.fullmatch(r"([A-Za-z_]{1,40})@(\d+(?:\.\d+)?)", abort)
    if match is None:
        raise ConfigError(f"--abort {abort}: give a cause and a day, as LEAK@2")
    return replace(usual, abort=float(match[2]), cause=match[1].upper())


def outages(texts: Sequence[str], relays: int, start: float) -> tuple[Outage, ...]:
    """Outages as in `2@1-1.5`: the second dockserver is off from day 1 to day 1.5.

    Raises `ConfigError` for one that is none.
    """
    found = []
    for text in texts:
        match = re.fullmatch(r"(\d{1,3})@(\d+(?:\.\d+)?)-(\d+(?:\.\d+)?)", text)
        if match is None or not 1 <= int(match[1]) <= relays or float(match[2]) >= float(match[3]):
            raise ConfigError(
                f"--outage {text}: give one of {relays} dockservers and two days, as {relays}@1-1.5"
            )
        since, until = (start + float(match[k]) * 86400.0 for k in (2, 3))
        found.append(Outage(int(match[1]) - 1, since, until))
    return tuple(found)


def ailments(texts: Sequence[str], scenario: Scenario) -> tuple[Ailment, ...]:
    """The ailments given in short, of a scenario. Raises `ConfigError` for one that is none."""
    return tuple(ailment(text, scenario.start) for text in texts)


def run(job: Job) -> None:
    """Do it, and say what was done. Raises `GliderwatchError` where a glider cannot fly."""
    if job.advice is not None:
        _follow(job, job.advice)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console, is_seen = Console(stderr=True), sys.stderr.isatty()
    with Progress(*columns, console=console, transient=True, disable=not is_seen) as progress:
        missions = _fly(job, progress)
        if job.ailments:
            missions[-1] = ailing(missions[-1], job.ailments)
        logs = _logs(job, missions)
        table, facts = write_truth(job.out, missions, logs, job.ailments)
        count = _write(job, missions, logs, progress)
    print(f"{count} files of {len(missions)} gliders below {job.dockserver}")
    print(f"what is true of them: {table}, {facts}")


def _follow(job: Job, advice: Path) -> None:
    """Fly on as the service advises, and say what was done."""
    for scenario in job.scenarios:  # the folders have to be there for the service to watch them
        (job.dockserver / scenario.glider / "from-glider").mkdir(parents=True, exist_ok=True)
    form = FileForm(Names.LONG, job.compressed, generation=job.scenarios[0].generation)
    answers = [0, 0]
    asked = by_files(job.dockserver, job.out / "cache", advice, form, PATIENCE)

    def answer(sent: Mission) -> Point | None:
        waypoint = asked(sent)
        answers[waypoint is None] += 1
        return waypoint

    fleet = {each.glider: each for each in fly(job.scenarios, answer)}
    write_truth(job.out, [each.mission() for each in fleet.values()])
    print(f"{len(fleet)} gliders came up {sum(answers)} times and followed {answers[0]} pieces of advice")


def _fly(job: Job, progress: Progress) -> list[Mission]:
    task, missions = progress.add_task("flying", total=len(job.scenarios)), []
    for scenario in job.scenarios:
        try:
            missions.append(simulate(scenario))
        except ValueError as error:
            raise GliderwatchError(f"{scenario.glider} cannot fly this scenario: {error}") from None
        progress.advance(task)
    return missions


def _logs(job: Job, missions: Sequence[Mission]) -> Logs:
    """The logs of the calls of each glider; none where none are wanted."""
    if job.calls is None:
        return {}
    logs = {}
    for mission in missions:
        rates = job.calls if mission is missions[-1] else replace(job.calls, abort=None)
        ailing_ = job.ailments if mission is missions[-1] else ()
        form = _form(job, mission, Names.AS_SENT)
        logs[mission.scenario.glider] = tuple(call_logs(mission, rates, form, ailing_))
    return logs


def _write(job: Job, missions: Sequence[Mission], logs: Logs, progress: Progress) -> int:
    """Write the files as they come, and those read out after the recovery; how many there are."""
    acts: list[Step] = []
    for mission in missions:
        write_cache(job.out / "cache", mission)
        for relay in range(job.relays):
            from_glider(job.root(relay), mission).mkdir(parents=True, exist_ok=True)
        called = logs.get(mission.scenario.glider, ())
        acts += _routed(
            job,
            mission,
            as_called(steps(job.dockserver, mission, _form(job, mission, Names.AS_SENT)), called),
        )
        acts += log_steps(job.dockserver, mission, called)
    acts.sort(key=lambda step: step.time)
    count = sum(step.ends for step in acts)
    task = progress.add_task("sending", total=count)
    for step in play(acts, _clock(job)):
        progress.advance(task, step.ends)
    recovered = job.out / "recovered"
    for mission in missions:
        count += len(write_full_rate(recovered, mission, _form(job, mission, Names.LONG)))
    return count


def _routed(job: Job, mission: Mission, acts: Iterable[Step]) -> Iterator[Step]:
    """The same acts at the dockservers that are called; all of a file at that where it was begun."""
    if job.relays == 1:
        yield from acts
        return
    roots = dict[Path, Path]()
    for step in sorted(acts, key=lambda each: each.time):
        if step.act in (Act.PUT, Act.BEGIN):
            roots[step.path] = job.root(job.relay_of(mission.scenario.member, step.time))
        root, target = roots[step.path], step.target
        yield replace(
            step,
            path=root / step.path.relative_to(job.dockserver),
            target=None if target is None else root / target.relative_to(job.dockserver),
        )


def _form(job: Job, mission: Mission, names: Names) -> FileForm:
    return FileForm(names, job.compressed, generation=mission.scenario.generation)


def _clock(job: Job) -> Callable[[float], None]:
    """Waits until it is a time of the simulation (s)."""
    if job.speedup is None:
        return lambda t: None
    speedup, first, begun = job.speedup, job.scenarios[0].start, time.monotonic()

    def wait(t: float) -> None:
        time.sleep(max(begun + (t - first) / speedup - time.monotonic(), 0.0))

    return wait
