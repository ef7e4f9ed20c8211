"""A depth sensor that does not show zero at the surface: its pressure was not zeroed. Pure."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from gliderwatch.model import Fix, Series, readonly
from gliderwatch.navigation.fixes import new_fixes
from gliderwatch.navigation.samples import Samples, get

NEAR = 30.0
"""Seconds from a fix within which a depth is one at the surface."""
LEAST = 2.0
"""Metres: less is the pitching in waves, and the depth of a sensor that is below the antenna."""
FEWEST = 3
"""Depths at the surface that say what the sensor shows there."""
MOST = 15.0
"""Metres: a depth beyond this at a fix is that of an old fix, reported once more under water."""
SHALLOW = 0.25
"""Quantile of the depths at the surface that is taken: some are of the first metres of a dive."""


def zeroed(fresh: Samples, last: Fix | None, known: float) -> tuple[Samples, float]:
    """The samples of a segment with depths from the surface, and what its sensor shows at the surface (m).

    That is seen at the fixes after the ``last`` of before; without them it is as ``known``. 0: near enough.
    """
    depth = get(fresh, "depth")
    if not len(depth):
        return fresh, known
    shown = _at_surface(depth, [fix.t for fix in new_fixes(fresh, last)])
    if shown is not None:
        known = shown if abs(shown) > LEAST else 0.0
    if not known:
        return fresh, 0.0
    return MappingProxyType({**fresh, "depth": Series(depth.t, readonly(depth.v - known))}), known


def _at_surface(depth: Series, fixes: list[float]) -> float | None:
    """The depth shown at the fixes (m), None where too few are."""
    if not fixes:
        return None
    t = np.asarray(fixes)
    at = np.clip(np.searchsorted(t, depth.t), 1, len(t)) - 1
    gap = np.minimum(np.abs(depth.t - t[at]), np.abs(depth.t - t[np.minimum(at + 1, len(t) - 1)]))
    near = depth.v[gap <= NEAR]
    if len(near) < FEWEST:
        return None
    shown = float(np.quantile(near, SHALLOW))
    # nobody flies above the surface: a fix at which it is much deeper than elsewhere is an old one
    return shown if abs(shown) <= MOST and depth.v.min() > shown - LEAST else None
