"""The flow at a glider from the depth-averaged currents of the gliders about it. Pure.

What one glider cannot know: a reference for its flow that knows nothing of its own dead reckoning. All
currents of a fleet are one Gaussian vector (`Sea`): eddies that turn and forget, a mean flow, tides that
differ in space, near-inertial motion. That is the basis of 003 (`tests/streamfunction.py`), its Gaussians
infinitely dense, which leaves a covariance in closed form. The flow on a dive given the currents is a
regression: the same as a Kalman filter and smoother over all of them, whatever order they came in. So there
is no state: currents are an input, and the dive's own glider is left out of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from gliderwatch.fleet.constants import (
    DAC_NOISE,
    FLOW_SCALE,
    FLOW_WINDOW,
    INERTIAL_MEMORY,
    INERTIAL_REACH,
    MOST_CURRENTS,
    NEAR,
    SEA_MEAN,
    SEA_MEMORY,
    SEA_TIDE,
    SMALL,
    SMALL_REACH,
    USUAL_SLIP,
    USUAL_TURN,
)
from gliderwatch.model import Array, Fix, readonly
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.sea.gauss_markov import EARTH
from gliderwatch.sea.tides import Constituent

TIDES = (Constituent.M2, Constituent.S2, Constituent.N2, Constituent.K1, Constituent.O1)


@dataclass(frozen=True, slots=True)
class Sea:
    """Usual sizes (m/s, a component) of the parts of the flow.

    ``eddy`` of eddies, which are alike within the ``reach`` (m); ``gradient`` by how much a part of a tide
    differs over `FLOW_SCALE`; ``inertial`` of near-inertial motion. ``noise`` is the error of the
    depth-averaged current of a healthy glider on one dive.
    """

    eddy: float = 0.06
    reach: float = 20e3
    gradient: float = 0.06
    inertial: float = 0.03
    noise: float = DAC_NOISE


@dataclass(frozen=True, slots=True)
class DiveCurrent:
    """The depth-averaged current of a dive between two fixes: ``u``, ``v`` (m/s, true north).

    ``doubt`` is the factor on its usual error; ``course`` (unit vector east, north; zeros: none) that of the
    glider through the water, ``speed`` (m/s) what it takes for its own, and ``along`` (m/s) the error along
    the course where that is not sure.
    """

    glider: str
    start: Fix
    end: Fix
    u: float
    v: float
    doubt: float = 1.0
    course: tuple[float, float] = (0.0, 0.0)
    along: float = 0.0
    speed: float = 0.0


class Fault(StrEnum):
    """What may be wrong with a glider that takes what it loses for a current."""

    LOSS = "loss"
    TURN = "turn"


@dataclass(frozen=True, slots=True)
class FleetFlow:
    """The mean flow on a dive by what other gliders measured: ``flow`` (m/s, (2,)) and its ``cov`` ((2, 2)).

    ``gliders`` are those it is from, ``nearest`` (m) the distance to the next of them.
    """

    flow: Array
    cov: Array
    gliders: tuple[str, ...]
    nearest: float


# ----------------------------------------
# The covariance of the flow on dives.


@dataclass(frozen=True, slots=True)
class Dives:
    """Dives between fixes: their ``middle`` ((n, 2), m east and north of the origin), its time ``t`` (s,
    after that of the origin) and how long they ``took`` (s)."""

    middle: Array
    t: Array
    took: Array


def dives_between(places: Sequence[tuple[Fix, Fix]], origin: Fix) -> Dives:
    """Dives by the fixes before and after them."""
    a, b = _plane([each[0] for each in places], origin), _plane([each[1] for each in places], origin)
    t0, t1 = (np.array([each[k].t for each in places]) - origin.t for k in range(2))
    return Dives((a + b) / 2, (t0 + t1) / 2, t1 - t0)


class FlowCovariance:
    """Covariance of the mean flow on two sets of dives at a latitude (degrees), in any sea."""

    def __init__(self, a: Dives, b: Dives, lat: float) -> None:
        self._a, self._b = a, b
        self._frequency = 2 * EARTH * math.sin(math.radians(lat))
        self._apart = a.middle[:, None] - b.middle
        self._later = a.t[:, None] - b.t
        self._square = np.square(self._apart).sum(-1)
        self._eddies = dict[float, Array]()

    def of(self, sea: Sea) -> Array:
        """The covariance (m2/s2, (2 n, 2 m): u, v of each in turn)."""
        if sea.reach not in self._eddies:
            self._eddies[sea.reach] = self._turning(sea.reach)
        tides = SEA_TIDE**2 + sea.gradient**2 * self._uneven
        out = sea.eddy**2 * self._eddies[sea.reach] + sea.inertial**2 * self._inertial
        same = SEA_MEAN**2 + tides * self._waves + SMALL**2 * self._small
        out[::2, ::2] += same
        out[1::2, 1::2] += same
        return np.asarray(out)

    def _turning(self, reach: float) -> Array:
        """Eddies of unit size: those of a streamfunction, so that no water comes from nowhere."""
        x, y = self._apart[..., 0] / reach, self._apart[..., 1] / reach
        alike = np.exp(-self._square / (2 * reach**2) - np.abs(self._later) / SEA_MEMORY)
        both = alike * x * y
        return _woven(alike * (1 - y**2), both, both, alike * (1 - x**2))

    @cached_property
    def _small(self) -> Array:
        """What is too small for two gliders to meet, of unit size."""
        near = np.exp(-self._square / (2 * SMALL_REACH**2) - np.abs(self._later) / SEA_MEMORY)
        return np.asarray(near)

    @cached_property
    def _inertial(self) -> Array:
        """Near-inertial motion of unit size: it turns clockwise in the north, and forgets."""
        means = [np.sinc(self._frequency * each.took / (2 * np.pi)) for each in (self._a, self._b)]
        alike = np.outer(*means) * np.exp(
            -self._square / (2 * INERTIAL_REACH**2) - np.abs(self._later) / INERTIAL_MEMORY
        )
        angle = self._frequency * self._later
        c, s = alike * np.cos(angle), alike * np.sin(angle)
        return _woven(c, s, -s, c)

    @cached_property
    def _waves(self) -> Array:
        """Tides of unit size: the sum over all of them, averaged along the dives."""
        out = np.zeros_like(self._later)
        for each in TIDES:
            means = [np.sinc(each.omega * dives.took / (2 * np.pi)) for dives in (self._a, self._b)]
            out += np.outer(*means) * np.cos(each.omega * self._later)
        return out

    @cached_property
    def _uneven(self) -> Array:
        """By how much tides differ from the origin's, in squares."""
        return np.asarray(self._a.middle @ self._b.middle.T / FLOW_SCALE**2)


