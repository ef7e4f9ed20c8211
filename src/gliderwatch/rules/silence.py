"""When a glider is overdue, and where it may be by then. Pure.

A glider surfaces, calls and sends files. The files, and even one that cannot be read, are signs of life. When
none has come a margin after the expected surfacing, the glider is overdue; it becomes more so at growing
intervals: one, two, four, ... margins after the expected surfacing.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, degrees, exp, inf, sqrt
from statistics import median_low

import numpy as np

from gliderwatch.alerts.overdue import Area, Fleet
from gliderwatch.model import Expected, Severity
from gliderwatch.navigation.frame import from_plane, to_plane

HOUR = 3600.0
LEAST_MARGIN = 3 * HOUR
"""Seconds by which a healthy glider may be late."""
COMMUNICATION = 2400.0
"""Seconds that a call takes at the most: its files come when it ends, not at the surfacing."""
KEPT = 8
"""Files from which the interval is guessed where dives do not tell it."""
LOSSY = 3.0
"""Intervals from file to file, above which it was a silence and not one or two files that were lost."""
SIGMAS = 3.0
"""Standard errors of the expected time that belong to the margin."""
FRESH = 2 * 86400.0
"""Seconds: a file that came longer after its end is history, no news of a glider at sea."""
GONE = 30 * 86400.0
"""Seconds of silence after which a deployment counts as over."""
FLOW_SIGMA = 0.15
"""m/s, a component: how far current and wind drift come to differ from the last known current. 0.11 is
sqrt(2) times the 0.08 of the current itself; the rest is allowed for the wind at the surface."""
FLOW_MEMORY = 30 * HOUR
"""Seconds over which the current forgets."""
_K95 = sqrt(5.991)
"""Semi-axes of the 95 % ellipse in standard deviations (chi-square, 2 degrees of freedom)."""


@dataclass(frozen=True, slots=True)
class Sign:
    """A sign of life: a file ``opened_at`` (s) by the glider's clock, with its last sample ``last_t`` (None:
    it is not read), that came ``at`` (s) by ours; or the log of a call from ``opened_at`` to ``last_t``."""

    opened_at: float
    last_t: float | None
    at: float
    is_call: bool = False

    def time(self, interval: float) -> float:
        """When the glider sent it, at the latest: after its last sample, one `interval` after its opening
        where it breaks off or cannot be read; never after it came."""
        end = self.opened_at if self.is_call else self.opened_at + interval
        return min(end if self.last_t is None else max(self.last_t, end), self.at)


@dataclass(frozen=True, slots=True)
class Awaited:
    """The next call of a glider: last ``heard``, awaited at ``t`` and overdue from ``due`` on (s);
    ``interval`` between its surfacings (s)."""

    heard: float
    t: float
    due: float
    interval: float

    def stage(self, k: int) -> float:
        """When it becomes overdue for the k-th time (s)."""
        return float(self.t + (self.due - self.t) * 2.0**k)

    def stages(self, now: float) -> int:
        """How often it has become overdue."""
        k = 0
        while self.stage(k) <= now and self.due > self.t:
            k += 1
        return k


def margin(expected: Expected, signs: Iterable[Sign], now: float, overdue_hours: float | None) -> float:
    """Seconds after the expected time until a glider is overdue: as configured, else so long that neither
    one missed surfacing (or one lost file) nor the uncertainty of the time matters."""
    if overdue_hours is not None:
        return overdue_hours * HOUR
    interval = expected.t - expected.after
    usual = rhythm(signs, now, LOSSY * interval) or interval
    return max(LEAST_MARGIN, SIGMAS * expected.t_sigma, interval, usual) + COMMUNICATION


def rhythm(signs: Iterable[Sign], now: float, longest: float = inf) -> float | None:
    """Seconds from one file that comes to the next, usually: with the stay at the surface, and with the file
    between them where every other one is lost. After ``longest`` it is a silence. None: too few known."""
    opened = sorted(s.opened_at for s in signs if s.opened_at <= now and not s.is_call)[-KEPT:]
    gaps = [b - a for a, b in pairwise(opened) if COMMUNICATION / 2 < b - a < longest]
    return median_low(gaps) if len(gaps) > 1 else None


def guess(signs: Iterable[Sign], now: float) -> Expected | None:
    """The next surfacing of a glider whose dives cannot be used: as long after its last sign of life as its
    last files were opened apart; None where too few are known."""
    known = [s for s in signs if s.opened_at <= now]
    interval = rhythm(known, now)
    if interval is None:
        return None
    last = max(s.opened_at for s in known)
    after = max((t for t in (s.time(interval) for s in known) if t <= now), default=last)
    return Expected(after, after + interval, interval / 2, None, None, 0.0, 0.0, 0.0, "its last files")


def awaited(expected: Expected, signs: Iterable[Sign], now: float, overdue_hours: float | None) -> Awaited:
    """The next call, as known at `now` (s).

    A sign of life of a later call than the one that `expected` rests upon (a file that waits for its
    cache, a dive without a fix) puts the next one off: one interval from there.
    """
    signs, interval = tuple(signs), expected.t - expected.after
    heard = max([expected.after, *(t for t in (s.time(interval) for s in signs) if t <= now)])
    t = heard + interval if heard > expected.after + interval / 2 else expected.t
    return Awaited(heard, t, t + margin(expected, signs, now, overdue_hours), interval)


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


def first_call(after: Awaited, signs: Iterable[Sign], surfacing: float | None, now: float) -> float | None:
    """The first sign of life of a later call than the one last heard; `surfacing` is the first fix since.

    What belongs to the call last heard may come up to a quarter of an interval later.
    """
    late = after.heard + after.interval / 4
    times = [s.time(after.interval) for s in signs] + ([] if surfacing is None else [surfacing])
    return min((t for t in times if (t > late or t == surfacing) and t <= now), default=None)


def severity(stage: int) -> Severity:
    """How loud it is to be overdue for the k-th time."""
    return Severity.WARNING if stage == 0 else Severity.CRITICAL


def fleet(others: Iterable[tuple[Expected, tuple[Sign, ...]]], now: float) -> Fleet:
    """How the other gliders at sea are: late are those whose next call is past its expected time."""
    n, late, last = 0, 0, -inf
    for expected, signs in others:
        call = awaited(expected, signs, now, None)
        if is_at_sea(signs, call.interval, now):
            n, late, last = n + 1, late + (call.t < now), max(last, call.heard)
    return Fleet(n, late, last if n else None)


def drift(
    expected: Expected, place: tuple[float, float] | None, flow: tuple[float, float] | None, now: float
) -> Area | None:
    """Where a glider is at `now` (s) that stopped to fly; None where no position is known.

    It drifts with the last known `flow` (east, north; m/s) from where it was expected, since then. The
    ellipse also reaches to where it would be, had it drifted since its last fix, at `place` (degrees). It
    grows as the integral of an Ornstein-Uhlenbeck process of `FLOW_SIGMA` and `FLOW_MEMORY`.
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
    r = elapsed / FLOW_MEMORY
    spread = FLOW_SIGMA if flow is not None else 2 * FLOW_SIGMA
    cov = cov + 2 * (spread * FLOW_MEMORY) ** 2 * (r - 1 + exp(-r)) * np.eye(2)
    values, vectors = np.linalg.eigh(cov)
    east, north = vectors[:, 1]
    lat, lon = from_plane(u * elapsed, *origin)
    minor, major = (_K95 * sqrt(max(float(v), 0.0)) for v in values)
    return Area(lat, lon, major, minor, degrees(atan2(east, north)) % 180.0)
