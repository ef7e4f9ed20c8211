"""What the logs of calls add to the files of a glider, in one transaction with all else that follows.

The segment that a call is at the end of, and all after it, are outdated where the call adds something to it
(`navigation.call_fixes`); they are processed again with the next of the glider's inputs, or at once.
"""

from __future__ import annotations

from math import inf

from gliderwatch.forecast.outlook import after_call
from gliderwatch.incidents.calls import is_in_mission, surfacings
from gliderwatch.incidents.constants import GONE
from gliderwatch.model import NextSurfacing, Segment, SegmentId
from gliderwatch.navigation.call_fixes import FromCall, missing_in_file, with_call
from gliderwatch.navigation.constants import FILE_TO_CALL
from gliderwatch.params import GliderParams
from gliderwatch.slocum.calls import Dialog
from gliderwatch.store.codec import plain_encode
from gliderwatch.store.state_file import File, Store


def has_calls(store: Store, glider: str) -> bool:
    """Whether there is anything that calls could add: of most gliders no log is kept."""
    return store.calls.has(glider)


def with_additions(store: Store, segment: Segment, until: float) -> Segment:
    """A segment with what the calls at its end add to it; the next one opens at `until` (s)."""
    if not has_calls(store, segment.id.glider):
        return segment
    return with_call(segment, added(store, segment, until))


def added(store: Store, segment: Segment, until: float = inf) -> FromCall:
    """What the calls at the end of a segment add to it; the next one opens at `until` (s)."""
    end = segment.last_t + 2 * FILE_TO_CALL  # a call tells of its surfacing what is no older than that
    return missing_in_file(segment, store.calls.during(segment.id.glider, segment.id.opened_at, end), until)


def touched(store: Store, first: SegmentId) -> SegmentId:
    """The first segment to be processed again, where one was put in its place: the one before it, if a call
    at its end belongs to the new one."""
    if not has_calls(store, first.glider):
        return first
    before = store.segments.last_before(first.glider, first.opened_at)
    if before is None or not store.calls.during(first.glider, first.opened_at, inf):
        return first
    segment = store.segments.get(before)
    if added(store, segment) == added(store, segment, first.opened_at):
        return first
    store.segments.outdate(before)
    return before


def keep_call(store: Store, file: File, dialog: Dialog, now: float) -> None:
    """Keep what a log tells by `now` (s), and outdate what that changes."""
    call = dialog.call
    at = None if call.surfaced is None else store.segments.last_before(call.glider, call.surfaced.t)
    segment = None if at is None else store.segments.get(at)
    before = None if segment is None else added(store, segment)
    store.calls.keep(file.path, call, plain_encode(dialog), now)
    store.segments.changed(call.glider)  # also segments that are still to come may get something from it
    if at is not None and segment is not None and added(store, segment) != before:
        store.segments.outdate(at)


def expect_by_calls(store: Store, glider: str, params: GliderParams, now: float) -> None:
    """Keep the next surfacing by the last call, where no file has come of that surfacing by `now` (s)."""
    if has_calls(store, glider):
        store.segments.expect_after_call(glider, _next_surfacing(store, glider, params, now))


def _next_surfacing(store: Store, glider: str, params: GliderParams, now: float) -> NextSurfacing | None:
    """The next surfacing by the last call, where no file has come of that surfacing by `now` (s).

    None as well of a glider that has fallen out of its mission: it stays at the surface.
    """
    calls = store.calls.during(glider, max(store.segments.last_surfacing(glider), now - GONE), inf)
    found = [call for call in calls if call.surfaced is not None]
    state = store.segments.newest(glider) if found else None
    if state is None:
        return None
    *_, last = surfacings(found)
    fix, memory = last[0].surfaced, state.memory
    if fix is None or not is_in_mission(last):
        return None
    return after_call(memory.surfacings, fix, last[-1].waypoint, memory.estimate, params.surfacing_hours)
