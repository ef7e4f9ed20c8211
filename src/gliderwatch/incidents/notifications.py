"""What people were notified of, compared with what is so: the messages that are due. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Protocol

from gliderwatch.fleet.advice import Advice
from gliderwatch.incidents.aborts import Episode
from gliderwatch.incidents.acknowledgement import Acks, is_taken_on
from gliderwatch.incidents.calls import SEVERAL, Empty
from gliderwatch.incidents.constants import FLOW_CHANGE, NEWS, REGIME_DIVES, SPEED_CHANGE
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
from gliderwatch.incidents.situation import SituationFacts, next_surfacing, situation
from gliderwatch.incidents.threads import by_thread, thread_id
from gliderwatch.incidents.unjudged import Unknown
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.model import Assessment, Incident, Kind, Severity

# ----------------------------------------
# What people have been told, compared with what is known: the messages that are due. Pure.
#
# Incidents are remade from the data whenever late data come; what was said stays said. So messages are never
# a by-product of a change: they are the difference between the two, found anew after every input. Nothing
# is said twice, and nothing that changed stays unsaid.

NO_ACKS: Acks = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Thread:
    """The messages of one incident: the incident and the dive as last ``told``, how many messages so far, and
    the latest surfacing (s) that was known at the last one."""

    id: str
    told: Incident
    dive: Assessment
    messages: int
    time: float
    withdrawn: bool = False


@dataclass(frozen=True, slots=True)
class NotificationState:
    """What people have been told of one glider.

    ``surfaced`` is the surfacing of the last notice (s), ``silences`` what was sent of its staying away
    (`incidents.overdue`), ``unknown`` of dives that could not be judged (`incidents.unjudged`), ``aborts`` of
    aborts (`incidents.aborts`), ``empty`` of calls without a file (`incidents.calls`), ``neighbours`` how it
    stood to them (`incidents.neighbours`), ``irregularities`` the ids of those of its files, ``renewed`` the
    dive (s) of the last notice of a new way of flying, ``health`` what rules of health found
    (`incidents.health`).
    """

    threads: tuple[Thread, ...] = ()
    surfaced: float | None = None
    silences: tuple[Silence, ...] = ()
    unknown: Unknown | None = None
    aborts: tuple[Episode, ...] = ()
    empty: Empty | None = None
    irregularities: tuple[str, ...] = ()
    neighbours: Comparison | None = None
    renewed: float | None = None
    health: tuple[HealthThread, ...] = ()


class IncidentFacts(SituationFacts, Protocol):
    """What is known of one glider now; the store answers."""

    def dive(self, t_dive: float) -> Assessment | None:
        """The dive that began at a time (s)."""


def due_notifications(
    said: NotificationState,
    known: IncidentFacts,
    reminder_hours: float | None,
    notices: bool,
    acks: Acks = NO_ACKS,
    advice: tuple[tuple[str, Advice], ...] = (),
    layers: LayerAdvice | None = None,
) -> tuple[NotificationState, list[Notice]]:
    """The messages to send now, and what will have been said then.

    `notices`: whether anyone wants a notice of each surfacing. An incident that somebody has acknowledged
    (`acks`) is not brought to mind, unless it has grown worse since. `advice`: where to look next, by the
    name of the field; `layers`: how deep to fly next.
    """
    latest = known.last_surfacing(float("inf"))
    if latest is None:
        return said, []
    threads: list[Thread] = []
    alerts: list[Notice] = []
    incidents = known.incidents()
    matched = _matched(said.threads, incidents)
    for before in said.threads:
        now = matched.get(before.id)
        hours = None if now is not None and _is_acknowledged(before, now, acks) else reminder_hours
        thread, more = _continued(before, now, known, latest, hours)
        threads.append(thread)
        alerts += more
    old = {i.id for i in matched.values()}
    for incident in sorted(incidents, key=lambda i: (i.opened_at, i.id)):
        if incident.id not in old and _is_news(incident, latest):
            thread, more = _begun(incident, known, latest, {t.id for t in threads})
            threads.append(thread)
            alerts += more
    renewed, more = _new_regime(said.renewed, known, latest)
    alerts += more
    surfaced = said.surfaced
    if notices and _is_another(latest, surfaced):
        identity = f"{latest.glider}/surfacing/{latest.t_dive:.0f}"
        before_it = known.last_surfacing(latest.t_surface - 1.0)
        previous = before_it.t_surface if before_it is not None else None
        content = Surfaced(latest, previous, next_surfacing(known, latest), advice, layers)
        info = Severity.INFO
        alerts.append(
            Notice(identity, "", latest.glider, latest.t_surface, Kind.SURFACING, info, info, content)
        )
        surfaced = latest.t_surface
    said = replace(said, threads=tuple(threads), surfaced=surfaced, renewed=renewed)
    return said, sorted(alerts, key=lambda a: a.time)


def _new_regime(
    renewed: float | None, known: IncidentFacts, latest: Assessment
) -> tuple[float | None, list[Notice]]:
    """The dive (s) whose new way of flying people were told of, and the notice of one that is news.

    Files may have come together: it is looked for among the last `REGIME_DIVES`.
    """
    dives = [latest]
    for _ in range(REGIME_DIVES):
        earlier = known.last_surfacing(dives[-1].t_surface - 1.0)
        if earlier is None:
            break
        dives.append(earlier)
    for k, dive in enumerate(dives):
        before = dive.evidence.get("usual_before")
        if renewed is not None and dive.t_dive <= renewed:
            break
        if before is not None and dive.speed is not None and latest.t_surface - dive.t_surface < NEWS:
            since = dives[min(k + 2, len(dives) - 1)].t_dive
            identity = f"{dive.glider}/regime/{dive.t_dive:.0f}"
            content, at = NewRegime(dive, before, since, situation(known)), dive.t_surface
            severity, audience = Severity.INFO, Severity.WARNING
            notice = Notice(identity, "", dive.glider, at, Kind.REGIME, severity, audience, content)
            return dive.t_dive, [notice]
    return renewed, []


def unacknowledged(said: NotificationState, incidents: tuple[Incident, ...], acks: Acks) -> frozenset[str]:
    """The threads of what goes on and nobody has taken on: incidents, and gliders that stay away, cannot be
    judged, have aborted, call and send nothing, or differ from their neighbours."""
    matched = _matched(said.threads, incidents)
    threads = {
        thread.id
        for thread in said.threads
        if (now := matched.get(thread.id)) is not None
        and now.cleared_at is None
        and not _is_acknowledged(thread, now, acks)
    }
    if said.unknown is not None and not said.unknown.is_over:
        threads.add(said.unknown.id)
    threads |= {t.id for t in open_threads(said) if not is_taken_on(acks, (t.id,), t.severity)}
    if said.neighbours is not None and said.neighbours.id:
        threads.add(said.neighbours.id)
    return frozenset(threads | {silence.id for silence in said.silences if silence.called is None})


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


def open_threads(said: NotificationState) -> tuple[OpenThread, ...]:
    """The aborts, calls without a file and findings of health that were reported and go on."""
    aborts = (
        OpenThread(e.id, Kind.ABORT, e.severity, e.told[0].t, e.told[0].cause or str(e.told[0].what))
        for e in said.aborts
        if e.cleared is None and e.told
    )
    health = (
        OpenThread(t.id, Kind.HEALTH, t.reported.severity, t.reported.since, t.reported.last.text)
        for t in said.health
        if not t.is_over
    )
    empty, found = said.empty, list[OpenThread]()
    if empty is not None and not empty.is_over:
        severity = Severity.INFO if empty.told < SEVERAL else Severity.WARNING
        found = [OpenThread(empty.id, Kind.CALL, severity, empty.since, f"{empty.told} without a file")]
    return (*aborts, *found, *health)


def as_notified(said: NotificationState, known: IncidentFacts) -> NotificationState:
    """What was said, as of what is known after all was assessed anew by other code or parameters.

    Nobody is told old things anew: no corrections of what is over, nor of details. What is left to `due` is
    what matters now: an incident that is open and was not told, or was told to be open and is not.
    """
    latest, incidents = known.last_surfacing(float("inf")), known.incidents()
    if latest is None:
        return said
    matched, threads = _matched(said.threads, incidents), list[Thread]()
    for thread in said.threads:
        now = matched.get(thread.id)
        was_open = thread.told.cleared_at is None and not thread.withdrawn
        if was_open != (now is not None and now.cleared_at is None):
            threads.append(thread)
        elif now is None:
            threads.append(replace(thread, withdrawn=True))
        else:
            dive = known.dive(thread.dive.t_dive) or known.last_surfacing(thread.dive.t_surface) or now.last
            threads.append(replace(thread, told=now, dive=dive, withdrawn=False))
    old = {i.id for i in matched.values()} | {t.id for t in threads}
    for i in incidents:
        if i.id not in old and i.cleared_at is not None and _is_news(i, latest):
            threads.append(Thread(i.id, i, i.last, 0, latest.t_surface))
    return replace(said, threads=tuple(threads), renewed=latest.t_dive)


def _is_acknowledged(thread: Thread, now: Incident, acks: Acks) -> bool:
    """Whether somebody has taken an incident on, as bad as it is; late data may have changed its id."""
    ack = acks.get(now.id) or acks.get(thread.id)
    return ack is not None and ack.holds(now)


def _is_another(dive: Assessment, surfaced: float | None) -> bool:
    """Whether a dive ended with a later surfacing than the one that was told, whose time data that came
    late may have moved."""
    return surfaced is None or (dive.t_dive + dive.t_surface) / 2 > surfaced


def _matched(threads: Iterable[Thread], incidents: tuple[Incident, ...]) -> dict[str, Incident]:
    """For each thread the incident that it is about now: the one told, else one of its kind and time."""
    return by_thread({t.id: t.told for t in threads}, incidents, _overlaps)


def _overlaps(now: Incident, told: Incident) -> bool:
    """Whether an incident is of the kind of one that was told and shares dives with it, as far as told."""
    if now.kind != told.kind:
        return False
    until = told.cleared_at if told.cleared_at is not None else told.last.t_surface
    return now.since <= until and (now.cleared_at is None or told.since <= now.cleared_at)


def _is_news(incident: Incident, latest: Assessment) -> bool:
    return incident.cleared_at is None or latest.t_surface - incident.cleared_at < NEWS


def _begun(
    incident: Incident, known: IncidentFacts, latest: Assessment, taken: set[str]
) -> tuple[Thread, list[Notice]]:
    identity = thread_id(incident.id, taken)
    thread = Thread(identity, incident, incident.last, 0, latest.t_surface)
    content = Opened(incident, incident.last, situation(known, incident.id))
    thread, alerts = _message(thread, content, latest)
    if incident.cleared_at is not None:
        thread, more = _message(thread, _cleared(incident, known), latest)
        alerts += more
    return thread, alerts


def _cleared(incident: Incident, known: IncidentFacts) -> Cleared:
    """That an incident is over, with the dive that cleared it and the incidents that go on."""
    dive = known.last_surfacing(incident.cleared_at if incident.cleared_at is not None else float("inf"))
    return Cleared(incident, dive if dive is not None else incident.last, situation(known, incident.id))


def _continued(
    thread: Thread,
    now: Incident | None,
    known: IncidentFacts,
    latest: Assessment,
    reminder_hours: float | None,
) -> tuple[Thread, list[Notice]]:
    """One thread after what is known now, and its messages."""
    dive = known.dive(thread.dive.t_dive) or known.last_surfacing(thread.dive.t_surface) or latest
    if now is None:
        if thread.withdrawn:
            return thread, []
        content = Corrected(thread.told, None, dive, _why(thread, dive), situation(known, thread.told.id))
        told, alerts = _message(thread, content, latest)
        return replace(told, withdrawn=True), alerts
    was_clear, is_clear = thread.told.cleared_at is not None, now.cleared_at is not None
    if is_clear and not was_clear and not thread.withdrawn:
        return _message(thread, _cleared(now, known), latest)
    moved = now.since != thread.told.since or now.cleared_at != thread.told.cleared_at
    if moved or thread.withdrawn or _changed(thread.dive, dive):
        content = Corrected(thread.told, now, dive, _why(thread, dive), situation(known, now.id))
        return _message(thread, content, latest)
    if not is_clear and is_reminder_due(now.opened_at, thread.time, latest.t_surface, reminder_hours):
        hours = (latest.t_surface - now.since) / 3600
        return _message(thread, StillOpen(now, latest, hours, situation(known, now.id)), latest)
    return thread, []


def _changed(told: Assessment, now: Assessment) -> bool:
    """Whether what was told of a dive is no longer true enough."""
    if told.flag != now.flag or (told.speed is None) != (now.speed is None):
        return True
    if told.speed is not None and now.speed is not None and abs(told.speed - now.speed) > SPEED_CHANGE:
        return True
    pairs = ((told.reference_u, now.reference_u), (told.reference_v, now.reference_v))
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
    dive, before = content.dive, thread.told
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
    over += [(min(t.told.since, t.dive.t_dive), ended_at(t)) for t in threads]
    floor, before = cut, math.inf
    while floor < before:  # what is kept may reach further back, and then keep more
        before = floor
        floor = min([before, *(since for since, end in over if end >= before)])
    return floor


def ended_at(thread: Thread) -> float:
    """When a thread had its last message (s); infinite while there may be one to come."""
    if thread.withdrawn:
        return thread.time
    return math.inf if thread.told.cleared_at is None else max(thread.told.cleared_at, thread.time)


def is_removable(incident: Incident, since: float) -> bool:
    """Whether an incident was over before the time (s) from which on all is kept."""
    return incident.cleared_at is not None and incident.cleared_at < since
