"""The heuristics of navigation, each with its unit, what it is for, and where it comes from. Pure.

Where no source is named the value is a judgement, and the tests named by `benchmarks/mutations.py` pin what
it is for. Radii of the Earth and codes of the glider are no heuristics: they stand where they are used.
"""

from __future__ import annotations

# Samples
SPACING = 30.0
"""s: finer samples are averaged to this. A glider turns and pitches in minutes, and a checkpoint that carries
a dive on to the next segment stays small also for 4 s data."""
SCIENCE_SPACING = 10.0
"""s: the same for what the science computer sends: 1 to 3 m of depth, a layer's edge."""
FULL_POWER = 24.0
"""W of a thruster that is fully on. Power goes with the square of the setting: electa-2022, 2.9 W at 35 % and
8.6 W at 60 %."""
SPARSE = 1800.0
"""s: the coarsest cadence of a real-time file; samples further apart leave a hole."""

# Fixes
FASTEST_OVER_GROUND = 3.0
"""m/s: more between two fixes means that one is old or wild. The Gulf Stream has 2.5, a glider adds 0.4."""
SURFACE_STAY = 600.0
"""s: fixes closer in time than this are of one stay at the surface."""
SUSPECT_DISTANCE = 30.0
"""m: a fix this near to the last one from before a dive may be the old one again; errors of GPS are 10 m."""
JUMP = 100.0
"""m beside `FASTEST_OVER_GROUND` times the time: a position that moved further has jumped."""
FILE_TO_CALL = 1800.0
"""s from the end of a file within which a fix in the log of a call is of the surfacing that the file ends
with: a glider that comes up calls within minutes, and again if the connection drops."""

# When the glider flew
DIVING_DEPTH = 3.0
"""m: deeper than the pitching of a glider at the surface in waves."""
DIVING_PITCH = 0.2
"""rad: a glider glides steeper than this (usual: 0.45), and mostly lies flatter at the surface."""
MOSTLY_STEEP = 0.5
"""Part of the pitches of a flight that are steep: all but those of the turns at top and bottom."""
DENIES_DIVE = 600.0
"""s between two shallow depths: too short for a dive between them that is worth the name."""
RECKONING_GROWS = 0.5
"""s of ``m_dr_time`` a second, above which it counts: its last value stays for the time at the surface."""

# Dives
SHORTEST_DIVE = 900.0
"""s: a shorter stay under water says too little of speed."""
SHORTEST_DIP = 120.0
"""s: a stay under water this long is a dive of which the glider computes a current."""
LONGEST_DIVE = 3 * 86400.0
"""s between fixes: a longer one is not a dive but a gap between deployments."""
SHORTEST_HOLE = 900.0
"""s between two files: a shorter time is a stay at the surface and no hole in the data."""
HIDING_HOLE = 3600.0
"""s: a hole in the data this long may hide a whole dive; in shorter ones a glider waits at the surface
between two missions, and corrects the current of the dive before."""

# Currents that the glider reports
CURRENT_EARLY = 120.0
"""s that a current may be published before the last sample under water."""
CURRENT_CORRECTED = 600.0
"""s after a surfacing: what is first published later is not the first estimate any more. Corrections come 10
to 40 min after the surfacing."""
SAME_CURRENT = 1e-6
"""m/s: currents that differ by less are one value, written with other digits."""

# Whether a dive can be used
MOST_UNOBSERVED = 0.25
"""Part of the interval between two fixes that may be missing before a dive cannot be used."""
MOST_BLIND = 0.8
"""Part of a flight without any heading beyond which a dive cannot be used. Some files hold every third yo
only: a glider on its way to a waypoint steers much the same in between."""
MOST_DRIFT = 0.5
"""Part of the interval between two fixes that the glider may have drifted before it cannot be used."""
HEADING_GAP = 3600.0
"""s without a heading, twice `SPARSE`: more must be said, and is only borne on a steady course."""
STEADY_COURSE = 0.9
"""Length of the mean of the headings seen above which the glider is taken to have kept it in between."""
TURNED_MUCH = 0.5
"""Length of the mean heading vector below which the speed of a dive hardly shows."""

