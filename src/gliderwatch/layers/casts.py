"""The casts of a segment: its ways down and up, each a profile of a property of the water. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import gsw
import numpy as np

from gliderwatch.layers.constants import LATITUDE, LEAST_BIN, LEAST_CAST, LEAST_PART, SAMPLES_A_BIN
from gliderwatch.model import EMPTY, Array, Segment, Series, readonly


@dataclass(frozen=True, slots=True)
class Cast:
    """One way down or up: times ``t`` (s), ``depth`` (m) and ``value``, each (n,), in the order of time."""

    t: Array
    depth: Array
    value: Array

    @property
    def top(self) -> float:
        """The least depth (m)."""
        return float(self.depth.min())

    @property
    def bottom(self) -> float:
        """The greatest depth (m)."""
        return float(self.depth.max())

    def within(self, top: float, bottom: float) -> Cast:
        """What of it lies between two depths (m)."""
        keep = (self.depth >= top) & (self.depth <= bottom)
        return Cast(readonly(self.t[keep]), readonly(self.depth[keep]), readonly(self.value[keep]))


def split(depth: Series, value: Series) -> tuple[Cast, ...]:
    """The casts in samples of `depth` (m) and of a value; the depth is straight between its samples.

    A turn is where the way goes back by `LEAST_CAST`, or by `LEAST_PART` of all depths: a glider that drifts
    at depth makes no casts. Samples of the value before the first and after the last depth are left out.
    """
    if len(depth) < 2 or not len(value):
        return ()
    value = value.between(float(depth.t[0]), float(depth.t[-1]))
    z = np.interp(value.t, depth.t, depth.v)
    casts = []
    least = max(LEAST_CAST, LEAST_PART * float(np.ptp(z))) if len(z) else LEAST_CAST
    turns = _turns(z, least)
    for i, j in pairwise(turns):
        if abs(z[j] - z[i]) >= least:
            part = slice(i, j + 1)
            casts.append(Cast(readonly(value.t[part]), readonly(z[part]), readonly(value.v[part])))
    return tuple(casts)


def _turns(z: Array, least: float) -> list[int]:
    """Where the way turns, with the first and the last sample."""
    if not len(z):
        return []
    turns, low, high, sign = [0], 0, 0, 0
    for i in range(1, len(z)):
        low, high = (i if z[i] < z[low] else low), (i if z[i] > z[high] else high)
        if sign >= 0 and z[high] - z[i] >= least:
            turns.append(high)
            sign, low, high = -1, i, i
        elif sign <= 0 and z[i] - z[low] >= least:
            turns.append(low)
            sign, low, high = 1, i, i
    turns.append(len(z) - 1 if sign == 0 else high if sign > 0 else low)
    return turns


def bin_of(casts: Sequence[Cast]) -> float:
    """The height of a bin (m) for the spacing of samples of `casts`."""
    steps = [np.abs(np.diff(cast.depth)) for cast in casts if len(cast.depth) > 1]
    spacing = float(np.median(np.concatenate(steps))) if steps else 0.0
    return max(SAMPLES_A_BIN * spacing, LEAST_BIN)


PROPERTIES = {
    "temperature": ("degree_Celsius", "sea_water_temperature"),
    "salinity": ("1", "sea_water_practical_salinity"),
    "density": ("kg m-3", "sea_water_sigma_theta"),
    "oxygen": ("umol l-1", "mole_concentration_of_dissolved_molecular_oxygen_in_sea_water"),
}
"""What the water is asked for without a sensor's name: unit and CF standard name of each."""
_PA_PER_DBAR, _MS_CM_PER_S_M = 1e4, 10.0


def is_own(name: str) -> bool:
    """Whether a property is that of a sensor, by its own name and in its own unit."""
    return name not in PROPERTIES


def casts_of(segment: Segment, property_name: str) -> tuple[Cast, ...]:
    """The casts of a property in a segment; none where it has no science data of it.

    `property_name` is `temperature` (degree C), `salinity` (practical), `density` (potential, less 1000
    kg/m3), or the name of any quantity of the segment.
    """
    pressure, value = segment.get("science_pressure"), _property(segment, property_name)
    if not len(pressure) or not len(value):
        return ()
    depth = readonly(-gsw.z_from_p(pressure.v / _PA_PER_DBAR, LATITUDE))
    return split(Series(pressure.t, depth), value)


def _property(segment: Segment, name: str) -> Series:
    if name not in ("salinity", "density"):
        return segment.get(name)
    warm, salty, pressure = (segment.get(n) for n in ("temperature", "conductivity", "science_pressure"))
    if not len(warm) or not len(salty):
        return EMPTY
    t = salty.t
    celsius = np.interp(t, warm.t, warm.v)
    decibar = np.interp(t, pressure.t, pressure.v) / _PA_PER_DBAR
    value: Array = gsw.SP_from_C(_MS_CM_PER_S_M * salty.v, celsius, decibar)
    if name == "density":  # of standard sea water: a gradient needs no place
        absolute = gsw.SR_from_SP(value)
        value = gsw.sigma0(absolute, gsw.CT_from_t(absolute, celsius, decibar))
    good = np.isfinite(value)
    return Series(readonly(t[good]), readonly(value[good]))
