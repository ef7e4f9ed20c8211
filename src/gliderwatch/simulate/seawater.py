"""Conductivity of sea water, as a CTD measures it. Pure.

Source: the Practical Salinity Scale 1978; Fofonoff and Millard (1983), Algorithms for computation
of fundamental properties of seawater, Unesco technical papers in marine science 44. Temperatures
are taken as IPTS-68; the difference to ITS-90 is below 0.01 K in the sea.
"""

from __future__ import annotations

import numpy as np

from gliderwatch.model import Array

C_35_15_0 = 4.2914
"""Conductivity of standard sea water at salinity 35, 15 degrees Celsius and no pressure (S/m)."""

_A = (0.0080, -0.1692, 25.3851, 14.0941, -7.0261, 2.7081)
_B = (0.0005, -0.0056, -0.0066, -0.0375, 0.0636, -0.0144)
_C = (0.6766097, 2.00564e-2, 1.104259e-4, -6.9698e-7, 1.0031e-9)
_E = (2.070e-5, -6.370e-10, 3.989e-15)


def _salinity(root: Array, temperature: Array) -> tuple[Array, Array]:
    """Salinity and its slope for the square root of the ratio R_t."""
    above = temperature - 15.0
    factor = above / (1 + 0.0162 * above)
    coefficients = [a + factor * b for a, b in zip(_A, _B, strict=True)]
    salinity = sum(c * root**i for i, c in enumerate(coefficients))
    slope = sum(i * c * root ** (i - 1) for i, c in enumerate(coefficients) if i)
    return np.asarray(salinity), np.asarray(slope)


def conductivity(salinity: Array, temperature: Array, pressure: Array) -> Array:
    """Conductivity (S/m) at a practical salinity, a temperature (degrees Celsius) and a pressure (dbar).

    >>> ratio = conductivity(np.array([35.0, 40.0]), np.array([15.0, 40.0]), np.array([0.0, 1e4])) / C_35_15_0
    >>> [round(float(r), 6) for r in ratio]
    [1.0, 1.888091]
    """
    root = np.sqrt(salinity / 35.0)
    for _ in range(6):
        found, slope = _salinity(root, temperature)
        root = root - (found - salinity) / slope
    at_surface = sum(c * temperature**i for i, c in enumerate(_C)) * root**2
    lifted = pressure * (_E[0] + pressure * (_E[1] + pressure * _E[2]))
    # R (R - R_t r_t) D2 + R D1 - R_t r_t D1 = lifted: quadratic in the ratio R.
    d1 = 1 + 3.426e-2 * temperature + 4.464e-4 * temperature**2
    d2 = 4.215e-1 - 3.107e-3 * temperature
    linear = d1 - at_surface * d2
    ratio = (-linear + np.sqrt(linear**2 + 4 * d2 * at_surface * (d1 + lifted))) / (2 * d2)
    return np.asarray(C_35_15_0 * ratio)
