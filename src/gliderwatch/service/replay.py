"""A past mission through the same path as a live one, with a state of its own."""

from __future__ import annotations

import tempfile
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from gliderwatch.config import Config, expand
from gliderwatch.delivery.dispatcher import Dispatcher
from gliderwatch.errors import GliderwatchError, MissingCache, Quarantine, Retry
from gliderwatch.export.dives import alert_line, assessment_line, write_lines
from gliderwatch.fleet.reference import beside_neighbours
from gliderwatch.incidents.constants import GONE
from gliderwatch.model import Alert, Hindrance, Segment
from gliderwatch.params import GliderParams
from gliderwatch.service import judgement, transaction
from gliderwatch.service.backlog import Job
from gliderwatch.service.fields import FleetField, fields_of
from gliderwatch.service.layers import layers_of, science_of
from gliderwatch.service.liveness import alive_path
from gliderwatch.service.replay_files import (
    Log,
    ReplayOrder,
    correct_clocks,
    find_files,
    find_logs,
    packed,
    read_logs,
)
from gliderwatch.service.routing import NOBODY, Routing, routing_of
from gliderwatch.service.runtime import OceanCache
from gliderwatch.slocum.caches import SensorLists, lists_folder
from gliderwatch.slocum.decode import Decoder
from gliderwatch.slocum.folders import rank
from gliderwatch.slocum.header import read_header
from gliderwatch.store.database import MEMORY, refuse_foreign
from gliderwatch.store.outbox import Outbox
from gliderwatch.store.state_file import File, Status, Store

STATE = "replay.sqlite"
"""Name of the state file in the folder of results: another one than a daemon's usual."""
ASSESSMENTS, ALERTS = "assessments.jsonl", "alerts.jsonl"
WRITTEN = (ASSESSMENTS, ALERTS, STATE)
"""All that is left in the folder of results."""
SEND_PATIENCE = 120.0
"""Seconds that `--send` waits at the end for messages to be delivered."""


@dataclass(frozen=True, slots=True)
class Request:
    """What to replay: folders, cache folders, the configuration (None: defaults), one glider or all,
    where results go, whether alerts are sent."""

    folders: tuple[Path, ...]
    caches: tuple[Path, ...] = ()
    config: Config | None = None
    glider: str | None = None
    out: Path | None = None
    send: bool = False

    def params(self, glider: str) -> GliderParams:
        """The parameters of a glider."""
        return GliderParams() if self.config is None else self.config.glider(glider)

    def is_wanted(self, glider: str) -> bool:
        """Whether a glider is to be replayed: the one named, else those of the configuration, else all."""
        if self.glider is not None:
            return glider == self.glider
        return self.config is None or glider in self.config.gliders

    def compares(self, glider: str) -> bool:
        """Whether the dives of a glider are compared with those of its neighbours."""
        if self.config is None or self.params(glider).reference == "fleet":
            return True
        return self.config.attention(glider).neighbours


@dataclass(slots=True)
class Report:
    """What a replay found: files by status with reasons, and the store that holds the rest.

    ``clock`` is what time it is for each glider (s): that of its data. ``coming`` is when its files were
    opened that are not processed yet (s).
    """

    store: Store
    ocean: OceanCache | None = None
    fields: tuple[FleetField, ...] = ()
    files: Counter[Status] = field(default_factory=Counter)
    undelivered: int = 0
    clock: dict[str, float] = field(default_factory=dict)
    coming: dict[str, deque[float]] = field(default_factory=dict)


