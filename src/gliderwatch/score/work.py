"""One glider through the real program: its files are made, replayed, and what came of it is kept."""

from __future__ import annotations

import hashlib
import math
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import msgspec

import gliderwatch
from gliderwatch.config import Config
from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Alert, Assessment, Kind, Segment
from gliderwatch.score.accuracy import results as forecast_results
from gliderwatch.score.graft import grafted, navigate, own_speeds
from gliderwatch.score.grid import Cell, configuration
from gliderwatch.score.measures import HEALTHY, DiveResult, OpenedIncident, Record
from gliderwatch.score.sensors import LEFT_OUT, left_out
from gliderwatch.service import transaction
from gliderwatch.service.replay import Request, cache_folders, replay
from gliderwatch.service.replay_files import find_files
from gliderwatch.service.routing import NOBODY
from gliderwatch.service.transaction import FileOutcome
from gliderwatch.simulate.delivery import FileForm, Names, arrivals, deliver, from_glider, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import DiveTruth, Mission
from gliderwatch.slocum.decode import Decoder
from gliderwatch.store.database import MEMORY
from gliderwatch.store.state_file import File, Status, Store

_QUIET = replace(NOBODY, limits=lambda glider: {})
"""No message goes out, and no rule of health runs: what is scored is the flight."""

# ----------------------------------------
# One glider through the real program: its files are made, replayed, and what came of it is written down.

_FLAGS = {Kind.ANOMALY: 1, Kind.FALSE_ALARM: 2}
_NOT_SCORED = (
    "delivery/channels.py",
    "delivery/mail.py",
    "delivery/dispatcher.py",
    "__main__.py",
    "cli/main.py",
    "cli/tables.py",
)
_OF_SCORE = ("score/graft.py", "score/measures.py", "score/sensors.py", "score/accuracy.py", "score/work.py")


@dataclass(frozen=True, slots=True)
class Task:
    """A cell, the estimators that are still to be run on it, and the file for the result of each."""

    cell: Cell
    estimators: tuple[str, ...]
    paths: tuple[Path, ...]


