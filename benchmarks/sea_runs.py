"""One glider in one sea through the program, for `seas.py`: simulated once, kept, assessed anew each time."""

from __future__ import annotations

import hashlib
import os
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path

import msgspec

import gliderwatch
from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Alert, Assessment, Kind, NextSurfacing, Segment
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.score.accuracy import results as forecast_results
from gliderwatch.score.measures import HEALTHY, DiveResult, NextResult
from gliderwatch.score.work import dive_results
from gliderwatch.service import transaction
from gliderwatch.service.routing import NOBODY
from gliderwatch.simulate.delivery import FileForm, Names, arrivals, deliver, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import SIZES, DiveTruth, Fault, FaultKind, Scenario
from gliderwatch.simulate.seas import sea_mission, with_fault
from gliderwatch.slocum.decode import decode
from gliderwatch.store.codec import decode as unpacked
from gliderwatch.store.codec import encode as packed
from gliderwatch.store.database import MEMORY
from gliderwatch.store.state_file import File, Status, Store

DAY, HOUR = 86400.0, 3600.0
ONSET, AFTER = 6.0, 15.5
"""Days: when a fault begins, and how long the mission is followed from then on."""
SETTLED = 3.0
"""Day from which speeds and forecasts are compared with the truth."""
FAULTS = {"remora": 3.0, "wing_loss": 0.4, "dac_wrong": 0.3, "fouling": 3.0}
AS_IT_IS = {
    "remora": Kind.ANOMALY,
    "wing_loss": Kind.ANOMALY,
    "dac_wrong": Kind.FALSE_ALARM,
    "fouling": Kind.ANOMALY,
}
"""What each fault is to be told as."""
_MANY = 1000
"""Files at hand: more than those whose checkpoints are kept."""
_NOT_MESSAGES = {Kind.SURFACING, Kind.OPERATOR}


class Manner(StrEnum):
    """How a glider is run: as a daemon would, without checkpoints on disk, or without messages."""

    WHOLE = "whole"
    DIRECT = "direct"
    BARE = "bare"


@dataclass(frozen=True)
class Job:
    """A glider to run: kind of sea, seed, fault or `HEALTHY`, days if healthy, where what is made is kept."""

    sea: str
    seed: int
    fault: str
    days: float
    kept: Path

    @property
    def name(self) -> str:
        return f"{self.sea}-{self.seed}-{self.fault}"


@dataclass(frozen=True)
class Flight:
    """A simulated mission as it is known on shore: segments, when each was there (s), and the truth."""

    segments: tuple[Segment, ...]
    on_shore: tuple[float, ...]
    truth: tuple[DiveTruth, ...]


@dataclass(frozen=True)
class Message:
    """A message: hours since the start at its surfacing, and when it could be told; what it says."""

    hours: float
    told: float
    kind: str
    title: str


@dataclass(frozen=True)
class Result:
    """What came of one glider. Times in hours since the start, but for ``start`` (s). Processor time (s) a
    dive: ``cost`` of `pipeline.process` alone (0: not measured), ``cpu`` of all, the store included."""

    sea: str
    seed: int
    fault: str
    hours: float
    onset: float | None
    messages: tuple[Message, ...]
    dives: tuple[DiveResult, ...]
    reasons: tuple[str, ...]
    next: tuple[NextResult, ...]
    start: float
    cost: float
    cpu: float


def scenario(job: Job) -> Scenario:
    """The mission of a job."""
    if job.fault == HEALTHY:
        return sea_mission(job.sea, job.seed, days=job.days)
    healthy, kind = sea_mission(job.sea, job.seed, days=job.days), FaultKind(job.fault)
    fault = Fault(kind, healthy.start + ONSET * DAY, FAULTS[job.fault], SIZES[kind].ramp)
    return with_fault(healthy, fault)


def flight(job: Job) -> Flight:
    """The mission of a job: as it was kept, else simulated, written as files, read again and kept."""
    wanted = scenario(job)
    key = hashlib.sha256(f"{_sources()}\n{wanted!r}\n{AFTER}".encode()).hexdigest()[:16]
    path = job.kept / f"{job.name}-{key}.segments"
    try:
        return unpacked(path.read_bytes(), Flight)
    except (OSError, GliderwatchError):
        pass
    made = _flown(wanted)
    _keep(path, packed(made))
    return made


@cache
def _sources() -> str:
    """A hash of all that makes the segments: the simulator, the decoder and the shape of a segment."""
    root, digest = Path(gliderwatch.__file__).parent, hashlib.sha256()
    made_by = (root / "slocum" / f"{name}.py" for name in ("cycles", "decode", "header", "sensors"))
    for path in (*sorted((root / "simulate").glob("*.py")), *made_by, root / "model.py"):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def _flown(wanted: Scenario) -> Flight:
    mission = simulate(wanted)
    segments, on_shore = [], []
    with tempfile.TemporaryDirectory(prefix="gliderwatch-benchmark-") as name:
        folder = Path(name)
        write_cache(folder / "cache", mission)
        for arrival in arrivals(mission, FileForm(Names.LONG)):
            path = folder / arrival.final_name
            deliver(path, arrival.data)
            segments.append(decode(path, [folder / "cache"]))
            on_shore.append(arrival.time)
            path.unlink()
            if wanted.faults and arrival.time > wanted.faults[0].onset + AFTER * DAY:
                break
    truth = tuple(dive for dive in mission.truth if dive.t_surface <= on_shore[-1])
    return Flight(tuple(segments), tuple(on_shore), truth)