def replay(
    request: Request,
    *,
    on_total: Callable[[int], None] = lambda n: None,
    on_file: Callable[[transaction.FileOutcome], None] = lambda outcome: None,
    workers: int = 1,
    decoder: Decoder | None = None,
) -> Report:
    """Replay the files of some folders in the order of time, decoded by `decoder` (None: one of its own with
    so many `workers`). Raises GliderwatchError where there are none."""
    files = find_files(request.folders)
    has_logs = request.config is None or request.config.dockserver.logs
    logs = find_logs(request.folders) if has_logs else []
    if not files and not logs:
        where = ", ".join(map(str, request.folders))
        archive = packed(request.folders)
        cure = "" if archive is None else f": unpack {archive} first"
        raise GliderwatchError(
            f"no flight data files (sbd, scd, mbd, mcd, dbd, dcd) or logs below {where}{cure}"
        )
    on_total(len(files) + len(logs))
    with _state(request) as path, tempfile.TemporaryDirectory(prefix="gliderwatch-") as kept:
        lists = SensorLists(Path(kept))
        ocean = None if request.config is None else OceanCache(request.config)
        fields = () if request.config is None else fields_of(request.config)
        report = Report(Store.open(path, durable=False), ocean, fields)
        with _delivery(request, path, report) as routing:
            jobs = _judge_all(files, report, lists, request, on_file)
            calls = deque(read_logs(logs, report.store, request.is_wanted))
            _check_glider(request, jobs, calls, report.store)
            report.coming = _coming(jobs, calls)
            order = ReplayOrder(jobs)
            science = None if request.config is None else science_of(request.config)
            caches = [*cache_folders(request), lists.folder]
            with Decoder((), max_workers=workers) if decoder is None else nullcontext(decoder) as hands:
                for decoded in _decoded(jobs, hands, caches, science):
                    for job, sent in order.after(decoded):
                        while calls and calls[0].sent <= sent:
                            _process_log(calls.popleft(), report, request, routing, on_file)
                        _process(job, sent, report, request, routing, on_file)
            for call in calls:
                _process_log(call, report, request, routing, on_file)
        if request.out is not None:
            _write(request.out, report.store, request)
    return report


def cache_folders(request: Request) -> list[Path]:
    """The cache folders named and configured, the folders replayed, any `cache` in or beside them, and the
    lists that the service of the configuration has kept."""
    folders = [*request.caches]
    if request.config is not None:
        folders += expand(request.config.dockserver.cache)
        folders.append(lists_folder(Path(request.config.state.path)))
    looked_into = set[Path]()  # where thousands of files are named, few folders hold them
    for folder in request.folders:
        folders += [folder] if folder.is_dir() else []
        for place in (folder, folder.resolve().parent):
            if place not in looked_into:
                looked_into.add(place)
                folders += caches_in(place)
    return list(dict.fromkeys(folders))


def caches_in(folder: Path) -> list[Path]:
    """The folders in a folder that are called `cache`."""
    return [path for path in folder.glob("[cC][aA][cC][hH][eE]") if path.is_dir()]


@contextmanager
def _state(request: Request) -> Iterator[Path | str]:
    """Where the replay keeps its state: never where the daemon does."""
    if request.out is not None:
        yield _fresh(request.out / STATE, request.config)
    elif request.send:
        with tempfile.TemporaryDirectory(prefix="gliderwatch-") as folder:
            yield Path(folder) / "state.sqlite"
    else:
        yield MEMORY


def _fresh(path: Path, config: Config | None) -> Path:
    """A state file of which nothing is there: what an earlier replay left is removed."""
    if alive_path(path).exists() or (config is not None and path.resolve() == Path(config.state.path)):
        raise GliderwatchError(f"{path} is the state of a daemon: choose another folder for --out")
    refuse_foreign(path, "Choose another folder for --out")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for old in (path, *path.parent.glob(f"{path.name}-*")):
            old.unlink(missing_ok=True)
    except OSError as error:
        raise GliderwatchError(f"{path} cannot be written: {error.strerror}") from None
    return path


