"""What one dive measures of speed and flow, how well, and as linear functions of the joint state. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from statistics import median

import numpy as np

from gliderwatch.estimation.constants import (
    ASSUMED_ERROR,
    ASSUMED_LENGTH,
    CARRIED,
    CARRIED_FOR,
    COMMANDED_ERROR,
    COMPASS_ERROR,
    DRAG_BY_LIFT,
    DRAG_SLIP,
    FASTEST,
    FLATTEST_GLIDE,
    GAP,
    GAP_IN_CADENCES,
    GPS_ERROR,
    INDUCED_BY_LIFT,
    NEW_AFTER,
    PROVISIONAL,
    RECKONED_ERROR,
    REPORTED,
    SHAPE_ERROR,
    SLOWEST,
    STEEPEST_GLIDE,
    STEERED_ERROR,
    STRAIGHT,
    SURFACE_FLOW,
    SWING,
    THRUST,
    THRUST_ERROR,
    TURNING_ERROR,
    TURNS,
    UNEVEN,
    UNSEEN,
    USUAL_PITCH,
)
from gliderwatch.estimation.kinematic_speed import KinematicSpeed
from gliderwatch.model import Array, Dive, Fix, Track, readonly, replace
from gliderwatch.navigation.geodesy import displacement
from gliderwatch.navigation.track import flown as flying_in

# ----------------------------------------
# What one dive measures of speed and flow, and how well. Pure.
#
# Over the interval between its two fixes a glider moves with the ground velocity g = F + V h, where F is the
# mean flow, V the horizontal speed through the water and h the mean of the heading vector (shorter than
# 1 where it turned or drifted at the surface). On board it reckons with a speed W of its own, from depth
# rate and pitch, and reports what is left as depth-averaged current: c = g - W h.


@dataclass(frozen=True, slots=True)
class Observation:
    """The numbers of one dive.

    ``start``, ``end`` (s) of the interval between the fixes; ``ground`` g (m/s, (2,)) with covariance
    ``ground_cov`` ((2, 2)) but for what is wrong with the heading; ``heading`` h ((2,)) with covariance
    ``heading_cov`` ((2, 2)); ``current`` c (m/s, (2,), None: not reported) with standard error
    ``current_sigma`` a component; ``slip`` the part of W that an angle of attack takes, by physics, and
    ``slip_sigma`` how far it is unsure on this dive; ``thrust`` (m2/s2) is what a thruster adds to the square
    of W, 0 without one; ``turning`` the chance that it turned though its headings say nothing of it;
    ``unseen`` the part of the flight within gaps between headings. ``is_free``: no
    heading was measured, so that its direction is that of g - c and what is across says nothing.
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
    is_free: bool = False
    slip_sigma: float = 0.0
    thrust: float = 0.0
    turning: float = 0.0

    @property
    def steadiness(self) -> float:
        """Length of the mean heading vector, 0 to 1."""
        return math.hypot(*self.heading.tolist())

    @property
    def rest(self) -> Array | None:
        """g - c (m/s, (2,)): the way through the water as the glider believes it."""
        return None if self.current is None else self.ground - self.current

    def own_speed(self) -> tuple[float, float] | None:
        """W along the heading and its standard error (m/s); None without a current or a heading."""
        rest, length = self.rest, self.steadiness
        if rest is None or length < 0.1:
            return None
        (u, v), (east, north) = rest.tolist(), (self.heading / length).tolist()
        speed = (u * east + v * north) / length
        return speed, math.sqrt(self._rest_var(speed, east, north)) / length

    def across(self, speed: float) -> tuple[float, float] | None:
        """What of g - c is across the heading, left positive, and its standard error (m/s) at that W."""
        rest, length = self.rest, self.steadiness
        if rest is None or length < 1e-3 or self.is_free:
            return None
        (u, v), (x, y) = rest.tolist(), (self.heading / length).tolist()
        return v * x - u * y, math.sqrt(self._rest_var(speed, -y, x))

    def _rest_var(self, speed: float, east: float, north: float) -> float:
        """Variance (m2/s2) of g - c along a unit vector at that W."""
        (a, b), (c, d) = (self.ground_cov + speed**2 * self.heading_cov).tolist()
        along = (east * a + north * c) * east + (east * b + north * d) * north
        return float(along) + self.current_sigma**2


def observe(dive: Dive) -> Observation:
    """The observation of a dive. Raises ValueError where it has no track."""
    if dive.track is None:
        raise ValueError(f"the dive at {dive.t_dive:.0f} has no track: {dive.reason}")
    if is_unmeasured(dive):
        return _observed(dive, dive.track)[0]
    seen, interval = _by_compass(replace(dive, current=None))
    if dive.current is None:
        return seen
    error = REPORTED if dive.current.final else PROVISIONAL
    return replace(
        seen,
        current=readonly([dive.current.u, dive.current.v]),
        current_sigma=math.hypot(error, 2 * GPS_ERROR / interval),
    )


