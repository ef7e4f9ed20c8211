"""What people have been told of a glider's silence, compared with what is known. Pure.

`hear` after an input: who was told that a glider is overdue is told that it called. `tick` as time goes by:
a glider that stays away is told, and brought to mind at growing intervals. Both look at what is known, not
at what changed, so that nothing is said twice and the order of arrival does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Protocol

from gliderwatch.alerts import overdue as message
from gliderwatch.alerts.overdue import Absence, Fleet
from gliderwatch.model import Alert, Assessment, Expected, Incident, Severity
from gliderwatch.rules.constants import GONE, LATER_CALL, MESSAGE_LATE, RECENT
from gliderwatch.rules.silence import (
    Awaited,
    Sign,
    awaited,
    drift,
    first_call,
    guess,
    is_at_sea,
    is_launched,
    severity,
)


@dataclass(frozen=True, slots=True)
class Silence:
    """The messages of one silence: the call that was ``awaited``, how often it was ``told`` to be overdue,
    ``messages`` so far; ``called`` when it was heard again (s), ``withdrawn`` if that was in time.

    ``shore`` is the id of the silence whose message was for all gliders because none called: its own, or that
    of another glider. Then this one has no message of its own before its next stage.
    """

    id: str
    awaited: Awaited
    told: int
    messages: int
    called: float | None = None
    withdrawn: bool = False
    shore: str = ""


class Known(Protocol):
    """What is known of one glider now; the store answers."""

    glider: str

    def incidents(self) -> tuple[Incident, ...]:
        """All its incidents."""

    def last_surfacing(self, until: float) -> Assessment | None:
        """The last dive that has ended with a fix and surfaced at `until` (s) or before."""

    def expected(self, until: float) -> Expected | None:
        """What was expected after the last surfacing at `until` (s) or before."""

    def first_surfacing(self, after: float) -> float | None:
        """The first surfacing later than `after` (s)."""

    def has_dived(self, since: float) -> bool:
        """Whether a dive began at `since` (s) or later, also one that has not ended or cannot be used."""

    def signs(self, since: float) -> tuple[Sign, ...]:
        """Its files that were opened at `since` (s) or later, or that came since."""


def hear(silences: tuple[Silence, ...], known: Known, now: float) -> tuple[tuple[Silence, ...], list[Alert]]:
    """All-clears and corrections for silences that have ended, as known at `now` (s)."""
    out, alerts = [], list[Alert]()
    for before in silences:
        silence, alert = _heard(before, known, now)
        out.append(silence)
        alerts += [alert] if alert is not None else []
    return tuple(out), alerts


def _heard(before: Silence, known: Known, now: float) -> tuple[Silence, Alert | None]:
    if before.withdrawn:
        return before, None
    call = before.awaited
    at = first_call(call, known.signs(call.heard - RECENT), known.first_surfacing(call.heard), now)
    if at is None or (before.called is not None and at > call.due):
        return before, None
    if not before.messages:  # nobody was told of this one
        return replace(before, called=at, withdrawn=at <= call.due), None
    silence = replace(before, messages=before.messages + 1, called=at, withdrawn=at <= call.due)
    identity, to = f"{before.id}/{before.messages}", _audience(before)
    if silence.withdrawn:
        return silence, message.withdrawn(
            known.glider, call.due, at, now, alert_id=identity, thread=before.id, to=to
        )
    dive = known.last_surfacing(now)
    return silence, message.called(
        known.glider,
        call.heard,
        at,
        dive,
        alert_id=identity,
        thread=before.id,
        to=to,
        shore=before.shore == before.id,
    )


def _audience(silence: Silence) -> Severity:
    return severity(silence.told - 1)


def tick(
    silences: tuple[Silence, ...], known: Known, fleet: Fleet, overdue_hours: float | None, now: float
) -> tuple[tuple[Silence, ...], list[Alert]]:
    """As `hear`, and what has become due by `now` (s).

    Where no glider calls, the message of the first that is due is for all of them: the others have none of
    their own while that goes on, nor for a margin after one calls again.
    """
    silences, alerts = hear(silences, known, now)
    silence = _going_on(silences, known, overdue_hours, now)
    if silence is None or now - silence.awaited.heard >= GONE:
        return silences, alerts
    stages = silence.awaited.stages(now)
    if stages <= silence.told or now < _patience(silence, fleet.back):
        return silences, alerts
    kept = tuple(s for s in silences if s.id != silence.id and (s.called is None or now - s.called < GONE))
    if fleet.is_silent and fleet.shore and not silence.messages:
        return (*kept, replace(silence, told=stages, shore=fleet.shore)), alerts
    since = silence.awaited.stage(stages - 1)
    absence = _absence(silence.awaited, known, fleet, since if now - since < MESSAGE_LATE else now)
    alert = message.overdue(
        absence,
        alert_id=f"{silence.id}/{silence.messages}",
        thread=silence.id,
        severity=severity(stages - 1),
        first=silence.messages == 0,
    )
    shore = silence.id if fleet.is_silent else ""
    told = replace(silence, told=stages, messages=silence.messages + 1, shore=shore)
    return (*kept, told), [*alerts, alert]


def next_tick(
    silences: tuple[Silence, ...],
    known: Known,
    overdue_hours: float | None,
    now: float,
    back: float | None = None,
) -> float | None:
    """When `tick` has something to say next (s) if nothing is heard until then; None: never. `back` is as in
    `Fleet`."""
    silence = _going_on(silences, known, overdue_hours, now)
    return None if silence is None else max(silence.awaited.stage(silence.told), _patience(silence, back))


def _patience(silence: Silence, back: float | None) -> float:
    """Until when (s) a glider of a fleet that was silent as a whole may take to call, once the first has."""
    call = silence.awaited
    return -inf if back is None or not silence.shore else back + call.due - call.t


def outlook(known: Known, now: float) -> tuple[Expected, tuple[Sign, ...]] | None:
    """What is expected of a glider in the water at `now` (s), and its signs of life; None: nothing."""
    signs = known.signs(now - RECENT)
    recent = tuple(sign for sign in signs if sign.opened_at >= now - RECENT)
    expected = known.expected(now) or guess(recent, now)
    if expected is None or not is_launched(recent, known.has_dived(now - RECENT)):
        return None
    return expected, signs


def _going_on(
    silences: tuple[Silence, ...], known: Known, overdue_hours: float | None, now: float
) -> Silence | None:
    """The silence that goes on, told or not; None where no call is awaited."""
    told = next((s for s in silences if s.called is None), None)
    if told is not None:
        return told
    found = outlook(known, now)
    if found is None:
        return None
    expected, signs = found
    call = awaited(expected, signs, now, overdue_hours)
    if not is_at_sea(signs, call.interval, now):
        return None
    identity, taken = f"{known.glider}/overdue/{call.heard:.0f}", {s.id for s in silences}
    while identity in taken:
        identity += "+"
    return Silence(identity, call, 0, 0)


def _absence(call: Awaited, known: Known, fleet: Fleet, now: float) -> Absence:
    expected, last = known.expected(call.heard), known.last_surfacing(now)
    if expected is None:
        expected = Expected(call.heard, call.t, 0.0, None, None, 0.0, 0.0, 0.0, "")
    place = _both(last.lat, last.lon) if last is not None else None
    flow = _both(*message.current(last)) if last is not None else None
    foreseen = expected if call.heard <= expected.after + LATER_CALL * call.interval else None
    return Absence(
        glider=known.glider,
        now=now,
        heard=call.heard,
        awaited=call.t,
        lat=foreseen.lat if foreseen is not None else None,
        lon=foreseen.lon if foreseen is not None else None,
        area=drift(expected, place, flow, now),
        last=last,
        incidents=tuple(i for i in known.incidents() if i.cleared_at is None),
        fleet=fleet,
    )


def _both(a: float | None, b: float | None) -> tuple[float, float] | None:
    return None if a is None or b is None else (a, b)
