"""A glider whose clock is set back in mid-mission: which segments go to which time. Pure.

The segments of a mission are numbered, and the next one opens seconds to minutes after the one before has
ended (10 to 810 s between 266 pairs of real segments). One that opens before the end of its predecessor has a
clock that was set back. Its time, and that of all after it until the clock is right again, is then moved on.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil

from gliderwatch.model import Fix, Segment, SegmentId, Series, readonly
from gliderwatch.navigation.constants import (
    ENOUGH_SEGMENTS,
    FASTEST_OVER_GROUND,
    LEAST_STEP,
    LONGEST_PAUSE,
    LONGEST_PAUSE_OF_DAYS,
    OVERLAP,
    PAUSE,
    SAME_OPENING,
    SILENT_AT_MOST,
    WILD_SEGMENT,
)
from gliderwatch.navigation.fixes import distance
from gliderwatch.navigation.flight import downsample

HOUR, DAY = 3600.0, 86400.0
ROLLOVER = 1024 * 7 * DAY
"""Seconds after which the week number of GPS begins again at 0; an old receiver falls back by it."""
_NUMBERED = re.compile(r"(?P<mission>.+-\d{4}-\d{1,3}-\d{1,5})-(?P<number>\d{1,5})", re.ASCII)


@dataclass(frozen=True, slots=True)
class Stamp:
    """One segment of a mission by the glider's clock: its ``number``, its opening and its last sample (s)."""

    number: int
    opened_at: float
    last_t: float


@dataclass(frozen=True, slots=True)
class Correction:
    """What is added to the time of a segment (``offset``, s), and by how much the clock was set back before
    it (``step``, s; 0: not; negative: it is right again). A step back without offset is not corrected: how
    much time lies between is not known."""

    offset: float = 0.0
    step: float = 0.0


@dataclass(frozen=True, slots=True)
class ClockStep:
    """Where the clock of a glider was set: the ``segment`` after that, opened at ``t`` (s, corrected)."""

    glider: str
    segment: str
    t: float
    offset: float
    step: float

    @property
    def is_corrected(self) -> bool:
        """Whether the times of what comes after are right."""
        return self.step < 0 or self.offset > 0


def numbered(name: str) -> tuple[str, int]:
    """The mission of a segment, and its number in it, from its full name.

    >>> numbered("unit-2023-318-0-41")
    ('unit-2023-318-0', 41)
    """
    match = _NUMBERED.fullmatch(name)
    return (match["mission"], int(match["number"])) if match else (name, 0)


def is_same(a: SegmentId, b: SegmentId) -> bool:
    """Whether two files of one glider hold the same segment: its name, and about the same opening."""
    return a.name == b.name and abs(a.opened_at - b.opened_at) <= SAME_OPENING


def corrections(stamps: Sequence[Stamp], start: Correction = Correction()) -> list[Correction]:
    """The correction of each of the known segments of one mission, in the order given.

    `start` is that of the first of them, where those before it are not kept any more.
    Where a number is there twice the mission counter began again: then nothing can be said of the clock.
    The order of arrival does not matter: all follows from the segments that are known.
    """
    found = {stamp.number: start for stamp in stamps}
    if len(found) < len(stamps):
        return [start] * len(stamps)
    before: Stamp | None = None
    offset = start.offset
    for stamp in _with_sound_ends(sorted(stamps, key=lambda s: s.number)):
        if before is not None:
            found[stamp.number] = _after(before, offset, stamp)
            offset = found[stamp.number].offset
        before = stamp
    return [found[stamp.number] for stamp in stamps]


@dataclass(frozen=True, slots=True)
class MissionClock:
    """How the clock of a mission stands at its segment of the highest number, so that the next segment needs
    no look at all of them: its stamp, its correction's offset (s), and the ``second_longest`` duration of a
    segment (s), which says where a wild end begins."""

    newest: Stamp
    offset: float
    second_longest: float

    def next(self, stamp: Stamp) -> Correction | None:
        """The correction of one more segment, as `corrections` of all would give it, which leaves those of
        the others as they are; None where only a look at all can tell."""
        if stamp.number <= self.newest.number or stamp.last_t - stamp.opened_at > self.second_longest:
            return None
        return _after(self.newest, self.offset, stamp)


