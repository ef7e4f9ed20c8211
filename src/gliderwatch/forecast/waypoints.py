"""Which waypoint a glider was bound for when it came up. Pure."""

from __future__ import annotations

from gliderwatch.forecast.constants import WAYPOINT_LATE, WAYPOINTS_HEARD
from gliderwatch.forecast.state import Place
from gliderwatch.model import Segment
from gliderwatch.navigation.samples import joined

Heard = tuple[tuple[float, float, float], ...]
"""Waypoints as they were told: time (s), latitude and longitude (degrees), in order of time."""


def heard(known: Heard, segment: Segment) -> Heard:
    """The waypoints told until now and those in one more segment; what changes nothing is left out."""
    t, lat, lon = joined(segment.get("waypoint_lat"), segment.get("waypoint_lon"))
    told = zip(t.tolist(), lat.tolist(), lon.tolist(), strict=True)
    out: list[tuple[float, float, float]] = []
    for report in sorted({*known, *told}):
        if not out or report[1:] != out[-1][1:]:
            out.append(report)
    return tuple(out[-WAYPOINTS_HEARD:])


def bound_for(known: Heard, t: float) -> Place | None:
    """The waypoint at a fix at time ``t`` (s), of those told; None before any.

    >>> bound_for(((0.0, 27.0, -84.0), (9000.0, 27.5, -84.0)), 8000.0)
    (27.0, -84.0)
    """
    before = [(lat, lon) for told, lat, lon in known if told <= t + WAYPOINT_LATE]
    return before[-1] if before else None
