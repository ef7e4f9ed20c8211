"""What one dive measures of speed and flow, how well, and as linear functions of the joint state. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median

import numpy as np

from gliderwatch.estimation.kinematic_speed import KinematicSpeed
from gliderwatch.model import Array, Dive, Fix, readonly
from gliderwatch.navigation.geodesy import displacement
from gliderwatch.sea.gauss_markov import FlowParams, mean_flow

# ----------------------------------------
# What one dive measures of speed and flow, and how well. Pure.
#
# Over the interval between its two fixes a glider moves with the ground velocity g = F + V h, where F is the
# mean flow, V the horizontal speed through the water and h the mean of the heading vector (shorter than
# 1 where it turned or drifted at the surface). On board it reckons with a speed W of its own, from depth
# rate and pitch, and reports what is left as depth-averaged current: c = g - W h.

GPS = 5.0
"""Metres, a component: error of a fix."""
SURFACE_FLOW = 0.15
"""m/s, a component: by how much the drift at the surface differs from the flow below."""
CONTROL = 0.1
"""rad: how much a glider swings about its course."""
COMPASS = 0.02
"""rad: how well the headings in the files are those that the glider reckoned with; mostly declination."""
COMMANDED = 0.08
"""rad: how far the mean of the commanded headings of a dive is from that of measured ones, where only they
are sent: 0.04 to 0.09 on the four missions that have both (robust standard deviations)."""
UNEVEN = 0.05
"""Part of the speed by which dives and climbs differ: matters where the heading differs between them too."""
UNSEEN = 0.5
"""Usual error of the mean heading vector over hours of which no data have come."""
REPORTED, PROVISIONAL = 0.006, 0.02
"""m/s, a component: error of a current as reckoning, corrected and as first published."""
DRAG_BY_LIFT = 0.02
"""C_D0 / a of a Slocum: parasite drag by slope of the lift (Merckelbach et al. 2019: 0.15 and 7.5 1/rad)."""
USUAL_PITCH, FLATTEST, STEEPEST = 0.45, 0.3, 1.0
"""rad: pitch of a glide where none is reported, and between which pitches the formula for slip is used."""
NEW_AFTER, CARRIED = 3 * 86400.0, 3.0
"""Seconds between two dives, or m/s between their fixes, after which sea and glider are unknown again: the
glider was recovered, or carried faster than any drift."""
GAP, GAP_IN_CADENCES = 600.0, 2.5
"""A gap between headings is one where it is longer than this in seconds, and in usual spacings."""


@dataclass(frozen=True, slots=True)
class Observation:
    """The numbers of one dive.

    ``start``, ``end`` (s) of the interval between the fixes; ``ground`` g (m/s, (2,)) with covariance
    ``ground_cov`` ((2, 2)) but for what is wrong with the heading; ``heading`` h ((2,)) with covariance
    ``heading_cov`` ((2, 2)); ``current`` c (m/s, (2,), None: not reported) with standard error
    ``current_sigma`` a component; ``slip`` the part of W that an angle of attack takes, by physics;
    ``unseen`` the part of the flight within gaps between headings.
    """

    start: float
    end: float
    ground: Array
    ground_cov: Array
    heading: Array
    heading_cov: Array
    current: Array | None
    current_sigma: float
    slip: float
    unseen: float

    @property
    def steadiness(self) -> float:
        """Length of the mean heading vector, 0 to 1."""
        return float(np.hypot(*self.heading))

    @property
    def rest(self) -> Array | None:
        """g - c (m/s, (2,)): the way through the water as the glider believes it."""
        return None if self.current is None else self.ground - self.current

    def own_speed(self) -> tuple[float, float] | None:
        """W along the heading and its standard error (m/s); None without a current or a heading."""
        rest, length = self.rest, self.steadiness
        if rest is None or length < 0.1:
            return None
        along = self.heading / length
        speed = float(rest @ along) / length
        return speed, math.sqrt(float(along @ self.rest_cov(speed) @ along)) / length

    def across(self, speed: float) -> tuple[float, float] | None:
        """What of g - c is across the heading, left positive, and its standard error (m/s) at that W."""
        rest, length = self.rest, self.steadiness
        if rest is None or length < 1e-3:
            return None
        aside = np.array([-self.heading[1], self.heading[0]]) / length
        return float(rest @ aside), math.sqrt(float(aside @ self.rest_cov(speed) @ aside))

    def rest_cov(self, speed: float) -> Array:
        """Covariance of g - c (m2/s2, (2, 2)) at that W."""
        return np.asarray(self.ground_cov + speed**2 * self.heading_cov + self.current_sigma**2 * np.eye(2))


def observe(dive: Dive) -> Observation:
    """The observation of a dive. Raises ValueError where it has no track."""
    if dive.track is None:
        raise ValueError(f"the dive at {dive.t_dive:.0f} has no track: {dive.reason}")
    track = dive.track
    dt = np.diff(track.t)
    interval = float(dt.sum())
    flying = np.any(track.heading != 0, axis=1)
    share = dt[flying] / interval
    flown, vectors = float(share.sum()), track.heading[flying]
    current = dive.current
    error = REPORTED if current is None or current.final else PROVISIONAL
    return Observation(
        start=float(track.t[0]),
        end=float(track.t[-1]),
        ground=readonly(track.x[-1] / interval),
        ground_cov=readonly((2 * (GPS / interval) ** 2 + ((1 - flown) * SURFACE_FLOW) ** 2) * np.eye(2)),
        heading=readonly(share @ vectors),
        heading_cov=readonly(_heading_cov(vectors, share, dive, interval)),
        current=None if current is None else readonly([current.u, current.v]),
        current_sigma=math.hypot(error, 2 * GPS / interval),
        slip=_slip(dive),
        unseen=_unseen(dt[flying]),
    )


def are_apart(end: Fix, start: Fix) -> bool:
    """Whether the fix that ended one dive and the one that began the next belong to different deployments.

    >>> are_apart(Fix(0.0, 30.0, -80.0), Fix(3600.0, 30.0, -80.01))
    False
    """
    gap = start.t - end.t
    moved = float(np.hypot(*displacement(start.lat, start.lon, end.lat, end.lon)))
    return gap > NEW_AFTER or moved > CARRIED * max(gap, 600.0)


def _heading_cov(vectors: Array, share: Array, dive: Dive, interval: float) -> Array:
    """Covariance of the mean heading vector: few samples, compass, uneven speed, hours not seen.

    Differences of successive vectors tell how far a glider swings between samples; a steady turn does not
    count. A vector of the track is the mean of two samples: its differences have half their variance.
    """
    if not len(share):
        return UNSEEN**2 * np.eye(2)
    flown = float(share.sum())
    mean = share @ vectors / flown
    steps = np.diff(vectors, axis=0)
    swings = 2 * (steps.T @ steps + CONTROL**2 * np.eye(2)) / (len(steps) + 1)
    aside = np.array([-mean[1], mean[0]])
    off = math.hypot(COMPASS, COMMANDED * dive.features.heading_commanded)
    turned = (off * flown) ** 2 * np.outer(aside, aside)
    uneven = (UNEVEN * flown) ** 2 * max(0.0, 1 - float(mean @ mean)) / 2
    # by way of hours, which keeps the last bit of every estimate of the missions on record
    missing = UNSEEN * (dive.features.unobserved / 3600) * 3600 / interval
    return np.asarray(swings * float(share @ share) + turned + (uneven + missing**2) * np.eye(2))


def _slip(dive: Dive) -> float:
    """The part of depth rate over tan(pitch) that is lost to the angle of attack alpha.

    In a steady glide alpha = C_D / (a tan(theta + alpha)) (Merckelbach et al. 2010), and
    1 - tan(theta) / tan(theta + alpha) = alpha / (sin theta cos theta) to first order.
    """
    both = (dive.features.pitch_dive, dive.features.pitch_climb)
    pitches = [abs(pitch) for pitch in both if pitch is not None]
    return slip_at(sum(pitches) / len(pitches) if pitches else USUAL_PITCH)


def slip_at(pitch: float) -> float:
    """The part of W that the angle of attack takes at a pitch (rad)."""
    return DRAG_BY_LIFT / math.sin(min(max(pitch, FLATTEST), STEEPEST)) ** 2


def _unseen(dt: Array) -> float:
    """The part of a flight within gaps between headings, of the intervals ``dt`` (s) between them."""
    if not len(dt):
        return 1.0
    gaps = dt > max(GAP, GAP_IN_CADENCES * median(dt.tolist()))
    return float(dt[gaps].sum() / dt.sum())


# ----------------------------------------
# The measurements of a dive as linear functions of the joint state. Pure.
#
# The state ends with the own speed W, slip and side; before them is the flow. See `joint` for the equations.

OWN, SLIP, SIDE = -3, -2, -1
"""Places in the state of W (m/s), and of slip and side (parts of W)."""


@dataclass(frozen=True, slots=True)
class Linear:
    """Measurements of one dive, linear in the n numbers of the state.

    ``rows`` ((m, n)), ``innovation`` ((m,)) at the predicted state, ``noise`` ((m, m)); the ground
    velocity comes first (2), then the current (2) if there is one.
    """

    rows: Array
    innovation: Array
    noise: Array

    def first(self, m: int) -> Linear:
        """The first ``m`` of the measurements."""
        return Linear(self.rows[:m], self.innovation[:m], self.noise[:m, :m])

    def with_own(self, x: Array, told: KinematicSpeed) -> Linear:
        """These and W as ``told``, at the state ``x`` ((n,))."""
        row = np.zeros((1, len(x)))
        row[0, OWN] = 1.0
        m = len(self.rows)
        noise = np.zeros((m + 1, m + 1))
        noise[:m, :m], noise[m, m] = self.noise, told.sigma**2
        innovation = np.append(self.innovation, told.speed - x[OWN])
        return Linear(np.concatenate([self.rows, row]), innovation, noise)


@dataclass(frozen=True, slots=True)
class Guess:
    """About what the measurements are linear: ``own`` speed W (m/s), the ``slip`` that is known of beside
    that of the state (part of W), and the standard error ``slip_sigma`` of that on this dive."""

    own: float
    slip: float
    slip_sigma: float


def measure(seen: Observation, x: Array, guess: Guess, doubt: float, flow: FlowParams) -> Linear:
    """The measurements of a dive at the predicted state ``x`` ((n,)).

    ``doubt`` is a factor on the variances of the measurements. The error of slip on this dive is one of
    ground velocity and current alike.
    """
    h, own = seen.heading, guess.own
    aside = np.array([-h[1], h[0]])
    rows = np.zeros((4, flow.size + 3))
    rows[:2, : flow.size] = rows[2:, : flow.size] = mean_flow(seen.start, seen.end, flow)
    rows[2:, OWN] = -(guess.slip + x[SLIP]) * h - x[SIDE] * aside
    rows[:2, OWN] = h + rows[2:, OWN]
    rows[:2, SLIP] = rows[2:, SLIP] = -own * h
    rows[:2, SIDE] = rows[2:, SIDE] = -own * aside
    noise = np.zeros((4, 4))
    noise[:2, :2] = seen.ground_cov + own**2 * seen.heading_cov
    noise[2:, 2:] = seen.current_sigma**2 * np.eye(2)
    along = np.tile(own * guess.slip_sigma * h, 2)
    # the products of W with slip and side are in two columns each: take them out once
    once = np.tile(own * (x[SLIP] * h + x[SIDE] * aside), 2)
    measured = np.concatenate([seen.ground, seen.current if seen.current is not None else np.zeros(2)])
    linear = Linear(rows, measured - rows @ x - once, doubt * noise + np.outer(along, along))
    return linear if seen.current is not None else linear.first(2)


def drag_slip(speed: float, usual: float | None) -> tuple[float, float]:
    """The slip that drag adds on a glider slower than usual (m/s): mean and standard error, parts of W.

    More drag at the same pitch needs more lift, so a larger angle of attack. With the flight model of
    Merckelbach et al. (2019) slip rises by 1.5 (1 - speed / usual)^2 where drag alone slows a Slocum,
    and not at all where it lacks buoyancy. Which of the two it is, is not known here.

    >>> drag_slip(0.25, 0.25), drag_slip(0.1, None)
    ((0.0, 0.0), (0.0, 0.0))
    """
    if usual is None or usual <= 0:
        return 0.0, 0.0
    lost = min(max(1 - speed / usual, 0.0), 1.0)
    return 0.9 * lost**2, 0.45 * lost**2
