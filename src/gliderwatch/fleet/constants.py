"""The heuristics of the fleet, each with its unit, what it is for, and where it comes from. Pure.

"003" is the paper of the fleet's field. "Stand-in" is the analytic temperature that takes the place of the
paper's ocean model (`simulate/stand_in.py`), on which `benchmarks/fleet_field.py` measures.
"""

from __future__ import annotations

# The basis of a field (003, section 5)
GRID = 7
"""Gaussians on each axis of the box (003: 7 x 7 x 7)."""
SPREAD = 0.025
"""V of the Gaussians exp(-|r|^2 / 2 V), the box being of side 1 (003: V = 0.025 I)."""
PROFILE = 13
"""Functions of depth alone, for the mean profile: twice as fine as the field, as a thermocline is."""
PROFILE_SPREAD = 0.005
"""V of those: neighbours, 1/12 apart, meet at 0.5 of their height."""
POINTS = 201
"""Points an axis of the trapezoid rule for integrals over the box: exact to 1e-9."""

# The filter of a field
INFORMATION_RATE = 360.0
"""s that a sample stands for, in squares of the usual deviation, per unit of information: R = 60 at one
sample in 6 s. What the basis cannot represent is the same error in all samples of a leg (stand-in, 15
gliders: with R = 0.001 overconfident 24 times in variance; with 30, 60, 90 errors of 0.107, 0.104, 0.104 and
1.3, 0.9, 0.7 times)."""
LONGEST_STAND = 60.0
"""s that one sample stands for at most: in a minute a glider goes through 10 m of water."""
MEMORY = 120 * 3600.0
"""s in which what is known of the field fades (stand-in: best of 48 to 240 h)."""
PROFILE_MEMORY = 30 * 86400.0
"""s in which the mean profile wanders by 1.4 usual deviations: that of the season. (Where it forgot in that
time, and so wandered by its spread before any sample, it was unknown to 1 degree after two hours: NEES
0.25.)"""
FORGOTTEN = 15.0
"""Memories after which a field is forgotten: of its information 1e-13 is left, and more would overflow."""
PAPER_VARIANCE = 0.001
"""Variance of a sample of the literal estimator (003: sigma^2 = 0.001)."""
PAPER_STEP = 6.0
"""s between those (003: T = 6 s)."""
PAPER_WALK = 2e-3 / 3600.0
"""Variance that a second adds to each coefficient of the literal estimator; 003 leaves Q free."""
BIN = 3600.0
"""s: samples of one such bin are taken as of one time. A field changes over days."""

SAMPLE_STEP = 60.0
"""s: finer samples are averaged to one before they are kept: 6 to 16 m of depth, within a Gaussian's spread
in a box of 100 m."""
SENSORS_OF_FIELDS = {
    "sci_water_temp": (1.0, 15.0, 10.0),
    "salinity": (0.2, 33.0, 10.0),
    "density": (0.3, 25.0, 10.0),
    "oxygen": (15.0, 250.0, 100.0),
}
"""Of each sensor of a field: usual deviation from the mean profile, mean and spread of that before any
sample, in °C, 1, kg/m³ and µmol/l. Upper ocean of middle latitudes; the spread holds the other seas."""

# Relays
LARGEST_PARCEL = 64 * 1024
"""Bytes of samples in one message to other relays: brokers in the cloud take 128 kB."""
MOST_SAMPLES = 20_000
"""Samples of a batch at most: two weeks without a surfacing. What is said to be more is no batch."""
AHEAD = 86400.0
"""s by which samples from another relay may be ahead of the clock: more is a wrong clock, of one of both."""

# Where to look next
HEADINGS = 12
"""Headings that the look-ahead compares."""
LOOK_DEPTHS = 12
"""Depths of the water column over which the gradient is averaged."""
LEG_SAMPLES = 24
"""Samples along the next leg by which the look-ahead judges it."""
APART = 5e3
"""m that the end of the next leg keeps from other gliders and from the ends of theirs: half the spread of a
Gaussian on a box of 60 km."""

USUAL_LEG = 3 * 3600.0
"""s until the next surfacing of a glider of which it is not known."""
NO_MORE_AT_SEA = 86400.0
"""s since the last surfacing of another glider after which it is not reckoned with."""

