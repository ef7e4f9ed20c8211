"""A track cut into steps short enough to hold the flow constant within each. Pure.

Horizontal vectors are complex numbers east + i north here: a turn into the frame of the heading
is then one product.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array

Complex = NDArray[np.complex128]

LONGEST = 300.0
"""Longest substep (s): a glider moves about 100 m in it, little against any width in use."""


@dataclass(frozen=True, slots=True)
class Substeps:
    """m substeps: times ``t`` (s) and places ``x`` (m) of their ends, (m+1,), and what holds within each.

    Lengths ``h`` (s), velocities over ground ``rate`` (m/s) and headings ``psi`` (0 at the surface), (m,).
    """

    t: Array
    x: Complex
    h: Array
    rate: Complex
    psi: Complex

    @property
    def middle(self) -> tuple[Array, Array]:
        """Places (m, shape (m, 2)) and times (s, (m,)) in the middle of the substeps."""
        x = self.x[:-1] + 0.5 * self.h * self.rate
        return np.column_stack([x.real, x.imag]), self.t[:-1] + 0.5 * self.h


def cut(t: Array, x: Array, heading: Array) -> Substeps:
    """Cut each interval of a track, straight between its points, into equal substeps up to `LONGEST`.

    ``t`` (s, (n,)), ``x`` (m, (n, 2)), ``heading`` ((n-1, 2)); see `adaptive.advance`. Raises ValueError
    when the shapes do not fit, t does not increase or a number is not finite.
    """
    n = len(t)
    if n < 1 or x.shape != (n, 2) or heading.shape != (n - 1, 2):
        raise ValueError(f"t {t.shape}, x {x.shape}, heading {heading.shape}: need (n,), (n, 2), (n-1, 2)")
    if not (np.isfinite(t).all() and np.isfinite(x).all() and np.isfinite(heading).all()):
        raise ValueError("track and headings must be finite: leave out samples that are not known")
    gap = np.diff(t)
    if not (gap > 0.0).all():
        raise ValueError("times of the track must increase: sort them and leave out repeated ones")
    counts = np.ceil(gap / LONGEST).astype(np.int64)
    interval = np.repeat(np.arange(n - 1), counts)
    within = np.arange(len(interval)) - (np.cumsum(counts) - counts)[interval]
    h = (gap / counts)[interval]
    place: Complex = x[:, 0] + 1j * x[:, 1]
    psi: Complex = heading[:, 0] + 1j * heading[:, 1]
    rate = (np.diff(place) / gap)[interval]
    return Substeps(
        t=np.append(t[interval] + within * h, t[-1]),
        x=np.append(place[interval] + within * h * rate, place[-1]),
        h=h,
        rate=rate,
        psi=psi[interval],
    )
