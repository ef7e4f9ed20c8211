"""The heuristics of layers: what each is, its unit, and what it rests on."""

from __future__ import annotations

LEAST_CAST = 3.0
"""m: a way up or down that is shorter is no cast; pressure of a glider at the surface wanders by 1 to 2 m."""
LEAST_PART = 0.05
"""Of all depths of a segment: a way that is shorter is no cast; electa drifted within 9 m at 309 m."""
SAMPLES_A_BIN = 2.0
"""A bin is so many times the median spacing of samples: with fewer a gradient is mostly that of its noise."""
LEAST_BIN = 1.0
"""m: the finest bin. A glider's CTD answers within 0.5 to 1 s, 0.1 to 0.3 m of depth."""
LEAST_CASTS = 2
"""A bin counts in the composite where so many casts went through it: one alone may be a spike."""
PART_OF_PEAK = 0.25
"""A layer is where the gradient is above this part of its peak; 004 uses J_thr from 0.2 to 0.8."""
TEMPERATURE_FLOOR = 0.02
"""Degree C per m: a gradient below is no layer, however even the water is: that of well-mixed water with its
internal waves in the missions of usf-sam, maria and electa."""
SALINITY_FLOOR = 0.005
"""1/m: the same of salinity, as much by density."""
DENSITY_FLOOR = 0.01
"""kg/m3 per m: the same of density."""
ERRORS = 2.0
"""Standard errors of the median by which the gradient has to differ from nothing."""
BRIDGED = 1.0
"""Bins that a gap within a layer may have: noise cuts layers in two."""
LEAST_EXTENSION = 2.0
"""m: what is added above and below a layer, where a bin is smaller."""
MOST_MOVED = 3.0
"""Extensions: the most that is added for a limit that moved."""
EDGE_EXTENSIONS = 2.0
"""Extensions: added where the layer goes on at the edge of what was seen."""
NEW_PART = 0.7
"""Weight of the new limits; internal waves move layers by some m from cast to cast."""
LOST = 0.5
"""The layer is lost where its peak falls below this part of its reference, as in 004 (Fig. 3)."""
LEAST_CONFIDENCE = 0.5
"""Below it the advice is not to track: of the casts not even half show the layer."""
LONGEST_TRACK = 129600.0
"""s: a complete segment at least so often: at another hour of the day each time, for the mixed layer has a
daily cycle. With a day, electa flew 0.02 more of the full way and saw no more."""
STILL = 0.5
"""Extensions: a band that would change by less at both ends stays, so that advice does not flicker."""
FILTER_Q, FILTER_R = 3e-5, 3e-2
"""Q (1/m2) and R (1) of the filter over received samples: R by the noise between two samples."""
LEAST_STEP = 0.2
"""m: z_min of 004 eq. (6), as in its Table 2."""
SHIFT = 0.25
"""1: part of (half a band)^2 times dJ/dz by which the band moves in a segment; in Table 1, 0.02 a period."""
FULL_CASTS = 2
"""Casts over all depths in each segment, down and up: they see what the band does not."""
COUNTED = 6
"""Casts that a segment has to have to count in a comparison of methods: shorter ones are test dives."""
LATITUDE = 45.0
"""Degrees: where depths are made of pressures; elsewhere they are 0.3 % off, less than a sample's spacing."""
LEAST_BAND = 3.0
"""m: a band of less height is none: a Slocum overshoots its turns by 1 to 3 m."""
WRONG_ECHOES = 0.1
"""Part of the depths of the bottom that may be too shallow: usf-sam had such, by 4 m, one in ten."""
MOST_DEPTHS = 200
"""Bins of a section at the most: a picture of it has no more lines."""
