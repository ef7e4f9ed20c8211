"""Aborts and what follows them, as a glider reports them in its calls: people are notified of each once.
Pure.

A glider prints its abort history at every call until it is reset: news is a count that grows or a later time.
As with incidents, messages are the difference between what the calls report and what people were notified of.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from types import MappingProxyType

from gliderwatch.incidents.acknowledgement import Acks, is_acknowledged
from gliderwatch.incidents.constants import NEWS, SAME_ABORT
from gliderwatch.incidents.notices import Aborted, AbortReport, Notice, Resumed, StillAborted
from gliderwatch.incidents.send_schedule import is_reminder_due
from gliderwatch.incidents.threads import thread_id
from gliderwatch.model import Aborts, Call, Happened, Happening, Kind, Severity

LAST_MISSIONS = ("lastgasp.mi", "initial.mi")
_SEVERITIES = {
    Happening.ABORTING: Severity.CRITICAL,
    Happening.LAST_MISSION: Severity.CRITICAL,
    Happening.EMERGENCY: Severity.CRITICAL,
    Happening.WEIGHT_DROPPED: Severity.CRITICAL,
    Happening.FELL_OUT: Severity.WARNING,
    Happening.GLIDER_DOS: Severity.WARNING,
}
_LOUDEST = (
    Happening.WEIGHT_DROPPED,
    Happening.EMERGENCY,
    Happening.ABORTING,
    Happening.LAST_MISSION,
    Happening.GLIDER_DOS,
    Happening.FELL_OUT,
)
"""What a message begins with, first."""


@dataclass(frozen=True, slots=True)
class ReportInCall:
    """What a `call` reported, as it is to be reported on."""

    report: AbortReport
    call: Call


@dataclass(frozen=True, slots=True)
class Episode:
    """What people were notified of since a glider fell out of its mission: the ``reports``, each once, in so
    many ``messages``, the last at ``time`` (s); ``cleared`` when it was in its mission again (s)."""

    id: str
    reports: tuple[AbortReport, ...]
    messages: int
    time: float
    cleared: float | None = None

    @property
    def severity(self) -> Severity:
        """How loud its loudest message was."""
        return max(one.severity for one in self.reports)


def reports_in_calls(calls: Iterable[Call]) -> tuple[ReportInCall, ...]:
    """What the calls of a glider, in order of time, report of aborts, each once, in order of time."""
    found: list[ReportInCall] = []
    before: Aborts | None = None
    for call in calls:
        for happened in call.happened:
            found.append(ReportInCall(_of_happened(happened), call))
        for aborts in call.aborts:
            if aborts.count and (before is None or _is_another(before, aborts)):
                found.append(ReportInCall(_of_history(aborts, is_first=before is None), call))
            before = aborts
    out: list[ReportInCall] = []
    for one in sorted(found, key=lambda f: (f.report.is_history, f.report.t, f.call.began)):
        if not any(_is_same(one.report, other.report) for other in out):
            out.append(one)
    return tuple(sorted(out, key=lambda f: (f.report.t, f.report.what)))


def _is_another(before: Aborts, now: Aborts) -> bool:
    """Whether a history has an abort that the one before had not; a count that falls is a reset."""
    if now.t is not None and before.t is not None:
        return now.t > before.t
    return now.count > before.count


def _of_history(aborts: Aborts, *, is_first: bool) -> AbortReport:
    t = aborts.at if aborts.t is None else aborts.t
    is_quiet = is_first or aborts.cause == "USER_INTERRUPT"
    severity = Severity.INFO if is_quiet else Severity.CRITICAL
    return AbortReport(Happening.ABORTING, t, aborts.cause, severity, is_history=is_first)


def _of_happened(happened: Happened) -> AbortReport:
    is_quiet = happened.cause == "USER_INTERRUPT" or (
        happened.by_pilot and happened.what not in (Happening.EMERGENCY, Happening.WEIGHT_DROPPED)
    )
    severity = Severity.INFO if is_quiet else _SEVERITIES[happened.what]
    return AbortReport(happened.what, happened.t, happened.cause, severity)


def _is_same(one: AbortReport, other: AbortReport) -> bool:
    """Whether two reports are of one abort. A history may leave out when it was, so that it has the time of
    the call that printed it: then it is the last one before, of the same cause."""
    if one.what != other.what:
        return False
    if one.is_history != other.is_history and one.cause == other.cause:
        history, itself = (one, other) if one.is_history else (other, one)
        return itself.t <= history.t + SAME_ABORT
    return abs(one.t - other.t) <= SAME_ABORT


def announce(
    glider: str,
    before: tuple[Episode, ...],
    calls: tuple[Call, ...],
    now: float,
    acks: Acks = MappingProxyType({}),
    reminder_hours: float | None = None,
) -> tuple[tuple[Episode, ...], list[Notice]]:
    """What people were notified of after the messages about aborts that are due `now` (s), and these
    messages.

    `calls` are those of the last weeks, in order of time. Of what nobody has acknowledged (`acks`) people are
    reminded after `reminder_hours`.
    """
    episodes, notices = list(before), list[Notice]()
    fresh: dict[int, list[ReportInCall]] = {}
    for one in reports_in_calls(calls):
        k = _place(episodes, one.report)
        if now - one.call.last_t >= NEWS or (k is not None and _is_reported(episodes[k], one.report)):
            continue
        if k is None:
            k = len(episodes)
            identity = thread_id(f"{glider}/abort/{one.report.t:.0f}", [e.id for e in episodes])
            episodes.append(Episode(identity, (), 0, one.report.t))
        was_info = bool(episodes[k].reports) and episodes[k].severity is Severity.INFO
        cleared = None if was_info else episodes[k].cleared
        # what was history, as its own call had not come yet, is the abort itself from now on
        others = (other for other in episodes[k].reports if not _is_same(one.report, other))
        episodes[k] = replace(episodes[k], reports=(*others, one.report), cleared=cleared)
        fresh.setdefault(k, []).append(one)
    for k, new in fresh.items():
        episodes[k], notice = _aborted(glider, episodes[k], new)
        notices.append(notice)
    for k, episode in enumerate(episodes):
        if episode.cleared is None:
            episodes[k], more = _cleared(glider, episode, calls)
            needs_none = k in fresh or is_acknowledged(acks, (episode.id,), episode.severity)
            if not more and not needs_none:
                episodes[k], more = _reminded(glider, episode, calls, reminder_hours)
            notices += more
    return tuple(episodes), notices


def _place(episodes: list[Episode], report: AbortReport) -> int | None:
    """The episode that a report belongs to: it goes on, or has had it; None: a new one."""
    for k, episode in enumerate(episodes):
        if any(_is_same(report, other) for other in episode.reports):
            return k
    for k, episode in enumerate(episodes):
        if episode.cleared is None or episode.reports[0].t <= report.t <= episode.cleared:
            return k
    return None


def _is_reported(episode: Episode, report: AbortReport) -> bool:
    """Whether people have been notified of it: a prompt that waits is reported once, an abort is implied by
    another word for it."""
    if report.what is Happening.ABORTING:
        same = [other for other in episode.reports if _is_same(report, other)]
        return any(report.is_history or not other.is_history for other in same)
    implied = report.what is Happening.FELL_OUT and any(o.what is Happening.ABORTING for o in episode.reports)
    return implied or any(report.what == other.what for other in episode.reports)


def _aborted(glider: str, episode: Episode, new: list[ReportInCall]) -> tuple[Episode, Notice]:
    """The episode after one message about what is new in it, and the message."""
    reports = sorted((one.report for one in new), key=lambda r: (-r.severity, _LOUDEST.index(r.what), r.t))
    call = max((one.call for one in new), key=lambda c: c.last_t)
    identity, loud = f"{episode.id}/{episode.messages}", max(report.severity for report in reports)
    content = Aborted(tuple(reports), call)
    notice = Notice(identity, episode.id, glider, call.last_t, Kind.ABORT, loud, loud, content)
    return replace(episode, messages=episode.messages + 1, time=call.last_t), notice


def _reminded(
    glider: str, episode: Episode, calls: tuple[Call, ...], hours: float | None
) -> tuple[Episode, list[Notice]]:
    """The episode, and the reminder of it that its last call makes due; what was only noted needs none."""
    since, call = min(one.t for one in episode.reports), max(calls, key=lambda c: c.last_t, default=None)
    if call is None or episode.severity is Severity.INFO:
        return episode, []
    if not is_reminder_due(since, episode.time, call.last_t, hours):
        return episode, []
    reports = sorted(episode.reports, key=lambda r: (-r.severity, _LOUDEST.index(r.what), r.t))
    content = StillAborted(tuple(reports), call, (call.last_t - since) / 3600)
    identity, loud = f"{episode.id}/{episode.messages}", episode.severity
    notice = Notice(identity, episode.id, glider, call.last_t, Kind.REMINDER, loud, loud, content)
    return replace(episode, messages=episode.messages + 1, time=call.last_t), [notice]


def _cleared(glider: str, episode: Episode, calls: tuple[Call, ...]) -> tuple[Episode, list[Notice]]:
    """The episode, and its all-clear once a later call reports a mission; what was only noted needs none."""
    if episode.severity is Severity.INFO:
        return replace(episode, cleared=episode.time), []
    since = max(episode.time, *(one.t for one in episode.reports))
    call = next((c for c in calls if c.began > since and _is_in_mission(c)), None)
    if call is None:
        return episode, []
    identity, info = f"{episode.id}/{episode.messages}", Severity.INFO
    to, content = episode.severity, Resumed(call)
    notice = Notice(identity, episode.id, glider, call.last_t, Kind.ALL_CLEAR, info, to, content)
    return replace(episode, messages=episode.messages + 1, time=call.last_t, cleared=call.last_t), [notice]


def _is_in_mission(call: Call) -> bool:
    """Whether a glider flies a mission of its pilots at the end of a call."""
    if call.mission_t is None or call.mission in LAST_MISSIONS:
        return False
    fallen = (Happening.GLIDER_DOS, Happening.LAST_MISSION, Happening.ABORTING, Happening.FELL_OUT)
    return not any(h.what in fallen and h.t >= call.mission_t for h in call.happened)
