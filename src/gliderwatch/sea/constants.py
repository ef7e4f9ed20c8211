"""The heuristics of the sea, each with its unit, what it is for, and where it comes from. Pure."""

from __future__ import annotations

# The forecast by a bank of models
SCORE_MEMORY = 100
"""Dives after which what a set has foretold counts for a third: seas change along the way."""
INNOVATION_TAIL = 6.0
"""Degrees of freedom of Student's t by which innovations are judged: one wild dive must not decide."""
SCALE_MEMORY = 40
"""Dives over which the scale is learnt."""
FIRST_SCALE_DIVES = 6
"""Dives that its first guess counts for."""
FAR_INNOVATION = 9.0
"""An innovation's normalised square counts as this at most."""
SCALE_BOUNDS = (0.1, 9.0)
"""Bounds of the scale."""
FIRST_SCALE = 1.5
"""First guess of the scale: little is known at first, and forecasts should say so."""
SEA_UNKNOWN_AFTER = 3 * 86400.0
"""Seconds without a current after which the sea is taken for unknown."""
SCORE_FORGETS = 1 / 100
"""Part of the score that is forgotten with each dive."""
SCORED_DIVES = 6.0
"""Dives that a score needs."""
TIDES_BETTER_BY = 2.0
"""Standard errors by which tides have to be better than persistence."""
RECENT_INTERVALS = 8
"""Dives whose intervals say how often the glider surfaces."""
EVEN_INTERVALS = 0.1
"""Intervals that differ by more than this part are uneven: then no tide hides behind them."""

# The field of an ocean model
STALE_FIELD = 24 * 3600.0
"""Seconds beyond the last time of a field, or between two times of it, after which it is not believed."""
WET = 0.5
"""Part of a place's weight that must be water: nearer to land the field is not believed."""
POINTS_ALONG = 8
"""Places along the way of a dive at which a field is read."""

# Which tides can be seen
NEAR_QUADRATURE = 0.05
"""Half periods by which an interval may miss a whole number of them and still show one quadrature only."""
SEEN_OFTEN = 0.42
"""Periods between surfacings at which a tide is well seen: clearly less than half a period."""
FAINT_TIDE = 0.2
"""Part of a tide that is left in the mean over a dive, below which it is lost in the noise."""
