"""The flow that a glider will meet next, learnt from the currents of its own dives. Pure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gliderwatch.model import Array, readonly
from gliderwatch.sea.constants import (
    APART,
    ENOUGH,
    EVEN,
    FAR,
    FIRST_SCALE,
    FIT_MEMORY,
    INTERVALS_KEPT,
    MARGIN,
    PLAIN_MEMORIES,
    PLAIN_STEPS,
    SCALE_FEW,
    SCALE_MEMORY,
    SCALES,
    TAIL,
    TIDAL_AMPLITUDES,
    TIDAL_CHANGE,
    TIDAL_MEMORIES,
    TIDAL_STEPS,
)
from gliderwatch.sea.tides import HOUR, Constituent, aliasing

# ----------------------------------------
# The current at a glider as one linear stochastic model, seen through means over dives. Pure.
#
# In each component the current is u = r + Re(sum c_k). The residual r is an Ornstein-Uhlenbeck process, dr
# = -r/tau dt + sigma sqrt(2/tau) dW; each tide a noisy oscillator, dc = i omega c dt + sqrt(q) dW with W
# complex and of unit strength in both parts, so that its amplitude wanders. I, the integral of u since the
# dive began, is part of the state while the glider dives: the depth-averaged current of a dive that lasts T
# is I/T, exact for any T and any gap between dives, and a forecast of I is the displacement by the current.
#
# Numbers of a component: r, then Re c and Im c of each tide, then I. Both components have the same
# covariance. Everything is done for G sets of parameters at once.


@dataclass(frozen=True, slots=True)
class Parameters:
    """G sets of parameters for the same C tides.

    ``sigma`` (m/s, (G,)) usual size of the residual in a component and ``tau`` (s, (G,)) its memory; ``q``
    (m2/s3, (G, C)) variance that a second adds to each part of a tide; ``prior`` (m2/s2, (G, C)) variance
    of these parts before any dive; ``omega`` (rad/s, (C,)).
    """

    sigma: Array
    tau: Array
    q: Array
    prior: Array
    omega: Array

    @property
    def size(self) -> int:
        """Numbers a component between dives, n = 1 + 2 C."""
        return 1 + 2 * len(self.omega)


@dataclass(frozen=True, slots=True)
class Belief:
    """What is known of the current at a time ``t`` (s): ``mean`` (m/s, (G, n, 2): east, north) and ``cov``
    (m2/s2, (G, n, n)) of a component."""

    t: float
    mean: Array
    cov: Array


@dataclass(frozen=True, slots=True)
class Forecast:
    """Mean flow over an interval: ``mean`` (m/s, (G, 2)), and ``var`` of a component (m2/s2, (G,))."""

    mean: Array
    var: Array


def init_belief(t: float, params: Parameters) -> Belief:
    """What is known before any dive."""
    sets, n = len(params.sigma), params.size
    cov = np.zeros((sets, n, n))
    cov[:, 0, 0] = params.sigma**2
    k = np.arange(1, n)
    cov[:, k, k] = np.repeat(params.prior, 2, axis=1)
    return Belief(t, readonly(np.zeros((sets, n, 2))), readonly(cov))


def transition(dt: float, params: Parameters) -> tuple[Array, Array]:
    """What ``dt`` seconds make of the state, and covariance of what chance adds: (G, n+1, n+1) each.

    The stochastic integrals are exact, so that two steps do what one of their length does.
    """
    n = params.size
    f, q = (np.zeros((len(params.sigma), n + 1, n + 1)) for _ in range(2))
    kept, variance, tau = np.exp(-dt / params.tau), params.sigma**2, params.tau
    f[:, 0, 0], f[:, n, 0], f[:, n, n] = kept, tau * (1 - kept), 1.0
    q[:, 0, 0] = variance * -np.expm1(-2 * dt / tau)
    q[:, 0, n] = q[:, n, 0] = variance * tau * np.expm1(-dt / tau) ** 2
    q[:, n, n] = variance * _wandered(dt, tau)
    for k, omega in enumerate(params.omega.tolist()):
        a, b = 1 + 2 * k, 2 + 2 * k
        angle, each = omega * dt, params.q[:, k]
        cos, sin = np.cos(angle), np.sin(angle)
        f[:, a, a] = f[:, b, b] = cos
        f[:, b, a], f[:, a, b] = sin, -sin
        f[:, n, a], f[:, n, b] = sin / omega, (cos - 1) / omega
        q[:, a, a] = q[:, b, b] = each * dt
        q[:, a, n] = q[:, n, a] = each * (1 - cos) / omega**2
        q[:, b, n] = q[:, n, b] = each * (angle - sin) / omega**2
        q[:, n, n] += each * 2 * (angle - sin) / omega**3
    return f, q


def _wandered(dt: float, tau: Array) -> Array:
    """Variance (s2) of the integral of what an Ornstein-Uhlenbeck process of variance 1 gains in ``dt`` s."""
    x = dt / tau
    kept = np.exp(-x)
    exact = 2 * x - 3 + 4 * kept - kept**2
    # the terms cancel where x is small
    return np.asarray(tau**2 * np.where(x < 1e-3, 2 / 3 * x**3 * (1 - 0.75 * x), exact))


def _moved(belief: Belief, dt: float, params: Parameters) -> tuple[Array, Array]:
    """Mean (G, n+1, 2) and covariance (G, n+1, n+1) after ``dt`` s, I counted from now."""
    f, q = transition(dt, params)
    from_now = f[:, :, :-1]
    return from_now @ belief.mean, from_now @ belief.cov @ from_now.transpose(0, 2, 1) + q


def at(belief: Belief, t: float, params: Parameters) -> Belief:
    """What is known of the current at a later time ``t`` (s), without a dive until then."""
    if t <= belief.t:
        return belief
    mean, cov = _moved(belief, t - belief.t, params)
    return Belief(t, readonly(mean[:, :-1]), readonly(cov[:, :-1, :-1]))


def forecast_belief(belief: Belief, start: float, end: float, params: Parameters) -> Forecast:
    """The mean flow between two times (s) that are not before the belief's."""
    mean, cov = _moved(at(belief, start, params), end - start, params)
    lasts = end - start
    return Forecast(readonly(mean[:, -1] / lasts), readonly(cov[:, -1, -1] / lasts**2))