# The track
NOMINAL_SPEED = 0.3
"""m/s: shapes a track where the glider reports no speed; the fixes correct its length. Usual for a Slocum."""
CIRCLING = 0.1
"""Length of the mean heading vector below which a mean direction means nothing."""
RECKONED_POSITIONS = 4
"""Dead-reckoned positions in a flight that shape its track."""
RECKONED_PART = 0.8
"""Part of a flight that they cover at least."""
RECKONED_GAP = 0.2
"""Part of a flight that lies between two of them at most (or `SPARSE`)."""

# How a dive was flown
FEW_SAMPLES = 3
"""Samples in a dive that say how much the thruster was on, or the pump moved."""
STEEP_PITCH = 0.1
"""rad: pitch of a glider that dives or climbs and does not turn."""
PUMPED = 20e-6
"""m3: a pump that moved less is on its way."""
DEPTHS_FOR_DEEPEST = 4
"""Depths in a dive, at most `SPARSE` apart, that say how deep it was."""
DEPTHS_FOR_RATES = 6
"""Depths in a dive that say how fast the glider sank and rose."""
RATE_INTERVAL = 300.0
"""s: depths at least this far apart may have a turn between them and tell no rate."""
LEAST_RATE = 0.02
"""m/s: a slower change of depth is a glider that levels or turns; usual are 0.1 to 0.2."""
FEW_RATES = 2
"""Rates of one direction that tell a median."""

# Heading from the dead-reckoned track
SHORTEST_STEP = 10.0
"""s between two dead-reckoned positions that tell a direction, at least: their digits are coarse."""
LONGEST_STEP = 3600.0
"""s, at most: a glider turns within the hour."""
SLOWEST_RECKONED = 0.03
"""m/s between dead-reckoned positions on a flight: slower is no flight."""
FASTEST_RECKONED = 1.5
"""m/s: faster ones jump to a fix."""

# A clock that is set in mid-mission
OVERLAP = 60.0
"""Seconds by which a segment may end after the next has opened: the time stamps of the last cycles."""
PAUSE = 60.0
"""Seconds from the end of a segment to the opening of the next, where the step is not in whole hours."""
LONGEST_PAUSE = 900.0
"""Seconds: a step in whole hours leaves no longer pause than this between two segments (real ones: 810)."""
LONGEST_PAUSE_OF_DAYS = 3600.0
"""Seconds of the same for a step in whole days, which is seldom met by chance."""
LEAST_STEP = 3600.0
"""Seconds: a clock that was set forward by less looks like a long call."""
SILENT_AT_MOST = 60 * 86400.0
"""Seconds without a segment over which a step of `ROLLOVER` is still known for one."""
ENOUGH_SEGMENTS = 4
"""Segments of a mission that say how long one may be."""
WILD_SEGMENT = 2.0
"""Times the second longest segment beyond which the end of the longest is a wild time stamp."""
SAME_OPENING = 120.0
"""Seconds: two files of one name that open further apart are of two segments. The sbd, mbd and dbd of one
segment open within seconds; a mission counter begins again at 0 after a restart of the glider."""

# A depth sensor that does not show zero at the surface
ZERO_NEAR = 30.0
"""Seconds from a fix within which a depth is one at the surface."""
ZERO_LEAST = 2.0
"""Metres: less is the pitching in waves, and the depth of a sensor that is below the antenna."""
ZERO_DEPTHS = 3
"""Depths at the surface that say what the sensor shows there."""
ZERO_MOST = 15.0
"""Metres: a depth beyond this at a fix is that of an old fix, reported once more under water."""
ZERO_QUANTILE = 0.25
"""Quantile of the depths at the surface that is taken: some are of the first metres of a dive."""