@lru_cache(maxsize=64)  # a dive comes again when its current is corrected
def _by_compass(dive: Dive) -> tuple[Observation, float]:
    """What of a dive does not depend on its current, where its compass tells the headings."""
    assert dive.track is not None
    return _observed(dive, dive.track)


def _observed(dive: Dive, track: Track) -> tuple[Observation, float]:
    """The observation of a dive, and the time (s) between its fixes."""
    dt = np.diff(track.t)
    interval = float(dt.sum())
    flying = flying_in(track)
    late = _not_logged(dive, dt[flying])
    share = dt[flying] / interval * (1 + late / max(float(dt[flying].sum()), 1.0))
    flown, vectors = float(share.sum()), track.heading[flying]
    current = dive.current
    ground = track.x[-1] / interval
    velocities = (np.diff(track.x, axis=0) / np.maximum(dt, 1e-3)[:, None])[flying]
    vectors, spread = _directed(vectors, velocities, share, dive)
    error = REPORTED if current is None or current.final else PROVISIONAL
    heading = share @ vectors
    along = heading / max(float(np.hypot(*heading)), 1e-6)
    pitch = _pitch(dive)
    seen = Observation(
        start=float(track.t[0]),
        end=float(track.t[-1]),
        ground=readonly(ground),
        ground_cov=readonly(
            (2 * (GPS_ERROR / interval) ** 2 + ((1 - flown) * SURFACE_FLOW) ** 2) * np.eye(2)
        ),
        heading=readonly(heading),
        heading_cov=readonly(
            (
                _missing(dive, interval, flown)
                if _is_free(dive)
                else _heading_cov(vectors, share, dive, interval)
            )
            + spread
            + (late / interval) ** 2 / 3 * np.outer(along, along)
        ),
        is_free=_is_free(dive),
        turning=TURNS if _is_free(dive) and dive.features.heading_commanded > 0 else 0.0,
        current=None if current is None else readonly([current.u, current.v]),
        current_sigma=math.hypot(error, 2 * GPS_ERROR / interval),
        slip=slip_at(pitch),
        thrust=THRUST * (dive.features.thruster or 0.0) * math.cos(pitch) ** 2,
        unseen=_unseen(dt[flying]),
    )
    return seen, interval


def _not_logged(dive: Dive, dt: Array) -> float:
    """Seconds of a dive before its first sample under water and after its last, of which nothing tells.

    Both lie within a spacing ``dt`` (s, (k,)) of samples, and within the time to the fix: half of that on
    average, with a third of its square as the variance.
    """
    if dive.start is None or dive.end is None or not len(dt):
        return 0.0
    usual = median(dt.tolist())
    gaps = (dive.t_dive - dive.start.t, dive.end.t - dive.t_surface)
    return float(sum(min(max(gap, 0.0), usual) / 2 for gap in gaps))


def are_apart(end: Fix, start: Fix) -> bool:
    """Whether the fix that ended one dive and the one that began the next belong to different deployments.

    >>> are_apart(Fix(0.0, 30.0, -80.0), Fix(3600.0, 30.0, -80.01))
    False
    """
    gap = start.t - end.t
    moved = float(np.hypot(*displacement(start.lat, start.lon, end.lat, end.lon)))
    return gap > NEW_AFTER or moved > CARRIED * max(gap, CARRIED_FOR)


def _is_free(dive: Dive) -> bool:
    """Whether the direction of a dive's heading is that which its current leaves."""
    return dive.current is not None and is_unmeasured(dive)


def is_unmeasured(dive: Dive) -> bool:
    """Whether the headings of a dive are not those of its compass."""
    features = dive.features
    return features.heading_reckoned or features.heading_commanded > 0 or features.heading_assumed


