"""Which reported depth-averaged current belongs to which dive. Pure.

The current of a dive is published after the surfacing that ends it: at the first fix, corrected 10 to
40 min later, often only in the next file. Until then the glider goes on reporting the
current of the dive before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.model import Current
from gliderwatch.navigation.samples import Samples, get

EARLY = 120.0
"""Seconds that a current may be published before the last sample under water."""
_SAME = 1e-6


@dataclass(frozen=True, slots=True)
class Report:
    """A newly published current: time (s), east, north (m/s), and whether it is the corrected one."""

    t: float
    u: float
    v: float
    final: bool


Known = tuple[tuple[float, float] | None, tuple[float, float] | None]
"""The last values reported as current and as corrected current; None: none yet."""


def new_reports(samples: Samples, known: Known) -> tuple[list[Report], Known]:
    """The currents in `samples` that differ from those reported before, in order of time."""
    provisional, known_provisional = _changes(samples, "current", False, known[0])
    final, known_final = _changes(samples, "current_final", True, known[1])
    # of one moment the corrected one comes last and so wins
    return sorted(provisional + final, key=lambda r: (r.t, r.final)), (known_provisional, known_final)


def _changes(
    samples: Samples, name: str, final: bool, last: tuple[float, float] | None
) -> tuple[list[Report], tuple[float, float] | None]:
    east, north = get(samples, f"{name}_e"), get(samples, f"{name}_n")
    out = []
    for t, u, v in zip(east.t.tolist(), east.v.tolist(), north.v.tolist(), strict=True):
        if last is None or abs(u - last[0]) > _SAME or abs(v - last[1]) > _SAME:
            out.append(Report(t, u, v, final))
            last = (u, v)
    return out, last


def pair(reports: list[Report], surfaced: list[float]) -> list[int]:
    """For each report the index of the dive it belongs to: the last that had surfaced then; -1: none.

    `surfaced` are the times of surfacing (s) of the dives, increasing.

    >>> pair([Report(50.0, 0, 0, False), Report(200.0, 0, 0, False)], [100.0, 900.0])
    [-1, 0]
    """
    ends = np.asarray(surfaced) - EARLY
    return [int(np.searchsorted(ends, report.t, "right")) - 1 for report in reports]


def updated(current: Current | None, report: Report) -> Current:
    """The current of a dive after one more report: the later replaces the earlier, but nothing a final one
    except a final one."""
    if current is not None and current.final and not report.final:
        return current
    return Current(report.u, report.v, report.final)
