"""The flow at a glider from the depth-averaged currents of the gliders about it. Pure.

What one glider cannot know: a reference for its flow that knows nothing of its own dead reckoning. The flow
is

- eddies: a streamfunction of Gaussians, u = -sqrt(V) dpsi/dy, v = sqrt(V) dpsi/dx, so that no water comes
  from nowhere; and a mean flow. Both forget (Ornstein-Uhlenbeck);
- tides M2 and K1: cosine and sine parts, each u and v a plane in space.

A depth-averaged current is the mean of that along its dive. With the basis ``H`` of each current and of the
dive in question, the flow there given the currents is a Gaussian regression: the same as a Kalman filter and
smoother over all of them, whatever order they came in. So there is no state: currents are an input, and the
dive's own glider is left out of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gliderwatch.fleet.constants import (
    DAC_NOISE,
    EDDY,
    FLOW_MEMORY,
    FLOW_SCALE,
    FLOW_WINDOW,
    GRID,
    MEAN_FLOW,
    MOST_CURRENTS,
    NEAR,
    SPREAD,
    TIDE,
    TIDE_GRADIENT,
)
from gliderwatch.model import Array, Fix, readonly
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.sea.tides import Constituent

TIDES = (Constituent.M2, Constituent.K1)
Places = Sequence[tuple[Fix, Fix]]
"""Dives by the fixes before and after them."""
_ALONG = np.array([-math.sqrt(0.6), 0.0, math.sqrt(0.6)]) / 2 + 0.5
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18
"""Gauss-Legendre points and weights on a dive: exact to 1e-5 for M2 over 6 h."""


@dataclass(frozen=True, slots=True)
class FlowSizes:
    """Usual sizes (m/s, a component) of the parts of the flow.

    ``eddy`` of one Gaussian, ``mean`` of what is the same everywhere, ``tide`` of a cosine or sine part, and
    by how much that differs over `FLOW_SCALE` (``gradient``), of each of the ``tides``. An eddy has a
    spread of sqrt(SPREAD) of the ``scale`` (m).
    """

    eddy: float = EDDY
    mean: float = MEAN_FLOW
    tide: float = TIDE
    gradient: float = TIDE_GRADIENT
    tides: tuple[Constituent, ...] = TIDES
    scale: float = FLOW_SCALE

    def deviations(self, eddies: int) -> Array:
        """Those of all coefficients, the eddies' first."""
        gradient = self.gradient * self.scale / FLOW_SCALE
        plane = [self.tide, gradient, gradient]
        return np.array([self.eddy] * eddies + [self.mean] * 2 + plane * (4 * len(self.tides)))


USUAL = FlowSizes()


@dataclass(frozen=True, slots=True)
class DiveCurrent:
    """The depth-averaged current of a dive between two fixes: ``u``, ``v`` (m/s, true north).

    ``noise`` (m/s) is its error in each component; ``course`` (unit vector east, north; zeros: none) that of
    the glider through the water, ``speed`` (m/s) what it takes for its own, and ``doubt`` (m/s) the error
    along the course where that is not sure.
    """

    glider: str
    start: Fix
    end: Fix
    u: float
    v: float
    noise: float = DAC_NOISE
    course: tuple[float, float] = (0.0, 0.0)
    doubt: float = 0.0
    speed: float = 0.0


@dataclass(frozen=True, slots=True)
class FleetFlow:
    """The mean flow on a dive by what other gliders measured: ``flow`` (m/s, (2,)) and its ``cov`` ((2, 2)).

    ``gliders`` are those it is from, ``nearest`` (m) the distance to the next of them.
    """

    flow: Array
    cov: Array
    gliders: tuple[str, ...]
    nearest: float


def basis(
    place: Array, t: Array, centres: Array, tides: Sequence[Constituent] = TIDES
) -> tuple[Array, Array]:
    """Rows of u and v ((n, L) each) at places ((n, 2), in units of `FLOW_SCALE`) and times (s, (n,)).

    First the streamfunction's Gaussians about ``centres`` ((m, 2)), then the mean u and v, then of each tide
    cosine and sine of u at 1, x - 1/2, y - 1/2, and of v. All but the first are of coefficients of unit size.
    """
    away = place[:, None, :] - centres
    psi = np.exp(-np.square(away).sum(-1) / (2 * SPREAD)) / math.sqrt(SPREAD)
    plane = np.column_stack([np.ones(len(place)), place - 0.5])
    waves = [wave(each.omega * t) for each in tides for wave in (np.cos, np.sin)]
    tide = np.hstack([wave[:, None] * plane for wave in waves])
    none, ones, still = np.zeros_like(tide), np.ones((len(place), 1)), np.zeros((len(place), 1))
    u = np.hstack([psi * away[..., 1], ones, still, tide, none])
    v = np.hstack([-psi * away[..., 0], still, ones, none, tide])
    return u, v


