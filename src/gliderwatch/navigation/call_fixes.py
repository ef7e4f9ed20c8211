"""What a glider told in the call at the end of a segment, where its file does not hold it. Pure.

Files of many gliders are closed before the first fix at the surface, so that it comes with the next file, a
dive later. The log of the call has it at once. What the file holds itself is not taken twice.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from gliderwatch.model import Call, Fix, Segment, Series, readonly
from gliderwatch.navigation.constants import FASTEST_OVER_GROUND, FILE_TO_CALL, JUMP, SURFACE_STAY
from gliderwatch.navigation.fixes import distance
from gliderwatch.navigation.flight import concatenated, joined


@dataclass(frozen=True, slots=True)
class FromCall:
    """What a file lacks: the first ``fix`` at the surface after it, and the ``waypoint`` (degrees), which was
    printed about then."""

    fix: Fix | None = None
    waypoint: tuple[float, float] | None = None


NOTHING = FromCall()


def missing_in_file(segment: Segment, calls: Iterable[Call], until: float) -> FromCall:
    """What the calls of a glider add to a segment; the next one opens at `until` (s, inf: none is there).

    Only the surfacing at its end counts: of one that is later the file is still to come.
    """
    since, end = segment.id.opened_at, min(until, segment.last_t + FILE_TO_CALL)
    found = [c for c in calls if c.surfaced is not None and since < c.surfaced.t < end]
    if not found:
        return NOTHING
    first = min((c.surfaced for c in found if c.surfaced is not None), key=lambda fix: fix.t)
    waypoint = max(found, key=lambda c: c.began).waypoint
    return FromCall(
        first if _is_new(segment, first) else None, None if len(segment.get("waypoint_lat")) else waypoint
    )


def _is_new(segment: Segment, fix: Fix) -> bool:
    """Whether a file has no fix of that stay at the surface, and the glider can have got there."""
    t, lat, lon = joined(segment.get("fix_lat"), segment.get("fix_lon"))
    if not len(t):
        return True
    last = Fix(float(t[-1]), float(lat[-1]), float(lon[-1]))
    later = fix.t - last.t
    return later > SURFACE_STAY and distance(last, fix) <= FASTEST_OVER_GROUND * later + JUMP


def with_call(segment: Segment, call: FromCall) -> Segment:
    """The segment with what the call at its end adds."""
    fix, waypoint, more = call.fix, call.waypoint, dict[str, Series]()
    if fix is not None:
        more |= {"fix_lat": _single(fix.t, fix.lat), "fix_lon": _single(fix.t, fix.lon)}
    if waypoint is not None:
        t = segment.last_t if fix is None else fix.t
        more |= {"waypoint_lat": _single(t, waypoint[0]), "waypoint_lon": _single(t, waypoint[1])}
    if not more:
        return segment
    return replace(segment, quantities=concatenated(segment.quantities, more))


def _single(t: float, value: float) -> Series:
    return Series(readonly([t]), readonly([value]))