@cache
def version() -> str:
    """A short hash of the sources that a result depends on: a change of them asks for new results."""
    root = Path(gliderwatch.__file__).parent
    files = [
        (path.relative_to(root).as_posix(), path)
        for path in sorted(root.rglob("*.py"))
        if path.relative_to(root).as_posix() not in _NOT_SCORED
    ]
    digest = hashlib.sha256()
    for name, path in files:
        if not name.startswith("score/") or name in _OF_SCORE:
            digest.update(name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def key(cell: Cell, estimator: str) -> str:
    """A short hash of all that the result of a cell depends on: scenario, parameters, version."""
    config = configuration(estimator, "score", *cell.normal)
    parts = [version(), repr(cell), repr(config.glider("score"))]
    if cell.mission is not None:
        parts += [f"{path.name} {path.stat().st_size}" for path in find_files([cell.mission])]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def result_path(out: Path, cell: Cell, estimator: str) -> Path:
    """Where the result of a cell is written."""
    return out / "cells" / f"{cell.name}-{estimator.replace(':', '-')}-{key(cell, estimator)}.json"


def read_result(path: Path) -> Record | None:
    """A result, None where there is none that can be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Record)
    except (OSError, msgspec.DecodeError):
        return None


def work(task: Task) -> None:
    """Run a cell and write one result for each estimator. Raises GliderwatchError where it cannot be run."""
    for record, path in zip(run(task.cell, task.estimators), task.paths, strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(f".{os.getpid()}.part")
        partial.write_bytes(msgspec.json.encode(record))
        partial.replace(path)


def run(cell: Cell, estimators: Iterable[str]) -> list[Record]:
    """The results of the estimators on the same files."""
    if cell.mission is not None:
        return _run_real(cell, cell.mission, estimators)
    return _run_simulated(cell, estimators)


# --------------------------------------------------------------------------- simulated gliders


def _run_simulated(cell: Cell, estimators: Iterable[str]) -> list[Record]:
    assert cell.scenario is not None
    try:
        mission = simulate(cell.scenario)
    except ValueError as error:
        raise GliderwatchError(f"{cell.name} cannot fly: {error}") from None
    with TemporaryDirectory(prefix="gliderwatch-score-") as folder:
        on_shore = _write(Path(folder), mission)
        return [_replayed(cell, mission, name, Path(folder), on_shore) for name in estimators]


def _write(folder: Path, mission: Mission) -> dict[str, float]:
    """Write the files of a mission as they come; when each path was on shore (s)."""
    write_cache(folder / "cache", mission)
    at, seen = from_glider(folder / "gliders", mission), dict[str, float]()
    for arrival in arrivals(mission, FileForm(Names.AS_SENT, generation=mission.scenario.generation)):
        path = at / arrival.final_name
        deliver(path, arrival.data)
        seen[str(path)] = arrival.time
    return seen


def _replayed(
    cell: Cell, mission: Mission, estimator: str, folder: Path, on_shore: Mapping[str, float]
) -> Record:
    begun, scenario = time.monotonic(), mission.scenario
    onset = scenario.faults[0].onset if scenario.faults else None
    usual = _usual(mission.truth, onset if onset is not None else scenario.start + 5 * 86400)
    low, high = (part * usual for part in cell.normal)
    openings: list[OpenedIncident] = []

    def on_file(outcome: FileOutcome) -> None:
        openings.extend(_openings(outcome.alerts, on_shore[outcome.file.path]))

    config = configuration(estimator, scenario.glider, low, high)
    request = Request((folder / "gliders",), (folder / "cache",), config)
    store = replay(request, on_file=on_file).store
    assessments = store.assessments(scenario.glider)
    dives = dive_results(assessments, mission.truth)
    upcoming = forecast_results(store.forecasts(scenario.glider), assessments, onset or math.inf)
    store.close()
    return Record(
        estimator=estimator,
        sea=cell.sea,
        fault=cell.fault,
        size=cell.size,
        seed=cell.seed,
        is_real=False,
        start=scenario.start,
        end=mission.truth[-1].t_surface,
        onset=onset,
        usual=usual,
        low=low,
        high=high,
        surfacings=tuple(dive.t_surface for dive in mission.truth),
        dives=dives,
        openings=tuple(openings),
        seconds=round(time.monotonic() - begun, 3),
        next=upcoming,
    )


def _usual(truth: Sequence[DiveTruth], until: float) -> float:
    """The median speed (m/s) that the glider believed on its dives before a time (s)."""
    return median(dive.believed_speed for dive in truth if dive.t_surface < until)


def _openings(alerts: Iterable[Alert], on_shore: float) -> list[OpenedIncident]:
    """The messages that open an incident; none is reported before its surfacing."""
    return [
        OpenedIncident(_FLAGS[alert.kind], alert.time, max(alert.time, on_shore))
        for alert in alerts
        if alert.kind in _FLAGS
    ]


def dive_results(assessments: Iterable[Assessment], truth: Sequence[DiveTruth]) -> tuple[DiveResult, ...]:
    """The dives, each with the truth of the simulated one that it has most in common with."""
    return tuple(_result(a, _same(a, truth)) for a in assessments)


def _same(a: Assessment, truth: Sequence[DiveTruth]) -> DiveTruth | None:
    """The dive that an assessment is about: more than half of the time of both, else none."""

    def common(dive: DiveTruth) -> float:
        return min(a.t_surface, dive.t_surface) - max(a.t_dive, dive.t_dive)

    best = max(truth, key=common, default=None)
    longer = max(a.t_surface - a.t_dive, best.t_surface - best.t_dive) if best is not None else 0.0
    return best if best is not None and common(best) > longer / 2 else None


def _result(a: Assessment, truth: DiveTruth | None) -> DiveResult:
    return DiveResult(
        a.t_dive,
        a.t_surface,
        a.flag,
        a.speed,
        a.speed_sigma,
        truth.speed if truth is not None else None,
        truth.believed_speed if truth is not None else None,
    )


# --------------------------------------------------------------------------- real missions


@cache
def _decoded(mission: Path) -> tuple[Segment, ...]:
    """The segments of a real mission in the order of time, the fullest copy of each."""
    request = Request((mission,))
    with Decoder(cache_folders(request)) as decoder:
        results = decoder.map(find_files(request.folders))
        found = [segment for _, segment in results if isinstance(segment, Segment)]
    if not found:
        raise GliderwatchError(f"no file below {mission} could be decoded: see `gliderwatch run --replay`")
    fullest = {s.id.name: s for s in sorted(found, key=lambda s: s.completeness)}
    gliders = {s.id.glider for s in found}
    if len(gliders) > 1:
        raise GliderwatchError(
            f"{mission} has files of {', '.join(sorted(gliders))}: give one glider's folder"
        )
    return tuple(sorted(fullest.values(), key=lambda s: s.id))


def _run_real(cell: Cell, mission: Path, estimators: Iterable[str]) -> list[Record]:
    segments = _decoded(mission)
    dives = navigate(segments)
    if len(dives) < 10:
        raise GliderwatchError(f"{mission} has {len(dives)} dives: too few to tell what is usual")
    onset = dives[len(dives) // 2].t_dive
    before = [speed for t, speed in own_speeds(dives).items() if t < onset]
    if not before:
        raise GliderwatchError(f"{mission} reports no current: what is usual of its speed cannot be found")
    usual = median(before)
    if cell.graft is not None:
        segments = tuple(grafted(segments, cell.graft, onset, usual))
    if cell.without:
        segments = tuple(left_out(segments, LEFT_OUT[cell.without]))
    low, high = (part * usual for part in cell.normal)
    surfacings = tuple(dive.t_surface for dive in dives)
    out = []
    for name in estimators:
        begun = time.monotonic()
        config = configuration(name, segments[0].id.glider, low, high)
        store, openings = _fed(segments, config)
        out.append(
            Record(
                estimator=name,
                sea=cell.sea,
                fault=cell.fault,
                size=cell.size,
                seed=cell.seed,
                is_real=True,
                start=dives[0].t_dive,
                end=surfacings[-1],
                onset=None if cell.fault == HEALTHY else onset,
                usual=usual,
                low=low,
                high=high,
                surfacings=surfacings,
                dives=tuple(_result(a, None) for a in store.assessments(segments[0].id.glider)),
                openings=openings,
                seconds=round(time.monotonic() - begun, 3),
                next=forecast_results(
                    store.forecasts(segments[0].id.glider),
                    store.assessments(segments[0].id.glider),
                    math.inf if cell.fault == HEALTHY else onset,
                ),
            )
        )
        store.close()
    return out


def _fed(segments: Iterable[Segment], config: Config) -> tuple[Store, tuple[OpenedIncident, ...]]:
    """A store with the segments, and the incidents that were opened.

    When a file of a real mission came to shore is not known: not before the last value in it."""
    store, openings = Store.open(MEMORY), list[OpenedIncident]()
    for segment in segments:
        file = File(segment.id.name, 0, 0, Status.WAITING, segment.id.glider, segment.id.name)
        outcome = transaction.process_file(
            store, file, segment, config.glider(segment.id.glider), _QUIET, 0.0
        )
        openings += _openings(outcome.alerts, segment.last_t)
    return store, tuple(openings)


# ----------------------------------------
# What is still to do; what is done stays done.


def to_do(cells: Iterable[Cell], estimators: Sequence[str], out: Path) -> list[Task]:
    """The cells of which a result is still missing."""
    tasks = []
    for cell in cells:
        paths = {e: result_path(out, cell, e) for e in estimators}
        missing = {e: path for e, path in paths.items() if read_result(path) is None}
        if missing:
            tasks.append(Task(cell, tuple(missing), tuple(missing.values())))
    return tasks


def results(cells: Iterable[Cell], estimators: Iterable[str], out: Path) -> list[Record]:
    """The results that there are, estimator by estimator, in the order of the cells."""
    cells = list(cells)
    found = (read_result(result_path(out, cell, e)) for e in estimators for cell in cells)
    return [record for record in found if record is not None]
