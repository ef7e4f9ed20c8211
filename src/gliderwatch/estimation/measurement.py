"""What one dive measures, as an explicit function of the state. Pure.

Of the state a dive shows five numbers: the mean flow F over it (east, north), the speed W that the glider
reckons with, and slip s and side d, by which its real way through the water differs from that. With h the
mean heading vector and h' that vector turned left it measures

    g = F + W ((1 - s) h - d h')        ground velocity
    c = F - W (s h + d h')              depth-averaged current, so that g - c = W h
    w = W                               speed by depth rate and pitch, or by the glider's own mean

each only where it is there. s is the slip of physics, that of drag, and the slip in the state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gliderwatch.estimation.observation import Observation
from gliderwatch.estimation.reckoned import Reckoned
from gliderwatch.model import Array

OWN, SLIP, SIDE = -3, -2, -1
"""Places in the state of W (m/s), and of slip and side (parts of W)."""
SHOWN = 5
"""How many numbers of the state a dive shows: those at its end."""
SLOWEST, FASTEST = 0.02, 1.3
"""m/s: between these is the speed of any glider through the water."""
DRAG_SLIP = 0.9
"""Slip that drag adds where it takes all of the speed, as part of W."""


@dataclass(frozen=True, slots=True)
class Slipping:
    """What is known of slip beside the state: of ``physics`` (part of W), ``noise`` of it on one dive, and
    the ``usual`` speed through the water (m/s, None: not known) below which drag adds to it."""

    physics: float
    noise: float
    usual: float | None


@dataclass(frozen=True, slots=True)
class Measured:
    """The measurements of a dive: ``values`` ((m,)): g (2), c (2, where there is ``current``), w (1, where
    it ``tells``)."""

    seen: Observation
    tells: Reckoned | None
    doubt: float
    slipping: Slipping

    @property
    def has_current(self) -> bool:
        """Whether a current was reported."""
        return self.seen.current is not None

    @property
    def values(self) -> Array:
        """The numbers measured, (m,)."""
        parts = [self.seen.ground]
        if self.seen.current is not None:
            parts.append(self.seen.current)
        if self.tells is not None:
            parts.append(np.array([self.tells.speed]))
        return np.concatenate(parts)


def drag_slip(speed: Array, usual: float | None) -> Array:
    """The slip that drag adds on a glider slower than usual (m/s), parts of W; half of it is its standard
    error.

    More drag at the same pitch needs more lift, so a larger angle of attack. With the flight model of
    Merckelbach et al. (2019) slip rises by 1.5 (1 - speed / usual)^2 where drag alone slows a Slocum,
    and not at all where it lacks buoyancy. Which of the two it is, is not known here.

    >>> drag_slip(np.array([0.25]), 0.25).tolist(), drag_slip(np.array([0.1]), None).tolist()
    ([0.0], [0.0])
    """
    if usual is None or usual <= 0:
        return np.zeros_like(speed)
    return np.asarray(DRAG_SLIP * np.clip(1 - speed / usual, 0.0, 1.0) ** 2)


def slip_of(x: Array, slipping: Slipping) -> tuple[Array, Array]:
    """All of slip, and its standard error on one dive, at states ``x`` ((k, 5)): (k,) each."""
    own = np.clip(x[:, OWN], SLOWEST, FASTEST)
    drag = drag_slip(own * (1 - slipping.physics - x[:, SLIP]), slipping.usual)
    return slipping.physics + drag + x[:, SLIP], np.hypot(drag / 2, slipping.noise)


def expected(x: Array, measured: Measured) -> tuple[Array, Array, Array]:
    """h(x), its slope and the noise at states ``x`` ((k, 5)): (k, m), (k, m, 5), (k, m, m)."""
    seen, k = measured.seen, len(x)
    h = seen.heading
    aside = np.array([-h[1], h[0]])
    own = np.clip(x[:, OWN], SLOWEST, FASTEST)
    slip, slip_sigma = slip_of(x, measured.slipping)
    lost = slip[:, None] * h + x[:, SIDE, None] * aside
    wrong = own[:, None] * lost
    flow = x[:, :2]
    values, slope = [flow + own[:, None] * h - wrong], np.zeros((k, 5, SHOWN))
    slope[:, [0, 2], 0] = slope[:, [1, 3], 1] = 1.0
    slope[:, :2, OWN], slope[:, 2:4, OWN] = h - lost, -lost
    slope[:, :2, SLIP] = slope[:, 2:4, SLIP] = -own[:, None] * h
    slope[:, :2, SIDE] = slope[:, 2:4, SIDE] = -own[:, None] * aside
    slope[:, 4, OWN] = 1.0
    values += [flow - wrong, own[:, None]]
    noise = np.zeros((k, 5, 5))
    noise[:, :2, :2] = measured.doubt * (seen.ground_cov + own[:, None, None] ** 2 * seen.heading_cov)
    noise[:, 2:4, 2:4] = measured.doubt * seen.current_sigma**2 * np.eye(2)
    along = np.tile((own * slip_sigma)[:, None] * h, 2)
    noise[:, :4, :4] += along[:, :, None] * along[:, None, :]
    if measured.tells is not None:
        noise[:, 4, 4] = measured.tells.sigma**2
    there = [0, 1, *([2, 3] if measured.has_current else []), *([4] if measured.tells is not None else [])]
    return np.concatenate(values, axis=1)[:, there], slope[:, there], noise[:, there][:, :, there]
