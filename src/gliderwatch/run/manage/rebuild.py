"""A glider assessed anew from its files, with today's code and parameters, beside what is known of it."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from gliderwatch.config import Config, expand
from gliderwatch.config.paths import is_folder
from gliderwatch.errors import GliderwatchError, Quarantine, StateError
from gliderwatch.ingest import names
from gliderwatch.ingest.decode import Decoder
from gliderwatch.ingest.lists import lists_folder
from gliderwatch.model import Segment, SegmentId
from gliderwatch.rules.announce import as_told
from gliderwatch.run import arrivals, intake
from gliderwatch.run.backlog import Job
from gliderwatch.run.life import Life, is_held
from gliderwatch.run.manage.change import Change, compare
from gliderwatch.run.manage.opening import known_glider
from gliderwatch.run.ocean import Ocean
from gliderwatch.store import rebuilt
from gliderwatch.store.database import connect, read_only
from gliderwatch.store.sqlite import File, Status, Store

Progress = Callable[[int, int], None]
_STATE = "state.sqlite"


@dataclass(slots=True)
class _Work:
    """Assessing one glider anew: the state there is, the new one, and what was found so far."""

    config: Config
    glider: str
    old: Store
    new: Store
    files: int = 0
    held: int = 0
    problems: list[tuple[str, str]] = field(default_factory=list)


def rebuild(
    config: Config, glider: str, *, keep: bool = False, on_step: Progress = lambda done, total: None
) -> Change:
    """Assess a glider anew from its files, or from the segments held where those are gone.

    All is done in a state of its own; `keep` puts it in place of what is held, for which the service must not
    run. Raises ConfigError for an unknown glider, StateError where the state cannot be used.
    """
    name, path = known_glider(config, glider), Path(config.state.path)
    with _alone(path, keep), tempfile.TemporaryDirectory(prefix="gliderwatch-") as folder:
        place = Path(folder) / _STATE
        with closing(read_only(path)) as db, closing(connect(place, durable=False)) as fresh:
            old, new = Store(db, path), Store(fresh, place)
            with old.guarded(), new.guarded():
                rebuilt.seed(db, fresh, name)
                work = _Work(config, name, old, new)
                _fill(work, rebuilt.paths(db, name), rebuilt.held(db, name), on_step)
                change = compare(name, old, new, (work.files, work.held), work.problems)
                said = as_told(old.said(name), new.known(name))
        if keep:
            with closing(connect(path)) as state, Store(state, path).guarded():
                rebuilt.replace(state, place, name, said)
    return change


@contextmanager
def _alone(path: Path, keep: bool) -> Iterator[None]:
    """With `keep`, nobody else has the state file, and the service cannot be started meanwhile."""
    if not keep:
        yield
        return
    read_only(path).close()  # where there is none, it says what to do
    if is_held(path):
        raise StateError(
            f"the service uses the state file {path}. What to do: systemctl stop gliderwatch, "
            "this command once more, systemctl start gliderwatch"
        )
    life = Life(path)
    try:
        yield
    finally:
        life.end()


def _fill(work: _Work, paths: Sequence[str], held: Sequence[SegmentId], on_step: Progress) -> None:
    """Assess all in the order of time; of one segment the files first, the fullest before the others."""
    caches = [folder for folder in expand(work.config.dockserver.cache) if is_folder(folder)]
    caches.append(lists_folder(Path(work.config.state.path)))
    steps: list[tuple[SegmentId, Job | None]] = [(identity, None) for identity in held]
    steps += [(job.header.id, job) for job in _jobs(work, paths, caches)]
    steps.sort(key=_turn)
    ocean = Ocean(work.config)
    with Decoder(caches, max_workers=2) as decoder:
        results = decoder.map([Path(job.file.path) for _, job in steps if job is not None])
        for done, (identity, job) in enumerate(steps, 1):
            segment = _fuller(work, identity) if job is None else next(results)[1]
            file = File("", 0, 0, Status.TAKEN, work.glider, identity.name) if job is None else job.file
            if segment is not None:
                _take(work, file, segment, len(steps) - done, ocean)
            on_step(done, len(steps))


def _jobs(work: _Work, paths: Sequence[str], caches: Sequence[Path]) -> Iterator[Job]:
    """The files that are there and can be decoded; of the others, why not."""
    for path in paths:
        found = arrivals.judge(Path(path), work.new, caches, lambda name: name == work.glider)
        if isinstance(found, Job):
            yield found
        elif found is not None and found.status != Status.UNKNOWN:
            work.problems.append((path, found.reason))


def _turn(step: tuple[SegmentId, Job | None]) -> tuple[SegmentId, int, str]:
    identity, job = step
    return (identity, 1, "") if job is None else (identity, -names.rank(job.header.kind), job.file.path)


def _fuller(work: _Work, identity: SegmentId) -> Segment | None:
    """The segment held, if it holds more than the files that are still there."""
    segment = work.old.segments.as_sent(identity)
    there = work.new.segments.completeness(segment.id)
    return None if there is not None and there >= segment.completeness else segment


def _take(work: _Work, file: File, segment: Segment | GliderwatchError, following: int, ocean: Ocean) -> None:
    """Assess one more segment; nobody is told."""
    if isinstance(segment, GliderwatchError):
        work.problems.append((file.path, str(segment)))
        return
    if work.new.is_past(segment.id):
        return
    params, field_ = work.config.glider(work.glider), ocean.field(work.glider)
    try:
        with work.new.followed_by(following):
            taken = intake.take(work.new, file, segment, params, None, time.time(), ocean=field_)
    except Quarantine as error:
        work.problems.append((file.path or segment.id.name, str(error)))
        return
    if taken.file.status == Status.TAKEN:
        work.files += bool(file.path)
        work.held += not file.path
