"""Persistent excitation (001 Assumption 4): whether a track tells speed and flow apart. Pure."""

from __future__ import annotations

import math

import numpy as np

from gliderwatch.estimation.substeps import Substeps
from gliderwatch.model import Array, readonly

EXCITATION_TIME = 86400.0
"""Time constant (s of flying) with which the excitation forgets: the window T of 001 eq. (15)."""


def excitation(flown: float, gram: Array) -> float:
    """Smallest eigenvalue of W (001 eq. 15), as a mean over the last `EXCITATION_TIME` of flying.

    Near 0 when flow and speed cannot be told apart, as on a constant heading. 0 before any flight.
    ``flown`` (s) and ``gram`` ((N+2, N+2)) as in `adaptive.AdaptiveState`.
    """
    if flown <= 0.0:
        return 0.0
    gram = gram / -math.expm1(-flown / EXCITATION_TIME)
    flow, n = gram[2:, 2:], len(gram) - 2
    w = np.zeros((2 * n + 1, 2 * n + 1))
    w[:n, :n] = w[n:-1, n:-1] = flow
    w[-1, :n] = w[:n, -1] = gram[0, 2:]
    w[-1, n:-1] = w[n:-1, -1] = gram[1, 2:]
    w[-1, -1] = gram[0, 0] + gram[1, 1]
    return max(0.0, float(np.linalg.eigvalsh(w)[0]))


def excite(flown: float, gram: Array, steps: Substeps, values: Array) -> tuple[float, Array]:
    """Time flown (s) and gram after some substeps; time at the surface does not count.

    ``values`` ((m, N)) are the basis functions in the middle of the substeps.
    """
    h = np.where(np.abs(steps.psi) > 0.0, steps.h, 0.0)
    left = np.cumsum(h[::-1])[::-1] - h
    total = float(h.sum())
    weight = -np.expm1(-h / EXCITATION_TIME) * np.exp(-left / EXCITATION_TIME)
    v = np.column_stack([steps.psi.real, steps.psi.imag, values])
    gram = math.exp(-total / EXCITATION_TIME) * gram + (v * weight[:, None]).T @ v
    return flown + total, readonly(gram)
