"""The flow that a glider will meet next, by the one model of the sea, from the currents of its dives. Pure.

How restless this sea is, and whether it has tides and inertial motion at all, is learnt from the mission: the
model (`gauss_markov`) runs in several kinds of sea side by side, which count by how well each has foretold
the dives so far. That is maximum likelihood on a grid, refitted with every dive at the cost of one step: no
search that could end elsewhere on another run, and what is uncertain about the sea is part of the forecast's
covariance. A scale of all variances is learnt for each kind from its own innovations. The state is a value,
and a function of the dives so far.

The parts of the flow know nothing of each other, and turn alike whatever way they point: so does the error
of a current. The filter of a kind is one of complex numbers, with the covariance of a component.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np

from gliderwatch.model import Array, Fix, readonly
from gliderwatch.navigation.geodesy import velocity
from gliderwatch.sea.constants import (
    APART,
    EVEN,
    FAR,
    FIRST_SCALE,
    FIT_MEMORY,
    INTERVALS_KEPT,
    SCALE_FEW,
    SCALE_MEMORY,
    SCALES,
    SEA_KINDS,
    TAIL,
    TIDE_SEEN,
)
from gliderwatch.sea.gauss_markov import (
    FIXED,
    Complex,
    FlowParams,
    crossing,
    prior,
    rates,
    restless,
    rotary_passage,
    wandering,
)
from gliderwatch.sea.tides import Constituent, aliasing

TIDES = (Constituent.M2, Constituent.S2, Constituent.N2, Constituent.K1, Constituent.O1)
"""Those of `FlowParams`, in its order."""
PARAMS = FlowParams()


@dataclass(frozen=True, slots=True, eq=False)
class Sea:
    """What each of G kinds of sea knows after a dive; m are the parts of the flow.

    ``mean`` (m/s, (G, m, 2): east, north); ``cov`` (m2/s2, (G, m, m)) of a component, Hermitian: the real
    part on and above the diagonal, the imaginary part below; ``fit`` (G,) logarithm of the likelihood, what
    is long ago counting less; ``scale`` (G,) factor on the variances.
    """

    mean: Array
    cov: Array
    fit: Array
    scale: Array


@dataclass(frozen=True, slots=True)
class Currents:
    """What is known of the current after a dive.

    ``end`` (s) of the last dive (None: none yet); ``dives`` seen; ``intervals`` (s) between the last
    surfacings and ``durations`` (s) of the last dives.
    """

    end: float | None = None
    dives: int = 0
    sea: Sea | None = None
    intervals: tuple[float, ...] = ()
    durations: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Prediction:
    """A mean ``flow`` (m/s, (2,): east, north) with its covariance ``cov`` (m2/s2, (2, 2)); ``source`` says
    in words what it rests on, ``notes`` what a pilot should know."""

    flow: Array
    cov: Array
    source: str
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Foreseen:
    """The parts at the end of a dive and the mean flow over it before its current is known: ``mean`` ((G,
    m + 1)) and ``cov`` ((G, m + 1, m + 1)), not scaled."""

    mean: Complex
    cov: Complex


def learn(state: Currents, start: Fix, end: Fix, current: Array, sigma: float) -> Currents:
    """The state after a dive between two fixes whose ``current`` (m/s, (2,)) is believed.

    ``sigma`` (m/s) is the current's standard error in a component. A dive that does not end after the last
    one teaches nothing. Raises ValueError where a number is not finite, or ``sigma`` not positive.
    """
    if not (np.isfinite([start.t, end.t, *current]).all() and 0 < sigma < math.inf):
        raise ValueError(f"no current to learn from: {current} with error {sigma} from {start} to {end}")
    if state.end is not None and start.t - state.end > APART:
        state = Currents()
    begin = start.t if state.end is None else max(start.t, state.end)
    if end.t <= begin:
        return state
    sea = unknown_sea() if state.sea is None else state.sea
    foreseen = _foreseen(sea, begin - (state.end or begin), end.t - begin, start, end)
    between = () if state.end is None else (end.t - state.end,)
    return Currents(
        end=end.t,
        dives=state.dives + 1,
        sea=_learnt(sea, foreseen, complex(*current), sigma, state.dives),
        intervals=(*state.intervals, *between)[-INTERVALS_KEPT:],
        durations=(*state.durations, end.t - begin)[-INTERVALS_KEPT:],
    )


def predict(state: Currents, start: Fix, end: Fix) -> Prediction | None:
    """The mean flow on a dive between two fixes; None before the first dive, long after the last, or within
    it."""
    if state.sea is None or state.end is None or start.t - state.end > APART:
        return None
    begin = max(start.t, state.end)
    if end.t <= begin:
        return None
    foreseen = _foreseen(state.sea, begin - state.end, end.t - begin, start, end)
    weight, means = weights(state.sea), foreseen.mean[:, -1]
    middle = complex(weight @ means)
    apart = means - middle
    off = np.column_stack([apart.real, apart.imag])
    within = float(weight @ (foreseen.cov[:, -1, -1].real * state.sea.scale))
    cov = within * np.eye(2) + (weight[:, None] * off).T @ off
    flow = readonly([middle.real, middle.imag])
    return Prediction(flow, readonly(cov), _source(state.sea), notes(state))


def unknown_sea() -> Sea:
    """Before any dive."""
    kinds, each = len(SEA_KINDS), np.arange(PARAMS.parts)
    cov = np.zeros((kinds, PARAMS.parts, PARAMS.parts))
    cov[:, each, each] = _prior()
    mean = readonly(np.zeros((kinds, PARAMS.parts, 2)))
    return Sea(mean, readonly(cov), readonly(np.zeros(kinds)), readonly(np.full(kinds, FIRST_SCALE)))


def weights(sea: Sea) -> Array:
    """What each kind of sea counts for (G,); they add up to 1."""
    relative = np.exp(sea.fit - sea.fit.max())
    return np.asarray(relative / relative.sum())


def notes(state: Currents) -> tuple[str, ...]:
    """What the glider's surfacing interval hides of the tides, once it is known to be even."""
    if len(state.intervals) < INTERVALS_KEPT:
        return ()
    usual = float(np.median(state.intervals))
    if np.abs(np.array(state.intervals) / usual - 1).max() > EVEN:
        return ()
    return aliasing(TIDES, usual, float(np.median(state.durations)))


