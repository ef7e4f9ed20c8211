"""When no dive of a glider can be judged although it is at sea: a blind watch is reported. Pure.

Files that wait or cannot be read are signs of life: the glider is not overdue. But how it flies is not
known, which must not look like health. The same holds for dives that came and have no flag.

As with incidents, the messages are the difference between what is so and what people were notified of, so
that no order of arrival matters and no message comes twice.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import inf
from typing import Protocol

from gliderwatch.incidents.constants import (
    DEPLOYMENT_HOURS,
    GONE,
    REMINDER_GROWTH,
    THINNED,
    UNJUDGED_INTERVALS,
)
from gliderwatch.incidents.facts import Facts, situation
from gliderwatch.incidents.notices import Blind, Blindness, JudgedAgain, Notice, Situation, Unjudged
from gliderwatch.incidents.overdue import HOUR, Sign, is_at_sea, rhythm
from gliderwatch.incidents.threads import thread_id
from gliderwatch.model import Kind, NextSurfacing, Severity, Unusable
from gliderwatch.navigation.constants import SHORTEST_DIVE
from gliderwatch.params import Attention


@dataclass(frozen=True, slots=True)
class UnjudgedThread:
    """The messages about one time in which nothing could be judged.

    It began at ``since`` (s); there were so many ``messages``, the last of them at ``time`` (s). ``is_over``
    once a dive was judged again.
    """

    id: str
    since: float
    messages: int
    time: float
    is_over: bool = False


class WatchFacts(Facts, Protocol):
    """The facts that show whether the dives of a glider can be judged."""

    glider: str

    def judged(self, until: float) -> float | None:
        """The last surfacing (s) at `until` (s) or before whose dive has a flag."""

    def unjudged(self, since: float) -> tuple[Unjudged, ...]:
        """Dives without a flag, and files that were not decoded, that began later than `since` (s)."""

    def signs(self, since: float) -> tuple[Sign, ...]:
        """Its files that were opened at `since` (s) or later."""


def blindness(facts: WatchFacts, attention: Attention, now: float) -> Blindness | None:
    """The time up to `now` (s) in which nothing could be judged, where it is long enough to be reported."""
    judged = facts.judged(now)
    since = now - GONE if judged is None else max(judged, now - GONE)
    items = _run([i for i in facts.unjudged(since) if i.start <= now], _apart(attention), now)
    if not items or not _is_long(items, facts.expected(now), attention):
        return None
    signs = facts.signs(now - GONE)
    if not is_at_sea(signs, rhythm(signs, now) or 0.0, now):
        return None
    return Blindness(facts.glider, items[0].start, _end(items), judged, items)


def _apart(attention: Attention) -> float:
    """Seconds without anything of a glider after which what comes belongs to another deployment."""
    return HOUR * (DEPLOYMENT_HOURS if attention.unknown_hours is None else attention.unknown_hours)


def _run(items: Iterable[Unjudged], apart: float, now: float) -> tuple[Unjudged, ...]:
    """The last of some items that follow each other without a pause, in order of time.

    Each ends where the next begins: a file that was not decoded may have come late.
    """
    run: list[Unjudged] = []
    ended = -inf  # of all in the run before the last one
    for item in sorted(items, key=lambda i: (i.start, i.end)):
        if run and item.start - max(ended, run[-1].end) > apart:
            run, ended = [], -inf
        if run and run[-1].end > item.start:
            run[-1] = replace(run[-1], end=item.start)
        ended = max(ended, run[-1].end) if run else -inf
        run.append(item if item.end <= now else replace(item, end=now))
    return tuple(run)


def _end(items: Iterable[Unjudged]) -> float:
    return max(item.end for item in items)


def _is_long(items: tuple[Unjudged, ...], expected: NextSurfacing | None, attention: Attention) -> bool:
    """Whether it lasted for as many hours, or dives, as are to be reported."""
    hours, dives = attention.unknown_hours, attention.unknown_dives
    if dives is not None and _dives(items) >= dives:
        return True
    interval = 0.0 if expected is None else expected.t - expected.after
    return hours is not None and _end(items) - items[0].start >= max(
        hours * HOUR, UNJUDGED_INTERVALS * interval
    )


def _dives(items: tuple[Unjudged, ...]) -> int:
    """How many dives the items stand for.

    Where files are not decoded, the dive between them has data missing: it is counted once.
    """
    has_files = any(item.is_file for item in items)
    return sum(
        item.end - item.start >= SHORTEST_DIVE and not (has_files and item.cause is Unusable.DATA_MISSING)
        for item in items
    )


def announce(
    before: UnjudgedThread | None,
    facts: WatchFacts,
    attention: Attention,
    reminder_hours: float | None,
    now: float,
) -> tuple[UnjudgedThread | None, list[Notice]]:
    """What people were notified of after the messages that are due `now` (s), and these messages."""
    found = blindness(facts, attention, now)
    if before is None or before.is_over:
        return (before, []) if found is None else _opened(before, found, situation(facts))
    at = facts.judged(now)
    if at is not None and at > before.since and found is None:
        identity, content = f"{before.id}/{before.messages}", JudgedAgain(before.since, at)
        info, to = Severity.INFO, Severity.WARNING
        notice = Notice(identity, before.id, facts.glider, at, Kind.ALL_CLEAR, info, to, content)
        return replace(before, messages=before.messages + 1, time=at, is_over=True), [notice]
    if found is None or reminder_hours is None:
        return before, []
    pause = min(REMINDER_GROWTH ** (before.messages - 1), THINNED) * reminder_hours * HOUR
    if found.until - before.time < pause:
        return before, []
    return _notified(before, found, situation(facts))


def _opened(
    before: UnjudgedThread | None, found: Blindness, now: Situation
) -> tuple[UnjudgedThread, list[Notice]]:
    used = [] if before is None else [before.id]
    identity = thread_id(f"{found.glider}/unknown/{found.since:.0f}", used)
    return _notified(UnjudgedThread(identity, found.since, 0, found.until), found, now)


def _notified(
    before: UnjudgedThread, found: Blindness, now: Situation
) -> tuple[UnjudgedThread, list[Notice]]:
    first, loud = before.messages == 0, Severity.WARNING
    identity, kind = f"{before.id}/{before.messages}", Kind.UNKNOWN if first else Kind.REMINDER
    content = Blind(found, first, now)
    notice = Notice(identity, before.id, found.glider, found.until, kind, loud, loud, content)
    return replace(before, messages=before.messages + 1, time=found.until), [notice]
