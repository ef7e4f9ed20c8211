"""One input: all that it leads to is written in one transaction, or nothing is; what is long in it is done
before."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import TypeVar

from gliderwatch.fleet.constants import CHECK_WINDOW, NEAR
from gliderwatch.fleet.cross_check import current_of
from gliderwatch.fleet.flow import DiveCurrent
from gliderwatch.health.readings import of_call, of_segment
from gliderwatch.incidents import overdue
from gliderwatch.incidents.acknowledgement import with_mute
from gliderwatch.incidents.due import Findings, Wanted, due
from gliderwatch.incidents.notices import Fleet, Notice
from gliderwatch.incidents.notifications import NotificationState, settled_changes
from gliderwatch.incidents.send_schedule import AT_ONCE, Wait
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.messages.notice_text import render
from gliderwatch.messages.template import with_machine
from gliderwatch.model import Alert, Assessment, Kind, Segment, SegmentId
from gliderwatch.navigation.clock import moved
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState
from gliderwatch.sea.ocean_field import Field
from gliderwatch.service import fields as fields_of_sea
from gliderwatch.service import layers as layers_of_sea
from gliderwatch.service.call_additions import expect_by_calls, keep_call, touched, with_additions
from gliderwatch.service.fields import FieldAdvice, FleetField, look
from gliderwatch.service.layers import GliderLayers
from gliderwatch.service.routing import Routing, post_alerts, post_due, withdraw_answered
from gliderwatch.service.run import Processed, Run, processed
from gliderwatch.slocum.calls import Dialog
from gliderwatch.store.segments import Plan
from gliderwatch.store.state_file import File, Status, Store

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class FileOutcome:
    """What an input led to: what became of its file, the dives assessed, the messages made, where to
    look next for fields, and how deep to fly to keep on layers."""

    file: File
    assessments: tuple[Assessment, ...] = ()
    alerts: tuple[Alert, ...] = ()
    advice: tuple[FieldAdvice, ...] = ()
    layers: LayerAdvice | None = None


LAST_ADVICE = 86400.0
"""s: how deep to fly is not advised by what was measured longer before the last dive."""


def process_file(
    store: Store,
    file: File,
    segment: Segment,
    params: GliderParams,
    routing: Routing | None,
    now: float,
    stopping: Callable[[], bool] = lambda: False,
    ocean: Field | None = None,
    fields: Sequence[FleetField] = (),
    layers: GliderLayers | None = None,
) -> FileOutcome:
    """Put a segment in its place and go on from the checkpoint before it; make the messages that are due.

    A copy that holds no more than the one that is held is only recorded. `routing` is None while more files
    of the glider are at hand: then the last of them speaks for all. `now` (s) is when the file came;
    `ocean` is a model's field, where dives are compared with one; `fields` are those that the gliders
    measure, `layers` says what is to be done about layers of the sea.
    Raises Quarantine for a segment that cannot be assessed, StoppedError once `stopping` holds; then
    nothing has changed.
    """
    glider, before = segment.id.glider, file

    def commit(done: Processed | None) -> FileOutcome:
        if not store.segments.is_fuller(segment):
            reason = "this segment is known from a fuller copy"
            file = replace(before, status=Status.DUPLICATE, reason=reason)
            store.receive(file, segment.id, segment.last_t, now)
            return FileOutcome(file, alerts=_due_messages(store, glider, params, routing, now))
        file = replace(before, status=Status.TAKEN, reason="")
        store.receive(file, segment.id, segment.last_t, now)
        assessments, state = _keep(store, _place(store, segment), segment, done, layers)
        if fields:
            fields_of_sea.add(store, fields, store.segments.kept(segment.id))
        outcome = FileOutcome(file, assessments)
        return _with_news(store, glider, outcome, state, params, routing, now, fields, layers)

    with store.guarded():
        run = _foreseen(store, segment)
        done = None if run is None else processed(run, params, ocean, stopping)
    return _committed(store, commit, done, params, ocean, stopping)


def foreseen(store: Store, segments: Sequence[Segment]) -> Run | None:
    """The run of some segments of one glider that come after all that are held, in order of time; None where
    they do not, or where earlier ones are to be processed again before them."""
    with store.guarded():
        plan = store.segments.plan_after(segments[0].id)
        if plan is None or len(plan.segments) > 1:
            return None
        offset = plan.segments[0].opened_at - segments[0].id.opened_at
        right = [moved(one, offset) for one in segments]
        identities = [one.id for one in right]
        if len({one.name for one in identities}) < len(right) or identities != sorted(identities):
            return None
        if any(store.segments.completeness(one.id) is not None for one in segments[1:]):
            return None
        return _run(store, replace(plan, segments=tuple(identities)), right)


def process_run(
    store: Store,
    files: Sequence[tuple[File, Segment]],
    done: Processed,
    params: GliderParams,
    routing: Routing | None,
    now: float,
    fields: Sequence[FleetField] = (),
    layers: GliderLayers | None = None,
) -> tuple[FileOutcome, ...] | None:
    """Commit a run (`foreseen`) that was processed elsewhere, in one transaction; its last file has the
    messages. None, and nothing is written, where by now another one is to be processed.
    """
    taken = [replace(file, status=Status.TAKEN, reason="") for file, _ in files]
    try:
        with store.transaction():
            firsts = list[SegmentId]()
            for file, (_, segment) in zip(taken, files, strict=True):
                store.receive(file, segment.id, segment.last_t, now)
                firsts.append(_place(store, segment))
            _, state = _keep(store, min(firsts), None, done, layers)
            for _, segment in files if fields else ():
                fields_of_sea.add(store, fields, store.segments.kept(segment.id))
            found = [FileOutcome(f, o.assessments) for f, o in zip(taken, done.outcomes, strict=True)]
            glider = files[-1][1].id.glider
            last = _with_news(store, glider, found[-1], state, params, routing, now, fields, layers)
    except _ToProcessError:
        return None
    return (*found[:-1], last)


def _with_news(
    store: Store,
    glider: str,
    outcome: FileOutcome,
    state: GliderState,
    params: GliderParams,
    routing: Routing | None,
    now: float,
    fields: Sequence[FleetField],
    layers: GliderLayers | None,
) -> FileOutcome:
    """The outcome of the last file at hand of a glider with the messages that are due, and what is advised;
    where `routing` is None, of one before it, without."""
    advice = look(store, fields, glider, state) if fields and routing is not None else ()
    alerts = _due_messages(store, glider, params, routing, now)
    deep = layers_of_sea.newest(store, glider) if layers is not None and routing is not None else None
    return replace(outcome, alerts=alerts, advice=advice, layers=deep)


def record_file(
    store: Store, file: File, params: GliderParams, routing: Routing | None, now: float
) -> FileOutcome:
    """Write down a file that cannot be decoded (now); make the messages that earlier files of its glider
    left.

    It is a sign of life all the same, if its header tells of what.
    """
    with store.transaction():
        if file.opened_at is not None and file.status != Status.UNKNOWN:
            store.receive(file, SegmentId(file.opened_at, file.glider, file.segment), None, now)
        else:
            store.record(file, now)
        alerts = _due_messages(store, file.glider, params, routing, now) if file.glider else ()
    return FileOutcome(file, alerts=alerts)


def process_log(
    store: Store,
    file: File,
    dialog: Dialog | None,
    params: GliderParams,
    routing: Routing | None,
    now: float,
    ocean: Field | None = None,
    layers: GliderLayers | None = None,
    *,
    catch_up: bool = True,
) -> FileOutcome:
    """Keep what the log of a call tells by `now` (s), and make the messages that are due.

    `dialog` is None where the log could not be read. Where it tells what the file of a dive lacks, that dive
    and those after it are assessed again; not yet without `catch_up`, as many logs come at once: then
    `notify_pilots` does. `ocean` and `layers` are as for `process_file`.
    Raises Quarantine where they cannot be assessed; then nothing has changed.
    """

    def commit(done: Processed | None) -> FileOutcome:
        assessments, alerts = tuple[Assessment, ...](), tuple[Alert, ...]()
        store.record(file, now)
        if dialog is not None:
            keep_call(store, file, dialog, now)
            call = dialog.call
            if call.glider:
                store.health.put(call.glider, file.path, call.last_t, of_call(call))
        if file.status is Status.TAKEN:
            if catch_up:
                assessments = _catch_up(store, file.glider, done, layers)
            alerts = _due_messages(store, file.glider, params, routing, now)
        return FileOutcome(file, assessments, alerts)

    return _committed(store, commit, None, params, ocean)


def notify_pilots(
    store: Store,
    glider: str,
    params: GliderParams,
    routing: Routing,
    now: float,
    ocean: Field | None = None,
    layers: GliderLayers | None = None,
) -> tuple[Alert, ...]:
    """Make the messages that are due of a glider without any new input: after a start, a new configuration or
    many logs. Raises Quarantine as `process_log` does."""

    def commit(done: Processed | None) -> tuple[Alert, ...]:
        _catch_up(store, glider, done, layers)
        return _due_messages(store, glider, params, routing, now)

    return _committed(store, commit, None, params, ocean)


def tick(store: Store, glider: str, routing: Routing, others: Iterable[str], now: float) -> tuple[Alert, ...]:
    """Report that a glider is overdue, if it is at `now` (s), and changes of incidents that have waited
    until then; `others` are watched as well."""
    due_at = next_tick(store, glider, routing, now, now)
    if due_at is None or due_at > now:
        return ()
    with store.transaction():
        notified, hours = store.notified(glider), routing.attention(glider).overdue_hours
        fleet = replace(_fleet(store, others, now), back=_back(store, notified.silences))
        facts, acks = store.facts(glider), store.notes.acks(glider)
        silences, due = overdue.tick(notified.silences, facts, fleet, hours, now)
        after, settled = settled_changes(replace(notified, silences=silences), facts, acks, now)
        alerts = tuple(map(render, (*due, *settled)))
        if after != notified:
            post_alerts(store, glider, after, alerts, _channels(store, silences, routing), now)
    return alerts


def _fleet(store: Store, others: Iterable[str], now: float) -> Fleet:
    """How the others at sea are, and whether a message about one of them was for all."""
    outlooks = {other: overdue.outlook(store.facts(other), now) for other in others}
    at_sea = {o: x for o, x in outlooks.items() if x is not None and overdue.fleet([x], now).others}
    shore = (s.id for o in at_sea for s in store.notified(o).silences if s.called is None and s.shore == s.id)
    found = overdue.fleet(at_sea.values(), now)
    return replace(found, names=tuple(sorted(at_sea)), shore=next(shore, ""))


def _back(store: Store, silences: Iterable[overdue.Silence]) -> float | None:
    """When the first glider called (s) after a time in which none did and of which one of these silences is
    part; None: none has, or none is."""
    shores = {s.shore for s in silences if s.shore and s.called is None}
    if not shores:
        return None
    fleet = (s for other in store.gliders() for s in store.notified(other).silences if s.shore in shores)
    return min((s.called for s in fleet if s.called is not None), default=None)


def _channels(
    store: Store, silences: Iterable[overdue.Silence], routing: Routing
) -> Callable[[Alert], Iterable[str]]:
    """The channels of an alert; of one that is for all gliders, those of the alerts of each."""
    for_all = {s.id for s in silences if s.shore == s.id}

    def channels(alert: Alert) -> Iterable[str]:
        if alert.incident not in for_all:
            return routing.channels(alert)
        merged: dict[str, list[Wait]] = {}
        for glider in store.gliders():
            if not routing.attention(glider).recovered:
                found = routing.channels(replace(alert, glider=glider))
                waits = found if isinstance(found, Mapping) else dict.fromkeys(found, AT_ONCE)
                for name, wait in waits.items():
                    merged.setdefault(name, []).extend(wait)
        return merged

    return channels


def next_tick(store: Store, glider: str, routing: Routing, now: float, until: float = inf) -> float | None:
    """When `tick` makes a message about a glider next (s), None: never, or only after `until` (s)."""
    attention = with_mute(routing.attention(glider), store.notes.muted_until(glider))
    if attention.recovered:
        return None
    notified, facts, hours = store.notified(glider), store.facts(glider), attention.overdue_hours
    at = overdue.next_tick(notified.silences, facts, hours, now, _back(store, notified.silences), until)
    if notified.settles is not None:
        at = notified.settles if at is None else min(at, notified.settles)
    return at if at is None or attention.muted_until is None else max(at, attention.muted_until)


def _place(store: Store, segment: Segment) -> SegmentId:
    """Keep a segment and its readings of health; the first segment that is to be processed from there on."""
    first, offset = store.segments.place(segment)
    right = moved(segment, offset)  # by a clock that is right
    store.health.put(segment.id.glider, right.id.name, right.last_t, of_segment(right))
    return touched(store, first)


class _ToProcessError(Exception):
    """A transaction cannot be committed before a run is processed, which must not be done inside of it."""

    def __init__(self, run: Run) -> None:
        super().__init__("to be processed first")
        self.run = run


def _committed(
    store: Store,
    commit: Callable[[Processed | None], T],
    done: Processed | None,
    params: GliderParams,
    ocean: Field | None,
    stopping: Callable[[], bool] = lambda: False,
) -> T:
    """Do a transaction that needs a run to be processed. Others can write while that goes on: the dispatcher
    that a mail was accepted, somebody an acknowledgement.

    `done` is what was foreseen. Where it is not what is needed, nothing is committed and that is processed.
    """
    while True:
        try:
            with store.transaction():
                return commit(done)
        except _ToProcessError as missing:
            done = processed(missing.run, params, ocean, stopping)


def _foreseen(store: Store, segment: Segment) -> Run | None:
    """The run that a segment makes necessary which comes after all that are held of its glider; None of
    another."""
    plan = store.segments.plan_after(segment.id)
    if plan is None:
        return None
    *held, last = plan.segments
    fresh = moved(segment, last.opened_at - segment.id.opened_at)
    return _run(store, plan, [*map(store.segments.get, held), fresh])


def _keep(
    store: Store, first: SegmentId, fresh: Segment | None, done: Processed | None, layers: GliderLayers | None
) -> tuple[tuple[Assessment, ...], GliderState]:
    """Keep the outcomes of a segment that is held and all after it; `fresh` is one of them that is at hand,
    whole. Raises _ToProcessError where `done` is not of the same run."""
    plan = store.segments.plan(first)
    if done is None or not done.plan.is_as(plan):
        whole = {} if fresh is None else {fresh.id: fresh}
        segments = [whole[one] if one in whole else store.segments.get(one) for one in plan.segments]
        raise _ToProcessError(_run(store, plan, segments))
    dives: dict[float, Assessment] = {}
    for identity, outcome, after in zip(plan.segments, done.outcomes, done.states, strict=True):
        store.keep(identity, outcome, after)
        if layers is not None:
            layers_of_sea.learn(store, identity, layers)
        dives = {t: a for t, a in dives.items() if t < outcome.since} | {
            a.t_dive: a for a in outcome.assessments
        }
    store.segments.thin(first)
    return tuple(dives.values()), done.outcomes[-1].state


def _run(store: Store, plan: Plan, segments: Sequence[Segment]) -> Run:
    """A plan with the state that it begins with, and its segments with what calls add to them."""
    ends = [*(one.opened_at for one in plan.segments[1:]), inf]
    whole = tuple(with_additions(store, one, end) for one, end in zip(segments, ends, strict=True))
    return Run(plan, store.segments.state(plan.base), whole)


def _catch_up(
    store: Store, glider: str, done: Processed | None, layers: GliderLayers | None
) -> tuple[Assessment, ...]:
    """Keep what calls have made outdated, processed again. Raises _ToProcessError as `_keep`."""
    newest = store.segments.behind(glider)
    return () if newest is None else _keep(store, newest, None, done, layers)[0]


def _due_messages(
    store: Store,
    glider: str,
    params: GliderParams,
    routing: Routing | None,
    now: float,
) -> tuple[Alert, ...]:
    """Make the messages that are due of a glider; none while `routing` is None, or while it is muted."""
    if routing is None:
        return ()
    expect_by_calls(store, glider, params, now)
    judged = store.health.judge(glider, routing.limits(glider))
    attention = with_mute(routing.attention(glider), store.notes.muted_until(glider))
    if attention.is_quiet(now):
        withdraw_answered(store, glider, now, quiet=True)
        return ()
    before, facts, surfacings = store.notified(glider), store.facts(glider), routing.notices(glider)
    wanted = Wanted(store.notes.acks(glider), attention, params.rules.reminder_hours, surfacings)
    found = Findings(judged)
    if surfacings:
        found = _with_advice(store, glider, found)
    if attention.neighbours and params.compares_own_current:
        found = replace(found, currents=_currents(store, glider, before))
    what = due(before, facts, wanted, found, now)
    alerts = tuple(map(_rendered, what.notices))
    if what.notified != before or alerts:
        channels = _channels(store, before.silences, routing)
        post_due(store, glider, what.notified, what.open_threads, alerts, channels, now)
    return alerts


def _rendered(notice: Notice) -> Alert:
    """The message of a notice; one to the operator names the machine."""
    alert = render(notice)
    return with_machine(alert, socket.gethostname()) if alert.kind is Kind.OPERATOR else alert


def _with_advice(store: Store, glider: str, found: Findings) -> Findings:
    """What was found, with the advice for the next dive: it is in the notice of a surfacing."""
    last = store.facts(glider).last_surfacing(inf)
    if last is None:
        return found
    advice = tuple((field, each) for field, _, each in store.fields.advice(glider, last.t_surface))
    layers = layers_of_sea.newest(store, glider, last.t_dive - LAST_ADVICE)
    return replace(found, advice=advice, layers=layers)


def _currents(store: Store, glider: str, notified: NotificationState) -> list[DiveCurrent] | None:
    """The currents of all gliders about the last surfacing of one, None where it was compared already. Only
    gliders with `reference: dac` or `fleet` have their own currents in their assessments."""
    last, before = store.facts(glider).last_surfacing(inf), notified.neighbours
    if last is None or (before is not None and before.checked >= last.t_surface):
        return None
    currents, since = list[DiveCurrent](), last.t_surface - CHECK_WINDOW
    near = store.surfaced_near(last, since, 2 * NEAR)
    if not any(other != glider for other in near):
        return []  # a glider alone is compared with nothing
    for other in near:
        dives = store.surfaced_between(other, since, last.t_surface)
        each = map(current_of, dives, [None, *dives])
        currents += [current for current in each if current is not None]
    return currents