@contextmanager
def _delivery(request: Request, path: Path | str, report: Report) -> Iterator[Routing]:
    """Who is notified: nobody, or with `send` whom the configuration says, until all is delivered."""
    if not request.send or request.config is None:
        yield NOBODY if request.config is None else _silent(request.config)
        return
    config, wake = request.config, threading.Event()
    channels = {name: config.channel(name) for name in config.channels}
    outbox = Path(path)
    dispatcher = Dispatcher(lambda: Outbox(outbox), channels, time.time, wake)
    dispatcher.start()
    try:
        yield _at_once(config)
        deadline = time.monotonic() + SEND_PATIENCE
        while report.store.undelivered() and time.monotonic() < deadline:
            wake.set()
            time.sleep(0.05)
    finally:
        dispatcher.stop()
    report.undelivered = len(report.store.undelivered())


def _silent(config: Config) -> Routing:
    """The messages of a configuration, for nobody: they are made and shown, not sent."""
    return replace(routing_of(config), channels=NOBODY.channels)


def _at_once(config: Config) -> Routing:
    """As the configuration says, but nobody waits: what they would have waited for is past."""
    routing = routing_of(config)
    return replace(routing, channels=lambda alert: list(routing.channels(alert)))


def _judge_all(
    files: Sequence[Path],
    report: Report,
    lists: SensorLists,
    request: Request,
    on_file: Callable[[transaction.FileOutcome], None],
) -> list[Job]:
    """The files to decode in the order of time, the fullest copy of a segment first.

    Those that leave their sensor list out are looked at last: any of the others may hold it.
    """
    caches = [*cache_folders(request), lists.folder]
    jobs, noted = list[Job](), list[File]()

    def look(path: Path) -> None:
        found = judgement.judge(path, report.store, caches, request.is_wanted)
        if isinstance(found, Job):
            lists.keep(path, found.header)
            jobs.append(found)
        elif found is not None:
            noted.append(found)

    for path in files:
        look(path)
    waiting, noted = [file for file in noted if file.crc], [file for file in noted if not file.crc]
    for file in waiting:
        look(Path(file.path))
    for found in noted:
        if found.hindrance is Hindrance.NO_CACHE:  # a sign of life: it has its turn with the others
            jobs.append(Job(found, read_header(Path(found.path)), MissingCache(found.crc, caches)))
        else:
            _note(found, report, request, on_file)
    correct_clocks(jobs)
    return sorted(jobs, key=lambda j: (j.opened_at, j.header.id, -rank(j.header.kind), j.file.path))


def _note(
    file: File, report: Report, request: Request, on_file: Callable[[transaction.FileOutcome], None]
) -> None:
    """Write down a file that is not decoded."""
    if file.status == Status.UNKNOWN and request.glider is not None:
        file = replace(file, reason=f"of {file.glider}, not of {request.glider}")
    _count(transaction.record_file(report.store, file, GliderParams(), None, time.time()), report, on_file)


def _check_glider(request: Request, jobs: Sequence[Job], calls: Iterable[Log], store: Store) -> None:
    """Raises GliderwatchError where the glider asked for has no files, but others have."""
    others = sorted({file.glider for file in store.files(Status.UNKNOWN)})
    asked = {job.header.id.glider for job in jobs} | {call.file.glider for call in calls}
    if request.glider is not None and others and request.glider not in asked:
        raise GliderwatchError(f"no files of glider {request.glider}, but of: {', '.join(others)}")


def _decoded(
    jobs: Sequence[Job], decoder: Decoder, caches: Sequence[Path], science: Sequence[str] | None
) -> Iterator[Job]:
    decoder.cache_folders, decoder.science = tuple(caches), science
    results = decoder.map([Path(job.file.path) for job in jobs if job.result is None])
    for job in jobs:
        if job.result is None:
            job.result = next(results)[1]
        yield job


