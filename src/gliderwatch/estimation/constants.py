"""The heuristics of speed and flow, each with its unit, what it is for, and where it comes from. Pure.

What happens at sea is in `sea.constants`. `python benchmarks/seas.py` and `python benchmarks/joint.py` score
a change of them. Where no source is named the value is a judgement, and the tests named by
`benchmarks/mutations.py` pin what it is for.
"""

from __future__ import annotations

MAD_TO_SIGMA = 1.4826
"""Standard deviation of normal numbers by their median absolute deviation: 1 / Phi^-1(3/4)."""

RAYLEIGH_MEDIAN = 1.1774
"""Median length of vectors whose components are normal numbers, by their standard deviation: sqrt(2 ln 2)."""

# What a dive measures
GPS_ERROR = 5.0
"""m, a component: error of a fix."""
SURFACE_FLOW = 0.15
"""m/s, a component: by how much the drift at the surface differs from the flow below."""
SWING = 0.1
"""rad: how much a glider swings about its course."""
COMPASS_ERROR = 0.02
"""rad: how well the headings in the files are those that the glider reckoned with; mostly declination."""
COMMANDED_ERROR = 0.08
"""rad: how far the mean of the commanded headings of a dive is from that of measured ones, where only they
are sent: 0.04 to 0.09 on the four missions that have both (robust standard deviations)."""
RECKONED_ERROR = 0.3
"""rad: error of the course by the dead-reckoned way where no current says how much of that way was drift."""
ASSUMED_LENGTH = 0.92
"""Usual length of the mean heading vector of a dive whose headings are not known."""
ASSUMED_ERROR = 0.2
"""Standard error of that length."""
STRAIGHT = 0.9
"""Length of the mean of the few headings there are, below which the glider turned."""
TURNING_ERROR = 0.5
"""Standard error of the length where it turned."""
STEERED_ERROR = 0.03
"""The same error where the commanded headings tell the length: on 58 dives of an hour and more of the real
missions that have both, 0.6 to 1.1 % (robust standard deviations), but for those where it turned,"""
TURNS = 0.1
"""which is the chance of that: 7 of the 58 were off by more than a tenth."""
SHAPE_ERROR = 0.03
"""The same error where the dead-reckoned way tells the length."""
UNEVEN = 0.05
"""Part of the speed by which dives and climbs differ: matters where the heading differs between them too."""
UNSEEN = 0.5
"""Usual error of the mean heading vector over hours of which no data have come."""
REPORTED = 0.006
"""m/s, a component: error of a current as reckoning, corrected."""
PROVISIONAL = 0.02
"""m/s, a component: error of a current as first published."""
DRAG_BY_LIFT = 0.02
"""C_D0 / a of a Slocum: parasite drag by slope of the lift (Merckelbach et al. 2019: 0.15 and 7.5 1/rad)."""
INDUCED_BY_LIFT = 1.4
"""1/rad: C_D1 / a, induced drag by the same (10.5 1/rad2)."""
USUAL_PITCH = 0.45
"""rad: pitch of a glide where none is reported."""
FLATTEST_GLIDE = 0.3
"""rad: the formula for slip is used from this pitch on,"""
STEEPEST_GLIDE = 1.0
"""rad: and up to this one."""
GAP = 600.0
"""s: a gap between headings is one where it is longer than this,"""
GAP_IN_CADENCES = 2.5
"""and than this many usual spacings."""
THRUST = 0.8
"""m2/s2 that a thruster adds to the square of the speed where it is always and fully on, and in proportion:
electa-2022 0.75 to 0.89 at means of 0.14 to 0.46, against what its ballast alone made of the speed."""
THRUST_ERROR = 0.2
"""Part of the slip without a thruster, by which that with one is unsure."""
SLOWEST = 0.02
"""m/s: no glider that flies is slower through the water,"""
FASTEST = 1.3
"""m/s: or faster."""
DRAG_SLIP = 0.9
"""Slip that drag adds where it takes all of the speed, as part of W."""

# Another deployment
NEW_AFTER = 3 * 86400.0
"""s between two dives after which sea and glider are unknown again: the glider was recovered."""
CARRIED = 3.0
"""m/s between the fixes of two dives, faster than any drift: the glider was carried."""
CARRIED_FOR = 600.0
"""s that count at least for that speed, as fixes of one surfacing scatter."""