def _directed(vectors: Array, velocities: Array, share: Array, dive: Dive) -> tuple[Array, Array]:
    """The heading vectors where none were measured, and what that adds to the covariance of their mean.

    The glider reckons with its compass, so that g - c = W h holds with the heading that nobody sent. Its
    dead-reckoned way, drawn to the fixes, has the ``velocities`` (m/s, (k, 2)) over ground: less the current
    these are W times the headings, whatever current the glider had put into its way. With nothing at all the
    course is taken for that of a leg.
    """
    none = np.zeros((2, 2))
    reckoned, commanded = dive.features.heading_reckoned, dive.features.heading_commanded > 0
    if not len(vectors) or not is_unmeasured(dive):
        return vectors, none
    flown = float(share.sum())
    if dive.current is None:
        # the way has the current in it, the course need not be flown as commanded
        error = COMMANDED_ERROR if commanded else RECKONED_ERROR if reckoned else 1.0
        return vectors, np.asarray((error * flown) ** 2 * np.eye(2))
    through = velocities - np.array([dive.current.u, dive.current.v])
    mean = share @ through / flown
    rest = float(np.hypot(*mean))
    if rest < 1e-3:
        return vectors, np.asarray(flown**2 * np.eye(2))
    along = mean / rest
    seen = float(np.hypot(*(share @ vectors))) / flown
    if reckoned:
        speeds = np.hypot(*through.T)
        length, error = rest / max(float(share @ speeds) / flown, rest), SHAPE_ERROR
    elif commanded:
        length, error = seen, STEERED_ERROR if seen > STRAIGHT else TURNING_ERROR
    else:
        length, error = ASSUMED_LENGTH * seen, ASSUMED_ERROR if seen > STRAIGHT else TURNING_ERROR
    error *= flown
    return np.tile(length * along, (len(vectors), 1)), np.asarray(error**2 * np.outer(along, along))


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
    swings = 2 * (steps.T @ steps + SWING**2 * np.eye(2)) / (len(steps) + 1)
    aside = np.array([-mean[1], mean[0]])
    turned = (COMPASS_ERROR * flown) ** 2 * np.outer(aside, aside)
    uneven = (UNEVEN * flown) ** 2 * max(0.0, 1 - float(mean @ mean)) / 2
    return np.asarray(
        swings * float(share @ share) + turned + uneven * np.eye(2) + _missing(dive, interval, 0.0)
    )


def _missing(dive: Dive, interval: float, flown: float) -> Array:
    """Covariance of the mean heading vector by hours of which no data came, and by the compass on a part
    ``flown``."""
    missing = UNSEEN * (dive.features.unobserved / 3600) * 3600 / interval
    return np.asarray((missing**2 + (COMPASS_ERROR * flown) ** 2) * np.eye(2))


def _pitch(dive: Dive) -> float:
    """The mean pitch (rad) of dives and climbs, without sign."""
    both = (dive.features.pitch_dive, dive.features.pitch_climb)
    pitches = [abs(pitch) for pitch in both if pitch is not None]
    return sum(pitches) / len(pitches) if pitches else USUAL_PITCH


def slip_at(pitch: float) -> float:
    """The part of depth rate over tan(pitch) that is lost to the angle of attack alpha, at a pitch (rad).

    In a steady glide alpha = (C_D0 + C_D1 alpha^2) / (a tan(theta + alpha)) (Merckelbach et al. 2010), and
    what is left of it is tan(theta) / tan(theta + alpha).
    """
    theta = min(max(pitch, FLATTEST_GLIDE), STEEPEST_GLIDE)
    attack, before = 0.0, math.inf
    while abs(attack - before) > 1e-6:
        attack, before = (DRAG_BY_LIFT + INDUCED_BY_LIFT * attack**2) / math.tan(theta + attack), attack
    return 1 - math.tan(theta) / math.tan(theta + attack)


def with_thrust(seen: Observation, own: float) -> Observation:
    """The numbers of a dive at a speed W ``own`` (m/s), with the slip that is left where a thruster drove.

    Lift balances buoyancy, which is what it was, at a higher speed, so that the angle of attack falls with
    the square of the speed: to the part of W squared that buoyancy alone would give.
    """
    if seen.thrust <= 0:
        return seen
    by_buoyancy = 1 - min(seen.thrust / max(own, SLOWEST) ** 2, 1.0)
    return replace(seen, slip=by_buoyancy * seen.slip, slip_sigma=THRUST_ERROR * seen.slip)


def _unseen(dt: Array) -> float:
    """The part of a flight within gaps between headings, of the intervals ``dt`` (s) between them."""
    if not len(dt):
        return 1.0
    gaps = dt > max(GAP, GAP_IN_CADENCES * median(dt.tolist()))
    return float(dt[gaps].sum() / dt.sum())


# ----------------------------------------
# What one dive measures, as an explicit function of the state. Pure.
#
# Of the state a dive shows five numbers: the mean flow F over it (east, north), the speed W that the glider
# reckons with, and slip s and side d, by which its real way through the water differs from that. With h the
# mean heading vector and h' that vector turned left it measures
#
#     g = F + W ((1 - s) h - d h')        ground velocity
#     c = F - W (s h + d h')              depth-averaged current, so that g - c = W h
#     w = W                               speed by depth rate and pitch, or by the glider's own mean
#
# each only where it is there. s is the slip of physics, that of drag, and the slip in the state.

OWN, SLIP, SIDE = -3, -2, -1
"""Places in the state of W (m/s), and of slip and side (parts of W)."""
SHOWN = 5
"""How many numbers of the state a dive shows: those at its end."""


