"""Processing one input: all that it leads to is written in one transaction, or nothing is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from gliderwatch.errors import GliderwatchError, NotAssessed
from gliderwatch.health.readings import of_call, of_segment
from gliderwatch.health.rule import Limits
from gliderwatch.health.rules import usual_limits
from gliderwatch.incidents import aborts, irregularities, overdue, unjudged
from gliderwatch.incidents import calls as without_files
from gliderwatch.incidents.acknowledgement import with_mute
from gliderwatch.incidents.constants import GONE
from gliderwatch.incidents.notifications import NotificationState, due_notifications
from gliderwatch.incidents.send_schedule import AT_ONCE, Wait
from gliderwatch.messages.overdue_text import Fleet
from gliderwatch.model import Alert, Assessment, Segment, SegmentId
from gliderwatch.navigation.clock import moved
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, Outcome, process
from gliderwatch.sea.ocean_field import Field
from gliderwatch.service.routing import Routing, post_alerts, withdraw_answered
from gliderwatch.slocum.calls import Dialog
from gliderwatch.store.codec import plain_encode
from gliderwatch.store.results import GliderFacts
from gliderwatch.store.state_file import File, Status, Store


@dataclass(frozen=True, slots=True)
class FileOutcome:
    """What an input led to: what became of its file, the dives assessed anew, the messages made."""

    file: File
    assessments: tuple[Assessment, ...] = ()
    alerts: tuple[Alert, ...] = ()


class StoppedError(GliderwatchError):
    """The daemon ends while an input is taken in: nothing of it is kept, the next start takes it again."""


def process_file(
    store: Store,
    file: File,
    segment: Segment,
    params: GliderParams,
    speaking: Routing | None,
    now: float,
    stopping: Callable[[], bool] = lambda: False,
    ocean: Field | None = None,
    limits: Mapping[str, Limits] | None = None,
) -> FileOutcome:
    """Put a segment in its place and go on from the checkpoint before it; say what is to be said.

    A copy that holds no more than the one known is only noted. `speaking` is None while more files of the
    glider are at hand: then the last of them speaks for all. `now` (s) is when the file came; `ocean` is a
    model's field, where dives are compared with one; `limits` are those of the rules of health.
    Raises Quarantine for a segment that cannot be assessed, StoppedError once `stopping` holds; then
    nothing has changed.
    """
    glider = segment.id.glider
    with store.transaction():
        store.hear(segment.id, segment.last_t, now)
        known = store.segments.completeness(segment.id)
        if known is not None and known >= segment.completeness:
            file = replace(file, status=Status.DUPLICATE, reason="this segment is known from a fuller copy")
            store.note(file, now)
            return FileOutcome(file, alerts=_due_messages(store, glider, params, speaking, now))
        file = replace(file, status=Status.TAKEN, reason="")
        store.note(file, now)
        assessments = _run(store, segment, params, stopping, ocean)
        _keep_readings(store, segment, limits)
        alerts = _due_messages(store, glider, params, speaking, now)
    return FileOutcome(file, assessments, alerts)


def record_file(
    store: Store, file: File, params: GliderParams, speaking: Routing | None, now: float
) -> FileOutcome:
    """Write down a file that cannot be taken (now); say what earlier files of its glider left to be said.

    It is a sign of life all the same, if its header tells of what.
    """
    with store.transaction():
        store.note(file, now)
        if file.opened_at is not None and file.status != Status.UNKNOWN:
            store.hear(SegmentId(file.opened_at, file.glider, file.segment), None, now)
        alerts = _due_messages(store, file.glider, params, speaking, now) if file.glider else ()
    return FileOutcome(file, alerts=alerts)


def take_log(
    store: Store,
    file: File,
    dialog: Dialog | None,
    params: GliderParams,
    speaking: Routing | None,
    now: float,
    limits: Mapping[str, Limits] | None = None,
) -> FileOutcome:
    """Keep what the log of a call tells by `now` (s), and say what is to be said.

    `dialog` is None where the log could not be read; `limits` are those of the rules of health.
    """
    with store.transaction():
        store.note(file, now)
        if dialog is not None:
            store.calls.keep(file.path, dialog.call, plain_encode(dialog), now)
            call = dialog.call
            if call.glider and limits != {}:
                store.health.put(call.glider, file.path, call.last_t, of_call(call), limits or usual_limits())
        alerts = (
            _due_messages(store, file.glider, params, speaking, now) if file.status is Status.TAKEN else ()
        )
    return FileOutcome(file, alerts=alerts)


def notify_pilots(
    store: Store, glider: str, params: GliderParams, speaking: Routing, now: float
) -> tuple[Alert, ...]:
    """Say what is to be said of a glider without any new input: after a start or a new configuration."""
    with store.transaction():
        return _due_messages(store, glider, params, speaking, now)


def tick(
    store: Store, glider: str, speaking: Routing, others: Iterable[str], now: float
) -> tuple[Alert, ...]:
    """Say that a glider is overdue, if it is at `now` (s); `others` are watched as well."""
    due_at = next_tick(store, glider, speaking, now)
    if due_at is None or due_at > now:
        return ()
    with store.transaction():
        said, hours = store.said(glider), speaking.attention(glider).overdue_hours
        fleet = replace(_fleet(store, others, now), back=_back(store, said.silences))
        silences, alerts = overdue.tick(said.silences, store.known(glider), fleet, hours, now)
        if silences != said.silences:
            channels = _channels(store, silences, speaking)
            post_alerts(store, glider, replace(said, silences=silences), alerts, channels, now)
    return tuple(alerts)


def _fleet(store: Store, others: Iterable[str], now: float) -> Fleet:
    """How the others at sea are, and whether a message about one of them was for all."""
    outlooks = {other: overdue.outlook(store.known(other), now) for other in others}
    at_sea = {o: x for o, x in outlooks.items() if x is not None and overdue.fleet([x], now).others}
    shore = (s.id for o in at_sea for s in store.said(o).silences if s.called is None and s.shore == s.id)
    found = overdue.fleet(at_sea.values(), now)
    return replace(found, names=tuple(sorted(at_sea)), shore=next(shore, ""))


def _back(store: Store, silences: Iterable[overdue.Silence]) -> float | None:
    """When the first glider called (s) after a time in which none did and of which one of these silences is
    part; None: none has, or none is."""
    shores = {s.shore for s in silences if s.shore and s.called is None}
    if not shores:
        return None
    fleet = (s for other in store.gliders() for s in store.said(other).silences if s.shore in shores)
    return min((s.called for s in fleet if s.called is not None), default=None)


def _channels(
    store: Store, silences: Iterable[overdue.Silence], speaking: Routing
) -> Callable[[Alert], Iterable[str]]:
    """The channels of an alert; of one that is for all gliders, those of the alerts of each."""
    for_all = {s.id for s in silences if s.shore == s.id}

    def channels(alert: Alert) -> Iterable[str]:
        if alert.incident not in for_all:
            return speaking.channels(alert)
        merged: dict[str, list[Wait]] = {}
        for glider in store.gliders():
            if not speaking.attention(glider).recovered:
                found = speaking.channels(replace(alert, glider=glider))
                waits = found if isinstance(found, Mapping) else dict.fromkeys(found, AT_ONCE)
                for name, wait in waits.items():
                    merged.setdefault(name, []).extend(wait)
        return merged

    return channels


def next_tick(store: Store, glider: str, speaking: Routing, now: float) -> float | None:
    """When `tick` has something to say of a glider next (s), None: never."""
    attention = with_mute(speaking.attention(glider), store.notes.muted_until(glider))
    if attention.recovered:
        return None
    silences = store.said(glider).silences
    known, hours = store.known(glider), attention.overdue_hours
    at = overdue.next_tick(silences, known, hours, now, _back(store, silences))
    return at if at is None or attention.muted_until is None else max(at, attention.muted_until)


def _run(
    store: Store,
    segment: Segment,
    params: GliderParams,
    stopping: Callable[[], bool],
    ocean: Field | None,
) -> tuple[Assessment, ...]:
    segments = store.segments
    state, todo = segments.resume(segments.put(segment))
    dives: dict[float, Assessment] = {}
    for identity in todo:
        if stopping():
            raise StoppedError(f"{segment.id.name} was not taken in: the daemon ends")
        one = segment if identity == segment.id else segments.get(identity)
        outcome = _process(state, one, params, ocean)
        store.apply(identity.glider, outcome)
        segments.checkpoint(identity, outcome.state)
        state = outcome.state
        dives = {t: a for t, a in dives.items() if t < outcome.since} | {
            a.t_dive: a for a in outcome.assessments
        }
    segments.thin(segment.id.glider)
    return tuple(dives.values())


def _keep_readings(store: Store, segment: Segment, limits: Mapping[str, Limits] | None) -> None:
    """Keep what a segment tells of the glider's health, by a clock that is right; not where no rule is on."""
    if limits != {}:
        sent = moved(segment, store.segments.offset(segment.id))
        readings = of_segment(sent)
        store.health.put(sent.id.glider, sent.id.name, sent.last_t, readings, limits or usual_limits())