# The speed before any dive, and how it changes
FIRST_SPEED = 0.35
"""m/s: W before any dive,"""
FIRST_SPEED_ERROR = 0.2
"""m/s: with its standard error."""
SPEED_WANDER = 0.015
"""m/s: usual change of W in 3 h."""
REAL_SLIP = 0.75
"""Part of the physical slip that is real: on board some is allowed for (a DAC is 5 to 10 % of W off)."""
SLIP_ERROR = 0.014
"""Standard error of slip, as part of W: 1.96 of it hold 95 % of gliders. On board any part from nothing to
half of what the angle of attack takes (0.09) is allowed for, each as likely: within 0.022 of the middle, and
that is no normal distribution. Drag and lift, by 10 and 5 % from airframe to airframe, add 0.007."""
SIDE_ERROR = 0.03
"""rad: standard error of side."""
SLIP_MEMORY = 30 * 86400.0
"""s: memory of both,"""
HEALTHY_BOUND = 4.0
"""within so many standard errors; beyond, no healthy glider has them, and they last: a wing does not grow
again (`benchmarks/deployments.py --only usf-stella`: a lost one was forgotten on three weeks of legs)."""
OWN_NOISE = 0.01
"""Error of W on one dive, as part of it."""
LEAST_SLIP = -0.1
"""On board at most this part of W too much is allowed for the angle of attack."""
MOST_SLIP = 0.95
"""A glider does not fly backwards."""
MOST_SIDE = 0.85
"""A compass, or a bent wing, that turns the way by more than a radian (its sine) is not thought of."""

# How restless the sea and how good the data are
NOISE_MEMORY = 40
"""Dives over which noise is learnt."""
NOISE_FEW = 6
"""Dives that the first guess of it counts for."""
FAR = 4.0
"""A normalised square above this counts as this much, so that a fault does not pass for noise."""
PROCESS_SCALES = (0.1, 40.0)
"""Bounds of the factor on the variance of the flow's changes."""
MEASUREMENT_SCALES = (0.02, 9.0)
"""Bounds of the factor on the variance of the measurements. The noise of a current is 0.6 cm/s before
anything is learnt; on the real missions at hand it is about that, and a tenth of it where compass, pitch and
fixes are as good as simulated ones."""
LEAST_TESTED = 0.25
"""What the tests take the factor on the measurements for, at least: data that were better than usual until
now do not make a fault of the first dive that is as usual."""

# How a dive can be explained
RARE = 0.01
"""Weight of a mode below which it is left out of the mixture."""
ITERATIONS = 2
"""Steps of the iterated update under each mode."""
BEYOND = 0.02
"""m/s by which a speed may be found beyond what a glider can fly, before that speaks against a mode."""
STAYS = 0.6
"""Chance that a current, or a ground velocity, which is wrong on one dive is wrong on the next one too, and
that a speed which changed on one dive changes on the next one too: it changed during the first."""
LEFT_OUT = 10.0
"""m/s: error given to a measurement that is wrong: it is left out, be it as near as it may."""
SPEED_CHANCE = 0.02
"""Chance of another speed on a dive,"""
SPEED_STEP = 0.2
"""m/s: which usually differs by this."""
FLOW_CHANCE = 0.03
"""Chance of another flow on a dive."""
FRONT = 0.25
"""m/s, a component: by how much it then differs usually, and also together with a step of slip or side."""
CURRENT_CHANCE = 0.02
"""Chance of a wrong current on a dive,"""
CURRENT_ERROR = 0.4
"""m/s, a component: which is usually wrong by this."""
GROUND_CHANCE = 0.01
"""Chance of a wrong ground velocity on a dive,"""
GROUND_ERROR = 0.3
"""m/s, a component: which is usually wrong by this."""
WING_ODDS = 9.0
"""For a wing that was lost or bent, where the glider has just begun to roll otherwise, which little else
does: nine to one."""
WING_SLIP = 0.45
"""Usual slip that it makes, as part of W,"""
LOST_SLIP = 0.36
"""and where the roll is that of a lost wing: the mean of half a normal distribution of that, as no lost wing
makes a glider faster,"""
LOST_SPREAD = 0.27
"""and the standard deviation of the same,"""
WING_SIDE = 0.15
"""rad: and usual side."""

