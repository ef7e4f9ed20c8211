"""What the drift at the surface says of a step that the glider does not know of. Pure.

Between the fixes of one surfacing a glider drifts with the water there, whatever its wings and its compass
do: a current that is independent of its reckoning. It differs from the flow below by wind and waves, a part
of which lasts for hours and some for weeks. A lost wing makes the flow that is believed wrong by what it
takes of the speed, along the heading; so the drift departs from that flow by as much, and turns with the
glider.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from gliderwatch.estimation.constants import (
    CARRIED,
    DRIFT_AGAINST,
    DRIFT_FOR,
    DRIFT_LEAST,
    DRIFT_LONGEST,
    DRIFT_MEMORY,
    DRIFT_SHORTEST,
    DRIFTS_FEW,
    DRIFTS_KEPT,
    FAR,
    LASTING_DRIFT,
    RAYLEIGH_MEDIAN,
    SURFACE_FLOW,
)
from gliderwatch.model import Array, Fix, readonly
from gliderwatch.navigation.geodesy import velocity


@dataclass(frozen=True, slots=True, eq=False)
class Drifts:
    """Drifts at the last surfacings, oldest first.

    ``times`` (s, (k,)); ``beside`` (m/s, (k, 2)) by how much each differed from the flow that was expected
    there; ``ways`` (m/s, (k, 2)) W h of the dive before it.
    """

    times: Array = field(default_factory=lambda: readonly([]))
    beside: Array = field(default_factory=lambda: readonly(np.empty((0, 2))))
    ways: Array = field(default_factory=lambda: readonly(np.empty((0, 2))))


def drift(before: Fix | None, after: Fix) -> Array | None:
    """The velocity (m/s, (2,)) between the last fix of a dive and the first of the next one; None where they
    are not of one surfacing, or too near, or one of them is wild."""
    if before is None or not DRIFT_SHORTEST <= after.t - before.t <= DRIFT_LONGEST:
        return None
    found = velocity(before, after)
    return found if np.hypot(*found) < CARRIED else None


def added(drifts: Drifts, t: float, beside: Array, way: Array) -> Drifts:
    """The drifts with that of one more surfacing; the last `DRIFTS_KEPT` stay."""
    return Drifts(
        readonly([*drifts.times, t][-DRIFTS_KEPT:]),
        readonly([*drifts.beside, beside][-DRIFTS_KEPT:]),
        readonly([*drifts.ways, way][-DRIFTS_KEPT:]),
    )


def evidence(drifts: Drifts, since: float, slip: float, side: float) -> float:
    """Twice the log likelihood ratio of a step in slip and side at a time (s) to none, within bounds.

    Drift beside the flow has a mean that nobody knows, a part that lasts for hours, and one that does not;
    how large they are these drifts tell. 0 where they are few.
    """
    later = drifts.times > since  # the one just before it is of the dive before
    if len(drifts.times) < DRIFTS_FEW or not later.any():
        return 0.0
    seen, precision = _believed(drifts)
    east, north = drifts.ways.T
    step = np.where(later[:, None], slip * drifts.ways + side * np.column_stack([-north, east]), 0.0)
    found = float(np.sum((precision @ step) * (2 * seen - step)))
    return min(max(found, -DRIFT_AGAINST), DRIFT_FOR)


@lru_cache(maxsize=2)  # asked for a loss and for a turn
def _believed(drifts: Drifts) -> tuple[Array, Array]:
    """What each drift was beside the flow (m/s, (k, 2)), one that is far off less so, and the inverse of the
    covariance of either component (s2/m2, (k, k))."""
    middle = drifts.beside.mean(axis=0)
    off = drifts.beside - middle
    far = np.maximum(np.hypot(*off.T), 1e-9)
    spread = max(float(np.median(far)) / RAYLEIGH_MEDIAN, DRIFT_LEAST)
    seen = middle + off * np.minimum(FAR * spread / far, 1.0)[:, None]
    apart = np.abs(drifts.times[:, None] - drifts.times)
    lasting = LASTING_DRIFT * np.exp(-apart / DRIFT_MEMORY) + (1 - LASTING_DRIFT) * np.eye(len(apart))
    return seen, np.asarray(np.linalg.inv(spread**2 * lasting + SURFACE_FLOW**2))
