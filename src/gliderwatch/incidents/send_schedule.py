"""When a message goes out: quiet hours, and people who get only what nobody has acknowledged. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime, time, timedelta, tzinfo
from math import ceil, inf

from gliderwatch.incidents.constants import MARKS, SLACK, WEEK
from gliderwatch.model import Alert, Severity


@dataclass(frozen=True, slots=True)
class QuietHours:
    """From ``start`` to ``end`` by the clock of a ``zone``, over midnight where ``end`` is the earlier of the
    two, messages ``below`` a severity wait."""

    start: time
    end: time
    zone: tzinfo
    below: Severity

    def holds(self, t: float) -> bool:
        """Whether a time (s) lies in them."""
        clock = datetime.fromtimestamp(t, self.zone).time()
        if self.start < self.end:
            return self.start <= clock < self.end
        return clock >= self.start or clock < self.end

    def until(self, t: float) -> float:
        """Their end, where a time (s) lies in them, else the time itself.

        An end that the clock leaves out when it is put forward has the offset before, as RFC 5545
        (3.3.5) does. Of one that comes twice it is the first that is still to come.
        """
        if not self.holds(t):
            return t
        day = datetime.fromtimestamp(t, self.zone).date()
        ends = (
            datetime.combine(day + timedelta(days=n), self.end, self.zone).replace(fold=fold).timestamp()
            for n in range(4)
            for fold in (0, 1)
        )
        return min(end for end in ends if end > t and not self.holds(end))


@dataclass(frozen=True, slots=True)
class Wait:
    """What one recipient waits for: they are notified of an incident ``after`` a time (s) without
    acknowledgement (None: at once), and not in their ``quiet`` hours."""

    after: float | None = None
    quiet: QuietHours | None = None

    def until(self, t: float, severity: Severity) -> float:
        """When they get what is meant for a time (s)."""
        return t if self.quiet is None or severity >= self.quiet.below else self.quiet.until(t)


AT_ONCE = (Wait(),)
"""The wait of a channel whose recipients wait for nothing."""


@dataclass(frozen=True, slots=True)
class Standing:
    """How an incident stands with a channel: whether people were ``notified`` of it there, whether it is
    ``unanswered`` (it is open, and nobody has acknowledged it), and when that what waits there ``escalates``
    (s; infinite: nothing waits)."""

    notified: bool
    unanswered: bool
    escalates: float = inf


NO_INCIDENT = Standing(notified=True, unanswered=False)
"""For messages that nobody can acknowledge."""


@dataclass(frozen=True, slots=True)
class Due:
    """When a message goes out: ``at`` a time (s; 0: at once, infinite: never) in any case, and earlier if it
    ``escalates`` (s; infinite: never): while nobody has acknowledged its incident."""

    at: float
    escalates: float


def due(waits: Iterable[Wait], severity: Severity, now: float, standing: Standing) -> Due | None:
    """When a message made `now` (s) goes out by a channel whose recipients wait so; None: it does not.

    The one of them who waits least decides. Whoever waits for an acknowledgement gets the messages of an
    incident from their first one on, or none.
    """
    at = escalates = inf
    for wait in waits:
        if wait.after is None or standing.notified:
            at = min(at, wait.until(now, severity))
        elif standing.unanswered:
            begins = now + wait.after if standing.escalates == inf else standing.escalates
            escalates = min(escalates, wait.until(begins, severity))
    if at == escalates == inf:
        return None
    return Due(at if at > now else 0.0, escalates if escalates < at else inf)


def deliveries(
    alert: Alert, channels: Iterable[str], now: float, standing: Callable[[str], Standing]
) -> dict[str, Due]:
    """When a message made `now` (s) goes out by each of its channels; one by which it does not is left out.

    A mapping of `channels` says what the recipients of each wait for; of names alone they get it at once.
    `standing` is how its incident stands with a channel, asked only where somebody waits for that.
    """
    waits = channels if isinstance(channels, Mapping) else dict.fromkeys(channels, AT_ONCE)
    found = {}
    for channel, wait in waits.items():
        is_asked = alert.incident and any(w.after is not None for w in wait)
        one = due(wait, alert.audience, now, standing(channel) if is_asked else NO_INCIDENT)
        if one is not None:
            found[channel] = one
    return found


def is_reminder_due(opened: float, last: float, now: float, hours: float | None) -> bool:
    """Whether what is so since a time (s) and had its ``last`` message is due for a reminder; ``hours`` are
    what is set in place of a day, None: never."""
    if hours is None:
        return False
    before, age = ((t - opened) / 3600 / hours for t in (last, now))
    return age >= next_reminder(before)


def next_reminder(age: float) -> float:
    """The age (days, or what is set in their place) of the next reminder of an incident whose last
    message was at an ``age``: at 1, 2, 4 and 7 days, then each week, and never within a day of that.

    >>> [next_reminder(age) for age in (0.0, 0.5, 1.0, 2.1, 4.2, 7.0)]
    [1.0, 2.0, 2.0, 4.0, 7.0, 14.0]
    """
    soonest = age + 1 - SLACK
    return next((mark for mark in MARKS if mark >= soonest), WEEK * max(ceil(soonest / WEEK), 1))
