"""Taking in one input: all that it leads to is written in one transaction, or nothing is."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from gliderwatch.errors import GliderwatchError, Quarantine
from gliderwatch.model import Alert, Assessment, Segment
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, Outcome, process
from gliderwatch.rules.announce import due
from gliderwatch.store.sqlite import File, Status, Store


@dataclass(frozen=True, slots=True)
class Speaking:
    """Who is told: ``channels`` of an alert, and of which gliders surfacing notices are wanted."""

    channels: Callable[[Alert], Iterable[str]]
    notices: Callable[[str], bool]


@dataclass(frozen=True, slots=True)
class Taken:
    """What an input led to: what became of its file, the dives assessed anew, the messages made."""

    file: File
    assessments: tuple[Assessment, ...] = ()
    alerts: tuple[Alert, ...] = ()


class StoppedError(GliderwatchError):
    """The daemon ends while an input is taken in: nothing of it is kept, the next start takes it again."""


def take(
    store: Store,
    file: File,
    segment: Segment,
    params: GliderParams,
    speaking: Speaking | None,
    now: float,
    stopping: Callable[[], bool] = lambda: False,
) -> Taken:
    """Put a segment in its place and go on from the checkpoint before it; say what is to be said.

    A copy that holds no more than the one known is only noted. `speaking` is None while more files of the
    glider are at hand: then the last of them speaks for all. `now` (s) dates the rows, and decides nothing.
    Raises Quarantine for a segment that cannot be assessed, StoppedError once `stopping` holds; then
    nothing has changed.
    """
    glider = segment.id.glider
    with store.transaction():
        known = store.completeness(glider, segment.id.name)
        if known is not None and known >= segment.completeness:
            file = replace(file, status=Status.DUPLICATE, reason="this segment is known from a fuller copy")
            store.note(file, now)
            return Taken(file, alerts=_speak(store, glider, params, speaking, now))
        file = replace(file, status=Status.TAKEN, reason="")
        store.note(file, now)
        assessments = _run(store, segment, params, stopping)
        alerts = _speak(store, glider, params, speaking, now)
    return Taken(file, assessments, alerts)


def note(store: Store, file: File, params: GliderParams, speaking: Speaking | None, now: float) -> Taken:
    """Write down a file that cannot be taken (now); say what earlier files of its glider left to be said."""
    with store.transaction():
        store.note(file, now)
        alerts = _speak(store, file.glider, params, speaking, now) if file.glider else ()
    return Taken(file, alerts=alerts)


def speak(
    store: Store, glider: str, params: GliderParams, speaking: Speaking, now: float
) -> tuple[Alert, ...]:
    """Say what is to be said of a glider without any new input: after a start or a new configuration."""
    with store.transaction():
        return _speak(store, glider, params, speaking, now)


def _run(
    store: Store, segment: Segment, params: GliderParams, stopping: Callable[[], bool]
) -> tuple[Assessment, ...]:
    state, todo = store.resume(store.put(segment))
    dives: dict[float, Assessment] = {}
    for identity in todo:
        if stopping():
            raise StoppedError(f"{segment.id.name} was not taken in: the daemon ends")
        outcome = _process(state, segment if identity == segment.id else store.segment(identity), params)
        store.apply(identity.glider, outcome)
        store.checkpoint(identity, outcome.state)
        state = outcome.state
        dives = {t: a for t, a in dives.items() if t < outcome.since} | {
            a.t_dive: a for a in outcome.assessments
        }
    store.thin(segment.id.glider)
    return tuple(dives.values())


def _process(state: GliderState, segment: Segment, params: GliderParams) -> Outcome:
    """`process`, in which one segment of unforeseen content must not stop all gliders for good."""
    try:
        return process(state, segment, params)
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise Quarantine(f"cannot be assessed, please report it ({segment.id.name}: {what})") from error


def _speak(
    store: Store, glider: str, params: GliderParams, speaking: Speaking | None, now: float
) -> tuple[Alert, ...]:
    if speaking is None:
        return ()
    before = store.said(glider)
    said, alerts = due(before, store.known(glider), params.rules.reminder_hours, speaking.notices(glider))
    if said != before or alerts:
        store.say(glider, said, alerts, speaking.channels, now)
    return tuple(alerts)
