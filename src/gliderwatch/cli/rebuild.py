"""`gliderwatch rebuild`: a glider assessed again from its files, beside what the state file holds."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from gliderwatch.cli.manage import known_glider
from gliderwatch.config import Config, expand
from gliderwatch.errors import GliderwatchError, Quarantine, StateError
from gliderwatch.incidents.constants import SPEED_CHANGE
from gliderwatch.incidents.notifications import as_notified
from gliderwatch.messages.formatting import clean, utc
from gliderwatch.model import Assessment, Flag, Incident, Segment, SegmentId
from gliderwatch.service import judgement, transaction
from gliderwatch.service.backlog import Job
from gliderwatch.service.layers import layers_of, science_of
from gliderwatch.service.liveness import PidLock, is_held
from gliderwatch.service.runtime import OceanCache
from gliderwatch.slocum import folders
from gliderwatch.slocum.caches import lists_folder
from gliderwatch.slocum.decode import Decoder
from gliderwatch.slocum.folders import is_folder
from gliderwatch.store import maintenance
from gliderwatch.store.database import connect, read_only
from gliderwatch.store.state_file import File, Status, Store

# ----------------------------------------
# What has changed after a glider was assessed again, and how it is shown.

_MOST = 50
"""Dives and files named; the rest is counted."""
_WORDS = {Flag.NORMAL: "0 normal", Flag.ANOMALY: "1 anomaly", Flag.FALSE_ALARM: "2 measurements disagree"}


@dataclass(frozen=True, slots=True)
class Change:
    """What was, and what is after all was assessed again.

    ``files`` and ``held`` count the files and the held segments it was made from. ``dives``: how many before
    and after. ``flags``: pairs of a dive before and after whose flag is another (None: no such dive).
    ``speeds`` counts dives whose speed is another. ``incidents``: pairs, likewise, of those that are another.
    """

    glider: str
    files: int
    held: int
    dives: tuple[int, int]
    flags: tuple[tuple[Assessment | None, Assessment | None], ...]
    speeds: int
    incidents: tuple[tuple[Incident | None, Incident | None], ...]
    problems: tuple[tuple[str, str], ...]

    @property
    def is_none(self) -> bool:
        """Whether nothing that a pilot sees is another."""
        return not (self.flags or self.speeds or self.incidents)


def compare(
    glider: str, old: Store, new: Store, used: tuple[int, int], problems: Sequence[tuple[str, str]]
) -> Change:
    """What two states say of a glider; `used`: how many files, how many held segments."""
    before = {a.t_dive: a for a in old.assessments(glider)}
    after = {a.t_dive: a for a in new.assessments(glider)}
    dives = [(before.get(t), after.get(t)) for t in sorted(before.keys() | after.keys())]
    was, now = ({i.id: i for i in store.incidents(glider)} for store in (old, new))
    pairs = [(was.get(key), now.get(key)) for key in sorted(was.keys() | now.keys())]
    return Change(
        glider,
        *used,
        (len(before), len(after)),
        tuple((a, b) for a, b in dives if a is None or b is None or a.flag != b.flag),
        sum(_is_faster(a, b) for a, b in dives if a is not None and b is not None),
        tuple((a, b) for a, b in pairs if a is None or b is None or _outline(a) != _outline(b)),
        tuple(problems),
    )


def _is_faster(a: Assessment, b: Assessment) -> bool:
    if a.speed is None or b.speed is None:
        return a.speed is not b.speed
    return abs(a.speed - b.speed) > SPEED_CHANGE


def _outline(i: Incident) -> tuple[object, ...]:
    return i.severity, i.since, i.opened_at, i.cleared_at, i.dives


def as_lines(change: Change) -> Iterator[str]:
    """The change in words, a line each."""
    made = f"{change.files} files" + (f" and {change.held} segments held" if change.held else "")
    yield f"{clean(change.glider)}: {change.dives[1]} dives from {made}, {change.dives[0]} before"
    yield from _first([f"  {clean(path, 500)}: {clean(why)}" for path, why in change.problems])
    yield from _first([_dive(*pair) for pair in change.flags])
    for pair in change.incidents:
        yield from _incident(*pair)
    if change.is_none:
        yield "no dive has another flag or speed, no incident is another"
        return
    yield (
        f"{len(change.flags)} dives with another flag, {change.speeds} with a speed more than "
        f"{SPEED_CHANGE:.2f} m/s off, {len(change.incidents)} incidents"
    )


def _first(lines: Sequence[str]) -> Iterator[str]:
    yield from lines[:_MOST]
    if len(lines) > _MOST:
        yield f"  and {len(lines) - _MOST} more"


def _dive(old: Assessment | None, new: Assessment | None) -> str:
    one = new or old
    assert one is not None
    return f"  {utc(one.t_surface)}  {_flag(old)} -> {_flag(new)}"


def _flag(a: Assessment | None) -> str:
    if a is None:
        return "no such dive"
    return f"no flag ({clean(a.reason)})" if a.flag is None else _WORDS[Flag(a.flag)]


def _incident(old: Incident | None, new: Incident | None) -> Iterator[str]:
    if old is None or new is None:
        one = new or old
        assert one is not None
        yield f"  incident {'gone' if new is None else 'new'}: {clean(one.id)}, {_shown(one)}"
        return
    yield f"  incident {clean(new.id)}: {_shown(old)}"
    yield f"    now {_shown(new)}"


def _shown(i: Incident) -> str:
    over = "open" if i.cleared_at is None else f"cleared {utc(i.cleared_at)}"
    return f"{i.severity.name.lower()}, {i.dives} dives, {over}"


# ----------------------------------------
# A glider assessed again from its files, with today's code and parameters, beside what is known of it.

Progress = Callable[[int, int], None]
_STATE = "state.sqlite"


@dataclass(slots=True)
class _Work:
    """Assessing one glider again: the state there is, the new one, and what was found so far."""

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
    """Assess a glider again from its files, or from the segments held where those are gone.

    All is done in a state of its own; `keep` puts it in place of what is held, for which the service must not
    run. Raises ConfigError for an unknown glider, StateError where the state cannot be used.
    """
    name, path = known_glider(config, glider), Path(config.state.path)
    with _alone(path, keep), tempfile.TemporaryDirectory(prefix="gliderwatch-") as folder:
        place = Path(folder) / _STATE
        with closing(read_only(path)) as db, closing(connect(place, durable=False)) as fresh:
            old, new = Store(db, path), Store(fresh, place)
            with old.guarded(), new.guarded():
                maintenance.seed(db, fresh, name)
                work = _Work(config, name, old, new)
                _fill(work, maintenance.paths(db, name), maintenance.held(db, name), on_step)
                change = compare(name, old, new, (work.files, work.held), work.problems)
                notified = as_notified(old.notified(name), new.facts(name))
        if keep:
            with closing(connect(path)) as state, Store(state, path).guarded():
                maintenance.replace(state, place, name, notified)
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
    lock = PidLock(path)
    try:
        yield
    finally:
        lock.end()


def _fill(work: _Work, paths: Sequence[str], held: Sequence[SegmentId], on_step: Progress) -> None:
    """Assess all in the order of time; of one segment the files first, the fullest before the others."""
    caches = [folder for folder in expand(work.config.dockserver.cache) if is_folder(folder)]
    caches.append(lists_folder(Path(work.config.state.path)))
    steps: list[tuple[SegmentId, Job | None]] = [(identity, None) for identity in held]
    steps += [(job.header.id, job) for job in _jobs(work, paths, caches)]
    steps.sort(key=_turn)
    ocean = OceanCache(work.config)
    with Decoder(caches, max_workers=2) as decoder:
        decoder.science = science_of(work.config)
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
        found = judgement.judge(Path(path), work.new, caches, lambda name: name == work.glider)
        if isinstance(found, Job):
            yield found
        elif found is not None and found.status != Status.UNKNOWN:
            work.problems.append((path, found.reason))


def _turn(step: tuple[SegmentId, Job | None]) -> tuple[SegmentId, int, str]:
    identity, job = step
    return (identity, 1, "") if job is None else (identity, -folders.rank(job.header.kind), job.file.path)


def _fuller(work: _Work, identity: SegmentId) -> Segment | None:
    """The segment held, if it holds more than the files that are still there."""
    segment = work.old.segments.as_sent(identity)
    there = work.new.segments.completeness(segment.id)
    return None if there is not None and there >= segment.completeness else segment


def _take(
    work: _Work, file: File, segment: Segment | GliderwatchError, following: int, ocean: OceanCache
) -> None:
    """Assess one more segment; nobody is notified."""
    if isinstance(segment, GliderwatchError):
        work.problems.append((file.path, str(segment)))
        return
    if work.new.is_past(segment.id):
        return
    params, field_ = work.config.glider(work.glider), ocean.field(work.glider)
    try:
        with work.new.followed_by(following):
            layers = layers_of(work.config, work.glider)
            outcome = transaction.process_file(
                work.new, file, segment, params, None, time.time(), ocean=field_, layers=layers
            )
    except Quarantine as error:
        work.problems.append((file.path or segment.id.name, str(error)))
        return
    if outcome.file.status == Status.TAKEN:
        work.files += bool(file.path)
        work.held += not file.path
