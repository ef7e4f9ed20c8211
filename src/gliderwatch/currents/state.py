"""The flow that a glider will meet next, from the currents of its own dives. Pure.

Three forecasts run side by side and are scored one dive ahead on the mission's own past: persistence (the
last depth-averaged current), the residual alone, and the residual with tides. Tides are believed only where
they have clearly beaten persistence. The state is a value, and a function of the dives so far.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from gliderwatch.currents import bank
from gliderwatch.currents.bank import Bank, Mixture
from gliderwatch.currents.constituents import HOUR, Constituent, aliasing
from gliderwatch.model import Array, readonly

TIDES = (Constituent.M2, Constituent.S2, Constituent.K1, Constituent.O1)
PLAIN_GRID = bank.grid((0.015, 0.04, 0.12), [h * HOUR for h in (10, 30, 100, 1000)], ((0.0, 0.0),), ())
TIDAL_GRID = bank.grid((0.02, 0.08), [h * HOUR for h in (30, 300)], ((0.05, 0.1), (0.2, 0.1)), TIDES)
APART = 3 * 86400.0
"""Seconds without a current after which the sea is taken for unknown."""
FORGET = 1 / 100
"""Part of the score that is forgotten with each dive."""
ENOUGH, MARGIN = 6.0, 2.0
"""Dives that a score needs, and by how many standard errors tides have to be better than persistence."""
RECENT = 8
"""Dives whose intervals say how often the glider surfaces."""
EVEN = 0.1
"""Intervals that differ by more than this part are uneven: then no tide hides behind them."""


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
        held = Filters(bank.init(begin, PLAIN_GRID), bank.init(begin, TIDAL_GRID), readonly(current))
    dives = state.dives
    plain, residual = bank.learn(held.plain, begin, end, current, sigma, dives, PLAIN_GRID)
    tidal, tides = bank.learn(held.tidal, begin, end, current, sigma, dives, TIDAL_GRID)
    if dives:
        squares = [float(np.sum((current - x) ** 2)) for x in (held.current, residual.mean, tides.mean)]
        state = replace(state, score=_scored(state.score, *squares))
    between = () if state.end is None else (end - state.end,)
    return replace(
        state,
        end=end,
        dives=dives + 1,
        filters=Filters(plain, tidal, readonly(current)),
        intervals=(*state.intervals, *between)[-RECENT:],
        durations=(*state.durations, end - begin)[-RECENT:],
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
    residual = bank.forecast(held.plain, begin, end, PLAIN_GRID)
    tides = bank.forecast(held.tidal, begin, end, TIDAL_GRID)
    apart = held.current - residual.mean
    last = Mixture(held.current, readonly(residual.cov + np.outer(apart, apart)))
    return {"persistence": last, "residual": residual, "tides": tides}


def notes(state: Currents) -> tuple[str, ...]:
    """What the glider's surfacing interval hides of the tides, once it is known to be even."""
    if len(state.intervals) < RECENT:
        return ()
    usual = float(np.median(state.intervals))
    if np.abs(np.array(state.intervals) / usual - 1).max() > EVEN:
        return ()
    return aliasing(TIDES, usual, float(np.median(state.durations)))


def _scored(score: Score, persistence: float, residual: float, tides: float) -> Score:
    """The score after one more dive's squared errors (m2/s2)."""
    kept, gain = 1 - FORGET, persistence - tides
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
    mean, cov = tidal.mean[best], bank.belief(tidal).cov[best] * tidal.scale[best]
    seen = [
        str(each)
        for k, each in enumerate(TIDES)
        if np.sum(mean[1 + 2 * k : 3 + 2 * k] ** 2)
        > 4 * 2 * (cov[1 + 2 * k, 1 + 2 * k] + cov[2 + 2 * k, 2 + 2 * k])
    ]
    return f"tides {' '.join(seen or map(str, TIDES))} + residual"
