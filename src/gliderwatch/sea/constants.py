"""The heuristics of the sea, each with its unit, what it is for, and where it comes from. Pure.

`python benchmarks/seas.py` and `python benchmarks/currents.py` score a change of them. Where no source is
named the value is a judgement, and the tests named by `benchmarks/mutations.py` pin what it is for.
"""

from __future__ import annotations

# The flow at a glider
LASTING_SIZE = 0.3
"""m/s, a component: usual size of the part of the flow that lasts."""
LASTING_MEMORY = 18 * 86400.0
"""s: its memory."""
PASSING = 0.08
"""m/s, a component: usual size of the part that passes."""
PASSING_MEMORY = 30 * 3600.0
"""s: its memory."""
INERTIAL = 0.06
"""m/s, a component: usual size of inertial motion."""
INERTIAL_MEMORY = 3 * 86400.0
"""s: its memory."""
TIDE_M2 = 0.25
"""m/s, a component: prior size of each rotary part of M2, from nothing to the 1 m/s of shelf seas,"""
TIDE_S2 = 0.12
"""m/s: of S2 (0.46 of M2 in the equilibrium tide),"""
TIDE_N2 = 0.06
"""m/s: of N2 (0.2 of M2),"""
TIDE_K1 = 0.15
"""m/s: of K1,"""
TIDE_O1 = 0.12
"""m/s: of O1 (0.7 of K1)."""
TIDE_WANDER = 0.08
"""Part of a tidal part that changes in a day along the way,"""
TIDE_LEAST = 0.005
"""m/s: of at least this much."""
CURRENT_SCALE = 60e3
"""m over which currents differ by their own size."""

# The forecast of the reference flow
SEA_KINDS = (
    *(
        (restless, restless, PASSING_MEMORY, inertial, tides)
        for restless in (0.3, 3.0)
        for inertial in (0.1, 1.0)
        for tides in (0.03, 0.3)
    ),
    *((restless, restless, PASSING_MEMORY, 0.01, 0.001) for restless in (0.3, 3.0)),
    (0.03, 1.0, 36e3, 0.01, 0.001),
)
"""The kinds of sea that are tried: factors on the noise of what lasts and of what passes, the memory of what
passes (s), factors on the sizes of inertial motion and of the tides. The last three have weather alone
(`benchmarks/currents.py`)."""
FIT_MEMORY = 100
"""Dives after which what a kind of sea foretold counts for a third: seas change along the way."""
TAIL = 6.0
"""Degrees of freedom of Student's t by which innovations are judged: one wild dive must not decide."""
SCALE_MEMORY = 40
"""Dives over which the scale is learnt,"""
SCALE_FEW = 6
"""and how many its first guess counts for."""
FAR = 9.0
"""An innovation's normalised square counts as this at most."""
SCALES = (0.1, 9.0)
"""Bounds of the scale,"""
FIRST_SCALE = 1.5
"""and its first guess: little is known at first, and forecasts should say so."""
TIDE_SEEN = 4.0
"""Squared size of a tide in variances from which on it is named: twice its standard error."""
APART = 3 * 86400.0
"""s without a current after which the sea is taken for unknown."""
INTERVALS_KEPT = 8
"""Dives whose intervals say how often the glider surfaces."""
EVEN = 0.1
"""Intervals that differ by more than this part are uneven: then no tide hides behind them."""
NEAR = 0.05
"""Half periods by which an interval may miss a whole number of them and still show one quadrature only."""
OFTEN = 0.42
"""Periods between surfacings at which a tide is well seen: clearly less than half a period."""
FAINT = 0.2
"""Part of a tide that is left in the mean over a dive, below which it is lost in the noise."""

# The field of an ocean model or a radar
STALE = 24 * 3600.0
"""s beyond the last time of a field, or between two times of it, after which it is not believed."""
WET = 0.5
"""Part of a place's weight that must be water: nearer to land the field is not believed."""
POINTS = 8
"""Places along the way of a dive at which a field is read."""
FASTEST_CURRENT = 10.0
"""m/s: no current is faster; above it a value is a fill value that the file does not call one."""

# The smoother of missions that are over
KNOT = 1800.0
"""s: currents are given so often at the least; a semidiurnal tide turns by 15 degrees in it."""
START_SIGMA = 1.0
"""m: error of the displacement where a dive begins, that of two fixes after each other."""
SEA_SCALES = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Factors on the noise of what is no tide, of which the one is taken that fits the mission best."""
TIDE_SCALES = (0.03, 0.1, 0.3, 1.0)
"""Factors on the prior sizes of the tides, taken likewise: on long dives a tide that is not there would
explain a front (`benchmarks/delayed.py --seas front`: 7.8 cm/s delayed at 1 alone)."""
