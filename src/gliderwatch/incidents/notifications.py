"""What people were notified of, compared with what is so: the messages that are due. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Protocol

from gliderwatch.fleet.advice import Advice
from gliderwatch.incidents.aborts import Episode
from gliderwatch.incidents.acknowledgement import Acks
from gliderwatch.incidents.calls import CallsWithoutFile
from gliderwatch.incidents.constants import (
    BACK,
    FLOW_CHANGE,
    NEWS,
    REGIME_DIVES,
    REMINDED,
    SETTLES,
    SPEED_CHANGE,
)
from gliderwatch.incidents.facts import Facts, last_dives, next_surfacing, situation
from gliderwatch.incidents.health import HealthThread
from gliderwatch.incidents.neighbours import Comparison
from gliderwatch.incidents.notices import (
    Cleared,
    Corrected,
    HealthIncident,
    NewRegime,
    Notice,
    Opened,
    Situation,
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
    """The messages of one incident: it as last ``reported``, the ``dive`` in that message, how many
    ``messages`` so far, the latest surfacing at the last one (``time``), when that was made
    (``reported_at``, both s), and the ids of the incidents of which the thread was ``formerly``."""

    id: str
    reported: Incident
    dive: Assessment
    messages: int
    time: float
    withdrawn: bool = False
    reported_at: float = 0.0
    formerly: tuple[str, ...] = ()

    @property
    def is_open(self) -> bool:
        """Whether people take the incident for open."""
        return self.reported.cleared_at is None and not self.withdrawn


@dataclass(frozen=True, slots=True)
class NotificationState:
    """What people were notified of about one glider.

    ``surfaced`` is the surfacing of the last notice (s), ``silences`` the messages of its staying away
    (`incidents.overdue`), ``unknown`` of dives that could not be judged (`incidents.unjudged`), ``aborts`` of
    aborts (`incidents.aborts`), ``empty`` of calls without a file (`incidents.calls`), ``neighbours`` how it
    stood to them (`incidents.neighbours`), ``irregularities`` the ids of those of its files, ``renewed`` the
    dive (s) of the last notice of a new way of flying, ``health`` what rules of health found
    (`incidents.health`). ``settles`` is when a change that waits is reported (s; None: none waits).
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
    settles: float | None = None


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
    now: float = 0.0,
) -> tuple[NotificationState, list[Notice]]:
    """What people were notified of after the messages that are due now, and these messages.

    `notices`: whether anyone wants a notice of each surfacing. An incident that somebody has acknowledged
    (`acks`) has no reminders, unless it has grown worse since. `advice`: where to look next, by the
    name of the field; `layers`: how deep to fly next. `now` (s) is when the messages are made.
    """
    latest, before_it = [*last_dives(facts, 2), None, None][:2]
    if latest is None:
        return notified, []
    health = tuple(t.reported for t in notified.health if not t.is_over)
    at, silences = max(now, latest.t_surface), notified.silences
    moment = _Moment(facts, latest, at, reminder_hours, acks, health, silences)
    threads, alerts, settles = _of_incidents(notified.threads, moment)
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
    notified = replace(notified, threads=threads, surfaced=surfaced, renewed=renewed, settles=settles)
    return notified, sorted(alerts, key=lambda a: a.time)


def settled_changes(
    notified: NotificationState, facts: IncidentFacts, acks: Acks, now: float
) -> tuple[NotificationState, list[Notice]]:
    """As `due_notifications`, of the changes alone that have waited until `now` (s), without new input."""
    if notified.settles is None or now < notified.settles:
        return notified, []
    return due_notifications(notified, facts, None, False, acks, now=now)


@dataclass(frozen=True, slots=True)
class _Moment:
    """What decides on the messages that are due: the ``latest`` dive, the time ``now`` (s), what rules of
    ``health`` found that goes on, and the messages of ``silences``."""

    facts: IncidentFacts
    latest: Assessment
    now: float
    reminder_hours: float | None
    acks: Acks
    health: tuple[HealthIncident, ...] = ()
    silences: tuple[Silence, ...] = ()


