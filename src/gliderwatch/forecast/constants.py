"""The heuristics of the next surfacing, each with its unit, what it is for, and where it comes from. Pure.

`docs/next-surfacing.md` says what real missions do, and `benchmarks/surfacing.py` scores a change of them.
Where no source is named the value is a judgement, and the tests named by `benchmarks/mutations.py` pin what
it is for. How a current changes is on the page of `sea`.
"""

from __future__ import annotations

# What is remembered
HABIT_DIVES = 5
"""Dives that show habits: times at the surface, lengths of the mean heading vector."""
MISSES_KEPT = 30
"""Errors of time and of place that are remembered; with `ERROR_MEMORY` the oldest weighs 8 %."""
WAYPOINTS_KEPT = 16
"""Waypoints of the past that are remembered, so that the next one of a round is known."""
WAYPOINTS_HEARD = 32
"""Reports of waypoints that are remembered: a corrected dive asks for the waypoint of some hours ago."""
WAYPOINT_LATE = 300.0
"""s after a fix in which a file that ends with it may still hold the waypoint."""
SAME_WAYPOINT = 200.0
"""m: waypoints nearer than this are the same one, written with other decimals."""
UNSEEN = 1800.0
"""s without data in which a glider may have been up."""

# When
INTERVALS_KEPT = 4
"""Intervals that count for the next."""
LATEST_AGAIN = 2
"""How often the latest interval counts beside once: after a change it goes half the way at once."""
ERROR_MEMORY = 0.92
"""What is left of the weight of an error of time after each further dive: a dozen dives."""
FIRST_ERRORS = (0.01, 0.02, 0.04, 0.12, 0.6)
"""Errors (logarithm of a ratio) that stand for those of missions in general."""
FIRST_WEIGHT = 0.2
"""The weight of each of them, in dives."""
LONGEST_ERROR = 1.0
"""An error (logarithm of a ratio) above this counts as this much."""
FEW_ERRORS = 1.1
"""By how much a quantile of few errors is too small, about."""
COVERED = 0.95
"""Part of errors that an interval of 1.96 standard errors, or an ellipse, holds."""
NORMAL_COVERED = 1.96
"""Standard errors of a normal distribution to either side that hold `COVERED`."""

# Where
COMMUNICATION = 900.0
"""s at the surface before they are known."""
MOST_AT_SURFACE = 0.5
"""Part of an interval that the time at the surface is at most."""
GPS_ERROR = 10.0
"""m, a component: error of the way between two fixes."""
SLOWEST = 0.05
"""m/s: a glider does not believe that it is slower than this."""
FASTEST = 1.5
"""m/s: nor that it is faster."""
VAGUE = 0.1
"""Part of the speed: its standard error where an estimator gives none."""

# The current and the drift at the surface
CURRENT_CHANGE = 0.06
"""m/s, a component: by how much a current differs from the one before, before it is known."""
WILD_CHANGE = 9.0
"""Mean squares of the change: a greater square counts as this much, three standard deviations."""
ALIKE = 0.5
"""Correlation of the errors of a forecast of the flow and of the last current taken for one."""
DRIFT_GAIN = 0.1
"""Weight of the latest drift at the surface."""
LONG_DRIFT = 300.0
"""s between two fixes that show a drift: errors of fixes are then 0.05 m/s."""
FASTEST_DRIFT = 1.0
"""m/s, a component: the drift beside the current is at most this."""

# The way of steering
DOUBT = 0.1
"""Mean square error of a course before any dive, in parts of the speed squared."""
DIVE_MEMORY = 0.8
"""What is left of what a dive showed of steering, or of the change of the current, after each further one."""
WORST_COURSE = 2.0
"""Greatest square of the error of a course that counts: that of one at a right angle."""
STEADY_HEADING = 0.3
"""Length of the mean heading vector from which the speed of a dive shows."""
HEADING_ERROR = 0.1
"""rad: how well the mean heading of half a dive shows how it was steered."""
ANY_HEADING = 0.005
"""Likelihood of any other heading, beside 1 of the one that leads to the goal: a turn, a pilot's command."""
NEW_GOAL = 0.05
"""Chance of a new goal on half a dive: a leg of some ten dives, a day."""
LEGS_KEPT = 16
"""Halves of dives whose headings show where a glider heads: two days of dives of 3 h."""
GOAL_BEARINGS = 48
"""Bearings all around at which a goal is thought of,"""
GOAL_DISTANCES = (2e3, 60e3)
"""m: and the nearest and the farthest: nearer ones are reached within a dive, farther ones look alike,"""
GOAL_RINGS = 8
"""with so many of them, in proportion."""
GOAL_REACHED = 1000.0
"""m from a goal at which a glider turns to the next one."""
LEG_STEPS = 2
"""Steps of a leg after which a glider that was carried aside aims anew: 45 min of dives of 3 h."""
MOST_ALLOWANCE = 0.8
"""Sine of the angle that allowance for a current takes at most."""
FLOORS = (0.03, 0.01, 0.01, 0.01)
"""Added to the scores of the ways of steering, so that none is taken for perfect; where all were alike, as on
a straight way, a glider is rather expected to follow its waypoint than to go on as before."""

# The ellipse
CHI2_COVERED = 5.991
"""Squared distance in a plane, in standard errors, that holds `COVERED`: chi-square, 2 degrees of freedom."""
FIRST_MISSES = (0.3, 0.5, 0.7, 0.9, 1.2)
"""Distances from the place expected (parts of the 95 % ellipse) that stand for those of missions at large."""
FIRST_MISSES_WEIGHT = 0.4
"""The weight of each of them, in dives."""
MISSES_MEMORY = 0.95
"""What is left of the weight of a miss after each further dive."""
MOST_STRETCH = 4.0
"""The greatest factor on the axes of the ellipse; the least follows from the first misses and is 0.7."""