def learn_belief(
    belief: Belief, start: float, end: float, current: Array, sigma: float, params: Parameters
) -> tuple[Belief, Forecast]:
    """What is known at the end of a dive by its ``current`` (m/s, (2,)), and what was expected of that.

    ``sigma`` (m/s) is the current's standard error in a component, ``start`` and ``end`` (s) the dive's.
    """
    lasts = end - start
    mean, cov = _moved(at(belief, start, params), lasts, params)
    expected = Forecast(readonly(mean[:, -1] / lasts), readonly(cov[:, -1, -1] / lasts**2))
    row = cov[:, :-1, -1] / lasts
    gain = row / (expected.var + sigma**2)[:, None]
    after = mean[:, :-1] + gain[:, :, None] * (current - expected.mean)[:, None, :]
    left = cov[:, :-1, :-1] - gain[:, :, None] * row[:, None, :]
    return Belief(end, readonly(after), readonly((left + left.transpose(0, 2, 1)) / 2)), expected


# ----------------------------------------
# Filters with different parameters side by side, weighted by how well each has foretold the mission. Pure.
#
# That is maximum likelihood on a grid, refitted with every dive at the cost of one step: no search that could
# end elsewhere on another run, and what is uncertain in the parameters is part of the forecast's covariance.
# The grid holds ratios; the scale of all variances is learnt for each set from its own innovations.

