"""Findings of the rules of health become incidents, by the table of all incidents; the notices due. Pure.

What is so follows from the readings, whatever their order of arrival. Notices are the difference between that
and what people have been notified of, as for all incidents.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from gliderwatch.health.attitude import ROLL
from gliderwatch.health.constants import DAY, RELAPSE, REMEMBERED
from gliderwatch.health.rule import Finding
from gliderwatch.health.rules import RULES, Judged
from gliderwatch.incidents.acknowledgement import Acks, is_acknowledged
from gliderwatch.incidents.constants import NEWS
from gliderwatch.incidents.notices import (
    Content,
    HealthFound,
    HealthIncident,
    HealthOver,
    HealthReminder,
    Notice,
)
from gliderwatch.incidents.send_schedule import is_reminder_due
from gliderwatch.incidents.state_machine import TRANSITIONS, Event, Phase
from gliderwatch.incidents.threads import by_thread, thread_id
from gliderwatch.model import Fix, Incident, Kind, Severity


def health_incidents(glider: str, rows: Iterable[tuple[float, Judged]]) -> tuple[HealthIncident, ...]:
    """The incidents of a glider by what the rules found in its segments and calls, in order of time (s)."""
    done: list[HealthIncident] = []
    over: dict[str, float] = {}
    open_: dict[str, list[tuple[float, Finding]]] = {}
    normal: dict[str, int] = {}
    needed = {rule.name: rule.clear_after for rule in RULES}
    for t, judged in rows:
        for rule, finding in judged.items():
            before = open_.get(rule)
            if finding is None and before is None:
                continue  # nothing is open, nothing opens: as nearly always
            phase = Phase.OK if before is None else Phase.OPEN
            normal[rule] = 0 if finding is not None else normal[rule] + 1
            is_normal = normal[rule] >= needed.get(rule, 1)
            if before is not None and _is_back(before, over.get(rule)):
                is_normal = is_normal and t - before[-1][0] >= RELAPSE
            after = TRANSITIONS[phase, _event(phase, finding, is_normal)]
            if finding is not None:
                open_.setdefault(rule, []).append((t, finding))
            elif after is Phase.OK:
                done.append(_incident(glider, open_.pop(rule), cleared_at=t))
                over[rule] = t
    still = (_incident(glider, found, None) for found in open_.values())
    return tuple(sorted((*done, *still), key=lambda i: (i.opened_at, i.id)))


def _is_back(found: Sequence[tuple[float, Finding]], over: float | None) -> bool:
    """Whether what was found first in a segment or call was over a short time (s) before."""
    return over is not None and found[0][0] - over < RELAPSE


def _event(phase: Phase, finding: Finding | None, is_normal: bool) -> Event:
    """What a segment or call means for a rule: each rule has two readings in a row in it already."""
    if finding is not None:
        return Event.CONFIRMED if phase is Phase.OK else Event.FLAGGED
    return Event.CLEARED if phase is Phase.OPEN and is_normal else Event.NORMAL


def _incident(
    glider: str, found: Sequence[tuple[float, Finding]], cleared_at: float | None
) -> HealthIncident:
    """The incident of what a rule found in a row of segments and calls, each with its time (s)."""
    opened_at, first = found[0]
    worst, last = max((each for _, each in found), key=lambda each: each.severity), found[-1][1]
    identity = f"{glider}/health/{first.rule}/{first.t:.0f}"
    return HealthIncident(
        identity, glider, first.rule, worst.severity, first.t, opened_at, cleared_at, worst, last
    )


# ----------------------------------------
# What people were notified of, compared with what is so.


@dataclass(frozen=True, slots=True)
class HealthThread:
    """The notices of one incident: it as ``reported``, so many ``messages``, and the time (s) of the latest
    reading at the last; ``is_over`` once that was reported too."""

    id: str
    reported: HealthIncident
    messages: int
    time: float
    is_over: bool = False


@dataclass(frozen=True, slots=True)
class _Now:
    """What decides on the notices that are due: what the rules found (``rows``, not none), the last fix,
    acks, and the ``rolling`` anomalies of dives. The reminders of dives at a severity of ``reminded`` (None:
    there are none) name what is open of health as well."""

    rows: Sequence[tuple[float, Judged]]
    fix: Fix | None
    acks: Acks
    reminder_hours: float | None
    rolling: tuple[Incident, ...]
    reminded: Severity | None

    @property
    def latest(self) -> float:
        """The latest reading (s)."""
        return self.rows[-1][0]

    def is_so(self, rule: str) -> bool:
        """Whether a rule found something within a day: what is back stays open for longer."""
        return any(judged.get(rule) is not None for t, judged in self.rows if self.latest - t < DAY)

    def is_named(self, incident: HealthIncident) -> bool:
        """Whether the reminders of an incident of dives are its reminders: one fault has one row of them."""
        return self.reminded is not None and incident.severity <= self.reminded

    def is_explained(self, incident: HealthIncident) -> bool:
        """Whether an anomaly stands for it: one fault is one incident. Of a roll that goes on only one that
        is open does."""
        end = math.inf if incident.cleared_at is None else incident.cleared_at
        return incident.rule == ROLL.name and any(
            each.since <= end
            and (each.cleared_at is None or (end < math.inf and incident.since <= each.cleared_at))
            for each in self.rolling
        )


def announce(
    before: tuple[HealthThread, ...],
    glider: str,
    rows: Sequence[tuple[float, Judged]],
    fix: Fix | None,
    acks: Acks,
    reminder_hours: float | None,
    anomalies: Iterable[Incident] = (),
    reminded: Severity | None = None,
) -> tuple[tuple[HealthThread, ...], list[Notice]]:
    """What people have been notified of after the notices that are due, and these.

    `rows` is what the rules found in the segments and calls, in order of time (s); `fix` the glider's
    last. Of what somebody has acknowledged (`acks`) nobody is reminded, unless it has grown worse. The
    `anomalies` of dives of which the roll is evidence stand for what is found of the roll; where people are
    reminded of one, as severe (`reminded`), they are of this by the same message.
    """
    if not rows:
        return before, []
    rolling = tuple(i for i in anomalies if i.kind is Kind.ANOMALY and (i.worst.rolls or i.last.rolls))
    now = _Now(rows, fix, acks, reminder_hours, rolling, reminded)
    incidents = health_incidents(glider, rows)
    matched = _matched(before, incidents)
    threads, notices = list[HealthThread](), list[Notice]()
    for thread in before:
        after, more = _continued(thread, matched.get(thread.id), now)
        threads.append(after)
        notices += more
    old, used = {i.id for i in matched.values()}, {t.id for t in threads}
    for incident in incidents:
        is_news = incident.cleared_at is None or now.latest - incident.cleared_at < NEWS
        if incident.id not in old and is_news and not now.is_explained(incident):
            identity = thread_id(incident.id, used)
            used.add(identity)
            thread = HealthThread(identity, incident, 0, now.latest)
            thread, more = _notified(thread, incident, HealthFound(incident, False, fix), now)
            notices += more
            if incident.cleared_at is not None:
                thread, more = _continued(thread, incident, now)
                notices += more
            threads.append(thread)
    return tuple(t for t in threads if not _is_past(t, now.latest)), notices


def _is_past(thread: HealthThread, latest: float) -> bool:
    """Whether a thread has been over for so long (s) that its incident is no news, whatever data come."""
    return thread.is_over and latest - thread.time > REMEMBERED


def _matched(
    threads: Iterable[HealthThread], incidents: tuple[HealthIncident, ...]
) -> dict[str, HealthIncident]:
    """For each thread the incident it is about: the one reported, else one of its rule and time."""
    return by_thread({t.id: t.reported for t in threads}, incidents, _overlaps)


def _overlaps(now: HealthIncident, reported: HealthIncident) -> bool:
    until = max(reported.last.t, reported.opened_at)
    until = until if reported.cleared_at is None else reported.cleared_at
    return (
        now.rule == reported.rule
        and now.since <= until
        and (now.cleared_at is None or reported.since <= now.cleared_at)
    )


def _continued(
    thread: HealthThread, incident: HealthIncident | None, now: _Now
) -> tuple[HealthThread, list[Notice]]:
    """A thread after what is so now, and the notice that is due; what an anomaly stands for ends without
    one."""
    if now.is_explained(incident or thread.reported):
        return replace(thread, reported=incident or thread.reported, is_over=True), []
    if incident is None or incident.cleared_at is not None:
        if thread.is_over:
            return thread, []
        ended = incident or thread.reported
        content = HealthOver(ended, is_withdrawn=incident is None, fix=now.fix)
        thread, notices = _notified(thread, ended, content, now)
        return replace(thread, is_over=True), notices
    if thread.is_over or incident.severity > thread.reported.severity:
        thread, notices = _notified(thread, incident, HealthFound(incident, not thread.is_over, now.fix), now)
        return replace(thread, is_over=False), notices
    is_acked = is_acknowledged(now.acks, (incident.id, thread.id), incident.severity)
    is_wanted = not is_acked and not now.is_named(incident)
    is_late = is_reminder_due(incident.opened_at, thread.time, now.latest, now.reminder_hours)
    if is_wanted and is_late and now.is_so(incident.rule):
        reminder = HealthReminder(incident, (now.latest - incident.since) / 3600, now.fix)
        return _notified(thread, incident, reminder, now)
    return replace(thread, reported=incident), []


def _notified(
    thread: HealthThread, incident: HealthIncident, content: Content, now: _Now
) -> tuple[HealthThread, list[Notice]]:
    """The thread after one more notice, and the notice."""
    kind, severity = Kind.HEALTH, incident.severity
    if isinstance(content, HealthOver):
        kind, severity = Kind.ALL_CLEAR, Severity.INFO
    elif isinstance(content, HealthReminder):
        kind = Kind.REMINDER
    worst = max(incident.severity, thread.reported.severity)
    notice = Notice(
        f"{thread.id}/{thread.messages}",
        thread.id,
        incident.glider,
        now.latest,
        kind,
        severity,
        worst,
        content,
    )
    after = HealthThread(thread.id, incident, thread.messages + 1, now.latest, thread.is_over)
    return after, [notice]