def _woven(uu: Array, uv: Array, vu: Array, vv: Array) -> Array:
    """Four blocks (n, m) as one ((2 n, 2 m)), u and v of each dive in turn."""
    out = np.empty((2 * uu.shape[0], 2 * uu.shape[1]))
    out[::2, ::2], out[::2, 1::2], out[1::2, ::2], out[1::2, 1::2] = uu, uv, vu, vv
    return out


# ----------------------------------------
# What is wrong in currents.


def noise(currents: Sequence[DiveCurrent], sea: Sea) -> Array:
    """Covariance of the errors of currents on single dives (m2/s2, (2 n, 2 n))."""
    n = len(currents)
    courses = np.array([each.course for each in currents])
    out = np.zeros((n, 2, n, 2))
    at = np.arange(n)
    usual = np.square([sea.noise * each.doubt for each in currents])
    along = np.square([each.along for each in currents])
    out[at, :, at, :] = usual[:, None, None] * np.eye(2)
    out[at, :, at, :] += along[:, None, None] * courses[:, :, None] * courses[:, None, :]
    return out.reshape(2 * n, 2 * n)


def effect(current: DiveCurrent, fault: Fault) -> Array:
    """What one unit of a fault does to a current (m/s, (2,))."""
    east, north = current.course
    return current.speed * np.array((-east, -north) if fault is Fault.LOSS else (-north, east))


