"""What people were notified of, compared with what is so: the messages that are due. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Protocol

from gliderwatch.fleet.advice import Advice
from gliderwatch.incidents.aborts import Episode
from gliderwatch.incidents.acknowledgement import Acks, is_acknowledged
from gliderwatch.incidents.calls import SEVERAL, CallsWithoutFile
from gliderwatch.incidents.constants import FLOW_CHANGE, NEWS, REGIME_DIVES, SPEED_CHANGE
from gliderwatch.incidents.facts import Facts, last_dives, next_surfacing, situation
from gliderwatch.incidents.health import HealthThread
from gliderwatch.incidents.neighbours import Comparison
from gliderwatch.incidents.notices import (
    Cleared,
    Corrected,
    NewRegime,
    Notice,
    Opened,
    StillOpen,
    Surfaced,
)
from gliderwatch.incidents.overdue import Silence
from gliderwatch.incidents.send_schedule import is_reminder_due
from gliderwatch.incidents.threads import by_thread, thread_id
from gliderwatch.incidents.unjudged import UnjudgedThread
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.model import Assessment, Incident, Kind, Severity

# ----------------------------------------
# What people were notified of, compared with what is so: the messages that are due. Pure.
#
# Incidents are made again from the data whenever late data come; a message that went out stays. So messages
# are never a by-product of a change: they are the difference between the two, computed after every input. No
# message comes twice, and no change is left out.

NO_ACKS: Acks = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Thread:
    """The messages of one incident: the incident as last ``reported``, the ``dive`` in that message, how many
    ``messages`` so far, and the latest surfacing at the last one (``time``, s)."""

    id: str
    reported: Incident
    dive: Assessment
    messages: int
    time: float
    withdrawn: bool = False


@dataclass(frozen=True, slots=True)
class NotificationState:
    """What people were notified of about one glider.

    ``surfaced`` is the surfacing of the last notice (s), ``silences`` the messages of its staying away
    (`incidents.overdue`), ``unknown`` of dives that could not be judged (`incidents.unjudged`), ``aborts`` of
    aborts (`incidents.aborts`), ``empty`` of calls without a file (`incidents.calls`), ``neighbours`` how it
    stood to them (`incidents.neighbours`), ``irregularities`` the ids of those of its files, ``renewed`` the
    dive (s) of the last notice of a new way of flying, ``health`` what rules of health found
    (`incidents.health`).
    """

    threads: tuple[Thread, ...] = ()
    surfaced: float | None = None
    silences: tuple[Silence, ...] = ()
    unknown: UnjudgedThread | None = None
    aborts: tuple[Episode, ...] = ()
    empty: CallsWithoutFile | None = None
    irregularities: tuple[str, ...] = ()
    neighbours: Comparison | None = None
    renewed: float | None = None
    health: tuple[HealthThread, ...] = ()


class IncidentFacts(Facts, Protocol):
    """The facts that messages of incidents need."""

    def dive(self, t_dive: float) -> Assessment | None:
        """The dive that began at a time (s)."""


def due_notifications(
    notified: NotificationState,
    facts: IncidentFacts,
    reminder_hours: float | None,
    notices: bool,
    acks: Acks = NO_ACKS,
    advice: tuple[tuple[str, Advice], ...] = (),
    layers: LayerAdvice | None = None,
) -> tuple[NotificationState, list[Notice]]:
    """What people were notified of after the messages that are due now, and these messages.

    `notices`: whether anyone wants a notice of each surfacing. An incident that somebody has acknowledged
    (`acks`) has no reminders, unless it has grown worse since. `advice`: where to look next, by the
    name of the field; `layers`: how deep to fly next.
    """
    latest, before_it = [*last_dives(facts, 2), None, None][:2]
    if latest is None:
        return notified, []
    threads: list[Thread] = []
    alerts: list[Notice] = []
    incidents = facts.incidents()
    matched = _matched(notified.threads, incidents)
    for before in notified.threads:
        now = matched.get(before.id)
        hours = None if now is not None and _holds_acknowledgement(before, now, acks) else reminder_hours
        thread, more = _continued(before, now, facts, latest, hours)
        threads.append(thread)
        alerts += more
    old = {i.id for i in matched.values()}
    for incident in sorted(incidents, key=lambda i: (i.opened_at, i.id)):
        if incident.id not in old and _is_news(incident, latest):
            thread, more = _opened(incident, facts, latest, {t.id for t in threads})
            threads.append(thread)
            alerts += more
    renewed, more = _new_regime(notified.renewed, facts, latest)
    alerts += more
    surfaced = notified.surfaced
    if notices and _is_another(latest, surfaced):
        identity = f"{latest.glider}/surfacing/{latest.t_dive:.0f}"
        previous = before_it.t_surface if before_it is not None else None
        content = Surfaced(latest, previous, next_surfacing(facts, latest), advice, layers)
        info = Severity.INFO
        alerts.append(
            Notice(identity, "", latest.glider, latest.t_surface, Kind.SURFACING, info, info, content)
        )
        surfaced = latest.t_surface
    notified = replace(notified, threads=tuple(threads), surfaced=surfaced, renewed=renewed)
    return notified, sorted(alerts, key=lambda a: a.time)


def _new_regime(
    renewed: float | None, facts: IncidentFacts, latest: Assessment
) -> tuple[float | None, list[Notice]]:
    """The dive (s) whose new way of flying was reported, and the notice of one that is news.

    Files may have come together: it is looked for among the last `REGIME_DIVES`.
    """
    dives = last_dives(facts, 1 + REGIME_DIVES)
    for k, dive in enumerate(dives):
        before = dive.evidence.get("usual_before")
        if renewed is not None and dive.t_dive <= renewed:
            break
        if before is not None and dive.speed is not None and latest.t_surface - dive.t_surface < NEWS:
            since = dives[min(k + 2, len(dives) - 1)].t_dive
            identity = f"{dive.glider}/regime/{dive.t_dive:.0f}"
            content, at = NewRegime(dive, before, since, situation(facts)), dive.t_surface
            severity, audience = Severity.INFO, Severity.WARNING
            notice = Notice(identity, "", dive.glider, at, Kind.REGIME, severity, audience, content)
            return dive.t_dive, [notice]
    return renewed, []


def unacknowledged(
    notified: NotificationState, incidents: tuple[Incident, ...], acks: Acks
) -> frozenset[str]:
    """The threads of what is open and nobody has acknowledged: incidents, and gliders that stay away, cannot
    be judged, have aborted, call and send nothing, or differ from their neighbours."""
    matched = _matched(notified.threads, incidents)
    threads = {
        thread.id
        for thread in notified.threads
        if (now := matched.get(thread.id)) is not None
        and now.cleared_at is None
        and not _holds_acknowledgement(thread, now, acks)
    }
    if notified.unknown is not None and not notified.unknown.is_over:
        threads.add(notified.unknown.id)
    threads |= {t.id for t in open_threads(notified) if not is_acknowledged(acks, (t.id,), t.severity)}
    if notified.neighbours is not None and notified.neighbours.id:
        threads.add(notified.neighbours.id)
    return frozenset(threads | {silence.id for silence in notified.silences if silence.called is None})


@dataclass(frozen=True, slots=True)
class OpenThread:
    """What goes on and is no incident of dives: an abort, calls without a file, what a rule of health found.

    ``since`` (s); ``about`` in a few words.
    """

    id: str
    kind: Kind
    severity: Severity
    since: float
    about: str

    @property
    def glider(self) -> str:
        """Whose it is."""
        return self.id.split("/", 1)[0]


def open_threads(notified: NotificationState) -> tuple[OpenThread, ...]:
    """The aborts, calls without a file and findings of health that were reported and go on."""
    aborts = (
        OpenThread(e.id, Kind.ABORT, e.severity, e.reports[0].t, e.reports[0].cause or str(e.reports[0].what))
        for e in notified.aborts
        if e.cleared is None and e.reports
    )
    health = (
        OpenThread(t.id, Kind.HEALTH, t.reported.severity, t.reported.since, t.reported.last.text)
        for t in notified.health
        if not t.is_over
    )
    empty, found = notified.empty, list[OpenThread]()
    if empty is not None and not empty.is_over:
        severity = Severity.INFO if empty.reported < SEVERAL else Severity.WARNING
        found = [OpenThread(empty.id, Kind.CALL, severity, empty.since, f"{empty.reported} without a file")]
    return (*aborts, *found, *health)


def as_notified(notified: NotificationState, facts: IncidentFacts) -> NotificationState:
    """What people were notified of, after all dives were assessed again by other code or parameters.

    No old message is sent again: no corrections of what is over, nor of details. What is left to
    `due_notifications` is what matters now: an open incident that was not reported, or one reported as open
    that is not.
    """
    latest, incidents = facts.last_surfacing(float("inf")), facts.incidents()
    if latest is None:
        return notified
    matched, threads = _matched(notified.threads, incidents), list[Thread]()
    for thread in notified.threads:
        now = matched.get(thread.id)
        was_open = thread.reported.cleared_at is None and not thread.withdrawn
        if was_open != (now is not None and now.cleared_at is None):
            threads.append(thread)
        elif now is None:
            threads.append(replace(thread, withdrawn=True))
        else:
            dive = facts.dive(thread.dive.t_dive) or facts.last_surfacing(thread.dive.t_surface) or now.last
            threads.append(replace(thread, reported=now, dive=dive, withdrawn=False))
    old = {i.id for i in matched.values()} | {t.id for t in threads}
    for i in incidents:
        if i.id not in old and i.cleared_at is not None and _is_news(i, latest):
            threads.append(Thread(i.id, i, i.last, 0, latest.t_surface))
    return replace(notified, threads=tuple(threads), renewed=latest.t_dive)


def _holds_acknowledgement(thread: Thread, now: Incident, acks: Acks) -> bool:
    """Whether somebody has acknowledged an incident, as bad as it is; late data may have changed its id."""
    ack = acks.get(now.id) or acks.get(thread.id)
    return ack is not None and ack.holds(now)


def _is_another(dive: Assessment, surfaced: float | None) -> bool:
    """Whether a dive ended with a later surfacing than the one that was reported, whose time data that
    came late may have moved."""
    return surfaced is None or (dive.t_dive + dive.t_surface) / 2 > surfaced


def _matched(threads: Iterable[Thread], incidents: tuple[Incident, ...]) -> dict[str, Incident]:
    """For each thread the incident that it is about now: the one reported, else one of its kind and time."""
    return by_thread({t.id: t.reported for t in threads}, incidents, _overlaps)


def _overlaps(now: Incident, reported: Incident) -> bool:
    """Whether an incident is of the kind of one that was reported and shares dives with it, as far as
    reported."""
    if now.kind != reported.kind:
        return False
    until = reported.cleared_at if reported.cleared_at is not None else reported.last.t_surface
    return now.since <= until and (now.cleared_at is None or reported.since <= now.cleared_at)


def _is_news(incident: Incident, latest: Assessment) -> bool:
    return incident.cleared_at is None or latest.t_surface - incident.cleared_at < NEWS


def _opened(
    incident: Incident, facts: IncidentFacts, latest: Assessment, used: set[str]
) -> tuple[Thread, list[Notice]]:
    identity = thread_id(incident.id, used)
    thread = Thread(identity, incident, incident.last, 0, latest.t_surface)
    content = Opened(incident, incident.last, situation(facts, incident.id))
    thread, alerts = _message(thread, content, latest)
    if incident.cleared_at is not None:
        thread, more = _message(thread, _cleared(incident, facts), latest)
        alerts += more
    return thread, alerts


def _cleared(incident: Incident, facts: IncidentFacts) -> Cleared:
    """That an incident is over, with the dive that cleared it and the incidents that go on."""
    dive = facts.last_surfacing(incident.cleared_at if incident.cleared_at is not None else float("inf"))
    return Cleared(incident, dive if dive is not None else incident.last, situation(facts, incident.id))


def _continued(
    thread: Thread,
    now: Incident | None,
    facts: IncidentFacts,
    latest: Assessment,
    reminder_hours: float | None,
) -> tuple[Thread, list[Notice]]:
    """One thread after what is so now, and its messages."""
    dive = facts.dive(thread.dive.t_dive) or facts.last_surfacing(thread.dive.t_surface) or latest
    if now is None:
        if thread.withdrawn:
            return thread, []
        content = Corrected(
            thread.reported, None, dive, _why(thread, dive), situation(facts, thread.reported.id)
        )
        after, alerts = _message(thread, content, latest)
        return replace(after, withdrawn=True), alerts
    was_clear, is_clear = thread.reported.cleared_at is not None, now.cleared_at is not None
    if is_clear and not was_clear and not thread.withdrawn:
        return _message(thread, _cleared(now, facts), latest)
    moved = now.since != thread.reported.since or now.cleared_at != thread.reported.cleared_at
    if moved or thread.withdrawn or _changed(thread.dive, dive):
        content = Corrected(thread.reported, now, dive, _why(thread, dive), situation(facts, now.id))
        return _message(thread, content, latest)
    if not is_clear and is_reminder_due(now.opened_at, thread.time, latest.t_surface, reminder_hours):
        hours = (latest.t_surface - now.since) / 3600
        return _message(thread, StillOpen(now, latest, hours, situation(facts, now.id)), latest)
    return thread, []


def _changed(reported: Assessment, now: Assessment) -> bool:
    """Whether what was reported of a dive is no longer true enough."""
    if reported.flag != now.flag or (reported.speed is None) != (now.speed is None):
        return True
    if (
        reported.speed is not None
        and now.speed is not None
        and abs(reported.speed - now.speed) > SPEED_CHANGE
    ):
        return True
    pairs = ((reported.reference_u, now.reference_u), (reported.reference_v, now.reference_v))
    return any((a is None) != (b is None) or abs((a or 0.0) - (b or 0.0)) > FLOW_CHANGE for a, b in pairs)


def _why(thread: Thread, now: Assessment) -> str:
    """What data changed a message, in words."""
    if now.t_dive != thread.dive.t_dive or now.n_samples != thread.dive.n_samples:
        return "a segment that came late completed the data"
    if (now.reference_u, now.reference_v) != (thread.dive.reference_u, thread.dive.reference_v):
        return "the depth-averaged current of the dive was corrected"
    return "data that came late changed the dives before"


def _message(
    thread: Thread, content: Opened | StillOpen | Cleared | Corrected, latest: Assessment
) -> tuple[Thread, list[Notice]]:
    """The thread after one more message, and the message."""
    dive, before = content.dive, thread.reported
    now = content.now if isinstance(content, Corrected) else content.incident
    severity = Severity.INFO if now is None or isinstance(content, Cleared) else now.severity
    kinds = {StillOpen: Kind.REMINDER, Cleared: Kind.ALL_CLEAR, Corrected: Kind.CORRECTION}
    kind = kinds.get(type(content), before.kind)
    identity = f"{thread.id}/{thread.messages}"
    notice = Notice(
        identity, thread.id, dive.glider, dive.t_surface, kind, severity, before.severity, content
    )
    return Thread(thread.id, now or before, dive, thread.messages + 1, latest.t_surface), [notice]


# ----------------------------------------
# What the incidents of a glider keep of it when old data are removed.


def kept_since(incidents: Iterable[Incident], threads: Iterable[Thread], cut: float) -> float:
    """The time (s), at the most `cut`, from which on all is kept for incidents that are not over at `cut`."""
    over = [(i.since, math.inf if i.cleared_at is None else i.cleared_at) for i in incidents]
    over += [(min(t.reported.since, t.dive.t_dive), ended_at(t)) for t in threads]
    floor, before = cut, math.inf
    while floor < before:  # what is kept may reach further back, and then keep more
        before = floor
        floor = min([before, *(since for since, end in over if end >= before)])
    return floor


def ended_at(thread: Thread) -> float:
    """When a thread had its last message (s); infinite while there may be one to come."""
    if thread.withdrawn:
        return thread.time
    return math.inf if thread.reported.cleared_at is None else max(thread.reported.cleared_at, thread.time)


def is_removable(incident: Incident, since: float) -> bool:
    """Whether an incident was over before the time (s) from which on all is kept."""
    return incident.cleared_at is not None and incident.cleared_at < since
