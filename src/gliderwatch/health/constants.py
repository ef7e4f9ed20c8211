"""The heuristics of this room: name, unit, and where each comes from.

Limits that pilots may want to set are not here but with their rule (`Limit`), and in the YAML.
"""

DAY = 86400.0
HOUR = 3600.0

KEPT = 64
"""Readings of one quantity in one file that are all kept; of more, the lowest or median of each bin."""
BINS = 24
"""Bins of a file with more readings: some seven minutes of a dive of 3 h."""
SHOWN = 10
"""Last readings that a message shows, and that are always kept as they are: operators' guides ask to look at
the plot before believing the trigger."""
SAME_READING = 3.0
"""Seconds within which two readings of a sensor are one, from a file and from the log of a call: the clock in
a log has whole seconds."""
PAUSE = 3 * DAY
"""Seconds without readings after which a glider is on another deployment: nothing usual is carried over."""
REMEMBERED = 30 * DAY
"""Seconds of readings that rules look back on."""
REPORTED = 45 * DAY
"""Seconds of what rules found that incidents are made of: one that is open for longer begins there."""

SURFACE = 2.0
"""Metres above which the glider is at the surface, with its air bladder full."""
FLIGHT = 5.0
"""Metres below which it flies: roll and vacuum are those of flight."""
APPROACH = 5.0
"""Metres by which a glider has to go away from the bottom between two approaches of it: noise of an
altimeter, and a bottom that is not even, make less."""
OUT_OF_RANGE = 600.0
"""Seconds without altitudes that part two approaches: the bottom was out of the altimeter's range."""

FEWEST = 5
"""Positions of a motor in flight that tell how it follows its commands (measured: fewer are those of a
glider that is about to surface, with its fin hard over).
"""
USUAL = 20
"""Readings that tell what is usual for a detector: a day at one in an hour."""
USUAL_FILES = 8
"""Files that tell what is usual for a quantity of which each file gives one value: a day of dives."""
ROBUST = 1.4826
"""Standard deviation of normal values by their median absolute deviation."""
BEYOND = 6.0
"""Robust standard deviations beyond which a value is none of the usual ones (measured: none in the five
missions beyond 5, but for roll)."""
MOVED = {"battery_position": 0.005, "fin": 0.1, "ballast": 30e-6, "oil_volume": 30e-6}
"""Least difference of commanded and measured (m, rad, m3, m3) that is spoken of: some times the deadband of
each motor."""

ATMOSPHERE = 101325.0
"""Pascal outside the hull when it was closed."""
KELVIN = 273.15
COOL = 288.0
"""Kelvin at which a density of gas is shown as a vacuum."""
INHG = 3386.389
"""Pascal in an inch of mercury."""
TREND_WINDOWS = (2.5 * DAY, 5 * DAY, 10 * DAY)
"""Seconds over which the trend of the vacuum is fitted: a leak that began lately shows in the shortest."""
TREND_COVERED = 0.6
"""Part of such a window that the readings have to reach over."""
MOST_CORRELATION = 0.9
"""Correlation of readings that follow each other, at most: more would leave no independent ones."""
HUBER = 3.0
"""Standard deviations from a line beyond which a reading is drawn in (Huber 1964)."""
TREND_FILES = 10
"""Least files for a trend."""
TREND_SIGMA = 3.0
"""Standard errors beyond which the vacuum falls (checklists: look at the trend; three: one in a thousand)."""
TREND_LEAST = 0.25 * INHG / (7 * DAY)
"""Pascal a second that are spoken of at least: 0.25 inHg a week; slower is the ageing of seals."""
OFF_LINE = 0.05 * INHG
"""Pascal by which a vacuum is off any line at least: one step of the sensor."""

FIT = 10 * DAY
"""Seconds of use that the end of the battery is fitted on."""
BLOCK = 12 * HOUR
"""Seconds of one value of use: dives and calls average out in half a day."""
LEAST_BLOCKS = 4
THRUSTER = 0.05
"""Part of the time from which on a block counts as flown with the thruster."""
CONFIDENCE = 0.975
ENDS_AT = {"alkaline": 11.0}
"""Volts at which a battery ends, by its chemistry: ten alkaline cells fall from 1.5 V to 1.1 V each, and
below the rest goes quickly (gliders abort at 10 V). Lithium cells are flat until the last days."""
FULL = 3600.0
"""Coulombs in an ampere hour."""

CRITICAL_DEVICES = frozenset(
    {
        "attitude",
        "attitude_rev",
        "ballast_pump",
        "de_pump",
        "pitch_motor",
        "fin",
        "digifin",
        "ocean_pressure",
        "leakdetect",
        "vacuum",
        "battery",
        "lithium_battery",
        "iridium",
        "gps",
        "coulomb",
        "bms",
        "science_super",
    }
)
"""Devices without which a glider does not steer, turn or call (devices whose failure aborts a mission)."""
LAST_CALLS = 10
"""Calls of which the part is counted that was cut."""
CLEAR_AFTER = 4
"""Segments or calls in a row in which a rule finds nothing that clear its incident: the file and the log of
two surfacings. One that is at its limit is not reported again at each."""
RELAPSE = 7 * DAY
"""Seconds after the end of an incident within which another of its rule is over only after so long without a
finding: a value that stays about its limit for weeks is two incidents, not one every other day."""
CLEAR_TREND_AFTER = 16
"""The same of a trend, whose error varies: two days of files (measured: with 4 two of ten came twice)."""