@dataclass(frozen=True, slots=True)
class Slipping:
    """What is known of slip beside the state: of ``physics`` (part of W), ``noise`` of it on one dive, and
    the ``usual`` speed through the water (m/s, None: not known) below which drag adds to it."""

    physics: float
    noise: float
    usual: float | None


@dataclass(frozen=True, slots=True)
class Measured:
    """The measurements of a dive: ``values`` ((m,)): g (2), c (2, where there is ``current``), w (1, where
    there is a ``kinematic`` speed)."""

    seen: Observation
    kinematic: KinematicSpeed | None
    scale: float
    slipping: Slipping

    @property
    def has_current(self) -> bool:
        """Whether a current was reported."""
        return self.seen.current is not None

    @property
    def values(self) -> Array:
        """The numbers measured, (m,)."""
        parts = [self.seen.ground]
        if self.seen.current is not None:
            parts.append(self.seen.current)
        if self.kinematic is not None:
            parts.append(np.array([self.kinematic.speed]))
        return np.concatenate(parts)


def drag_slip(speed: Array, usual: float | None) -> Array:
    """The slip that drag adds on a glider slower than usual (m/s), parts of W; half of it is its standard
    error.

    More drag at the same pitch needs more lift, so a larger angle of attack. With the flight model of
    Merckelbach et al. (2019) slip rises by 1.5 (1 - speed / usual)^2 where drag alone slows a Slocum,
    and not at all where it lacks buoyancy. Which of the two it is, is not known here.

    >>> drag_slip(np.array([0.25]), 0.25).tolist(), drag_slip(np.array([0.1]), None).tolist()
    ([0.0], [0.0])
    """
    if usual is None or usual <= 0:
        return np.zeros_like(speed)
    return np.asarray(DRAG_SLIP * _clipped(1 - speed / usual, 0.0, 1.0) ** 2)


def _clipped(values: Array, low: float, high: float) -> Array:
    """As `np.clip`, which takes five times as long for a few numbers."""
    return np.asarray(np.minimum(np.maximum(values, low), high))


def slip_of(x: Array, slipping: Slipping) -> tuple[Array, Array]:
    """All of slip, and its standard error on one dive, at states ``x`` ((k, 5)): (k,) each."""
    return _slip_at_speed(_clipped(x[:, OWN], SLOWEST, FASTEST), x[:, SLIP], slipping)


def _slip_at_speed(own: Array, slip: Array, slipping: Slipping) -> tuple[Array, Array]:
    """The same at speeds W (m/s, (k,)) and values of the slip in the state."""
    drag = drag_slip(own * (1 - slipping.physics - slip), slipping.usual)
    return slipping.physics + drag + slip, np.hypot(drag / 2, slipping.noise)


_SLOPE = readonly([[1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, 1, 0, 0]])
"""What is always so of the slope of h: rows g, c, w; columns F, W, s, d."""


_FLOW = np.array([0, 1, 0, 1])
"""Places of F in the state for g and for c."""


def expected(x: Array, measured: Measured) -> tuple[Array, Array, Array]:
    """h(x), its slope and the noise at states ``x`` ((k, 5)): (k, m), (k, m, 5), (k, m, m)."""
    seen, k = measured.seen, len(x)
    east, north = seen.heading.tolist()
    # of g, then of c: what goes with W alone is in g only
    h, aside = np.array([east, north, east, north]), np.array([-north, east, -north, east])
    full = np.array([east, north, 0.0, 0.0])
    own = _clipped(x[:, OWN], SLOWEST, FASTEST)
    slip, slip_sigma = _slip_at_speed(own, x[:, SLIP], measured.slipping)
    speed = own[:, None]
    lost = slip[:, None] * h + x[:, SIDE, None] * aside
    found, slope, noise = np.empty((k, 5)), np.empty((k, 5, SHOWN)), np.zeros((k, 5, 5))
    found[:, :4] = x[:, _FLOW] + speed * full - speed * lost
    found[:, 4] = own
    slope[:] = _SLOPE
    slope[:, :4, OWN] = full - lost
    slope[:, :4, SLIP] = -speed * h
    slope[:, :4, SIDE] = -speed * aside
    noise[:, :2, :2] = measured.scale * (seen.ground_cov + (speed**2)[:, :, None] * seen.heading_cov)
    noise[:, 2, 2] = noise[:, 3, 3] = measured.scale * seen.current_sigma**2
    along = (own * slip_sigma)[:, None] * h
    noise[:, :4, :4] += along[:, :, None] * along[:, None, :]
    if measured.kinematic is not None:
        noise[:, 4, 4] = measured.kinematic.sigma**2
    if measured.has_current:
        m = 4 if measured.kinematic is None else 5
        return found[:, :m], slope[:, :m], noise[:, :m, :m]
    there = [0, 1] if measured.kinematic is None else [0, 1, 4]
    return found[:, there], slope[:, there], noise[:, there][:, :, there]
