"""When something began, within a dive: by the samples of full files, which show it hours before a surfacing
does. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import degrees

import numpy as np

from gliderwatch.model import EMPTY, Array, Series
from gliderwatch.navigation.constants import DIVING_DEPTH, STEEP_PITCH

BIN = 60.0
"""s: samples are averaged to this; yos of a shelf glider take some minutes."""
FEWEST = 30
"""Bins before a change, and after it, so that it can be seen."""
LEAST = 25.0
"""How much likelier (in chi-squared) a step must make the samples than none: five standard errors."""
STANDS_OUT = 2.0
"""Standard deviations of what a step leaves, by which it must change a quantity."""
WITHIN = 4.0
"""So much less likely (in chi-squared) a moment may be than the likeliest one: two standard errors."""


@dataclass(frozen=True, slots=True)
class Step:
    """A quantity that changed: its ``name``, means ``before`` and ``after`` (SI)."""

    name: str
    before: float
    after: float

    @property
    def words(self) -> str:
        """The step in words.

        >>> Step("roll", 0.0, 0.05).words, Step("sinking", 0.15, 0.11).words
        ('roll 0.0 to 2.9 degrees', 'sinking 15.0 to 11.0 cm/s')
        """
        factor, unit = (100.0, "cm/s") if self.name in ("sinking", "climbing") else (degrees(1), "degrees")
        return f"{self.name} {self.before * factor:.1f} to {self.after * factor:.1f} {unit}"


@dataclass(frozen=True, slots=True)
class Onset:
    """When something began: the likeliest moment ``t`` (s), between ``earliest`` and ``latest`` (s) by 95 %,
    and the ``steps`` that show it."""

    t: float
    earliest: float
    latest: float
    steps: tuple[Step, ...]


def onset(samples: Mapping[str, Series], until: float) -> Onset | None:
    """The moment before ``until`` (s) at which depth rate, pitch or roll changed, as one step of all that
    change then; None where no step is beyond chance.

    ``samples`` (SI) of `depth`, `pitch` and `roll` reach from a day before what was flagged to a day after
    it. Dives and climbs are looked at apart. The step is the likeliest one of independent normal errors,
    whose variances are those of what it leaves, greater by how long they hold on (AR(1)).
    """
    series = dict(_series(samples))
    times = np.unique(np.concatenate([np.empty(0), *(s.t for s in series.values())]))
    times = times[times <= until]
    if len(times) < FEWEST:
        return None
    rough = sum(_gain(s, times, _noise(s.v)) for s in series.values())
    at = float(times[int(np.argmax(rough))])
    gains = {name: _gain(s, times, _left(s, at)) for name, s in series.items() if _stands_out(s, at)}
    if not gains:
        return None
    total = np.asarray(sum(gains.values()))
    best = int(np.argmax(total))
    if total[best] < LEAST:
        return None
    near = times[total >= total[best] - WITHIN]
    steps = tuple(
        Step(name, float(s.v[s.t < times[best]].mean()), float(s.v[s.t >= times[best]].mean()))
        for name, s in series.items()
        if name in gains and gains[name][best] >= LEAST
    )
    return Onset(float(times[best]) - BIN / 2, float(near[0]) - BIN / 2, float(near[-1]) + BIN / 2, steps)


def _series(samples: Mapping[str, Series]) -> Iterator[tuple[str, Series]]:
    """What is looked at, a mean a bin, where the glider sinks or climbs steadily: depth rates, pitch of each,
    roll."""
    pitch, depth = samples.get("pitch", EMPTY), samples.get("depth", EMPTY)
    if not len(pitch) or not len(depth):
        return
    bins = np.floor(pitch.t / BIN)
    starts = np.flatnonzero(np.diff(bins, prepend=bins[0] - 1))
    least, most = np.minimum.reduceat(pitch.v, starts), np.maximum.reduceat(pitch.v, starts)
    t = (bins[starts] + 0.5) * BIN
    deep = np.interp(t, depth.t, depth.v) > DIVING_DEPTH
    rate = np.diff([np.interp(t + side * BIN / 2, depth.t, depth.v) for side in (-1, 1)], axis=0)[0] / BIN
    mean = np.add.reduceat(pitch.v, starts) / np.diff(np.append(starts, len(pitch)))
    down, up = (most < -STEEP_PITCH) & deep, (least > STEEP_PITCH) & deep
    yield "sinking", Series(t[down], rate[down])
    yield "climbing", Series(t[up], -rate[up])
    yield "pitch of dives", Series(t[down], mean[down])
    yield "pitch of climbs", Series(t[up], mean[up])
    roll = samples.get("roll", EMPTY)
    if len(roll):
        steady = t[down | up]
        seen = np.abs(steady - roll.t[_nearest(roll.t, steady)]) < BIN
        first, last = roll.t.searchsorted(steady - BIN / 2), roll.t.searchsorted(steady + BIN / 2)
        total = np.concatenate([[0.0], np.cumsum(roll.v)])
        n = np.maximum(last - first, 1)
        seen &= last > first
        yield "roll", Series(steady[seen], ((total[last] - total[first]) / n)[seen])


def _nearest(t: Array, at: Array) -> Array:
    """The index of the time of ``t`` that is nearest to each."""
    right = np.clip(t.searchsorted(at), 1, max(len(t) - 1, 1))
    right = np.minimum(right, len(t) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(t[left] - at) < np.abs(t[right] - at), left, right)


def _gain(series: Series, times: Array, variance: float) -> Array:
    """By how much (in chi-squared) a step at each time makes a series likelier."""
    n, before = len(series), series.t.searchsorted(times)
    after = n - before
    sums = np.concatenate([[0.0], np.cumsum(series.v)])
    with np.errstate(invalid="ignore", divide="ignore"):
        step = sums[before] / before - (sums[-1] - sums[before]) / after
        gain = before * after / n * step**2 / variance
    return np.where((before >= FEWEST) & (after >= FEWEST), gain, 0.0)


def _noise(v: Array) -> float:
    """The variance of values by the differences of those beside each other, which a step hardly moves."""
    return max(float(np.median(np.abs(np.diff(v)))) * 1.05, 1e-6) ** 2 if len(v) > 1 else 1.0


def _parts(series: Series, at: float) -> list[Array]:
    """The values before a time (s), and from then on, each without their mean."""
    return [p - p.mean() for p in (series.v[series.t < at], series.v[series.t >= at]) if len(p)]


def _stands_out(series: Series, at: float) -> bool:
    """Whether a step is greater than what tide, density of the water and pilot do all the time."""
    before, after = series.v[series.t < at], series.v[series.t >= at]
    if len(before) < FEWEST or len(after) < FEWEST:
        return False
    spread = float(np.std(np.concatenate(_parts(series, at))))
    return abs(float(after.mean() - before.mean())) > STANDS_OUT * spread


def _left(series: Series, at: float) -> float:
    """The variance of what a step at ``at`` leaves, times how many bins in a row tell the same."""
    rest = np.concatenate([np.empty(0), *_parts(series, at)])
    variance = float(np.mean(rest**2)) if len(rest) else 0.0
    if len(rest) < 3 or variance < 1e-12:
        return max(variance, 1e-12)
    beside = float(np.clip(np.mean(rest[1:] * rest[:-1]) / variance, 0.0, 0.98))
    return variance * (1 + beside) / (1 - beside)
