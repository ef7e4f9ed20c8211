"""Calls of a glider in which it sends no file: it lives, but is not watched. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from types import MappingProxyType

from gliderwatch.incidents.acknowledgement import Acks, is_acknowledged
from gliderwatch.incidents.constants import EMPTY_CALLS, LONGEST_CALL, NEWS, SAME_SURFACING
from gliderwatch.incidents.notices import CalledWithoutFile, Notice, SendsAgain
from gliderwatch.incidents.overdue import HOUR, Sign
from gliderwatch.incidents.threads import thread_id
from gliderwatch.model import Call, Kind, Severity

_PLACE = 1e-5
"""Degrees by which two fixes may differ that are the same one, printed twice."""


@dataclass(frozen=True, slots=True)
class CallsWithoutFile:
    """The messages about calls without a file in a row: the first call began at ``since`` (s), so many were
    ``reported`` in so many ``messages``; ``is_over`` once a file was sent again."""

    id: str
    since: float
    reported: int
    messages: int
    is_over: bool = False


Surfacing = tuple[Call, ...]
"""The connections of one stay at the surface, in order of time."""


def surfacings(calls: Iterable[Call]) -> tuple[Surfacing, ...]:
    """The calls (in order of time) by surfacing: several connections with one fix, or soon after another,
    are one."""
    out: list[list[Call]] = []
    for call in calls:
        if out and _is_one(out[-1], call):
            out[-1].append(call)
        else:
            out.append([call])
    return tuple(map(tuple, out))


def _is_one(before: list[Call], call: Call) -> bool:
    pause = call.began - max(c.last_t for c in before)
    if pause > SAME_SURFACING:
        return False
    fix = next((c.fix for c in reversed(before) if c.fix is not None), None)
    if fix is None or call.fix is None:
        return pause <= LONGEST_CALL
    return abs(fix.lat - call.fix.lat) <= _PLACE and abs(fix.lon - call.fix.lon) <= _PLACE


@dataclass(frozen=True, slots=True)
class Announced:
    """A file whose transfer began in a call: its 8.3 ``name``, and the full name of its ``segment`` (empty:
    not known), lower case."""

    name: str
    segment: str


def announced_flight(call: Call) -> tuple[Announced, ...]:
    """The flight files (sbd, mbd, dbd, compressed or not) that were announced in a call.

    The call names one segment in both ways (`unit_1033-2025-022-0-33`, `0103.0033`): from that follow the
    full names of others of the same mission.
    """
    mission = call.segment.rpartition("-")[0].lower()
    found = []
    for name in call.announced:
        stem, _, kind = name.lower().rpartition(".")
        if kind in ("sbd", "scd", "mbd", "mcd", "dbd", "dcd"):
            is_of_mission = (
                mission and stem.isdigit() and len(stem) == len(call.short) and stem[:4] == call.short[:4]
            )
            found.append(Announced(name.lower(), f"{mission}-{int(stem[4:])}" if is_of_mission else ""))
    return tuple(found)


def announce(
    glider: str,
    before: CallsWithoutFile | None,
    calls: tuple[Call, ...],
    signs: tuple[Sign, ...],
    now: float,
    acks: Acks = MappingProxyType({}),
) -> tuple[CallsWithoutFile | None, list[Notice]]:
    """What people were notified of after the messages about calls without a file due `now` (s), and these.

    `calls` are those of the last weeks, in order of time; `signs` has the files that came another way.
    What somebody has acknowledged (`acks`) is not repeated.
    """
    groups = surfacings(calls)
    over = [g for k, g in enumerate(groups) if k + 1 < len(groups) or _is_over(g, now)]
    run: list[Surfacing] = []
    for group in over:
        if is_in_mission(group):  # what is at its prompt or on deck sends nothing
            run = [] if _has_file(group, signs) else [*run, group]
    if not run:
        return _over(glider, before, over)
    since, n = run[0][0].began, len(run)
    state = before
    if state is None or state.is_over:
        used = [] if state is None else [state.id]
        state = CallsWithoutFile(thread_id(f"{glider}/call/{since:.0f}", used), since, 0, 0)
    is_due = n > state.reported and (n <= EMPTY_CALLS or n >= 2 * state.reported)
    if not is_due or now - run[-1][-1].last_t >= NEWS:
        return before, []
    loud = Severity.INFO if n < EMPTY_CALLS else Severity.WARNING
    if is_acknowledged(acks, (state.id,), loud):
        return before, []
    content = CalledWithoutFile(tuple(group[-1] for group in run))
    identity, time = f"{state.id}/{state.messages}", content.calls[-1].last_t
    notice = Notice(identity, state.id, glider, time, Kind.CALL, loud, loud, content)
    return replace(state, reported=n, messages=state.messages + 1), [notice]


def _over(
    glider: str, before: CallsWithoutFile | None, groups: list[Surfacing]
) -> tuple[CallsWithoutFile | None, list[Notice]]:
    """A file was sent again."""
    later = [] if before is None else [g for g in groups if g[0].began > before.since]
    if before is None or before.is_over or not later:
        return before, []
    ended = replace(before, is_over=True)
    if before.reported < EMPTY_CALLS:
        return ended, []
    identity, call = f"{before.id}/{before.messages}", later[-1][-1]
    info, to = Severity.INFO, Severity.WARNING
    notice = Notice(identity, before.id, glider, call.last_t, Kind.ALL_CLEAR, info, to, SendsAgain(call))
    return replace(ended, messages=before.messages + 1), [notice]


def _is_over(surfacing: Surfacing, now: float) -> bool:
    """Whether a surfacing has ended: its last connection, and no further one is to come soon."""
    last = surfacing[-1]
    return now - last.last_t > LONGEST_CALL or (last.over and not last.calls_back)


def is_in_mission(surfacing: Surfacing) -> bool:
    """Whether a mission runs, and nothing that is reported as an abort (`incidents.aborts`) has happened."""
    return any(call.mission for call in surfacing) and not any(call.happened for call in surfacing)


def _has_file(surfacing: Surfacing, signs: Iterable[Sign]) -> bool:
    """Whether a file was sent, or came by another way."""
    if any(call.sent for call in surfacing):
        return True
    start, end = surfacing[0].began - HOUR, surfacing[-1].last_t + HOUR
    return any(s.last_t is not None and start <= s.last_t <= end for s in signs if not s.is_call)
