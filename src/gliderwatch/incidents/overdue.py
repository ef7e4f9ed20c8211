"""When a glider is overdue, and which messages of it are due. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, isfinite
from statistics import median_low
from typing import Protocol

from gliderwatch.incidents.constants import (
    FILES_KEPT,
    FRESH,
    GONE,
    GUESSED_SIGMA,
    LATER_CALL,
    LEAST_MARGIN,
    LONGEST_CALL,
    LOSSY,
    MARGIN_GROWTH,
    MESSAGE_LATE,
    RECENT,
    SAME_CALL,
    SHORTEST_INTERVAL,
    TIME_SIGMAS,
)
from gliderwatch.incidents.facts import Facts, next_surfacing
from gliderwatch.incidents.notices import (
    Absence,
    CalledAgain,
    CalledInTime,
    Content,
    Fleet,
    Notice,
    Overdue,
)
from gliderwatch.incidents.threads import thread_id
from gliderwatch.incidents.whereabouts import drift
from gliderwatch.model import Assessment, Kind, NextSurfacing, Severity

# ----------------------------------------
# When a glider is overdue. Pure.
#
# A glider surfaces, calls and sends files. The files, and even one that cannot be read, are signs of life.
# When none has come a margin after the expected surfacing, the glider is overdue; it becomes more so at
# growing intervals: one, two, four, ... margins after the expected surfacing.

HOUR = 3600.0


@dataclass(frozen=True, slots=True)
class Sign:
    """A sign of life: a file ``opened_at`` (s) by the glider's clock, with its last sample ``last_t`` (None:
    it is not read), that came ``at`` (s) by ours; or the log of a call from ``opened_at`` to ``last_t``."""

    opened_at: float
    last_t: float | None
    at: float
    is_call: bool = False

    def alive_at(self, interval: float, watched: float) -> float:
        """When the glider was alive by this file, whatever its clock says.

        A file that came days after its date, of a glider whose files come since `watched` (s), has a wrong
        clock or was sent once more: either way it was sent now. An archive that is read at the first start
        is history.
        """
        t = self.sent_at(interval)
        return self.at if self.at - t > FRESH and self.at - watched > interval else t

    def sent_at(self, interval: float) -> float:
        """When the glider sent it, at the latest: after its last sample, one `interval` after its opening
        where it breaks off or cannot be read; never after it came."""
        end = self.opened_at if self.is_call else self.opened_at + interval
        return min(end if self.last_t is None else max(self.last_t, end), self.at)


@dataclass(frozen=True, slots=True)
class ExpectedCall:
    """The next call of a glider: expected at ``t``, overdue from ``due`` on; the ``last_sign`` of life
    before it; the ``interval`` between its surfacings (all s)."""

    last_sign: float
    t: float
    due: float
    interval: float

    def stage(self, k: int) -> float:
        """When it becomes overdue for the k-th time (s)."""
        return float(self.t + (self.due - self.t) * MARGIN_GROWTH**k)

    def stages(self, now: float) -> int:
        """How often it has become overdue."""
        k = 0
        while self.stage(k) <= now and self.due > self.t:
            k += 1
        return k


def margin(expected: NextSurfacing, signs: Iterable[Sign], now: float, overdue_hours: float | None) -> float:
    """Seconds after the expected time until a glider is overdue: as configured, else so long that neither
    one missed surfacing (or one lost file) nor the uncertainty of the time matters."""
    if overdue_hours is not None:
        return overdue_hours * HOUR
    interval = expected.t - expected.after
    usual = rhythm(signs, now, LOSSY * interval) or interval
    return max(LEAST_MARGIN, TIME_SIGMAS * expected.t_sigma, interval, usual) + LONGEST_CALL


def rhythm(signs: Iterable[Sign], now: float, longest: float = inf) -> float | None:
    """Seconds from one file that comes to the next, usually: with the stay at the surface, and with the file
    between them where every other one is lost. After ``longest`` it is a silence. None: too few known."""
    opened = sorted(s.opened_at for s in signs if s.opened_at <= now and not s.is_call)[-FILES_KEPT:]
    gaps = [b - a for a, b in pairwise(opened) if SHORTEST_INTERVAL < b - a < longest]
    return median_low(gaps) if len(gaps) > 1 else None


def guess(signs: Iterable[Sign], now: float) -> NextSurfacing | None:
    """The next surfacing of a glider whose dives cannot be used: as long after its last sign of life as its
    last files were opened apart; None where too few are known."""
    past = [s for s in signs if s.opened_at <= now]
    interval = rhythm(past, now)
    if interval is None:
        return None
    last = max(s.opened_at for s in past)
    after = max((t for t in (s.sent_at(interval) for s in past) if t <= now), default=last)
    return NextSurfacing(
        after, after + interval, GUESSED_SIGMA * interval, None, None, 0.0, 0.0, 0.0, "its last files"
    )


def expected_call(
    expected: NextSurfacing, signs: Iterable[Sign], now: float, overdue_hours: float | None
) -> ExpectedCall:
    """The next call, as known at `now` (s).

    A sign of life of a later call than the one that `expected` rests upon (a file that waits for its
    cache, a dive without a fix) puts the next one off: one interval from there.
    """
    signs, interval = tuple(signs), expected.t - expected.after
    watched = min((s.at for s in signs), default=now)
    last_sign = max(
        [expected.after, *(t for t in (s.alive_at(interval, watched) for s in signs) if t <= now)]
    )
    t = last_sign + interval if last_sign > expected.after + LATER_CALL * interval else expected.t
    recent = (s for s in signs if now - s.opened_at <= GONE + FRESH)
    return ExpectedCall(last_sign, t, t + margin(expected, recent, now, overdue_hours), interval)


def is_at_sea(signs: Iterable[Sign], interval: float, now: float) -> bool:
    """Whether a deployment is going on: in the last 30 days a file came while it was news.

    An archive of old missions that is read for the first time is none.
    """
    times = ((s.sent_at(interval), s.at) for s in signs)
    return any(t <= now and now - t < GONE and at - t < FRESH for t, at in times)


def is_launched(signs: Iterable[Sign], has_dived: bool) -> bool:
    """Whether a glider is in the water: it has dived lately, or there are files of which that is not known.

    On deck and at the dock it makes files too, and then no more for days.
    """
    return has_dived or any(s.last_t is None for s in signs)


def first_call(
    after: ExpectedCall, signs: Iterable[Sign], surfacing: float | None, now: float
) -> float | None:
    """The first sign of life of a later call than the last one; `surfacing` is the first fix since.

    What belongs to the last call may come up to a quarter of an interval later.
    """
    late, signs = after.last_sign + SAME_CALL * after.interval, tuple(signs)
    watched = min((s.at for s in signs), default=now)
    times = [s.alive_at(after.interval, watched) for s in signs] + ([] if surfacing is None else [surfacing])
    return min((t for t in times if (t > late or t == surfacing) and t <= now), default=None)


def severity(stage: int) -> Severity:
    """How loud it is to be overdue for the k-th time."""
    return Severity.WARNING if stage == 0 else Severity.CRITICAL


def fleet(others: Iterable[tuple[NextSurfacing, tuple[Sign, ...]]], now: float) -> Fleet:
    """How the other gliders at sea are: late are those whose next call is past its expected time."""
    n, late, last = 0, 0, -inf
    for expected, signs in others:
        call = expected_call(expected, signs, now, None)
        if is_at_sea(signs, call.interval, now):
            n, late, last = n + 1, late + (call.t < now), max(last, call.last_sign)
    return Fleet(n, late, last if n else None)


# ----------------------------------------
# What people were notified of a silent glider, compared with what is so. Pure.
#
# `on_calls` after an input: who was notified that a glider is overdue is notified that it called. `tick` as
# time goes by: a glider that stays away is reported, with reminders at growing intervals. Both look at what
# is so, not at what changed, so that no message comes twice and the order of arrival does not matter.


@dataclass(frozen=True, slots=True)
class Silence:
    """The messages of one silence: the call that was ``missed``, the ``stages`` of being overdue reported so
    far, in so many ``messages``; ``called`` when it called again (s), ``withdrawn`` if that was in time.

    ``shore`` is the id of the silence whose message was for all gliders because none called: its own, or that
    of another glider. Then this one has no message of its own before its next stage.
    """

    id: str
    missed: ExpectedCall
    stages: int
    messages: int
    called: float | None = None
    withdrawn: bool = False
    shore: str = ""


class SilenceFacts(Facts, Protocol):
    """The facts that show whether a glider stays away."""

    glider: str

    def first_surfacing(self, after: float) -> float | None:
        """The first surfacing later than `after` (s)."""

    def has_dived(self, since: float) -> bool:
        """Whether a dive began at `since` (s) or later, also one that has not ended or cannot be used."""

    def signs(self, since: float) -> tuple[Sign, ...]:
        """Its files that were opened at `since` (s) or later, or that came since."""


def on_calls(
    silences: tuple[Silence, ...], facts: SilenceFacts, now: float
) -> tuple[tuple[Silence, ...], list[Notice]]:
    """All-clears and corrections for silences that have ended, as known at `now` (s)."""
    out, alerts = [], list[Notice]()
    for before in silences:
        silence, alert = _on_calls(before, facts, now)
        out.append(silence)
        alerts += [alert] if alert is not None else []
    return tuple(out), alerts


def _on_calls(before: Silence, facts: SilenceFacts, now: float) -> tuple[Silence, Notice | None]:
    if before.withdrawn:
        return before, None
    call = before.missed
    at = first_call(call, facts.signs(call.last_sign - RECENT), facts.first_surfacing(call.last_sign), now)
    if at is None or (before.called is not None and at > min(call.due, before.called - 1.0)):
        return before, None
    if not before.messages:  # nobody was notified of this one
        return replace(before, called=at, withdrawn=at <= call.due), None
    is_late = now - at > LONGEST_CALL  # its files: what comes as a call ends is a glider that was late itself
    silence = replace(before, messages=before.messages + 1, called=at, withdrawn=at <= call.due and is_late)
    if silence.withdrawn:
        return silence, _notice(before, facts.glider, now, Kind.CORRECTION, CalledInTime(call.due, at))
    last = facts.last_surfacing(now)
    expected = None if last is None else next_surfacing(facts, last)
    expected = None if expected is None or expected.t <= at else expected
    still = tuple(i for i in facts.incidents() if i.cleared_at is None)
    content = CalledAgain(call.last_sign, at, last, before.shore == before.id, expected, still)
    return silence, _notice(before, facts.glider, at, Kind.ALL_CLEAR, content)


def _notice(before: Silence, glider: str, time: float, kind: Kind, content: Content) -> Notice:
    """That a silence is over, to whom was notified of it."""
    identity = f"{before.id}/{before.messages}"
    return Notice(
        identity, before.id, glider, time, kind, Severity.INFO, severity(before.stages - 1), content
    )


def tick(
    silences: tuple[Silence, ...], facts: SilenceFacts, fleet: Fleet, overdue_hours: float | None, now: float
) -> tuple[tuple[Silence, ...], list[Notice]]:
    """As `on_calls`, and what has become due by `now` (s).

    Where no glider calls, the message of the first that is due is for all of them: the others have none of
    their own while that goes on, nor for a margin after one calls again.
    """
    silences, alerts = on_calls(silences, facts, now)
    silence = _going_on(silences, facts, overdue_hours, now)
    if silence is None or now - silence.missed.last_sign >= GONE:
        return silences, alerts
    stages = silence.missed.stages(now)
    if stages <= silence.stages or now < _patience(silence, fleet.back):
        return silences, alerts
    lasting = tuple(s for s in silences if s.id != silence.id and (s.called is None or now - s.called < GONE))
    if fleet.is_silent and fleet.shore and not silence.messages:
        return (*lasting, replace(silence, stages=stages, shore=fleet.shore)), alerts
    since = silence.missed.stage(stages - 1)
    absence = _absence(silence.missed, facts, fleet, since if now - since < MESSAGE_LATE else now)
    first, loud = silence.messages == 0, severity(stages - 1)
    alert = Notice(
        f"{silence.id}/{silence.messages}",
        silence.id,
        facts.glider,
        absence.now,
        Kind.OVERDUE if first else Kind.REMINDER,
        loud,
        loud,
        Overdue(absence, first),
    )
    shore = silence.id if fleet.is_silent else ""
    after = replace(silence, stages=stages, messages=silence.messages + 1, shore=shore)
    return (*lasting, after), [*alerts, alert]


def next_tick(
    silences: tuple[Silence, ...],
    facts: SilenceFacts,
    overdue_hours: float | None,
    now: float,
    back: float | None = None,
    until: float = inf,
) -> float | None:
    """When `tick` has something to report next (s) if nothing comes until then; None: never, or only after
    `until` (s). `back` is as in `Fleet`."""
    if until < _earliest(silences, facts, overdue_hours, now):
        return None
    silence = _going_on(silences, facts, overdue_hours, now)
    return None if silence is None else max(silence.missed.stage(silence.stages), _patience(silence, back))


def _earliest(
    silences: tuple[Silence, ...], facts: SilenceFacts, overdue_hours: float | None, now: float
) -> float:
    """A time (s) before which nothing is to be reported, whatever the signs of life are: they are many, and
    can only put the next call off and widen the margin."""
    expected = facts.expected(now)
    if expected is None or any(s.called is None for s in silences):
        return -inf
    return expected.t + margin(expected, (), now, overdue_hours)


def _patience(silence: Silence, back: float | None) -> float:
    """Until when (s) a glider of a fleet that was silent as a whole may take to call, once the first has."""
    call = silence.missed
    return -inf if back is None or not silence.shore else back + call.due - call.t


def outlook(facts: SilenceFacts, now: float) -> tuple[NextSurfacing, tuple[Sign, ...]] | None:
    """What is expected of a glider in the water at `now` (s), and its signs of life; None: nothing."""
    signs = facts.signs(now - RECENT)
    recent = tuple(sign for sign in signs if sign.opened_at >= now - RECENT)
    expected = facts.expected(now) or guess(recent, now)
    if expected is None or not is_launched(recent, facts.has_dived(now - RECENT)):
        return None
    return expected, signs


def _going_on(
    silences: tuple[Silence, ...], facts: SilenceFacts, overdue_hours: float | None, now: float
) -> Silence | None:
    """The silence that goes on, reported or not; None where no call is expected."""
    reported = next((s for s in silences if s.called is None), None)
    if reported is not None:
        return reported
    found = outlook(facts, now)
    if found is None:
        return None
    expected, signs = found
    call = expected_call(expected, signs, now, overdue_hours)
    if not is_at_sea(signs, call.interval, now):
        return None
    identity = thread_id(f"{facts.glider}/overdue/{call.last_sign:.0f}", [s.id for s in silences])
    return Silence(identity, call, 0, 0)


def _absence(call: ExpectedCall, facts: SilenceFacts, fleet: Fleet, now: float) -> Absence:
    expected, last = facts.expected(call.last_sign), facts.last_surfacing(now)
    if expected is None:
        expected = NextSurfacing(call.last_sign, call.t, 0.0, None, None, 0.0, 0.0, 0.0, "")
    place = _both(last.lat, last.lon) if last is not None else None
    flow = current(last) if last is not None else None
    foreseen = expected if call.last_sign <= expected.after + LATER_CALL * call.interval else None
    return Absence(
        glider=facts.glider,
        now=now,
        last_sign=call.last_sign,
        expected_at=call.t,
        lat=foreseen.lat if foreseen is not None else None,
        lon=foreseen.lon if foreseen is not None else None,
        area=drift(expected, place, flow, now),
        last=last,
        flow=flow,
        incidents=tuple(i for i in facts.incidents() if i.cleared_at is None),
        fleet=fleet,
    )


def current(dive: Assessment) -> tuple[float, float] | None:
    """The last known current (east, north; m/s) of a dive: the estimated one, else the reference."""
    estimated = _both(dive.flow_u, dive.flow_v)
    return _both(dive.reference_u, dive.reference_v) if estimated is None else estimated


def _both(a: float | None, b: float | None) -> tuple[float, float] | None:
    return (a, b) if a is not None and b is not None and isfinite(a) and isfinite(b) else None
