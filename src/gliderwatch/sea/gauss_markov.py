"""The one model of the sea: what the flow at a glider does, as a linear Gaussian state. Pure.

The flow, east + i north, is a sum of complex parts that know nothing of each other,

    dz = (i omega - 1 / tau) z dt + sqrt(q) dB

a lasting part and a passing one (omega 0), inertial motion (clockwise at the Coriolis frequency in the
north), and two rotary parts a tidal constituent, one each way round: any ellipse is the sum of the two, and
what they wander in time makes spring, neap and the way from one sea to the next. How strong the tides are is
learnt from the mission: their prior reaches from nothing to 1 m/s, and they wander by a part of what they
have been found to be. What is not known yet is wide, not wrong.

State: east and north of each part at the end of the last dive, then east and north of the mean flow over
that dive (m/s). The mean is the integral over the dive divided by its length, exact for any length and any
gap between dives: it is what a depth-averaged current measures, and times the length it is the displacement
by the water (002).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array, readonly
from gliderwatch.sea.constants import (
    CURRENT_SCALE,
    INERTIAL,
    INERTIAL_MEMORY,
    LASTING_MEMORY,
    LASTING_SIZE,
    PASSING,
    PASSING_MEMORY,
    TIDE_K1,
    TIDE_LEAST,
    TIDE_M2,
    TIDE_N2,
    TIDE_O1,
    TIDE_S2,
    TIDE_WANDER,
)
from gliderwatch.sea.tides import Constituent

HOUR, DAY = 3600.0, 86400.0
EARTH = 7.292115e-5
"""Angular frequency of the earth's rotation (rad/s)."""
LASTING = slice(0, 2)
"""Place of the lasting part in the state: there a flow changes for good, as at a front."""
FIXED = 3
"""Parts before those of the tides: lasting, passing, inertial."""
_SMALL = 1e-4
"""|a| T below which the first terms of the series are taken: the closed forms cancel there."""

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Tide:
    """A tidal constituent: angular speed (rad/s), usual size of each rotary part in a component (m/s)."""

    omega: float
    size: float


@dataclass(frozen=True, slots=True)
class FlowParams:
    """Sizes (m/s) and memories (s) of the parts, in a component.

    ``lasting``, ``passing`` and ``inertial`` with their memories; ``tide_wander`` the part of a tidal part
    that changes in a day, of what it is and of ``tide_least`` (m/s) at least; ``scale`` (m) over which
    currents differ by their own size.
    """

    lasting: float = LASTING_SIZE
    lasting_memory: float = LASTING_MEMORY
    passing: float = PASSING
    memory: float = PASSING_MEMORY
    inertial: float = INERTIAL
    inertial_memory: float = INERTIAL_MEMORY
    tides: tuple[Tide, ...] = (
        Tide(Constituent.M2.omega, TIDE_M2),
        Tide(Constituent.S2.omega, TIDE_S2),
        Tide(Constituent.N2.omega, TIDE_N2),
        Tide(Constituent.K1.omega, TIDE_K1),
        Tide(Constituent.O1.omega, TIDE_O1),
    )
    tide_wander: float = TIDE_WANDER
    tide_least: float = TIDE_LEAST
    scale: float = CURRENT_SCALE

    def __hash__(self) -> int:
        """Of some of the numbers: it is asked for several times a dive, and parameters are few."""
        return hash((self.lasting, self.passing, self.scale))

    @property
    def parts(self) -> int:
        """How many parts the flow has."""
        return FIXED + 2 * len(self.tides)

    @property
    def size(self) -> int:
        """How many numbers the state has."""
        return 2 * self.parts + 2

    @property
    def mean(self) -> slice:
        """Place of the mean flow over the last dive in the state."""
        return slice(self.size - 2, self.size)


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """What a gap and the dive after it make of the state: ``matrix`` and ``noise`` ((size, size)).

    ``restless`` (m2/s2) is the variance of a component of the mean flow that is new and no tide.
    """

    matrix: Array
    noise: Array
    restless: float


def prior(params: FlowParams) -> Array:
    """Variance (m2/s2, (size,)) of the state before any dive; its mean is zero."""
    sizes = [params.lasting, params.passing, params.inertial]
    sizes += [tide.size for tide in params.tides for _ in range(2)]
    return np.concatenate([np.repeat(np.square(sizes), 2), [0.0, 0.0]])


@lru_cache(maxsize=256)
def rates(lat: float, params: FlowParams) -> Complex:
    """i omega - 1 / tau of each part (1/s, (parts,)) at a latitude (degrees)."""
    fixed = [
        -1 / params.lasting_memory,
        -1 / params.memory,
        -1 / params.inertial_memory - 2j * EARTH * math.sin(math.radians(lat)),
    ]
    found = np.array(fixed + [way * 1j * tide.omega for tide in params.tides for way in (1, -1)])
    found.flags.writeable = False
    return found


def intensities(state: Array, sea: float, params: FlowParams) -> Array:
    """q of each part (m2/s3, (parts,)) where the state is ``state`` ((size,)).

    ``sea`` is a factor on those of the parts that are no tides.
    """
    squares = np.square(state[2 * FIXED : -2])
    return np.concatenate([sea * restless(params), wandering(squares[::2] + squares[1::2], params)])


def wandering(square: Array, params: FlowParams) -> Array:
    """q (m2/s3) of tidal parts of which the squared size (m2/s2) is ``square``."""
    return np.asarray(params.tide_wander**2 / DAY * (square / 2 + params.tide_least**2))


