"""Losses that the glider does not know of: steps in slip (a lost or bent wing) and side (a compass). Pure."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gliderwatch.detection.sequential import Bank, Step, Update, advance, likeliest, ratio_bound
from gliderwatch.estimation.measurement import SIDE, SLIP
from gliderwatch.model import Array

LARGEST = 0.5
"""Usual size of a step in slip or side (parts of W)."""
MOST = 4.0
"""Standard errors: an innovation that is longer counts as this long."""


def steps(
    bank: Bank, matrix: Array, update: Update, jump: Array, front: float
) -> tuple[Step | None, Step | None, Bank]:
    """The likeliest loss (a step up in slip) and turn (one in side), and the bank with one more dive.

    ``matrix`` ((n, n)) is the transition to the dive and ``update`` that of the filter. The flow may have
    changed together with the step, by ``front`` (m/s, a component), which does ``jump`` ((n, 2)) to the
    state. No dive alone may prove a step.
    """
    shape = np.zeros((len(matrix), 4))
    shape[[SLIP, SIDE], [0, 1]] = 1.0
    shape[:, 2:] = jump
    sizes = np.array([LARGEST, LARGEST, front, front])
    square = float(update.innovation @ update.weight @ update.innovation)
    believed = update.innovation * min(1.0, MOST / math.sqrt(max(square, 1e-12)))
    bank = advance(bank, shape, np.diag(sizes**-2), matrix, replace(update, innovation=believed))
    return likeliest(bank, 0, sign=1), likeliest(bank, 1), bank


def told(loss: Step | None, turn: Step | None, alarms_per_month: float) -> Step | None:
    """The step that is too likely for chance, if there is one."""
    bound = ratio_bound(alarms_per_month)
    return next((step for step in (loss, turn) if step is not None and step.ratio > bound), None)
