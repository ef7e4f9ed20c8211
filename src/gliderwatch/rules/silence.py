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
from gliderwatch.estimation.flow import FlowParams
from gliderwatch.forecast.constants import CHI2_COVERED
from gliderwatch.model import Expected, Severity
from gliderwatch.navigation.frame import from_plane, to_plane
from gliderwatch.rules.constants import (
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
    SAME_CALL,
    SHORTEST_INTERVAL,
    TIME_SIGMAS,
    UNKNOWN_FLOW,
)

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
class Awaited:
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


def margin(expected: Expected, signs: Iterable[Sign], now: float, overdue_hours: float | None) -> float:
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


def guess(signs: Iterable[Sign], now: float) -> Expected | None:
    """The next surfacing of a glider whose dives cannot be used: as long after its last sign of life as its
    last files were opened apart; None where too few are known."""
    known = [s for s in signs if s.opened_at <= now]
    interval = rhythm(known, now)
    if interval is None:
        return None
    last = max(s.opened_at for s in known)
    after = max((t for t in (s.time(interval) for s in known) if t <= now), default=last)
    return Expected(
        after, after + interval, GUESSED_SIGMA * interval, None, None, 0.0, 0.0, 0.0, "its last files"
    )


def awaited(expected: Expected, signs: Iterable[Sign], now: float, overdue_hours: float | None) -> Awaited:
    """The next call, as known at `now` (s).

    A sign of life of a later call than the one that `expected` rests upon (a file that waits for its
    cache, a dive without a fix) puts the next one off: one interval from there.
    """
    signs, interval = tuple(signs), expected.t - expected.after
    watched = min((s.at for s in signs), default=now)
    heard = max([expected.after, *(t for t in (s.life(interval, watched) for s in signs) if t <= now)])
    t = heard + interval if heard > expected.after + LATER_CALL * interval else expected.t
    recent = (s for s in signs if now - s.opened_at <= GONE + FRESH)
    return Awaited(heard, t, t + margin(expected, recent, now, overdue_hours), interval)


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
    late, signs = after.heard + SAME_CALL * after.interval, tuple(signs)
    watched = min((s.at for s in signs), default=now)
    times = [s.life(after.interval, watched) for s in signs] + ([] if surfacing is None else [surfacing])
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
    return Area(lat, lon, major, minor, degrees(atan2(east, north)) % 180.0)
