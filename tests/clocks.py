"""Missions whose clock is set on the way: segments for the core, and files as a dockserver gets them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gliderwatch.model import Segment, Series, readonly
from gliderwatch.simulate.scenario import Mission
from gliderwatch.simulate.telemetry import SegmentData

WEEKS = 1024 * 7 * 86400.0


def shifted(segment: Segment, seconds: float) -> Segment:
    """The segment by a clock that is ahead by some seconds."""
    return replace(
        segment,
        id=replace(segment.id, opened_at=segment.id.opened_at + seconds),
        last_t=segment.last_t + seconds,
        quantities={k: Series(readonly(s.t + seconds), s.v) for k, s in segment.quantities.items()},
    )


def with_clock_set(
    segments: Sequence[Segment], first: int, seconds: float, until: int = 10**6
) -> list[Segment]:
    """The segments of a glider whose clock is set by some seconds before the `first`, and right again at
    `until`."""
    return [shifted(s, seconds if first <= i < until else 0.0) for i, s in enumerate(segments)]


def files_with_clock_set(mission: Mission, first: int, seconds: float) -> Mission:
    """The same of a simulated mission: the times in its files, not when they come to shore."""

    def changed(segment: SegmentData) -> SegmentData:
        values = segment.values.copy()
        names = [sensor.name for sensor in segment.sensors.columns]
        values[:, names.index("m_present_time")] += seconds
        header = replace(segment.header, opened=segment.header.opened + seconds)
        return replace(segment, header=header, values=values)

    kept, later = mission.segments[:first], mission.segments[first:]
    return replace(mission, segments=(*kept, *map(changed, later)))
