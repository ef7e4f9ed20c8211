"""A property of the water, and its depth, in what a segment holds. Pure."""

from __future__ import annotations

import gsw
import numpy as np

from gliderwatch.layers.casts import Cast, split
from gliderwatch.layers.constants import LATITUDE
from gliderwatch.model import EMPTY, Array, Segment, Series, readonly

PROPERTIES = ("temperature", "salinity", "density", "oxygen")
"""What is known of the water without a sensor's name."""
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