def _process(
    job: Job,
    sent: float,
    report: Report,
    request: Request,
    routing: Routing,
    on_file: Callable[[transaction.FileOutcome], None],
) -> None:
    """Let the clock run until a file was `sent` (s), and take it."""
    glider = job.header.id.glider
    params, ticked = request.params(glider), _tick(report, routing, sent)
    try:
        if not isinstance(job.result, Segment):
            raise job.result if job.result is not None else Retry("was not decoded")
        ocean = None if report.ocean is None else report.ocean.field(glider)
        outcome = transaction.process_file(
            report.store,
            job.file,
            job.result,
            params,
            routing,
            sent,
            ocean=ocean,
            fields=report.fields,
            layers=None if request.config is None else layers_of(request.config, glider),
        )
    except (Quarantine, Retry) as error:
        outcome = transaction.record_file(
            report.store, judgement.failed(job.file, error), params, routing, sent
        )
    report.coming[glider].popleft()
    report.clock[glider] = max(sent, report.clock.get(glider, sent))
    _count(replace(outcome, alerts=(*ticked, *outcome.alerts)), report, on_file)


def _process_log(
    log: Log,
    report: Report,
    request: Request,
    routing: Routing,
    on_file: Callable[[transaction.FileOutcome], None],
) -> None:
    """Let the clock run until a call was over, and take its log."""
    glider, is_read = log.file.glider, log.file.status is Status.TAKEN
    ticked = _tick(report, routing, log.sent) if is_read else []
    try:
        outcome = transaction.process_log(
            report.store,
            log.file,
            log.dialog,
            request.params(glider),
            routing,
            log.sent,
            None if report.ocean is None else report.ocean.field(glider),
            None if request.config is None else layers_of(request.config, glider),
        )
    except Quarantine as error:
        outcome = transaction.record_file(
            report.store, judgement.failed(log.file, error), request.params(glider), routing, log.sent
        )
    if is_read:
        report.coming[glider].popleft()
        report.clock[glider] = max(log.sent, report.clock.get(glider, log.sent))
    _count(replace(outcome, alerts=(*ticked, *outcome.alerts)), report, on_file)


def _coming(jobs: Iterable[Job], calls: Iterable[Log]) -> dict[str, deque[float]]:
    """When the files of each glider were opened and its calls were over, in order of time (s)."""
    coming: dict[str, list[float]] = {}
    for job in jobs:
        coming.setdefault(job.header.id.glider, []).append(job.opened_at)
    for log in calls:
        if log.file.status is Status.TAKEN:
            coming.setdefault(log.file.glider, []).append(log.sent)
    return {glider: deque(sorted(times)) for glider, times in coming.items()}


def _tick(report: Report, routing: Routing, until: float) -> list[Alert]:
    """What a daemon would have reported of all gliders that stay away until a time (s), in its order.

    Nothing between two deployments, nor after the last file: a replay knows that a deployment has ended.
    """
    store, alerts = report.store, list[Alert]()
    while True:
        due = {g: t for g in report.clock if (t := _due(g, report, routing, until)) is not None}
        if not due:
            return alerts
        glider = min(due, key=lambda g: (due[g], g))
        others = [g for g in store.gliders() if g != glider and not routing.attention(g).recovered]
        alerts += transaction.tick(store, glider, routing, others, due[glider])
        report.clock[glider] = due[glider]


def _due(glider: str, report: Report, routing: Routing, until: float) -> float | None:
    """When there is a message about a glider that stays away, if that is before `until` (s)."""
    now, coming = report.clock[glider], report.coming[glider]
    if not coming or coming[0] - now >= GONE:
        return None
    at = transaction.next_tick(report.store, glider, routing, now, until)
    return at if at is not None and now < at <= until else None


def _count(
    outcome: transaction.FileOutcome, report: Report, on_file: Callable[[transaction.FileOutcome], None]
) -> None:
    report.files[outcome.file.status] += 1
    on_file(outcome)


def _write(out: Path, store: Store, request: Request) -> None:
    fleet = [store.assessments(glider) for glider in store.gliders()]
    dives = list(chain.from_iterable(fleet))
    seen = iter(beside_neighbours((dive for dive in dives if request.compares(dive.glider)), fleet))
    lines = (next(seen) if request.compares(dive.glider) else dive for dive in dives)
    write_lines(out / ASSESSMENTS, map(assessment_line, lines))
    write_lines(out / ALERTS, (alert_line(a) for a in store.alerts()))
