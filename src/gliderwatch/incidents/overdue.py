"""When a glider is overdue, where it may be by then, and which messages of it are due. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from math import atan2, degrees, exp, inf, isfinite, sqrt
from statistics import median_low
from typing import Protocol

import numpy as np

from gliderwatch.forecast.constants import CHI2_COVERED
from gliderwatch.incidents.constants import (
    FILES_KEPT,
    FLOW_SIGMA,
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
    UNKNOWN_FLOW,
)
from gliderwatch.incidents.notices import (
    Absence,
    CalledAgain,
    CalledInTime,
    Content,
    DriftEllipse,
    Fleet,
    Notice,
    Overdue,
)
from gliderwatch.incidents.threads import thread_id
from gliderwatch.model import Assessment, Incident, Kind, NextSurfacing, Severity
from gliderwatch.navigation.geodesy import from_plane, to_plane
from gliderwatch.sea.gauss_markov import FlowParams

# ----------------------------------------
# When a glider is overdue, and where it may be by then. Pure.
#
# A glider surfaces, calls and sends files. The files, and even one that cannot be read, are signs of life.
# When none has come a margin after the expected surfacing, the glider is overdue; it becomes more so at
# growing intervals: one, two, four, ... margins after the expected surfacing.

HOUR = 3600.0
_K95 = sqrt(CHI2_COVERED)
"""Semi-axes of the 95 % ellipse in standard deviations (chi-square, 2 degrees of freedom)."""


@dataclass(frozen=True, slots=True)
class Sign:
    """A sign of life: a file ``opened_at`` (s) by the glider's clock, with its last sample ``last_t`` (None:
    it is not read), that came ``at`` (s) by ours; or the log of a call from ``opened_at`` to ``last_t``."""

    opened_at: float
    last_t: float | None
    at: float
    is_call: bool = False

    def life(self, interval: float, watched: float) -> float:
        """When the glider was alive by this file, whatever its clock says.

        A file that came days after its date, when the glider was heard since `watched` (s), has a wrong clock
        or was sent once more: either way it was sent now. An archive that is read at the first start
        is history.
        """
        t = self.time(interval)
        return self.at if self.at - t > FRESH and self.at - watched > interval else t

    def time(self, interval: float) -> float:
        """When the glider sent it, at the latest: after its last sample, one `interval` after its opening
        where it breaks off or cannot be read; never after it came."""
        end = self.opened_at if self.is_call else self.opened_at + interval
        return min(end if self.last_t is None else max(self.last_t, end), self.at)


@dataclass(frozen=True, slots=True)
class ExpectedCall:
    """The next call of a glider: last ``heard``, awaited at ``t`` and overdue from ``due`` on (s);
    ``interval`` between its surfacings (s)."""

    heard: float
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
    known = [s for s in signs if s.opened_at <= now]
    interval = rhythm(known, now)
    if interval is None:
        return None
    last = max(s.opened_at for s in known)
    after = max((t for t in (s.time(interval) for s in known) if t <= now), default=last)
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
    heard = max([expected.after, *(t for t in (s.life(interval, watched) for s in signs) if t <= now)])
    t = heard + interval if heard > expected.after + LATER_CALL * interval else expected.t
    recent = (s for s in signs if now - s.opened_at <= GONE + FRESH)
    return ExpectedCall(heard, t, t + margin(expected, recent, now, overdue_hours), interval)


def is_at_sea(signs: Iterable[Sign], interval: float, now: float) -> bool:
    """Whether a deployment is going on: in the last 30 days a file came while it was news.

    An archive of old missions that is taken in for the first time is none.
    """
    times = ((s.time(interval), s.at) for s in signs)
    return any(t <= now and now - t < GONE and at - t < FRESH for t, at in times)


def is_launched(signs: Iterable[Sign], has_dived: bool) -> bool:
    """Whether a glider is in the water: it has dived lately, or there are files of which that is not known.

    On deck and at the dock it makes files too, and then no more for days.
    """
    return has_dived or any(s.last_t is None for s in signs)


def first_call(
    after: ExpectedCall, signs: Iterable[Sign], surfacing: float | None, now: float
) -> float | None:
    """The first sign of life of a later call than the one last heard; `surfacing` is the first fix since.

    What belongs to the call last heard may come up to a quarter of an interval later.
    """
    late, signs = after.heard + SAME_CALL * after.interval, tuple(signs)
    watched = min((s.at for s in signs), default=now)
    times = [s.life(after.interval, watched) for s in signs] + ([] if surfacing is None else [surfacing])
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
            n, late, last = n + 1, late + (call.t < now), max(last, call.heard)
    return Fleet(n, late, last if n else None)


def drift(
    expected: NextSurfacing, place: tuple[float, float] | None, flow: tuple[float, float] | None, now: float
) -> DriftEllipse | None:
    """Where a glider is at `now` (s) that stopped to fly; None where no position is known.

    It drifts with the last known `flow` (east, north; m/s) from where it was expected, since then. The
    ellipse also reaches to where it would be, had it drifted since its last fix, at `place` (degrees). It
    grows as the integral of an Ornstein-Uhlenbeck process of `FLOW_SIGMA` and the memory of a current.
    """
    u = np.array(flow if flow is not None else (0.0, 0.0))
    if expected.lat is not None and expected.lon is not None:
        origin, since = (expected.lat, expected.lon), expected.t
        cov = np.array([[expected.east, expected.cross], [expected.cross, expected.north]])
        if place is not None:
            flown = to_plane(*origin, *place) - u * (expected.t - expected.after)
            cov = cov + np.outer(flown, flown) / _K95**2
    elif place is not None:
        origin, since, cov = place, expected.after, np.zeros((2, 2))
    else:
        return None
    elapsed = max(now - since, 0.0)
    memory = FlowParams().memory
    r = elapsed / memory
    spread = FLOW_SIGMA if flow is not None else UNKNOWN_FLOW * FLOW_SIGMA
    cov = cov + 2 * (spread * memory) ** 2 * (r - 1 + exp(-r)) * np.eye(2)
    values, vectors = np.linalg.eigh(cov)
    east, north = vectors[:, 1]
    lat, lon = from_plane(u * elapsed, *origin)
    minor, major = (_K95 * sqrt(max(float(v), 0.0)) for v in values)
    return DriftEllipse(lat, lon, major, minor, degrees(atan2(east, north)) % 180.0)


# ----------------------------------------
# What people have been told of a glider's silence, compared with what is known. Pure.
#
# `hear` after an input: who was told that a glider is overdue is told that it called. `tick` as time goes by:
# a glider that stays away is told, and brought to mind at growing intervals. Both look at what is known, not
# at what changed, so that nothing is said twice and the order of arrival does not matter.


@dataclass(frozen=True, slots=True)
class Silence:
    """The messages of one silence: the call that was ``awaited``, how often it was ``told`` to be overdue,
    ``messages`` so far; ``called`` when it was heard again (s), ``withdrawn`` if that was in time.

    ``shore`` is the id of the silence whose message was for all gliders because none called: its own, or that
    of another glider. Then this one has no message of its own before its next stage.
    """

    id: str
    awaited: ExpectedCall
    told: int
    messages: int
    called: float | None = None
    withdrawn: bool = False
    shore: str = ""


class SilenceFacts(Protocol):
    """What is known of one glider now; the store answers."""

    glider: str

    def incidents(self) -> tuple[Incident, ...]:
        """All its incidents."""

    def last_surfacing(self, until: float) -> Assessment | None:
        """The last dive that has ended with a fix and surfaced at `until` (s) or before."""

    def expected(self, until: float) -> NextSurfacing | None:
        """What was expected after the last surfacing at `until` (s) or before."""

    def first_surfacing(self, after: float) -> float | None:
        """The first surfacing later than `after` (s)."""

    def has_dived(self, since: float) -> bool:
        """Whether a dive began at `since` (s) or later, also one that has not ended or cannot be used."""

    def signs(self, since: float) -> tuple[Sign, ...]:
        """Its files that were opened at `since` (s) or later, or that came since."""


def on_calls(
    silences: tuple[Silence, ...], known: SilenceFacts, now: float
) -> tuple[tuple[Silence, ...], list[Notice]]:
    """All-clears and corrections for silences that have ended, as known at `now` (s)."""
    out, alerts = [], list[Notice]()
    for before in silences:
        silence, alert = _on_calls(before, known, now)
        out.append(silence)
        alerts += [alert] if alert is not None else []
    return tuple(out), alerts


def _on_calls(before: Silence, known: SilenceFacts, now: float) -> tuple[Silence, Notice | None]:
    if before.withdrawn:
        return before, None
    call = before.awaited
    at = first_call(call, known.signs(call.heard - RECENT), known.first_surfacing(call.heard), now)
    if at is None or (before.called is not None and at > call.due):
        return before, None
    if not before.messages:  # nobody was told of this one
        return replace(before, called=at, withdrawn=at <= call.due), None
    silence = replace(before, messages=before.messages + 1, called=at, withdrawn=at <= call.due)
    if silence.withdrawn:
        return silence, _notice(before, known.glider, now, Kind.CORRECTION, CalledInTime(call.due, at))
    content = CalledAgain(call.heard, at, known.last_surfacing(now), before.shore == before.id)
    return silence, _notice(before, known.glider, at, Kind.ALL_CLEAR, content)


def _notice(before: Silence, glider: str, time: float, kind: Kind, content: Content) -> Notice:
    """That a silence is over, to whom was notified of it."""
    identity = f"{before.id}/{before.messages}"
    return Notice(identity, before.id, glider, time, kind, Severity.INFO, severity(before.told - 1), content)


def tick(
    silences: tuple[Silence, ...], known: SilenceFacts, fleet: Fleet, overdue_hours: float | None, now: float
) -> tuple[tuple[Silence, ...], list[Notice]]:
    """As `on_calls`, and what has become due by `now` (s).

    Where no glider calls, the message of the first that is due is for all of them: the others have none of
    their own while that goes on, nor for a margin after one calls again.
    """
    silences, alerts = on_calls(silences, known, now)
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
    first, loud = silence.messages == 0, severity(stages - 1)
    alert = Notice(
        f"{silence.id}/{silence.messages}",
        silence.id,
        known.glider,
        absence.now,
        Kind.OVERDUE if first else Kind.REMINDER,
        loud,
        loud,
        Overdue(absence, first),
    )
    shore = silence.id if fleet.is_silent else ""
    told = replace(silence, told=stages, messages=silence.messages + 1, shore=shore)
    return (*kept, told), [*alerts, alert]


def next_tick(
    silences: tuple[Silence, ...],
    known: SilenceFacts,
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


def outlook(known: SilenceFacts, now: float) -> tuple[NextSurfacing, tuple[Sign, ...]] | None:
    """What is expected of a glider in the water at `now` (s), and its signs of life; None: nothing."""
    signs = known.signs(now - RECENT)
    recent = tuple(sign for sign in signs if sign.opened_at >= now - RECENT)
    expected = known.expected(now) or guess(recent, now)
    if expected is None or not is_launched(recent, known.has_dived(now - RECENT)):
        return None
    return expected, signs


def _going_on(
    silences: tuple[Silence, ...], known: SilenceFacts, overdue_hours: float | None, now: float
) -> Silence | None:
    """The silence that goes on, told or not; None where no call is awaited."""
    told = next((s for s in silences if s.called is None), None)
    if told is not None:
        return told
    found = outlook(known, now)
    if found is None:
        return None
    expected, signs = found
    call = expected_call(expected, signs, now, overdue_hours)
    if not is_at_sea(signs, call.interval, now):
        return None
    identity = thread_id(f"{known.glider}/overdue/{call.heard:.0f}", [s.id for s in silences])
    return Silence(identity, call, 0, 0)


def _absence(call: ExpectedCall, known: SilenceFacts, fleet: Fleet, now: float) -> Absence:
    expected, last = known.expected(call.heard), known.last_surfacing(now)
    if expected is None:
        expected = NextSurfacing(call.heard, call.t, 0.0, None, None, 0.0, 0.0, 0.0, "")
    place = _both(last.lat, last.lon) if last is not None else None
    flow = current(last) if last is not None else None
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
        flow=flow,
        incidents=tuple(i for i in known.incidents() if i.cleared_at is None),
        fleet=fleet,
    )


def current(dive: Assessment) -> tuple[float, float] | None:
    """The last known current (east, north; m/s) of a dive: the estimated one, else the reference."""
    estimated = _both(dive.flow_u, dive.flow_v)
    return _both(dive.reference_u, dive.reference_v) if estimated is None else estimated


def _both(a: float | None, b: float | None) -> tuple[float, float] | None:
    return (a, b) if a is not None and b is not None and isfinite(a) and isfinite(b) else None
