"""Spatial and temporal basis functions of the flow, and how they grow along a track. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gliderwatch.model import Array, readonly

Kernel = Literal["exponential", "gaussian"]


@dataclass(frozen=True, slots=True)
class Basis:
    """N functions that span the flow.

    ``centres`` c (m, shape (N, 2): east, north), widths ``sigma`` (m, (N,)), angular frequencies
    ``omega`` (rad/s, (N,)), phases ``nu`` (rad, (N,)), and ``kernel``: ``exponential`` is
    exp(-r / 2 sigma) as 001 eq. (6) prints it, ``gaussian`` exp(-r² / 2 sigma²).
    """

    centres: Array
    sigma: Array
    omega: Array
    nu: Array
    kernel: Kernel = "exponential"

    @classmethod
    def uniform(
        cls, centres: object, sigma: float, omega: float, nu: float, kernel: Kernel = "exponential"
    ) -> Basis:
        """The basis whose functions differ in nothing but their centres (m, shape (N, 2))."""
        at = readonly(np.asarray(centres, dtype=np.float64).reshape(-1, 2))
        ones = np.ones(len(at))
        return cls(at, readonly(sigma * ones), readonly(omega * ones), readonly(nu * ones), kernel)

    def __len__(self) -> int:
        return len(self.centres)


def phi(x: Array, t: Array | float, basis: Basis) -> Array:
    """Values of the basis functions at places and times (001 eq. 6).

    ``x`` (m, shape (..., 2)), ``t`` (s, shape (...)); the result has shape (..., N).

    >>> one = Basis.uniform([[0.0, 0.0]], sigma=1000.0, omega=0.0, nu=0.0)
    >>> phi(np.array([0.0, 2000.0]), 0.0, one).round(4)
    array([0.3679])
    """
    place = np.asarray(x, dtype=np.float64)[..., None, :] - basis.centres
    r = np.hypot(place[..., 0], place[..., 1]) / basis.sigma
    exponent = r if basis.kernel == "exponential" else r * r
    tide = np.cos(basis.omega * np.asarray(t, dtype=np.float64)[..., None] + basis.nu)
    values: Array = np.exp(-0.5 * exponent) * tide
    return values


def new_centres(centres: Array, x: Array, sigma: float) -> Array:
    """Centres to add so that every point of a track lies within sigma of one of them.

    Goes along the track and puts a centre on each point that is farther than ``sigma`` (m) from
    all centres so far; there both kernels are down to exp(-1/2). Looks back only, so that the same
    track in pieces gives the same centres. ``centres`` (m, (N, 2)), track ``x`` (m, (n, 2)); the
    result, in the order of the track, has shape (m, 2) with m = 0 where the track is covered.

    >>> new_centres(np.empty((0, 2)), np.array([[0.0, 0.0], [900.0, 0.0], [1100.0, 0.0]]), 1000.0)
    array([[   0.,    0.],
           [1100.,    0.]])
    """
    away = np.full(len(x), np.inf)
    for centre in centres:
        away = np.minimum(away, np.hypot(*(x - centre).T))
    added = []
    while (outside := away > sigma).any():
        centre = x[int(outside.argmax())]
        added.append(centre)
        away = np.minimum(away, np.hypot(*(x - centre).T))
    return readonly(np.reshape(added, (-1, 2)))