# The flow
FLOW_SCALE = 60e3
"""m by which distances count as much as `SEA_MEMORY` in time, and over which tides differ by `gradient`."""
NEAR = 60e3
"""m: neighbours within this tell of a glider's flow."""
FLOW_WINDOW = 10 * 86400.0
"""s before a dive from which currents are taken: five memories, and 19 periods of M2."""
SMALL, SMALL_REACH = 0.015, 6e3
"""m/s, a component, and m: flow that is too small for two gliders to meet, in every sea. Without it smooth
eddies know the flow at a glider better than they can: of 36 healthy gliders in simulated seas one was taken
for faulty with a ratio of 31, with it none above 4."""
SEA_MEMORY = 48 * 3600.0
"""s in which eddies forget: 30 to 120 h in the open sea, a day or two on shelves under wind."""
INERTIAL_MEMORY, INERTIAL_REACH = 72 * 3600.0, 100e3
"""s, m in which near-inertial motion forgets and over which it is alike (Alford et al. 2016: days, and 100
km)."""
DAC_NOISE = 0.02
"""m/s, a component: error of a depth-averaged current of a healthy glider, where it is not known."""
PROVISIONAL_DOUBT, UNKNOWN_DOUBT, FAULTY_DOUBT = 2.0, 3.0, 10.0
"""Factors on that error: of a current that is provisional; of a dive of which nothing could be said, so that
it weighs a ninth; of a glider that likely has a fault, which weighs next to nothing."""
IN_A_ROW = 2
"""Surfacings in a row at which the neighbours show a fault before it counts."""
SEA_EDDIES = (0.03, 0.06, 0.12, 0.3)
"""m/s, a component: eddies that are tried, from a slack sea to the jet of a front; each explanation of the
currents takes the sea that suits it best."""
SEA_REACHES = (20e3, 40e3, 80e3)
"""m: reaches of eddies that are tried, from submesoscale to boundary currents."""
SEA_GRADIENTS = (0.02, 0.06, 0.2)
"""m/s over `FLOW_SCALE`: by how much tides differ in space that is tried, from the open sea to shelf seas
with M2 of 0.7 m/s, which goes 20 degrees on in 60 km of 50 m of water."""
OWN_WATER = 0.1
"""m/s, a component: flow at one glider that no other meets, as at a front."""
WATER_CLEARER = 35.0
"""By so much the ratio of a fault has to be above that of such water, which follows any current and pays for
it on all dives: in simulated seas it was 23 to 26 for a sound glider in a jet that looked like one with a
compass 0.6 rad off, and 42 to 100 for faults after four sound days."""
SEA_INERTIAL = (0.03, 0.15)
"""m/s, a component: near-inertial motion that is tried, depth-averaged: calm, and after a storm."""
SEA_NOISES = (0.008, 0.02)
"""m/s, a component: errors of depth-averaged currents that are tried: by the fixes alone over 3 h, and by
compass and flight that wander."""
SEA_MEAN, SEA_TIDE = 0.3, 0.3
"""m/s, a component: mean flow, and a cosine or sine part of a tide, that all gliders of a fleet share: wide,
not wrong."""
CHECK_WINDOW = 4 * 86400.0
"""s: dives of this long are compared with those of the neighbours."""
LEAST_DIVES, MOST_DIVES = 4, 16
"""Dives since a fault that are needed to tell it, and that are looked back over: at 3 h, half a day and two
days."""
LEAST_LOSS, LEAST_TURN = 0.2, 0.2
"""Part of the speed, and rad: smaller faults are not told by the fleet. A healthy glider's current is 5 to 10
% of its speed off, and eddies that nobody else meets look like as much again."""
MOST_LOSS = 1.2
"""Part of the speed: what looks like a larger loss is none: it would fly backwards."""
USUAL_SLIP, USUAL_TURN = 0.08, 0.05
"""Part of the speed, and rad: by how much the current of a healthy glider is off, all the time: the angle of
attack that is not allowed for on board, and how the compass is mounted."""
SURE, CLEARER, SHARED_SURE = 12.0, 6.0, 40.0
"""Twice the log likelihood ratio of a fault to none, and to the likeliest fault of another glider, at which
it is told; and the first for an error that all share: where all fly one way a current looks alike."""
BETWEEN_DIVES = 6 * 3600.0
"""s at the surface after which a dive is not taken to begin where the one before ended."""
DOUBTED_SPEED = 0.15
"""m/s: error, along its course, of the current of a glider that flies out of its range."""
MOST_ONE_WAY = 0.5
"""Length of the mean course of a fleet above which an error that all share is not told from a current: all go
one way. With a front, eight sound gliders on one course had a ratio above 40."""
MOST_CURRENTS = 200
"""Currents that are taken at most: for the flow the nearest in space and time, for a comparison the latest.
The rest would only cost time."""
