"""The heuristics of estimation, each with its unit, what it is for, and where it comes from. Pure.

Where no source is named the value is a judgement, and the tests named by `benchmarks/mutations.py` pin what
it is for. Tables of modes, quantities and sources stand where they are used.
"""

from __future__ import annotations

import math

# Measurements of a dive
GPS_ERROR = 5.0
"""Metres, a component: error of a fix."""
SURFACE_FLOW = 0.15
"""m/s, a component: by how much the drift at the surface differs from the flow below."""
COURSE_SWING = 0.1
"""rad: how much a glider swings about its course."""
COMPASS_ERROR = 0.02
"""rad: how well the headings in the files are those that the glider reckoned with; mostly declination."""
COMMANDED_ERROR = 0.08
"""rad: how far the mean of the commanded headings of a dive is from that of measured ones, where only they
are sent: 0.04 to 0.09 on the four missions that have both (robust standard deviations)."""
CURRENT_ERROR = 0.006
"""m/s, a component: error of a current as reckoning, as corrected after the next fix."""
PROVISIONAL_ERROR = 0.02
"""m/s, a component: the same as first published."""
ASSUMED_STEADINESS = 0.92
"""Usual length of the mean heading vector of a dive whose headings are not known."""
ASSUMED_STEADINESS_ERROR = 0.2
"""Standard error of that length."""
STRAIGHT = 0.9
"""Length of the mean of the few headings there are, below which the glider turned."""
TURNING_ERROR = 0.5
"""Standard error of the length where it turned."""
STEERED_ERROR = 0.1
"""The same error where the commanded headings tell the length."""
RECKONED_ERROR = 0.03
"""The same error where the dead-reckoned way tells the length."""
UNEVEN_SPEED = 0.05
"""Part of the speed by which dives and climbs differ: matters where the heading differs between them too."""
UNSEEN_ERROR = 0.5
"""Usual error of the mean heading vector over hours of which no data have come."""
HEADING_GAP = 600.0
"""s: a gap between headings is longer than this,"""
HEADING_GAP_CADENCES = 2.5
"""and longer than so many usual spacings."""

# The flight of a glider
DRAG_BY_LIFT = 0.02
"""C_D0 / a of a Slocum: parasite drag by slope of the lift (Merckelbach et al. 2019: 0.15 and 7.5 1/rad)."""
USUAL_PITCH = 0.45
"""rad: pitch of a glide where none is reported."""
FLATTEST_GLIDE = 0.3
"""rad: the flattest pitch for which the formula for slip is used."""
STEEPEST_GLIDE = 1.0
"""rad: the steepest."""
SLOWEST_GLIDER = 0.02
"""m/s: no glider that flies is slower through the water."""
FASTEST_GLIDER = 1.3
"""m/s: none is faster."""
DRAG_SLIP = 0.9
"""Slip that drag adds where it takes all of the speed, as part of W."""

# Another deployment
NEW_DEPLOYMENT = 3 * 86400.0
"""s between two dives after which sea and glider are unknown again: the glider was recovered."""
CARRIED_SPEED = 3.0
"""m/s between the fixes of two dives beyond which it was carried: faster than any drift."""

# Speed by depth rate and pitch
RATIOS_KEPT = 12
"""Healthy dives from which a ratio is learnt, at most."""
FEW_RATIOS = 3
"""Healthy dives from which a ratio is learnt, at least."""
SHORTEST_FOR_RATIO = 3600.0
"""s: on a shorter dive the turns and the surface take too much of the time."""
FLATTEST_PITCH = 0.15
"""rad: below this pitch its tangent says too little."""
MAD_TO_SIGMA = 1.4826
"""Standard deviation of normal numbers by their median absolute deviation."""

# Explanations of a dive
ITERATIONS = 2


BEYOND_FLIGHT = 0.02
"""m/s by which a speed may be found beyond what a glider can fly, before that speaks against an
explanation."""
FAULT_STAYS = 0.6
"""Chance that a current, or a ground velocity, which is wrong on one dive is wrong on the next one too: a
fault lasts."""
LEFT_OUT = 10.0
"""m/s: error given to a measurement that is wrong: it is left out, be it as near as it may."""

# The filter
NOISE_MEMORY = 40
"""Dives over which noise is learnt."""
FIRST_NOISE_DIVES = 6
"""Dives that the first guess of the noise counts for."""
FAR_INNOVATION = 4.0
"""A normalised square above this counts as this much, so that a fault does not pass for noise."""
PROCESS_SCALES = (0.1, 40.0)
"""Bounds of the factor on the variance of the flow's changes."""
MEASUREMENT_SCALES = (0.02, 9.0)
"""Bounds of the factor on the variance of the measurements. The noise of a current is 0.6 cm/s before
anything is learnt; on the real missions at hand it is about that, and a tenth of it where compass, pitch and
fixes are as good as simulated ones."""
LEAST_TESTED_SCALE = 0.25
"""What the tests take the factor on the measurements for, at least: data that were better than usual until
now do not make a fault of the first dive that is as usual."""
LEAST_SLIP = -0.1
"""Part of W, bound of slip: on board at most a tenth of W too much is allowed for the angle of attack."""
MOST_SLIP = 0.95
"""Part of W, bound of slip: a glider does not fly backwards."""
MOST_SIDE = 0.85
"""Part of W, bound of side: no compass, and no bent wing, turns the way by more than a radian (its sine)."""
RARE_MODE = 0.01
"""Weight of a mode below which it is left out of the mixture."""