def _of_incidents(
    before: tuple[Thread, ...], moment: _Moment
) -> tuple[tuple[Thread, ...], list[Notice], float | None]:
    """The threads after the messages that are due, these, and when a change that waits is reported (s)."""
    incidents = tuple(sorted(moment.facts.incidents(), key=lambda i: (i.opened_at, i.id)))
    matched = matched_incidents(before, incidents)
    unreported = _unreported(before, matched, incidents, moment.latest)
    # one is open at the most: an anomaly explains measurements that disagree
    opened = next((i for i in unreported if i.cleared_at is None), None)
    over = [i for i in unreported if i.cleared_at is not None]
    threads, notices, settles = list[Thread](), list[Notice](), list[float]()
    for thread in before:
        incident = matched.get(thread.id)
        if opened is not None and thread.is_open and (incident is None or incident.cleared_at is not None):
            after, more = _opened(thread, opened, [*over, incident or thread.reported], moment)
            opened, over = None, []
        else:
            after, more = _continued(thread, incident, moment)
            is_fresh = 0 <= moment.now - thread.reported_at < SETTLES  # not before it: a clock set back
            if more and is_fresh and _can_wait(thread, after, more[0]):
                settles.append(thread.reported_at + SETTLES)
                after, more = thread, []
        threads.append(after)
        notices += more
    for incident in over if opened is None else [opened]:
        thread = Thread(thread_id(incident.id, {t.id for t in threads}), incident, incident.last, 0, 0.0)
        after, more = _opened(
            thread, incident, [] if opened is None else over, moment, _again(before, incident)
        )
        threads.append(after)
        notices += more
    return tuple(threads), notices, min(settles, default=None)


def _again(threads: Iterable[Thread], incident: Incident) -> Incident | None:
    """The incident of the same kind whose end people were notified of within `BACK` before this one."""
    over = [t.reported for t in threads if t.reported.kind is incident.kind and not t.withdrawn]
    ended = [i for i in over if i.cleared_at is not None and 0 <= incident.opened_at - i.cleared_at < BACK]
    return max(ended, key=lambda i: i.cleared_at or 0.0, default=None)


def _unreported(
    threads: Iterable[Thread],
    matched: Mapping[str, Incident],
    incidents: Sequence[Incident],
    latest: Assessment,
) -> list[Incident]:
    """The incidents that are news: no thread is about them, or was before they were over.

    Measurements that disagreed until an anomaly opened are no incident beside it: it explains them.
    """
    reported = {i.id for i in matched.values()}
    former = {identity for t in threads for identity in t.formerly}
    explained = {i.opened_at for i in incidents if i.kind is Kind.ANOMALY}
    return [
        i
        for i in incidents
        if i.id not in reported
        and (i.cleared_at is None or i.id not in former)
        and _is_news(i, latest)
        and not (i.kind is Kind.FALSE_ALARM and i.cleared_at in explained)
    ]


def _can_wait(before: Thread, after: Thread, notice: Notice) -> bool:
    """Whether a message is a change of mind that may wait: that an incident is open is none, nor a
    reminder."""
    return notice.kind is not Kind.REMINDER and (before.is_open or not after.is_open)


def _new_regime(
    renewed: float | None, facts: IncidentFacts, latest: Assessment
) -> tuple[float | None, list[Notice]]:
    """The dive (s) whose new way of flying was reported, and the notice of one that is news.

    Files may have come together: it is looked for among the last `REGIME_DIVES`.
    """
    dives = last_dives(facts, 1 + REGIME_DIVES)
    for k, dive in enumerate(dives):
        before = dive.usual_before
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


def as_notified(notified: NotificationState, facts: IncidentFacts) -> NotificationState:
    """What people were notified of, after all dives were assessed again by other code or parameters.

    No old message is sent again: no corrections of what is over, nor of details. What is left to
    `due_notifications` is what matters now: an open incident that was not reported, or one reported as open
    that is not.
    """
    latest, incidents = facts.last_surfacing(float("inf")), facts.incidents()
    if latest is None:
        return notified
    matched, threads = matched_incidents(notified.threads, incidents), list[Thread]()
    for thread in notified.threads:
        now = matched.get(thread.id)
        if thread.is_open != (now is not None and now.cleared_at is None):
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


def holds_acknowledgement(thread: Thread, now: Incident, acks: Acks) -> bool:
    """Whether somebody has acknowledged an incident, as bad as it is; late data may have changed its id."""
    ack = acks.get(now.id) or acks.get(thread.id)
    return ack is not None and ack.holds(now)


def _is_another(dive: Assessment, surfaced: float | None) -> bool:
    """Whether a dive ended with a later surfacing than the one that was reported, whose time data that
    came late may have moved."""
    return surfaced is None or (dive.t_dive + dive.t_surface) / 2 > surfaced