# Steps that the glider does not know of, and slow drifts
WINDOW = 24
"""Dives before each of which a step is looked for, some three days,"""
OLDER_EVERY = 12
"""and then before one in so many: where a glider flies on one leg for days, a step that it does not know of
is seen when it turns,"""
OLDER_KEPT = 8
"""and of those at most so many are kept: some two weeks."""
STEP_SIZE = 0.5
"""Usual size of a step in slip or side (parts of W)."""
DRIFTS_KEPT = 48
"""Surfacings whose drift is kept, about a week,"""
DRIFTS_FEW = 8
"""and of how many it tells of a step."""
DRIFT_SHORTEST = 240.0
"""s between the fixes before and after a surfacing: nearer ones are off by more than 3 cm/s,"""
DRIFT_LONGEST = 2400.0
"""s: and between ones that are further apart there may have been a dive."""
DRIFT_LEAST = 0.08
"""m/s, a component: least standard deviation of the drift beside the flow; on real missions 0.08 to 0.18,"""
LASTING_DRIFT = 0.6
"""of whose variance this part lasts"""
DRIFT_MEMORY = 10 * 3600.0
"""s: for hours: drifts 3 h apart correlate by 0.2 to 0.56 there."""
DRIFT_FOR = 10.0
"""Twice a log likelihood ratio: what drift may say for a step at most, as wind that turned blows for days,"""
DRIFT_AGAINST = 20.0
"""and against one."""
LONGEST_INNOVATION = 4.0
"""Standard errors: an innovation that is longer counts as this long, as no dive alone may prove a step."""
CALIBRATED_ALARMS = 0.5
"""Alarms that a healthy glider gives in a month at a ratio of `CALIBRATED_RATIO`. With the next two that is
so in the worst kinds of sea, as `python benchmarks/joint.py calibrate` printed (176 gliders of 30 days,
eleven kinds of sea, 48 of them in the three worst: critical-30, front, shallow) before the drift at the
surface was heard; with it, and `--first 8000`, they are less (the worst: critical-30, critical-74, shallow).
They stay: the wind at sea is not all in the simulator.

    ratio above                   8     10    12    14    16    18    20    24
    alarms a month, the worst     .81   .50   .21   .15   .08   .06   .02   .02
    these three numbers           .82   .50   .30   .18   .11   .07   .04   .02
    all kinds of sea              .32   .16   .07   .06   .03   .02   .01   .01
    with drift, the worst         .54   .33   .15   .10   .04   .02   .02   .00
    with drift, all kinds         .22   .14   .05   .03   .02   .01   .01   .00
"""
CALIBRATED_RATIO = 10.0
"""That ratio: twice a log likelihood ratio."""
CALIBRATED_FALL = 4.0
"""By how much the ratio must rise for a factor e fewer alarms."""
DEPARTURE = 0.1
"""Part of the usual speed by which a healthy glider's speed varies at least, for the sum of small losses.
Water that is denser or lighter changes it by up to 4 % (one standard deviation) for days, so that dives one
after another are no independent evidence, and the usual speed was learnt in such water: 2.5 of these.
At 0.08 two gliders in 28 glider-months (`benchmarks/seas.py`) were reported that truly flew 9 % slower for
two days."""
SLACK = 1.0
"""How many times that does not add to the sum."""
USUAL_DIVE = 3 * 3600.0
"""s: a shorter dive counts for less in the sum, and of shorter dives fewer make the range of speed."""

# What the glider tells of its speed without a fix
RATIOS_KEPT = 12
"""Healthy dives from which a ratio to W is learnt, at most,"""
RATIOS_FEW = 3
"""and at least."""
FLATTEST_PITCH = 0.15
"""rad: below this pitch its tangent says too little."""
VERTICAL_RATIO = 1 / 1.17
"""W by depth rate over tan(pitch), before it is learnt: 1 / 1.16 to 1 / 1.20 on real missions,"""
VERTICAL_SPREAD = 0.15
"""and the standard error of that ratio,"""
VERTICAL_LEAST = 0.07
"""which is at least this once it is learnt: on real missions it kept to 5 %."""
VERTICAL_LIES = 0.01
"""Chance that depth rate and pitch have nothing to do with the speed."""
ONBOARD_LEAST = 0.12
"""Least standard error of the ratio of W to the glider's own mean, which lags for hours."""
ONBOARD_LIES = 0.1
"""Chance that the glider's own mean has nothing to do with the speed."""