def result(job: Job, manner: Manner) -> Result:
    """What comes of a job: as it was kept by an earlier run of this very program, else run now and kept."""
    key = hashlib.sha256(f"{_program()}\n{job.days}\n{manner}\n{AFTER}".encode()).hexdigest()[:16]
    path = job.kept / "results" / f"{job.name}-{key}.result"
    try:
        return msgspec.msgpack.decode(path.read_bytes(), type=Result)
    except (OSError, msgspec.MsgspecError):
        pass
    made = run_bare(job) if manner is Manner.BARE else run(job, direct=manner is Manner.DIRECT)
    _keep(path, msgspec.msgpack.encode(made))
    return made


def _keep(path: Path, data: bytes) -> None:
    """Write a file that is there whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(f".{os.getpid()}.part")
    partial.write_bytes(data)
    partial.replace(path)


@cache
def _program() -> str:
    """A hash of all of gliderwatch and of this module."""
    root, digest = Path(gliderwatch.__file__).parent, hashlib.sha256(Path(__file__).read_bytes())
    for path in sorted(root.rglob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def run(job: Job, *, direct: bool = False) -> Result:
    """Run the glider of a job through the program as its files came to shore, as a daemon would; ``direct``
    keeps states in memory between files, as while a backlog is taken in, which changes no message."""
    flown, params = flight(job), GliderParams()
    begun, start = time.process_time(), flown.segments[0].id.opened_at
    store, glider = Store.open(MEMORY), flown.segments[0].id.glider
    if direct:
        store.segments.following = _MANY
    messages = [
        Message((a.time - start) / HOUR, (max(a.time, at) - start) / HOUR, str(a.kind), a.title)
        for at, a in fed(store, flown, params)
        if a.kind not in _NOT_MESSAGES
    ]
    dives, expected = store.assessments(glider), store.forecasts(glider)
    store.close()
    cpu = (time.process_time() - begun) / max(len(dives), 1)
    cost = _cost(flown.segments, params) if job.fault == HEALTHY and job.seed == 0 else 0.0
    return _result(job, flown, messages, dives, expected, cost, cpu)


def run_bare(job: Job) -> Result:
    """The same through `pipeline.process` alone, in a quarter of the time: of messages there are those that
    an incident opens; one that opens and is gone with the next file counts as well."""
    flown, params = flight(job), GliderParams()
    begun, start = time.process_time(), flown.segments[0].id.opened_at
    state, dives, opened, said = GliderState(), dict[float, Assessment](), dict[str, Message](), []
    for segment, at in zip(flown.segments, flown.on_shore, strict=True):
        outcome = process(state, segment, params)
        state = outcome.state
        dives = {t: a for t, a in dives.items() if t < outcome.since}
        dives |= {a.t_dive: a for a in outcome.assessments}
        for i in outcome.incidents:
            hours = (i.opened_at - start) / HOUR, (max(i.opened_at, at) - start) / HOUR
            opened.setdefault(i.id, Message(*hours, str(i.kind), f"{i.kind} opened: {i.worst.reason}"))
        said += [outcome.expected] if outcome.expected is not None else []
    every = [dives[t] for t in sorted(dives)]
    cost = (time.process_time() - begun) / max(len(every), 1)
    messages = sorted(opened.values(), key=lambda m: m.hours)
    return _result(job, flown, messages, every, said, cost, cost)


def _result(
    job: Job,
    flown: Flight,
    messages: Sequence[Message],
    dives: Sequence[Assessment],
    expected: Sequence[NextSurfacing],
    cost: float,
    cpu: float,
) -> Result:
    """What came of a flight, with forecasts beside the truth until a fault begins."""
    start = flown.segments[0].id.opened_at
    onset = None if job.fault == HEALTHY else ONSET * 24
    until = start + HOUR * onset if onset is not None else float("inf")
    settled = [a for a in dives if a.t_dive >= start + SETTLED * DAY]
    return Result(
        job.sea,
        job.seed,
        job.fault,
        (flown.truth[-1].t_surface - start) / HOUR,
        onset,
        tuple(messages),
        dive_results(dives, flown.truth),
        tuple(f"{(a.t_dive - start) / HOUR:.1f} h, flag {a.flag}: {a.reason}" for a in dives if a.flag),
        forecast_results(expected, settled, until),
        start,
        cost,
        cpu,
    )


def fed(store: Store, flown: Flight, params: GliderParams) -> Iterator[tuple[float, Alert]]:
    """Each message with the time (s) at which it could be told, in order; silences come between files."""
    glider, clock = flown.segments[0].id.glider, flown.on_shore[0]
    for segment, at in zip(flown.segments, flown.on_shore, strict=True):
        tick = transaction.next_tick(store, glider, NOBODY, clock, at)
        while tick is not None and clock < tick <= at:
            for alert in transaction.tick(store, glider, NOBODY, (), tick):
                yield tick, alert
            clock, tick = tick, transaction.next_tick(store, glider, NOBODY, tick, at)
        clock = at
        file = File(segment.id.name, 0, 0, Status.WAITING, glider, segment.id.name)
        for alert in transaction.process_file(store, file, segment, params, NOBODY, at).alerts:
            yield at, alert


def _cost(segments: Sequence[Segment], params: GliderParams) -> float:
    """Processor time (s) of assessing a dive, nothing else."""
    state, dives = GliderState(), set[float]()
    begun = time.process_time()
    for segment in segments:
        outcome = process(state, segment, params)
        state = outcome.state
        dives |= {a.t_dive for a in outcome.assessments}
    return (time.process_time() - begun) / max(len(dives), 1)


def as_json(results: Sequence[Result], summary: Mapping[str, object]) -> bytes:
    """All of it."""
    return msgspec.json.format(msgspec.json.encode({"summary": summary, "gliders": list(results)}), indent=1)