STRENGTH = {
    Constituent.M2: 1.0,
    Constituent.S2: 0.46,
    Constituent.N2: 0.2,
    Constituent.K1: 1.0,
    Constituent.O1: 0.7,
    Constituent.M4: 0.2,
}
"""Usual amplitude of a tide as part of that of the first of its kind (equilibrium tide: S2 0.46, N2 0.19 of
M2, O1 0.71 of K1)."""


@dataclass(frozen=True, slots=True)
class Bank:
    """What the filters know after a dive that ended at ``t`` (s).

    ``mean`` (m/s, (G, n, 2)); ``cov`` (m2/s2, (G, n (n + 1) / 2)) upper triangles, row by row; ``fit`` (G,)
    logarithm of the likelihood, what is long ago counting less; ``scale`` (G,) factor on the variances.
    """

    t: float
    mean: Array
    cov: Array
    fit: Array
    scale: Array


@dataclass(frozen=True, slots=True)
class Mixture:
    """A mean flow (m/s, (2,)) with its covariance (m2/s2, (2, 2))."""

    mean: Array
    cov: Array


def grid(
    steps: Sequence[float],
    memories: Sequence[float],
    tides: Sequence[tuple[float, float]],
    constituents: Sequence[Constituent],
) -> Parameters:
    """All combinations.

    ``steps`` (m/s) usual change of the residual in 3 h; ``memories`` (s); ``tides`` usual amplitude of M2 and
    K1 (m/s) with the part of it that changes in a day.
    """
    strength = np.array([STRENGTH[each] for each in constituents])
    rows = []
    for step, memory, (amplitude, wander) in itertools.product(steps, memories, tides):
        sigma = step / np.sqrt(-2 * np.expm1(-3 * HOUR / memory))
        rows.append((sigma, memory, (wander * amplitude) ** 2 / (24 * HOUR), amplitude**2))
    sigma, tau, q, prior = np.array(rows).T
    return Parameters(
        readonly(sigma),
        readonly(tau),
        readonly(np.outer(q, strength**2)),
        readonly(np.outer(prior, strength**2)),
        readonly([each.omega for each in constituents]),
    )


def init_bank(t: float, params: Parameters) -> Bank:
    """Before any dive, at a time (s)."""
    belief, sets = init_belief(t, params), len(params.sigma)
    return Bank(
        t, belief.mean, _packed(belief.cov), readonly(np.zeros(sets)), readonly(np.full(sets, FIRST_SCALE))
    )


def belief(bank: Bank) -> Belief:
    """What each filter knows, its covariances not scaled."""
    n = bank.mean.shape[1]
    cov = np.empty((len(bank.mean), n, n))
    rows, columns = np.triu_indices(n)
    cov[:, rows, columns] = cov[:, columns, rows] = bank.cov
    return Belief(bank.t, bank.mean, cov)


def forecast_bank(bank: Bank, start: float, end: float, params: Parameters) -> Mixture:
    """The mean flow between two times (s) not before the last dive's end."""
    each = forecast_belief(belief(bank), start, end, params)
    return _mixed(bank, each.mean, each.var * bank.scale)


def learn_bank(
    bank: Bank, start: float, end: float, current: Array, sigma: float, dives: int, params: Parameters
) -> tuple[Bank, Mixture]:
    """The bank after a dive, and the mean flow that it had expected.

    ``current`` (m/s, (2,)) with error ``sigma`` (m/s) in a component, ``dives`` seen before.
    """
    after, each = learn_belief(belief(bank), start, end, current, sigma, params)
    variance = (each.var + sigma**2) * bank.scale
    square = np.sum((current - each.mean) ** 2, axis=1) / variance
    likelihood = -np.log(variance) - (TAIL + 2) / 2 * np.log1p(square / TAIL)
    surprise = np.minimum(square / 2, FAR) - 1
    scale = np.clip(bank.scale * (1 + surprise / min(dives + 1 + SCALE_FEW, SCALE_MEMORY)), *SCALES)
    fit = bank.fit * (1 - 1 / FIT_MEMORY) + likelihood
    learnt = Bank(end, after.mean, _packed(after.cov), readonly(fit), readonly(scale))
    return learnt, _mixed(bank, each.mean, each.var * bank.scale)


