"""Which reported depth-averaged current belongs to which dive. Pure.

The current of a dive is published after the surfacing that ends it: at the first fix, corrected 10 to
40 min later, often only in the next file. Until then the glider goes on reporting the
current of the dive before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.model import Current, Segment
from gliderwatch.navigation.constants import CURRENT_CORRECTED, CURRENT_EARLY, SAME_CURRENT
from gliderwatch.navigation.flight import joined
from gliderwatch.navigation.geodesy import magnetic_to_true


@dataclass(frozen=True, slots=True)
class Report:
    """A newly published current: time (s), east, north (m/s, true north), and whether its sensor is the one
    for corrected values."""

    t: float
    u: float
    v: float
    final: bool


LastReported = tuple[tuple[float, float] | None, tuple[float, float] | None]
"""The last values reported as current and as corrected current, as the glider gave them: relative to
magnetic north, so that one repeated under a new declination is still the same. None: none yet."""


def new_reports(
    segment: Segment, declination: float, before: LastReported
) -> tuple[list[Report], LastReported]:
    """The currents in a segment that differ from those reported before, in order of time.

    `declination` (rad) turns them to true north. A current of exactly zero is one not computed yet.
    """
    name = "current" if len(segment.get("current_x")) else "current_initial"
    provisional, last_provisional = _changes(segment, name, False, declination, before[0])
    final, last_final = _changes(segment, "current_final", True, declination, before[1])
    # of one moment the corrected one comes last and so wins
    return sorted(provisional + final, key=lambda r: (r.t, r.final)), (last_provisional, last_final)


def _changes(
    segment: Segment, name: str, final: bool, declination: float, last: tuple[float, float] | None
) -> tuple[list[Report], tuple[float, float] | None]:
    times, east, north = joined(segment.get(f"{name}_x"), segment.get(f"{name}_y"))
    out = []
    for t, x, y in zip(times.tolist(), east.tolist(), north.tolist(), strict=True):
        if (x, y) == (0.0, 0.0):
            continue
        if last is None or abs(x - last[0]) > SAME_CURRENT or abs(y - last[1]) > SAME_CURRENT:
            u, v = magnetic_to_true(np.array([x, y]), declination).tolist()
            out.append(Report(t, u, v, final))
            last = (x, y)
    return out, last


def pair(reports: Sequence[Report], surfaced: Sequence[float]) -> list[int]:
    """For each report the index of the dive it belongs to: the last that had surfaced then; -1: none.

    `surfaced` are the times of surfacing (s) of the dives, increasing.

    >>> pair([Report(50.0, 0, 0, False), Report(2000.0, 0, 0, False)], [1000.0, 9000.0])
    [-1, 0]
    """
    ends = np.asarray(surfaced, dtype=np.float64) - CURRENT_EARLY
    return [int(np.searchsorted(ends, report.t, "right")) - 1 for report in reports]


def updated(current: Current | None, report: Report, surfaced: float) -> Current:
    """The current of a dive that `surfaced` (s) after one more report: the later replaces the earlier.

    Many files hold no sensor of corrected values. Then the second value of a dive is the corrected
    one, and so is a first one that is published `CURRENT_CORRECTED` after the surfacing.
    """
    corrected = report.final or current is not None or report.t - surfaced > CURRENT_CORRECTED
    return Current(report.u, report.v, corrected)