@cache
def restless(params: FlowParams) -> Array:
    """q (m2/s3, (FIXED,)) of the parts that are no tides."""
    return readonly(
        [
            2 * params.lasting**2 / params.lasting_memory,
            2 * params.passing**2 / params.memory,
            2 * params.inertial**2 / params.inertial_memory,
        ]
    )


def passage(gap: float, dive: float, lat: float, q: Array, params: FlowParams) -> Passage:
    """What a ``gap`` and then a ``dive`` (s) make of the state, with intensities ``q`` ((parts,)).

    The stochastic integrals are exact: two gaps do what one of their length does.
    """
    parts, new = rotary_passage(gap, dive, rates(lat, params), q)
    matrix, noise = _real(parts)
    return Passage(matrix, noise, float(new[:FIXED].sum()))


def rotary_passage(gap: float, dive: float, a: Complex, q: Array) -> tuple[Complex, Array]:
    """The same of the parts and the mean flow as complex numbers.

    ``a`` are the `rates` and ``q`` the intensities, both (..., parts). Matrix and noise ((..., 2, parts + 1,
    parts + 1)), and the variance of a component of the mean flow that each part adds ((..., parts)).
    """
    kept = np.exp(a * gap)
    gained = q * _squared(a, gap)
    phi, square, integral = np.exp(a * dive), _squared(a, dive), _integral(a, dive)
    mean, cross, own = integral / dive, *_wandered(a, dive, square, integral)
    m = a.shape[-1]
    each = np.arange(m)
    parts = np.zeros((*q.shape[:-1], 2, m + 1, m + 1), dtype=np.complex128)  # of the matrix, and of the noise
    parts[..., 0, each, each] = phi * kept
    parts[..., 0, m, :m] = mean * kept
    parts[..., 1, each, each] = q * square + gained * np.abs(phi) ** 2
    parts[..., 1, m, :m] = q * cross / dive + gained * mean * np.conj(phi)
    parts[..., 1, :m, m] = np.conj(parts[..., 1, m, :m])
    new = q * own / dive**2 + gained * np.abs(mean) ** 2
    parts[..., 1, m, m] = new.sum(-1)
    return parts, new


def mean_passage(gap: float, dive: float, lat: float, q: Array, params: FlowParams) -> tuple[Array, float]:
    """The rows ((2, size)) of the matrix of `passage` that make the mean flow over the dive, and the variance
    (m2/s2) of its noise in a component."""
    rows, variances = _mean_passage(gap, dive, lat, params)
    return rows, float(q @ variances)


@lru_cache(maxsize=64)  # a dive comes again when its current is corrected
def _mean_passage(gap: float, dive: float, lat: float, params: FlowParams) -> tuple[Array, Array]:
    """The rows, and the variance of the noise at unit intensity of each part ((parts,))."""
    a = rates(lat, params)
    integral = _integral(a, dive)
    mean, (_, own) = integral / dive, _wandered(a, dive, _squared(a, dive), integral)
    row = np.zeros((1, params.parts + 1), dtype=np.complex128)
    row[0, :-1] = mean * np.exp(a * gap)
    return readonly(_real(row)), readonly(own / dive**2 + _squared(a, gap) * np.abs(mean) ** 2)


@cache
def jump(params: FlowParams) -> Array:
    """What a step of the lasting part before a dive does to the state, (size, 2): east and north."""
    out = np.zeros((params.size, 2))
    out[LASTING] = out[params.mean] = np.eye(2)
    return readonly(out)


def crossing(flow: Array, ground: Iterable[float], dt: float, params: FlowParams) -> float:
    """By how much (m/s) a flow (m/s, (2,)) usually differs after ``dt`` seconds at a velocity over ground.

    A strong current is a narrow one: it differs by its own size over a distance of ``params.scale``. Tides
    are wider: only the other parts are meant.
    """
    return math.hypot(*flow) * min(math.hypot(*ground) * dt / params.scale, 1.0)


def _squared(a: Complex, t: float) -> Array:
    """Integral of |exp(a s)|^2 over ``t`` (s)."""
    x = 2 * a.real * t
    return np.asarray(np.where(np.abs(x) < _SMALL, t * (1 + x / 2), np.expm1(x) / np.where(x == 0, 1, x) * t))


def _integral(a: Complex, t: float) -> Complex:
    """Integral of exp(a s) over ``t`` (s)."""
    return np.asarray(np.where(np.abs(a * t) < _SMALL, t * (1 + a * t / 2), np.expm1(a * t) / a))


def _wandered(a: Complex, t: float, square: Array, linear: Complex) -> tuple[Complex, Array]:
    """Covariance of the integral of what chance adds with that itself, and its variance, at unit intensity.

    ``square`` and ``linear`` are `_squared` and `_integral` over ``t``.
    """
    small = np.abs(a * t) < _SMALL
    cross = np.where(small, t**2 / 2, (square - np.conj(linear)) / a)
    own = np.where(small, t**3 / 3, (square - 2 * linear.real + t) / np.abs(a) ** 2)
    return cross, own


def _real(parts: Complex) -> Array:
    """Complex factors ((..., j, k)) as real blocks of two by two ((..., 2 j, 2 k))."""
    *some, j, k = parts.shape
    out = np.empty((*some, j, 2, k, 2))
    out[..., 0, :, 0] = out[..., 1, :, 1] = parts.real
    out[..., 1, :, 0] = parts.imag
    out[..., 0, :, 1] = -parts.imag
    return out.reshape(*some, 2 * j, 2 * k)