# ----------------------------------------
# The kinds of sea, and what a dive makes of what each knows.


@cache
def _prior() -> Array:
    """Variance (m2/s2, (G, m)) of each part before any dive."""
    _, passing, memory, inertial, tides = np.array(SEA_KINDS).T
    out = np.tile(prior(PARAMS)[:-2:2], (len(SEA_KINDS), 1))
    out[:, 1] *= passing * memory / PARAMS.memory  # as much as its noise keeps up
    out[:, 2] *= passing * inertial**2
    out[:, FIXED:] *= tides[:, None] ** 2
    return readonly(out)


@cache
def _restless() -> Array:
    """q (m2/s3, (G, FIXED)) of the parts that are no tides."""
    lasting, passing, _, inertial, _ = np.array(SEA_KINDS).T
    return readonly(restless(PARAMS) * np.stack([lasting, passing, passing * inertial**2], axis=1))


@lru_cache(maxsize=64)
def _rates(lat: float) -> Complex:
    """i omega - 1 / tau of each part (1/s, (G, m)) at a latitude (degrees)."""
    return np.array([rates(lat, replace(PARAMS, memory=kind[2])) for kind in SEA_KINDS])


def _intensities(mean: Complex) -> Array:
    """q (m2/s3, (G, m)) of each part where the parts are ``mean`` ((G, m))."""
    tides = mean[:, FIXED:]
    return np.hstack([_restless(), wandering(tides.real**2 + tides.imag**2, PARAMS)])


@cache
def _lasting() -> Array:
    """The factor on the noise of what lasts (G,)."""
    return readonly([kind[0] for kind in SEA_KINDS])


@lru_cache(maxsize=64)  # a dive is foreseen, and then learnt
def _foreseen(sea: Sea, gap: float, lasts: float, start: Fix, end: Fix) -> _Foreseen:
    """What each kind of sea expects of a dive that lasts so long (s), a `gap` (s) after the last."""
    mean, cov = sea.mean[..., 0] + 1j * sea.mean[..., 1], _unpacked(sea.cov)
    parts, _ = rotary_passage(gap, lasts, _rates(start.lat), _intensities(mean))
    matrix, noise = parts[:, 0, :, :-1], parts[:, 1]
    cov = matrix @ cov @ matrix.conj().transpose(0, 2, 1) + noise
    ground = velocity(start, end)
    steps = np.zeros(PARAMS.parts + 1)
    steps[[0, -1]] = 1.0
    flows = mean[:, 0] + mean[:, 1]
    crossed = [crossing(np.array([z.real, z.imag]), ground, gap + lasts, PARAMS) for z in flows]
    new = _lasting() * np.square(crossed)
    cov = cov + new[:, None, None] * np.outer(steps, steps)
    return _Foreseen((matrix @ mean[:, :, None])[..., 0], cov)


def _learnt(sea: Sea, foreseen: _Foreseen, current: complex, sigma: float, dives: int) -> Sea:
    """What is known when the ``current`` (m/s, east + i north) is, after so many ``dives`` before."""
    off = current - foreseen.mean[:, -1]
    own = foreseen.cov[:, -1, -1].real + sigma**2
    row = foreseen.cov[:, :-1, -1]
    mean = foreseen.mean[:, :-1] + row * (off / own)[:, None]
    cov = foreseen.cov[:, :-1, :-1] - row[:, :, None] * row.conj()[:, None, :] / own[:, None, None]
    variance = own * sea.scale
    square = np.abs(off) ** 2 / variance
    likelihood = -np.log(variance) - (TAIL + 2) / 2 * np.log1p(square / TAIL)
    surprise = np.minimum(square / 2, FAR) - 1
    scale = np.clip(sea.scale * (1 + surprise / min(dives + 1 + SCALE_FEW, SCALE_MEMORY)), *SCALES)
    return Sea(
        readonly(np.stack([mean.real, mean.imag], axis=-1)),
        readonly(_packed(cov)),
        readonly(sea.fit * (1 - 1 / FIT_MEMORY) + likelihood),
        readonly(scale),
    )


def _packed(cov: Complex) -> Array:
    """Hermitian matrices as real ones, see `Sea`."""
    return np.triu(cov.real) + np.tril(cov.imag, -1)


def _unpacked(cov: Array) -> Complex:
    real, imag = np.triu(cov), np.tril(cov, -1)
    upper = real + np.triu(real, 1).transpose(0, 2, 1)
    return np.asarray(upper + 1j * (imag - imag.transpose(0, 2, 1)))


def _source(sea: Sea) -> str:
    """What a forecast rests on, with the tides that are seen."""
    best = int(np.argmax(sea.fit))
    size = np.square(sea.mean[best]).sum(-1)[FIXED:]
    variance = 2 * sea.scale[best] * np.diagonal(sea.cov[best])[FIXED:]
    both = (size[::2] + size[1::2]) > TIDE_SEEN * (variance[::2] + variance[1::2])  # either way round
    seen = [str(each) for each, is_seen in zip(TIDES, both, strict=True) if is_seen]
    return "forecast by the dives before" + (f", with tides {' '.join(seen)}" if seen else "")
