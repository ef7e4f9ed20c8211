"""Algorithm 2 (001; 000 eq. 5): is the speed abnormal, and can the estimate be believed? Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.model import Array, Flag


@dataclass(frozen=True, slots=True)
class FlowMaxima:
    """Greatest speeds (m/s) so far of the learnt flow |F_L| and of the reference flow |F_M|."""

    flow: float = 0.0
    reference: float = 0.0


def update(maxima: FlowMaxima, flow_speed: float, reference_speed: float) -> FlowMaxima:
    """The maxima with one more pair of speeds (m/s) (Algorithm 2, lines 1 and 2).

    Raises ValueError when a speed is not finite: a maximum never forgets it.
    """
    if not (math.isfinite(flow_speed) and math.isfinite(reference_speed)):
        raise ValueError(
            f"flow speeds must be finite, not {flow_speed} and {reference_speed}: leave out unknown ones"
        )
    return FlowMaxima(max(maxima.flow, flow_speed), max(maxima.reference, reference_speed))


def p_e(flow: Array | Sequence[float], reference: Array | Sequence[float], maxima: FlowMaxima) -> float:
    """Measure of the error of the learnt flow, from 0 to 1 (001 eq. 14, 000 eq. 5).

    ``flow`` F_L and ``reference`` F_M (m/s: east, north), ``maxima`` up to and with this moment:
    `update` them first. 0 when no flow was ever seen in either. Raises ValueError when a
    component is not finite.

    >>> p_e((0.1, 0.0), (-0.1, 0.0), FlowMaxima(0.1, 0.1))
    1.0
    """
    pair = np.array([flow, reference], dtype=np.float64)
    if not np.isfinite(pair).all():
        raise ValueError(f"flows must be finite, not {flow} and {reference}: leave out unknown ones")
    scale = 2.0 * max(maxima.flow, maxima.reference)
    return math.hypot(*(pair[0] - pair[1])) / scale if scale > 0.0 else 0.0


def flag(p_e: float, gamma_f: float, speed: float, speed_min: float, speed_max: float) -> Flag:
    """What the numbers say of the glider (Algorithm 2, lines 4 to 10).

    FALSE_ALARM when ``p_e`` is above the threshold ``gamma_f``: a speed learnt beside a wrong flow
    is not to be believed. Else ANOMALY when ``speed`` V_L (m/s) is outside the normal range. Both
    ends of the range are normal. Raises ValueError when a number is not finite.

    >>> flag(p_e=0.02, gamma_f=0.07, speed=0.1, speed_min=0.15, speed_max=0.25).name
    'ANOMALY'
    """
    if not all(math.isfinite(v) for v in (p_e, gamma_f, speed, speed_min, speed_max)):
        raise ValueError(
            f"no flag can be given for p_E {p_e}, threshold {gamma_f}, "
            f"speed {speed} in {speed_min} to {speed_max}: all must be finite"
        )
    if p_e > gamma_f:
        return Flag.FALSE_ALARM
    return Flag.NORMAL if speed_min <= speed <= speed_max else Flag.ANOMALY
