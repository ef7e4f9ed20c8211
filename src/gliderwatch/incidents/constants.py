"""The heuristics of the rules, each with its unit, what it is for, and where it comes from. Pure.

What a pilot may set stands in `params`. Where no source is named the value is a judgement, and the tests
named by `benchmarks/mutations.py` pin what it is for.
"""

from __future__ import annotations

# Incidents
SEVERE = 0.667
"""Part of the lower bound of the normal range: a speed below it needs fewer dives to open an incident. So a
glider that lost half of its speed is there, with 0.42 to 0.5 of the usual speed left (drag takes more than
the glider itself believes), and one that lost 30 % is not."""
WORSE_SPEED = 0.05
"""m/s further out of the normal range than when it was acknowledged: an anomaly has grown worse."""
WORSE_FLOW_ERROR = 0.1
"""Of the flow error p_E: the same for measurements that disagree."""

# What people are notified of
NEWS = 86400.0
"""s: an incident that was over for longer when it became known is history, not news."""
REGIME_DIVES = 8
"""Dives back among which a new way of flying is looked for that nobody was notified of: a day of 3 h."""
TREND_DIVES = 5
"""Dives back whose speeds a message names: half a day to two days of flight."""
NEIGHBOURS_AGAIN = 7 * 86400.0
"""s after which what the neighbours show is reported once more, if they show it: their currents of four days
count."""
SPEED_CHANGE = 0.05
"""m/s: a smaller change of a speed that was reported is not worth a correction."""
SETTLES = 3600.0
"""s after a message about an incident within which a change of mind waits for the next: files of one call,
and the final current of a dive (10 to 40 min after it), come within the hour."""
FLOW_CHANGE = 0.05
"""m/s, a component: the same for the reference flow."""
MESSAGE_LATE = 900.0
"""s: a message made later than that after its time is about now (the service was off), an earlier one about
its time, so that live and replay send the same."""

# When a glider is overdue
LEAST_MARGIN = 3 * 3600.0
"""s by which a healthy glider may be late."""
LONGEST_CALL = 2400.0
"""s that a call takes at the most: its files come when it ends, not at the surfacing."""
SHORTEST_INTERVAL = 1200.0
"""s: files opened closer together are of one call."""
TIME_SIGMAS = 3.0
"""Standard errors of the expected time that belong to the margin."""
MARGIN_GROWTH = 2.0
"""A glider becomes overdue again after one, two, four, ... margins."""
FILES_KEPT = 8
"""Files from which the interval is guessed where dives do not show it."""
LOSSY = 3.0
"""Intervals from file to file, above which it was a silence and not one or two files that were lost."""
GUESSED_SIGMA = 0.5
"""Part of an interval guessed from files: the standard error of its end."""
SAME_CALL = 0.25
"""Part of an interval: what comes so soon after the last call belongs to it."""
LATER_CALL = 0.5
"""Part of an interval: a sign of life later than this after a surfacing is of another call."""

# Whether a deployment goes on
FRESH = 2 * 86400.0
"""s: a file that came longer after its end is history, no news of a glider at sea."""
GONE = 30 * 86400.0
"""s of silence after which a deployment counts as over."""
RECENT = GONE + 2 * 86400.0
"""s: files opened before are no sign of life of the last 30 days; none is open for two days."""

# Where a silent glider drifts (the current forgets in `sea.constants.PASSING_MEMORY`)
FLOW_SIGMA = 0.15
"""m/s, a component: how far current and wind drift come to differ from the last known current. 0.11 is
sqrt(2) times the 0.08 of the current itself; the rest is allowed for the wind at the surface."""
UNKNOWN_FLOW = 2.0
"""Times `FLOW_SIGMA` where no current is known."""

# When nothing can be judged
DEPLOYMENT_HOURS = 24.0
"""h that separate two deployments where `unknown_hours` is not given."""
UNJUDGED_INTERVALS = 2.0
"""Intervals between surfacings until a dive is judged, at most: the fix that ends it, and its current, come
with the file after it."""
REMINDER_GROWTH = 2.0
"""Reminders come after 1, 2 and 4 times `reminder_hours`,"""
THINNED = 7.0
"""then each time after so many of them: once a week where they are daily."""

# When an incident opens, and is over
WELL = 0.5
"""Part of the way from the lower bound to the usual speed from which an open anomaly is over."""
SURELY = 2.0
"""Standard errors by which a speed must be below normal for one dive alone to be severe,"""
LINGERS = 0.5
"""and by which, and by this part of what it was, a misfit across the heading has to be there for
measurements still to disagree."""

BACK = 3 * 86400.0
"""s after the end of an incident within which another of its kind is called the same one again."""

# Reminders of what is open
MARKS = (1.0, 2.0, 4.0, 7.0)
"""Days after which people are reminded of an open incident,"""
WEEK = 7.0
"""and then each time after so many days."""
REMINDED = 3
"""Messages of a silence that is over: with so many people were reminded of it."""
SLACK = 0.2
"""Of a day: so much sooner a reminder may come; surfacings do not fall on full days."""

UNTIL_COME = 3600.0
"""Seconds after a call after which a file that was announced in it has come, or does not."""

# What a glider reports in its calls
SAME_ABORT = 1800.0
"""Seconds: two lines about an abort that are no further apart are about the same one."""

EMPTY_CALLS = 2
"""Calls without a file in a row that are a warning; one alone may be a dropped connection."""
SAME_SURFACING = 6 * 3600.0
"""s between two calls, above which they are never of one surfacing."""

# Files that are wrong although the flight may be right
STEP_REPORTED = 3 * 3600.0
"""Seconds: a clock that was set by less is named in the notes of the dives alone."""
PLACES = 12
"""Surfacings among which two gliders of one name are looked for."""
ALTERNATIONS = 3
"""Times that a glider is elsewhere and back again: once and twice may be a wild position."""
FAR_APART = 5000.0
"""Metres: two places nearer than this may be of one glider, however close in time."""