def matched_incidents(threads: Iterable[Thread], incidents: tuple[Incident, ...]) -> dict[str, Incident]:
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
    thread: Thread,
    incident: Incident,
    former: Sequence[Incident],
    moment: _Moment,
    again: Incident | None = None,
) -> tuple[Thread, list[Notice]]:
    """A thread with the first message of an incident: of one that is over already that is its end.

    It takes the place of the ``former`` ones, which are over or gone without a message of that: one message
    says what is so now. ``again``: one that people take for over.
    """
    content: Opened | Cleared = Opened(
        incident, incident.last, situation(moment.facts, incident.id), former[-1] if former else None, again
    )
    if incident.cleared_at is not None:
        content = _cleared(incident, moment, is_first=True)
    after, notices = _message(thread, content, moment)
    return replace(after, formerly=(*thread.formerly, *(i.id for i in former))), notices


def _cleared(incident: Incident, moment: _Moment, *, is_first: bool = False) -> Cleared:
    """That an incident is over, with the dive that cleared it and what goes on."""
    end = incident.cleared_at if incident.cleared_at is not None else float("inf")
    last = moment.facts.last_surfacing(end) or incident.last
    return Cleared(incident, last, _what_goes_on(incident, moment), is_first)


def _what_goes_on(incident: Incident, moment: _Moment) -> Situation:
    """How it stands beside an incident, with what rules of health found."""
    return replace(situation(moment.facts, incident.id), health=moment.health)


def _continued(thread: Thread, now: Incident | None, moment: _Moment) -> tuple[Thread, list[Notice]]:
    """One thread after what is so now, and its message, if one is due."""
    facts, latest = moment.facts, moment.latest
    dive = facts.dive(thread.dive.t_dive) or facts.last_surfacing(thread.dive.t_surface) or latest
    if now is None:
        if thread.withdrawn:
            return thread, []
        before = thread.reported
        content = Corrected(before, None, dive, _why(thread, dive), situation(facts, before.id))
        after, notices = _message(thread, content, moment)
        return replace(after, withdrawn=True), notices
    if now.cleared_at is not None and thread.is_open:
        return _message(thread, _cleared(now, moment), moment)
    moved = now.since != thread.reported.since or now.cleared_at != thread.reported.cleared_at
    # a reminder says that the incident stands: it does, whatever the flag of its last dive is in the end
    is_other = thread.messages == 1 and thread.dive.flag != dive.flag
    if moved or thread.withdrawn or is_other or _changed(thread.dive, dive):
        content = Corrected(thread.reported, now, dive, _why(thread, dive), situation(facts, now.id))
        return _message(thread, content, moment)
    is_quiet = now.cleared_at is not None or holds_acknowledgement(thread, now, moment.acks)
    last = _last_word(thread, now, moment)
    if not is_quiet and is_reminder_due(now.opened_at, last, latest.t_surface, moment.reminder_hours):
        hours = (latest.t_surface - now.since) / 3600
        return _message(thread, StillOpen(now, latest, hours, _what_goes_on(now, moment)), moment)
    return thread, []


def _last_word(thread: Thread, now: Incident, moment: _Moment) -> float:
    """When people were last told of an incident (s). One that began in a silence of which they were reminded
    has had its first reminder by that."""
    told = any(
        s.messages >= REMINDED
        and s.called is not None
        and s.missed.last_sign <= now.opened_at
        and now.since <= s.called
        for s in moment.silences
    )
    if thread.messages > 1 or moment.reminder_hours is None or not told:
        return thread.time
    return max(thread.time, now.opened_at + 3600 * moment.reminder_hours)


def _changed(reported: Assessment, now: Assessment) -> bool:
    """Whether what was reported of the speed and the flow on a dive is no longer true enough."""
    if (reported.speed is None) != (now.speed is None):
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
    thread: Thread, content: Opened | StillOpen | Cleared | Corrected, moment: _Moment
) -> tuple[Thread, list[Notice]]:
    """The thread after one more message, and the message."""
    dive, before = content.dive, thread.reported
    now = content.now if isinstance(content, Corrected) else content.incident
    severity = Severity.INFO if now is None or isinstance(content, Cleared) else now.severity
    kinds = {StillOpen: Kind.REMINDER, Cleared: Kind.ALL_CLEAR, Corrected: Kind.CORRECTION}
    kind = kinds.get(type(content), before.kind if now is None else now.kind)
    identity = f"{thread.id}/{thread.messages}"
    notice = Notice(
        identity,
        thread.id,
        dive.glider,
        dive.t_surface,
        kind,
        severity,
        max(before.severity, severity),
        content,
    )
    after = replace(
        thread,
        reported=now or before,
        dive=dive,
        messages=thread.messages + 1,
        time=moment.latest.t_surface,
        withdrawn=False,
        reported_at=moment.now,
    )
    return after, [notice]