def weights(bank: Bank) -> Array:
    """What each filter counts for (G,); they add up to 1."""
    relative = np.exp(bank.fit - bank.fit.max())
    return np.asarray(relative / relative.sum())


def _mixed(bank: Bank, mean: Array, var: Array) -> Mixture:
    """Mean and covariance of the mixture of forecasts with ``mean`` ((G, 2)) and ``var`` ((G,))."""
    weight = weights(bank)
    middle = weight @ mean
    apart = mean - middle
    cov = (weight @ var) * np.eye(2) + (weight[:, None] * apart).T @ apart
    return Mixture(readonly(middle), readonly(cov))


def _packed(cov: Array) -> Array:
    rows, columns = np.triu_indices(cov.shape[1])
    return readonly(cov[:, rows, columns])


# ----------------------------------------
# The flow that a glider will meet next, from the currents of its own dives. Pure.
#
# Three forecasts run side by side and are scored one dive ahead on the mission's own past: persistence (the
# last depth-averaged current), the residual alone, and the residual with tides. Tides are believed only where
# they have clearly beaten persistence. The state is a value, and a function of the dives so far.

TIDES = (Constituent.M2, Constituent.S2, Constituent.K1, Constituent.O1)
PLAIN_GRID = grid(PLAIN_STEPS, PLAIN_MEMORIES, ((0.0, 0.0),), ())
TIDAL_GRID = grid(TIDAL_STEPS, TIDAL_MEMORIES, [(size, TIDAL_CHANGE) for size in TIDAL_AMPLITUDES], TIDES)


@dataclass(frozen=True, slots=True)
class Score:
    """One step ahead, what is long ago counting less: ``dives``, and sums of squared errors (m2/s2) of each
    forecast; ``gain`` by how much tides were better than persistence, ``gain_squared`` of its squares."""

    dives: float = 0.0
    persistence: float = 0.0
    residual: float = 0.0
    tides: float = 0.0
    gain: float = 0.0
    gain_squared: float = 0.0

    @property
    def tides_won(self) -> bool:
        """Whether tides have clearly beaten persistence, and the residual alone as well."""
        enough = self.dives >= ENOUGH and self.tides < self.residual
        return enough and self.gain > MARGIN * math.sqrt(self.gain_squared)


@dataclass(frozen=True, slots=True)
class Filters:
    """The two banks of filters, without and with tides, and the last ``current`` (m/s, (2,))."""

    plain: Bank
    tidal: Bank
    current: Array


@dataclass(frozen=True, slots=True)
class Currents:
    """What is known of the current after a dive.

    ``end`` (s) of the last dive (None: none yet); ``dives`` seen; ``intervals`` (s) between the last
    surfacings and ``durations`` (s) of the last dives.
    """

    end: float | None = None
    dives: int = 0
    filters: Filters | None = None
    score: Score = field(default_factory=Score)
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