# What is normal
LIKE = 0.1
"""Settings of a thruster (0 to 1) that differ by less are alike,"""
NEAR = 0.05
"""and have one normal speed: 0.4 m/s at one is 0.42 at the other."""
LEAST_THRUST = 0.4
"""m2/s2: of `THRUST` what is counted on at a setting that was never flown. Half of it, as a range that is too
high is a false alarm, and one that is too low is not noticed: between 0.3 and 0.55 the same is told."""
MOST_PUMPED = 2.0
"""How many times the volume of an earlier dive is counted on there at most: of a dive on which far less was
pumped it is not known why."""
SHORTEST = 3600.0
"""s: a shorter dive teaches nothing: turns and surface take too much of it, and after launch pilots try out
the ballast."""
TRIALS = 8
"""Dives of a deployment among which such trials are looked for."""
RANGE_LEAST = 3
"""Dives at a setting that a range of speed needs,"""
RANGE_MOST = 24
"""and that it is made of at most."""
RANGE_WIDTH = 4.0
"""Half width of the range of a number of healthy dives, in robust standard deviations."""
NARROWEST = 0.15
"""Part of the usual speed by which the range of speed goes down at least,"""
WIDEST = 0.25
"""and at most, so that a loss of 30 % is always outside."""
ABOVE = 0.35
"""Part of the usual speed by which the range goes up at least."""
BASELINE_FIRST = 12
"""Healthy dives kept of those at a like setting of the thruster: the first,"""
BASELINE_RECENT = 12
"""and the latest."""
BASELINE_MOST = 144
"""Dives kept of all settings: six settings' worth."""
BASELINE_LEAST = 5
"""Dives that tell what is usual of a number or of the roll."""
BRIEF = 1800.0
"""s: the numbers of a shorter dive are those of its turns: it is not compared."""
ROLL_RANGE = 0.08
"""rad: what half of the usual range of the mean roll is at least, and of the mean pitch."""
ASYMMETRY_RANGE = 0.1
"""rad: the same of the difference of pitch of climbs and dives."""
RATE_RANGE = 0.15
"""Part of the usual value: the same of depth rates and their ratio, of ballast, and of depth."""
BALLAST_RANGE = 20e-6
"""m3: the same of ballast,"""
YOS_RANGE = 0.3
"""as part of the usual value of yos an hour,"""
DURATION_RANGE = 0.4
"""as part of the usual duration,"""
DURATION_LEAST = 0.5
"""h: of the duration,"""
VACUUM_RANGE = 4e3
"""Pa: of the vacuum,"""
DEPTH_RANGE = 5.0
"""m: of the depth reached."""

# What a dive says
CONFIDENCE = 1.645
"""Standard errors by which a speed must be out of the normal range: one-sided 95 %."""
GATE = 4.0
"""Standard errors that are across the heading where a measurement is wrong,"""
LEAST_ACROSS = 0.05
"""m/s: and at least this much."""
VAGUE = 0.3
"""Standard error as part of the usual speed, above which a dive says nothing."""
COMPASS_OFF = 0.15
"""rad: the least error of a compass that is reported."""
MISFITS_KEPT = 8
"""Dives back over which a wrong current is held apart from a wrong compass."""
CLEARLY = 6.0
"""By how much the chi-square of one explanation has to be below that of the other."""
TURNED = 0.785
"""rad: by how much the glider must have turned before the two can differ: 45 degrees."""
OWN_SURE = 0.15
"""Standard error of W on a dive, as part of the usual speed, above which the fixes hardly tell the speed,"""
RATIO_SURE = 0.3
"""and as part of W, up to which the dive tells what W is to what is reported: a median of them counts."""
ROLL_STEP = 0.12
"""rad: a step of the mean roll that speaks for a lost or bent wing. Healthy gliders roll within 0.05."""
ROLL_LOST = 0.19
"""rad, 11 degrees: a step of the mean roll that is taken for a lost or bent wing. USF-Gansett kept 11 to 15
degrees after a shark had bent one (000, III.B.3). On a healthy real mission a new trim made one of 0.18."""
ROLL_STAYS = 0.05
"""rad: a mean roll nearer than this to the usual one is as before. No wing was lost then: of those in 000, a
bent wing and two with a remora beside a wing, all rolled."""
ROLL_CONFIRMS = 0.67
"""Standard errors by which a speed must be below normal where the glider rolls otherwise for two dives:
three to one."""
HIDDEN = 0.1
"""Part of the speed that the glider believes, by which it must be slower to be slower than that."""
AGREE = 0.12
"""Part of it by which speeds of a new way of flying differ at most,"""
ENOUGH = 3
"""and dives in a row that make it one."""
EXPLAINED = 0.7
"""Part of the usual speed that is left at least after a change of trim: pitch and ballast take no more."""
RETRIMMED = (0.08, 0.08, 30e-6, 30e-6)
"""rad, rad, m3, m3: change of pitch diving and climbing, and of ballast, that was the pilot's."""

# What it is compared with
APART = 16.0
"""Squared misfit of flow and reference, in standard errors, that is no chance."""
MODEL_ERROR = 0.1
"""m/s, a component: usual error of an ocean model or a radar beside a glider's mean current."""
SHALLOW = 30.0
"""m to which a model is averaged where the depth of the dive is not known."""

# The estimator of paper 001
WARM_UP = 3.0
"""Time constants K/gamma of the speed law: by then 95 % of an error of the first guess is gone."""
STALE = 12 * 3600.0
"""s without a usable dive after which the sea may be another: the learner warms up again, and the current of
an earlier dive no longer stands in for one that has not come."""
FORGOTTEN = 6.0
"""Widths sigma behind the glider at which a basis function that was placed on the way is let go."""
