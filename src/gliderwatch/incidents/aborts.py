"""Aborts and what comes of them, as a glider tells them in its calls: each is told once. Pure.

A glider prints its abort history at every call until it is reset: news is a count that grows or a later time.
As with incidents, messages are the difference between what the calls tell and what people have been told.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from gliderwatch.messages import call_text as message
from gliderwatch.messages.call_text import Told
from gliderwatch.model import Aborts, Alert, Call, Happened, Happening, Severity

SAME = 1800.0
"""Seconds: two lines about an abort that are no further apart are about the same one."""
NEWS = 86400.0
"""Seconds: what was told in a call that was over for longer when its log came is history, not news."""
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
class Finding:
    """What a `call` told, as it is to be told."""

    told: Told
    call: Call


@dataclass(frozen=True, slots=True)
class Episode:
    """What people have been ``told`` since a glider fell out of its mission, in so many ``messages``, the
    last at ``time`` (s); ``cleared`` when it was in its mission again (s)."""

    id: str
    told: tuple[Told, ...]
    messages: int
    time: float
    cleared: float | None = None

    @property
    def severity(self) -> Severity:
        """How loud its loudest message was."""
        return max(one.severity for one in self.told)


def findings(calls: Iterable[Call]) -> tuple[Finding, ...]:
    """What the calls of a glider, in order of time, tell of aborts, each once, in order of time."""
    found: list[Finding] = []
    before: Aborts | None = None
    for call in calls:
        for happened in call.happened:
            found.append(Finding(_of_happened(happened), call))
        for aborts in call.aborts:
            if aborts.count and (before is None or _is_another(before, aborts)):
                found.append(Finding(_of_history(aborts, is_first=before is None), call))
            before = aborts
    out: list[Finding] = []
    for one in sorted(found, key=lambda f: (f.told.is_history, f.told.t, f.call.began)):
        if not any(_is_same(one.told, other.told) for other in out):
            out.append(one)
    return tuple(sorted(out, key=lambda f: (f.told.t, f.told.what)))


def _is_another(before: Aborts, now: Aborts) -> bool:
    """Whether a history has an abort that the one before had not; a count that falls is a reset."""
    if now.t is not None and before.t is not None:
        return now.t > before.t
    return now.count > before.count


def _of_history(aborts: Aborts, *, is_first: bool) -> Told:
    t = aborts.at if aborts.t is None else aborts.t
    is_quiet = is_first or aborts.cause == "USER_INTERRUPT"
    severity = Severity.INFO if is_quiet else Severity.CRITICAL
    return Told(Happening.ABORTING, t, aborts.cause, severity, is_history=is_first)


def _of_happened(happened: Happened) -> Told:
    is_quiet = happened.cause == "USER_INTERRUPT" or (
        happened.by_pilot and happened.what not in (Happening.EMERGENCY, Happening.WEIGHT_DROPPED)
    )
    severity = Severity.INFO if is_quiet else _SEVERITIES[happened.what]
    return Told(happened.what, happened.t, happened.cause, severity)


def _is_same(one: Told, other: Told) -> bool:
    return one.what == other.what and abs(one.t - other.t) <= SAME


def announce(
    glider: str, before: tuple[Episode, ...], calls: tuple[Call, ...], now: float
) -> tuple[tuple[Episode, ...], list[Alert]]:
    """What people have been told of aborts after the messages that are due `now` (s), and these.

    `calls` are those known of the last weeks, in order of time.
    """
    episodes, alerts = list(before), list[Alert]()
    fresh: dict[int, list[Finding]] = {}
    for one in findings(calls):
        k = _place(episodes, one.told)
        if now - one.call.last_t >= NEWS or (k is not None and _is_told(episodes[k], one.told)):
            continue
        if k is None:
            k = len(episodes)
            episodes.append(Episode(_identity(glider, one.told, episodes), (), 0, one.told.t))
        was_noted = bool(episodes[k].told) and episodes[k].severity is Severity.INFO
        cleared = None if was_noted else episodes[k].cleared
        episodes[k] = replace(episodes[k], told=(*episodes[k].told, one.told), cleared=cleared)
        fresh.setdefault(k, []).append(one)
    for k, new in fresh.items():
        episodes[k], alert = _spoken(glider, episodes[k], new)
        alerts.append(alert)
    for k, episode in enumerate(episodes):
        if episode.cleared is None:
            episodes[k], more = _cleared(glider, episode, calls)
            alerts += more
    return tuple(episodes), alerts


def _place(episodes: list[Episode], told: Told) -> int | None:
    """The episode that something told belongs to: it goes on, or had been told of it; None: a new one."""
    for k, episode in enumerate(episodes):
        if any(_is_same(told, other) for other in episode.told):
            return k
    for k, episode in enumerate(episodes):
        if episode.cleared is None or episode.told[0].t <= told.t <= episode.cleared:
            return k
    return None


def _is_told(episode: Episode, told: Told) -> bool:
    """Whether people have been told of it: a prompt that waits is told once, an abort is implied by another
    word for it."""
    if told.what is Happening.ABORTING:
        same = [other for other in episode.told if _is_same(told, other)]
        return any(told.is_history or not other.is_history for other in same)
    implied = told.what is Happening.FELL_OUT and any(o.what is Happening.ABORTING for o in episode.told)
    return implied or any(told.what == other.what for other in episode.told)


def _identity(glider: str, told: Told, episodes: list[Episode]) -> str:
    identity, taken = f"{glider}/abort/{told.t:.0f}", {e.id for e in episodes}
    while identity in taken:
        identity += "+"
    return identity


def _spoken(glider: str, episode: Episode, new: list[Finding]) -> tuple[Episode, Alert]:
    """The episode after one message about what is new in it, and the message."""
    told = sorted((one.told for one in new), key=lambda t: (-t.severity, _LOUDEST.index(t.what), t.t))
    call = max((one.call for one in new), key=lambda c: c.last_t)
    alert_id = f"{episode.id}/{episode.messages}"
    alert = message.aborted(glider, tuple(told), call, alert_id=alert_id, thread=episode.id)
    return replace(episode, messages=episode.messages + 1, time=call.last_t), alert


def _cleared(glider: str, episode: Episode, calls: tuple[Call, ...]) -> tuple[Episode, list[Alert]]:
    """The episode, and its all-clear once a later call tells of a mission; what was only noted needs none."""
    if episode.severity is Severity.INFO:
        return replace(episode, cleared=episode.time), []
    since = max(episode.time, *(one.t for one in episode.told))
    call = next((c for c in calls if c.began > since and _is_in_mission(c)), None)
    if call is None:
        return episode, []
    alert_id = f"{episode.id}/{episode.messages}"
    alert = message.resumed(glider, call, alert_id=alert_id, thread=episode.id, audience=episode.severity)
    return replace(episode, messages=episode.messages + 1, time=call.last_t, cleared=call.last_t), [alert]


def _is_in_mission(call: Call) -> bool:
    """Whether a glider flies a mission of its pilots at the end of a call."""
    if call.mission_t is None or call.mission in LAST_MISSIONS:
        return False
    fallen = (Happening.GLIDER_DOS, Happening.LAST_MISSION, Happening.ABORTING, Happening.FELL_OUT)
    return not any(h.what in fallen and h.t >= call.mission_t for h in call.happened)