def learn(state: Currents, start: float, end: float, current: Array, sigma: float) -> Currents:
    """The state after a dive from ``start`` to ``end`` (s) whose ``current`` (m/s, (2,)) is believed.

    ``sigma`` (m/s) is the current's standard error in a component. A dive that does not end after the last
    one teaches nothing. Raises ValueError where a number is not finite, or ``sigma`` not positive.
    """
    if not (
        math.isfinite(start) and math.isfinite(end) and np.isfinite(current).all() and 0 < sigma < math.inf
    ):
        raise ValueError(f"no current to learn from: {current} with error {sigma} from {start} to {end}")
    if state.end is not None and start - state.end > APART:
        state = Currents()
    begin = start if state.end is None else max(start, state.end)
    if end <= begin:
        return state
    held = state.filters
    if held is None:
        held = Filters(init_bank(begin, PLAIN_GRID), init_bank(begin, TIDAL_GRID), readonly(current))
    dives = state.dives
    plain, residual = learn_bank(held.plain, begin, end, current, sigma, dives, PLAIN_GRID)
    tidal, tides = learn_bank(held.tidal, begin, end, current, sigma, dives, TIDAL_GRID)
    if dives:
        squares = [float(np.sum((current - x) ** 2)) for x in (held.current, residual.mean, tides.mean)]
        state = replace(state, score=_scored(state.score, *squares))
    between = () if state.end is None else (end - state.end,)
    return replace(
        state,
        end=end,
        dives=dives + 1,
        filters=Filters(plain, tidal, readonly(current)),
        intervals=(*state.intervals, *between)[-INTERVALS_KEPT:],
        durations=(*state.durations, end - begin)[-INTERVALS_KEPT:],
    )


def predict(state: Currents, start: float, end: float) -> Prediction | None:
    """The mean flow between two times (s); None before the first dive, long after the last, or within it."""
    chosen = choice(state)
    found = forecasts(state, start, end)
    if found is None:
        return None
    source = _tides_words(state) if chosen == "tides" else chosen
    return Prediction(found[chosen].mean, found[chosen].cov, source, notes(state))


def choice(state: Currents) -> str:
    """Which of the `forecasts` the mission's past speaks for."""
    score = state.score
    if score.tides_won:
        return "tides"
    return "residual" if score.dives >= ENOUGH and score.residual <= score.persistence else "persistence"


def forecasts(state: Currents, start: float, end: float) -> dict[str, Mixture] | None:
    """All three forecasts of the mean flow between two times (s), by name.

    The error of persistence is that of the residual's forecast, and how far the two are apart.
    """
    held = state.filters
    if held is None or state.end is None or start - state.end > APART:
        return None
    begin = max(start, state.end)
    if end <= begin:
        return None
    residual = forecast_bank(held.plain, begin, end, PLAIN_GRID)
    tides = forecast_bank(held.tidal, begin, end, TIDAL_GRID)
    apart = held.current - residual.mean
    last = Mixture(held.current, readonly(residual.cov + np.outer(apart, apart)))
    return {"persistence": last, "residual": residual, "tides": tides}


def notes(state: Currents) -> tuple[str, ...]:
    """What the glider's surfacing interval hides of the tides, once it is known to be even."""
    if len(state.intervals) < INTERVALS_KEPT:
        return ()
    usual = float(np.median(state.intervals))
    if np.abs(np.array(state.intervals) / usual - 1).max() > EVEN:
        return ()
    return aliasing(TIDES, usual, float(np.median(state.durations)))


def _scored(score: Score, persistence: float, residual: float, tides: float) -> Score:
    """The score after one more dive's squared errors (m2/s2)."""
    kept, gain = 1 - 1 / FIT_MEMORY, persistence - tides
    return Score(
        dives=kept * score.dives + 1,
        persistence=kept * score.persistence + persistence,
        residual=kept * score.residual + residual,
        tides=kept * score.tides + tides,
        gain=kept * score.gain + gain,
        gain_squared=kept * score.gain_squared + gain**2,
    )


def _tides_words(state: Currents) -> str:
    """The tides that are seen: those whose amplitude is more than twice its standard error."""
    assert state.filters is not None
    tidal = state.filters.tidal
    best = int(np.argmax(tidal.fit))
    mean, cov = tidal.mean[best], belief(tidal).cov[best] * tidal.scale[best]
    seen = [
        str(each)
        for k, each in enumerate(TIDES)
        if np.sum(mean[1 + 2 * k : 3 + 2 * k] ** 2)
        > 4 * 2 * (cov[1 + 2 * k, 1 + 2 * k] + cov[2 + 2 * k, 2 + 2 * k])
    ]
    return f"tides {' '.join(seen or map(str, TIDES))} + residual"