def fleet_flow(
    currents: Iterable[DiveCurrent],
    glider: str,
    start: Fix,
    end: Fix,
    sizes: FlowSizes = USUAL,
    until: float = -math.inf,
) -> FleetFlow | None:
    """The mean flow at a dive of ``glider`` between two fixes, from the ``currents`` of others near it.

    Those within `NEAR`, and of the last `FLOW_WINDOW`, count; None where there is none. Their order does not
    matter. Its own that ended ``until`` then (s) count as well: what it expects by itself and what the others
    measured are weighed by their covariance.
    """
    others = _near(currents, glider, start, end, until)
    if all(each.glider == glider for each in others):
        return None
    from scipy.linalg import cho_factor, cho_solve  # noqa: PLC0415 (slow; every command loads this module)

    dives = [(each.start, each.end) for each in others]
    centres = _centres([start, end, *(fix for dive in dives for fix in dive)], start, sizes.scale)
    own, own_t = _rows([(start, end)], start, centres, sizes)
    seen, seen_t = _rows(dives, start, centres, sizes)
    fading = len(centres) + 2
    cross = _covariance(own, own_t, seen, seen_t, fading)
    matrix = _covariance(seen, seen_t, seen, seen_t, fading) + _noise(others)
    gain = cho_solve(cho_factor(matrix, lower=True), cross.T).T
    measured = np.array([[each.u, each.v] for each in others]).ravel()
    cov = _covariance(own, own_t, own, own_t, fading) - gain @ cross.T
    middle = _middle(start, end, start)
    distances = (
        np.hypot(*(_middle(each.start, each.end, start) - middle)) for each in others if each.glider != glider
    )
    return FleetFlow(
        readonly(gain @ measured),
        readonly((cov + cov.T) / 2),
        tuple(sorted({each.glider for each in others} - {glider})),
        float(min(distances)),
    )


def currents_covariance(currents: Sequence[DiveCurrent], sizes: FlowSizes) -> Array:
    """Covariance (m2/s2, (2 n, 2 n): u, v of each in turn) of depth-averaged currents, their noise
    included."""
    dives = [(each.start, each.end) for each in currents]
    origin = dives[-1][0]
    centres = _centres([fix for dive in dives for fix in dive], origin, sizes.scale)
    rows, t = _rows(dives, origin, centres, sizes)
    return _covariance(rows, t, rows, t, len(centres) + 2) + _noise(currents)


def _near(
    currents: Iterable[DiveCurrent], glider: str, start: Fix, end: Fix, until: float
) -> list[DiveCurrent]:
    """The currents that count, in one order whatever the order they come in."""
    middle, t, found = _middle(start, end, start), (start.t + end.t) / 2, list[tuple[float, DiveCurrent]]()
    for each in currents:
        age = t - (each.start.t + each.end.t) / 2
        is_own = each.glider == glider and each.end.t > until
        if is_own or not -FLOW_MEMORY < age < FLOW_WINDOW:
            continue
        distance = float(np.hypot(*(_middle(each.start, each.end, start) - middle)))
        if distance <= NEAR:
            found.append((abs(age) / FLOW_MEMORY + distance / FLOW_SCALE, each))
    found.sort(key=lambda pair: (pair[0], pair[1].glider, pair[1].start.t))
    return sorted((each for _, each in found[:MOST_CURRENTS]), key=lambda each: (each.start.t, each.glider))


def _middle(start: Fix, end: Fix, origin: Fix) -> Array:
    return np.asarray(_plane([start, end], origin).mean(axis=0))


def _plane(fixes: Sequence[Fix], origin: Fix) -> Array:
    lat, lon = np.array([fix.lat for fix in fixes]), np.array([fix.lon for fix in fixes])
    return to_plane(lat, lon, origin.lat, origin.lon)


def _centres(fixes: Sequence[Fix], origin: Fix, scale: float = FLOW_SCALE) -> Array:
    """Centres of eddies, a sixth of the scale (m) apart, wherever the dives are and one spread about."""
    places = _plane(fixes, origin) / scale * (GRID - 1)
    margin = math.ceil(2 * math.sqrt(SPREAD) * (GRID - 1))
    low, high = np.floor(places.min(axis=0)) - margin, np.ceil(places.max(axis=0)) + margin
    x, y = (np.arange(low[k], high[k] + 1) / (GRID - 1) for k in range(2))
    return np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)


def _rows(dives: Places, origin: Fix, centres: Array, sizes: FlowSizes) -> tuple[Array, Array]:
    """The basis averaged along each dive ((2 n, L): u, v of each in turn), scaled by usual sizes; times of u,
    v (s after the origin's, (2 n,))."""
    a, b = _plane([d[0] for d in dives], origin), _plane([d[1] for d in dives], origin)
    t0, t1 = (np.array([d[k].t for d in dives]) - origin.t for k in range(2))
    places = (a[:, None] + _ALONG[:, None] * (b - a)[:, None]).reshape(-1, 2) / sizes.scale
    times = (t0[:, None] + _ALONG * (t1 - t0)[:, None]).ravel()
    mean = [
        np.einsum("npl,p->nl", part.reshape(len(dives), len(_ALONG), -1), _WEIGHTS)
        for part in basis(places + 0.5, times, centres + 0.5, sizes.tides)
    ]
    rows = np.stack(mean, axis=1).reshape(2 * len(dives), -1)
    return rows * sizes.deviations(len(centres)), np.repeat((t0 + t1) / 2, 2)


def _noise(currents: Sequence[DiveCurrent]) -> Array:
    """Covariance of the errors of currents."""
    out = np.zeros((2 * len(currents), 2 * len(currents)))
    for k, each in enumerate(currents):
        course = np.array(each.course)
        part = slice(2 * k, 2 * k + 2)
        out[part, part] = each.noise**2 * np.eye(2) + each.doubt**2 * np.outer(course, course)
    return out


def _covariance(a: Array, ta: Array, b: Array, tb: Array, fading: int) -> Array:
    """Covariance of the flow at two sets of dives: ``fading`` functions forget, the others do not."""
    kept = np.exp(-np.abs(ta[:, None] - tb) / FLOW_MEMORY)
    return np.asarray(kept * (a[:, :fading] @ b[:, :fading].T) + a[:, fading:] @ b[:, fading:].T)
