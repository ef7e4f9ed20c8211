"""The flow of a fleet on a basis, with the idea of 003's field for depth-averaged currents. Pure.

49 Gaussians of a streamfunction on a grid over the area, a mean flow, and tides that are planes in space.
The exact form: `gliderwatch.fleet.flow` has the Gaussians infinitely dense, so that no area needs to
be known ahead.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gliderwatch.model import Array
from gliderwatch.sea.tides import Constituent

SPREAD = 0.025
"""V of the Gaussians exp(-|r|^2 / 2 V), the area being of side 1 (003: V = 0.025 I)."""
TIDES = (Constituent.M2, Constituent.K1)


def basis(
    place: Array, t: Array, centres: Array, tides: Sequence[Constituent] = TIDES
) -> tuple[Array, Array]:
    """Rows of u and v ((n, L) each) at places in the area ((n, 2)) and times (s, (n,)).

    First the streamfunction's Gaussians about ``centres`` ((m, 2)), u = -sqrt(V) dpsi/dy and v = sqrt(V)
    dpsi/dx; then the mean u and v, then of each tide cosine and sine of u at 1, x - 1/2, y - 1/2, and of v.
    """
    away = place[:, None, :] - centres
    psi = np.exp(-np.square(away).sum(-1) / (2 * SPREAD)) / math.sqrt(SPREAD)
    plane = np.column_stack([np.ones(len(place)), place - 0.5])
    waves = [wave(each.omega * t) for each in tides for wave in (np.cos, np.sin)]
    tide = np.hstack([wave[:, None] * plane for wave in waves])
    none, ones, still = np.zeros_like(tide), np.ones((len(place), 1)), np.zeros((len(place), 1))
    u = np.hstack([psi * away[..., 1], ones, still, tide, none])
    v = np.hstack([-psi * away[..., 0], still, ones, none, tide])
    return u, v