def _process(state: GliderState, segment: Segment, params: GliderParams, ocean: Field | None) -> Outcome:
    """`process`, in which one segment of unforeseen content must not stop all gliders for good."""
    try:
        return process(state, segment, params, ocean)
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise NotAssessed(f"cannot be assessed, please report it ({segment.id.name}: {what})") from error


def _speak_of_calls(
    said: NotificationState, known: GliderFacts, now: float
) -> tuple[NotificationState, list[Alert]]:
    """What is to be said of what a glider told in its calls."""
    calls = known.calls(now - GONE)
    episodes, alerts = aborts.announce(known.glider, said.aborts, calls, now)
    empty, more = without_files.announce(known.glider, said.empty, calls, known.signs(now - GONE), now)
    return replace(said, aborts=episodes, empty=empty), [*alerts, *more]


def _due_messages(
    store: Store, glider: str, params: GliderParams, speaking: Routing | None, now: float
) -> tuple[Alert, ...]:
    if speaking is None:
        return ()
    attention = with_mute(speaking.attention(glider), store.notes.muted_until(glider))
    if attention.is_quiet(now):
        withdraw_answered(store, glider, now, quiet=True)
        return ()
    before, known = store.said(glider), store.known(glider)
    silences, heard = overdue.on_calls(before.silences, known, now)
    said, alerts = due_notifications(
        replace(before, silences=silences),
        known,
        params.rules.reminder_hours,
        speaking.notices(glider),
        store.notes.acks(glider),
    )
    blind, more = unjudged.announce(said.unknown, known, attention, params.rules.reminder_hours, now)
    ids, notices = irregularities.due(before.irregularities, known.irregularities(now), now)
    said = replace(said, unknown=blind, irregularities=ids)
    alerts = [*heard, *notices, *alerts, *more]
    said, more = _speak_of_calls(said, known, now)
    alerts += more
    if said != before or alerts:
        post_alerts(store, glider, said, alerts, _channels(store, before.silences, speaking), now)
    return tuple(alerts)