def mission_clock(stamps: Sequence[Stamp], found: Sequence[Correction]) -> MissionClock | None:
    """The clock of a mission from all its segments and their corrections; None where these are too few, or
    where a number is there twice."""
    if len(stamps) < ENOUGH_SEGMENTS or len({stamp.number for stamp in stamps}) < len(stamps):
        return None
    newest = max(stamps, key=lambda stamp: stamp.number)
    offset = found[stamps.index(newest)].offset
    sound = next(s for s in _with_sound_ends(list(stamps)) if s.number == newest.number)
    return MissionClock(sound, offset, sorted(s.last_t - s.opened_at for s in stamps)[-2])


def _with_sound_ends(stamps: list[Stamp]) -> list[Stamp]:
    """The segments in order; one that is far longer than all others has a wild time stamp, no known end."""
    if len(stamps) < ENOUGH_SEGMENTS:
        return stamps
    longest = WILD_SEGMENT * sorted(s.last_t - s.opened_at for s in stamps)[-2]
    return [s if s.last_t - s.opened_at <= longest else replace(s, last_t=s.opened_at) for s in stamps]


def _after(before: Stamp, offset: float, stamp: Stamp) -> Correction:
    """The correction of a segment from the one before, whose correction has this `offset` (s)."""
    end, follows = before.last_t + offset, stamp.number == before.number + 1
    if stamp.opened_at > end - OVERLAP and (offset > DAY or (offset and follows)):
        return Correction(0.0, -offset)  # the clock is right again
    gap = stamp.opened_at + offset - end
    if gap > -OVERLAP:
        return Correction(offset)
    if -OVERLAP < gap + ROLLOVER < SILENT_AT_MOST:
        return Correction(offset + ROLLOVER, ROLLOVER)
    if not follows:  # segments are missing: nobody knows how much time is
        return Correction(0.0, -gap)
    step = _step_back(-gap)
    return Correction(offset + step, step)


def _step_back(overlap: float) -> float:
    """By how much (s) a clock was set back: a segment opens ``overlap`` (s) before the end of the last one.

    People set clocks by whole days and hours; between the two segments is the pause that this leaves.
    """
    for unit, pause in ((DAY, LONGEST_PAUSE_OF_DAYS), (HOUR, LONGEST_PAUSE)):
        step = ceil((overlap - OVERLAP) / unit) * unit
        if step - overlap <= pause:
            return step
    return overlap + PAUSE


def moved(segment: Segment, offset: float) -> Segment:
    """The segment as if the glider's clock had been ahead by `offset` (s) of what it was, with a note.

    Its samples are averaged first, as the state file holds it: which of them are averaged depends on their
    times, and a segment at hand and the one that was kept must be moved to the same.
    """
    if not offset:
        return segment
    kept = downsample(segment.quantities)
    held = {name: Series(readonly(s.t + offset), s.v) for name, s in kept.items()}
    note = f"the glider's clock was {span(offset)} behind: the times of this segment are corrected"
    return replace(
        segment,
        id=replace(segment.id, opened_at=segment.id.opened_at + offset),
        last_t=segment.last_t + offset,
        quantities=held,
        notes=(*segment.notes, note),
    )


def span(seconds: float) -> str:
    """How far a clock is off, in words.

    >>> span(1024 * 7 * 86400.0), span(10 * 86400.0), span(7200.0), span(2000.0)
    ('1024 weeks', '10 days', '2 h', '33 min')
    """
    if seconds == ROLLOVER:
        return "1024 weeks"
    for unit, length in (("days", DAY), ("h", HOUR)):
        if seconds >= 2 * length:
            return f"{round(seconds / length, 1):g} {unit}"
    return f"{seconds / 60:.0f} min"


def forward_step(
    latest: str, last_t: float | None, fix: Fix | None, identity: SegmentId, first: Fix | None
) -> float:
    """By how much (s) a clock was set forward between the ``latest`` segment and the next; 0: it was not.

    ``last_t`` is the end of the latest one and ``fix`` its last fix, ``first`` the first fix of the next.
    """
    (mission, before), (same, number) = numbered(latest), numbered(identity.name)
    if last_t is None or fix is None or first is None or (mission, before + 1) != (same, number):
        return 0.0
    step = identity.opened_at - last_t - PAUSE
    at_surface = last_t - fix.t < LONGEST_PAUSE and first.t - identity.opened_at < LONGEST_PAUSE
    between = first.t - fix.t - step
    near = distance(fix, first) < FASTEST_OVER_GROUND * between
    return step if step > LEAST_STEP and at_surface and near else 0.0