# The test for a step
STEP_WINDOW = 24
"""Dives that a step may lie back, some three days: by then the flow has forgotten what it was before."""
CALIBRATED = (0.5, 10.0, 4.0)
"""Alarms a healthy glider gives in a month at a ratio, that ratio, and by how much it must rise for a factor
e fewer. Fitted to what `python benchmarks/joint.py calibrate` printed (74 glider-months, seven kinds of sea):

    ratio above     8     10    12    14    16    18    20    24
    alarms a month  .89   .43   .30   .20   .11   .068  .027  .014
"""
STEP_SIZE = 0.5
"""Usual size of a step in slip or side (parts of W)."""
FAR_STEP_INNOVATION = 4.0
"""Standard errors: an innovation that is longer counts as this long."""

# The normal range
LIKE_SETTING = 0.1
"""Settings of a thruster (0 to 1) that differ by less are alike."""

# The verdict
MISFITS_KEPT = 8
"""Dives back over which a current is told from a compass."""
CLEARLY_BETTER = 6.0
"""By how much the chi-square of one explanation has to be below that of the other."""
TURNED = math.radians(45)
"""By how much the glider must have turned before the two can differ."""
USUAL_DIVE = 3 * 3600.0
"""s: a usual dive; of shorter ones each counts for less."""
DIVES_A_MONTH = 240.0
"""Such dives in 30 days."""
DEPARTURE = 0.08
"""Part of the usual speed by which a healthy glider's speed varies at least, for the sum of small losses."""
SLACK_DEPARTURES = 1.0
"""Times that departure does not add to the sum."""
OWN_SURE = 0.15
"""Standard error of W on a dive, as part of it, up to which the dive tells what W is to what is reported."""
ROLL_CONFIRMS = 0.67
"""Standard errors by which a speed must be below normal where the glider rolls otherwise for two dives:
three to one."""
HIDDEN = 0.1
"""Part of the speed that the glider believes, by which it must be slower to be slower than that."""
ROLL_STEP = 0.12
"""rad: a step of the mean roll that speaks for a lost or bent wing. Healthy gliders roll within 0.05."""
USUAL_ROLLS = 5
"""Dives that say what roll is usual, and samples that say the roll of a dive."""
REGIME_AGREES = 0.12
"""Part of it by which speeds of a new way of flying differ at most."""
REGIME_DIVES = 3
"""Dives in a row that make a new way of flying."""
EXPLAINED_BY_TRIM = 0.7
"""Part of the usual speed that is left at least after a change of trim: pitch and ballast take no more."""
TRIM_CHANGE = (0.08, 0.08, 30e-6, 30e-6)
"""Change of each number of the trim that was the pilot's."""

# What is usual of a healthy dive
FIRST_DIVES = 12
"""Healthy dives kept of the first ones at a like setting of the thruster."""
RECENT_DIVES = 12
"""Healthy dives kept of the latest ones."""
BASELINE_DIVES = 144
"""Dives kept of all settings: six settings' worth."""
LEAST_BASELINE = 5
"""Dives that tell what is usual."""
SHORTEST_TAUGHT = 3600.0
"""s: a shorter dive teaches nothing, because after launch pilots try out the ballast."""
BRIEF_DIVE = 1800.0
"""s: a dive so short that its numbers are those of its turns is not compared."""
RANGE_WIDTH = 4.0
"""Half width of a range in robust standard deviations."""

# Flow against a reference
REFERENCE_APART = 16.0
"""Squared misfit of flow and reference, in standard errors, that is no chance."""
MODEL_ERROR = 0.1
"""m/s, a component: usual error of an ocean model or a radar beside a glider's mean current."""
MODEL_DEPTH = 30.0
"""Metres to which a model is averaged where the depth of the dive is not known."""

# The learner of paper 001
WARM_UP = 3.0
"""Time constants K/gamma of the speed law: by then 95 % of an error of the first guess is gone."""
STALE_LEARNER = 12 * 3600.0
"""Seconds without a usable dive after which the sea may be another: the learner warms up anew."""
LATEST_CURRENT = 12 * 3600.0
"""Seconds for which the current of an earlier dive stands in for one that has not come yet."""
FORGOTTEN_WIDTHS = 6.0
"""Widths sigma behind the glider at which a basis function that was placed on the way is let go."""
