"""The heuristics of the words: what is said for and against a cause, and when; each with its unit. Pure.

Where no source is named the value is a judgement, and the tests named by `benchmarks/mutations.py` pin what
it is for. How many characters or lines fit somewhere is no heuristic, and stands where it is written.
"""

from __future__ import annotations

# What is said for and against a cause
ROLL_OF_ANY = 15.0
"""Degrees: unusual on any glider, for one whose usual roll is not known."""
HIDDEN = 0.1
"""Part of the speed that the glider believes, by which it is slower than that."""
MISFIT = 0.05
"""m/s across the heading; a few mm/s to 2 cm/s where fixes, compass and current agree."""
SURE = 4.0
"""Standard errors beyond which a misfit is one."""
RATE_RATIO = 1.5
"""Depth rate of the descent to that of the climb, or the other way round, that is named as unlike."""
STEADY = 0.98
"""Length of the mean heading vector from which the course was steady."""
LEARNT = 1.6
"""Times the usual speed: a bound above it was not learnt from dives."""
CERTAIN = 0.99
"""Confidence: more than that is never claimed, as what is modelled is not all."""

# What is said of the data of a dive
SHORT_DIVE = 1.0
"""h: a shorter dive is named as one of which less is known."""
DRIFT = 0.5
"""h at the surface that are named."""
FIX_GAP = 15.0
"""min without a fix that are named."""
UNOBSERVED = 0.1
"""h of a dive without data that are named."""

# What is said of speeds and places
SLOWER = 0.01
"""m/s: speeds that differ by less are as bad as each other."""
ROUND = 0.9
"""Ratio of the semi-axes from which an ellipse is called a circle."""