def healthy_errors(currents: Sequence[DiveCurrent]) -> Array:
    """Covariance of what is off in the currents of each healthy glider all the time (m2/s2, (2 n, 2 n))."""
    out = np.zeros((2 * len(currents), 2 * len(currents)))
    names = np.repeat([each.glider for each in currents], 2)
    same = names[:, None] == names
    for fault, usual in ((Fault.LOSS, USUAL_SLIP), (Fault.TURN, USUAL_TURN)):
        effects = np.concatenate([effect(each, fault) for each in currents])
        out += usual**2 * np.outer(effects, effects) * same
    return out


# ----------------------------------------
# The flow on a dive.


def fleet_flow(
    currents: Iterable[DiveCurrent],
    glider: str,
    start: Fix,
    end: Fix,
    sea: Sea,
    until: float = -math.inf,
) -> FleetFlow | None:
    """The mean flow at a dive of ``glider`` between two fixes, from the ``currents`` of others near it.

    Those within `NEAR`, and of the last `FLOW_WINDOW`, count; None where there is none. Their order does not
    matter. Its own that ended ``until`` then (s) count as well: what it expects by itself and what the others
    measured are weighed by their covariance.
    """
    chosen = _near(currents, glider, start, end, until)
    if all(each.glider == glider for each in chosen):
        return None
    flow, cov = _regression(chosen, start, end, sea)
    middle = _middle(start, end, start)
    distances = (
        np.hypot(*(_middle(each.start, each.end, start) - middle)) for each in chosen if each.glider != glider
    )
    return FleetFlow(
        flow, cov, tuple(sorted({each.glider for each in chosen} - {glider})), float(min(distances))
    )


def _regression(currents: Sequence[DiveCurrent], start: Fix, end: Fix, sea: Sea) -> tuple[Array, Array]:
    """The mean flow on a dive between two fixes and its covariance, given some currents."""
    from scipy.linalg import cho_factor, cho_solve  # noqa: PLC0415 (slow; every command loads this module)

    own = dives_between([(start, end)], start)
    seen = dives_between([(each.start, each.end) for each in currents], start)
    cross = FlowCovariance(own, seen, start.lat).of(sea)
    errors = noise(currents, sea) + healthy_errors(currents)
    factor = cho_factor(FlowCovariance(seen, seen, start.lat).of(sea) + errors, lower=True)
    gain = cho_solve(factor, cross.T).T
    measured = np.array([[each.u, each.v] for each in currents]).ravel()
    cov = FlowCovariance(own, own, start.lat).of(sea) - gain @ cross.T
    return readonly(gain @ measured), readonly((cov + cov.T) / 2)


def _near(
    currents: Iterable[DiveCurrent], glider: str, start: Fix, end: Fix, until: float
) -> list[DiveCurrent]:
    """The currents that count, in one order whatever the order they come in."""
    middle, t, found = _middle(start, end, start), (start.t + end.t) / 2, list[tuple[float, DiveCurrent]]()
    for each in currents:
        age = t - (each.start.t + each.end.t) / 2
        is_own = each.glider == glider and each.end.t > until
        if is_own or not -SEA_MEMORY < age < FLOW_WINDOW:
            continue
        distance = float(np.hypot(*(_middle(each.start, each.end, start) - middle)))
        if distance <= NEAR:
            found.append((abs(age) / SEA_MEMORY + distance / FLOW_SCALE, each))
    found.sort(key=lambda pair: (pair[0], pair[1].glider, pair[1].start.t))
    return sorted((each for _, each in found[:MOST_CURRENTS]), key=lambda each: (each.start.t, each.glider))


def _middle(start: Fix, end: Fix, origin: Fix) -> Array:
    return np.asarray(_plane([start, end], origin).mean(axis=0))


def _plane(fixes: Sequence[Fix], origin: Fix) -> Array:
    lat, lon = np.array([fix.lat for fix in fixes]), np.array([fix.lon for fix in fixes])
    return to_plane(lat, lon, origin.lat, origin.lon)
