"""Does the current of a glider fit those of the gliders about it? Who is wrong if not? Pure.

A wing lost at the same depth rate, or a compass that is off, leaves no trace on a steady heading: the glider
takes what it loses for a current. Its neighbours do not measure that current. With W the speed that it
reckons with and h its course its depth-averaged current is

    c = F - loss W h + turn W (left of h) + noise,

F the flow that all share. All currents of the fleet are one Gaussian vector (`fleet.flow`); for each glider
and each of its dives the likelihood that a loss, or a turn, began with it is compared with that of no fault,
and with that of a fault of another glider. Each explanation has the eddies that suit it best. Nothing is
kept: the same currents, in any order, give the same result.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gliderwatch.fleet.constants import (
    BETWEEN_DIVES,
    CHECK_WINDOW,
    CLEARER,
    DOUBTED_SPEED,
    LEAST_DIVES,
    LEAST_LOSS,
    LEAST_TURN,
    MOST_CURRENTS,
    MOST_DIVES,
    MOST_LOSS,
    MOST_ONE_WAY,
    NEAR,
    OWN_WATER,
    PROVISIONAL_DOUBT,
    SEA_EDDIES,
    SEA_GRADIENTS,
    SEA_INERTIAL,
    SEA_MEMORY,
    SEA_NOISES,
    SEA_REACHES,
    SHARED_SURE,
    SURE,
    UNKNOWN_DOUBT,
    WATER_CLEARER,
)
from gliderwatch.fleet.flow import (
    DiveCurrent,
    Fault,
    FlowCovariance,
    Sea,
    dives_between,
    effect,
    healthy_errors,
    noise,
)
from gliderwatch.model import OTHER_REFERENCE, Array, Assessment, Fix, Flag
from gliderwatch.navigation.geodesy import to_plane

_KINDS: tuple[tuple[dict[str, float], ...], ...] = (
    tuple({"gradient": gradient} for gradient in SEA_GRADIENTS),
    tuple({"eddy": eddy} for eddy in SEA_EDDIES),
    tuple({"reach": reach} for reach in SEA_REACHES),
    tuple({"inertial": inertial} for inertial in SEA_INERTIAL),
    tuple({"noise": error} for error in SEA_NOISES),
)
"""What of a sea is tried, one kind after the other."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """That a ``fault`` of a glider began with a dive (``since``, s), ``dives`` ago.

    ``size`` with its standard error ``sigma``: part of the speed that is lost, or rad that the compass shows
    too much; ``ratio`` twice the log likelihood ratio to no fault; ``sea`` the one that suits it best.
    """

    glider: str
    fault: Fault
    since: float
    dives: int
    size: float
    sigma: float
    ratio: float
    sea: Sea = Sea()


@dataclass(frozen=True, slots=True)
class Check:
    """What the comparison of a glider with its ``neighbours`` (names, with ``nearest``, m) shows.

    ``found`` is the likeliest fault of it (None: none is likely), ``others`` the likeliest of another glider,
    ``common`` the likeliest that all have alike (its ``glider`` is empty); ``one_way`` is the length of their
    mean course, ``sea`` the one that suits the currents best where nothing is wrong. ``own_water``: the ratio
    for water about the glider that no other meets, as a front is.
    """

    neighbours: tuple[str, ...]
    nearest: float
    found: Hypothesis | None
    others: Hypothesis | None
    common: Hypothesis | None = None
    one_way: float = 0.0
    sea: Sea = Sea()
    own_water: float = -math.inf

    @property
    def sure(self) -> Hypothesis | None:
        """The fault that is to be reported: too likely for chance, large enough, and more likely than the
        others."""
        own, other, common = (
            h.ratio if h is not None else 0.0 for h in (self.found, self.others, self.common)
        )
        if self.one_way > MOST_ONE_WAY:
            common = 0.0  # on one course it is a current, of which the sea has as much as it likes
        if common > max(own, other) + CLEARER:
            return self.common if _is_large(self.common) else None
        clear = own > max(other, common) + CLEARER and own > self.own_water + WATER_CLEARER
        return self.found if clear and _is_large(self.found) else None

    @property
    def doubted(self) -> Hypothesis | None:
        """A fault of another glider that is more likely than not."""
        own, other = (h.ratio if h is not None else 0.0 for h in (self.found, self.others))
        return self.others if other > own and _is_large(self.others) else None


def _is_large(found: Hypothesis | None) -> bool:
    if found is None or found.ratio < (SURE if found.glider else SHARED_SURE) or found.dives < LEAST_DIVES:
        return False
    return abs(found.size) >= (LEAST_LOSS if found.fault is Fault.LOSS else LEAST_TURN)


def cross_check(currents: Sequence[DiveCurrent], glider: str) -> Check | None:
    """Compare the last dives of a glider with the currents of those about it; None where nobody is near.

    ``currents`` are those of all gliders, in any order.
    """
    own = sorted((each for each in currents if each.glider == glider), key=lambda each: each.end.t)
    if not own:
        return None
    last = own[-1]
    chosen = [each for each in currents if _is_near(each, last)]
    chosen.sort(key=lambda each: (each.end.t, each.glider))
    chosen = chosen[-MOST_CURRENTS:]
    neighbours = tuple(sorted({each.glider for each in chosen} - {glider}))
    if not neighbours:
        return None
    nearest = min(_distance(each, last) for each in chosen if each.glider != glider)
    seas = _Seas(chosen)
    tried = list(_candidates(chosen))
    found = seas.likeliest([each for each in tried if each.glider == glider])
    return Check(
        neighbours,
        nearest,
        found,
        seas.likeliest([each for each in tried if each.glider not in ("", glider)]),
        seas.likeliest([each for each in tried if not each.glider]),
        float(np.hypot(*np.mean([each.course for each in chosen], axis=0))),
        seas.usual,
        -math.inf if found is None else seas.own_water(glider, found.sea),
    )


def current_of(dive: Assessment, before: Assessment | None) -> DiveCurrent | None:
    """The current of an assessed dive, and of how it was flown; None where it says nothing of the flow.

    ``before`` is the dive before it, at whose end it began. A dive whose measurements disagree says nothing.
    """
    known = dive.lat is not None and dive.lon is not None
    if not known or dive.reference_u is None or dive.reference_v is None or dive.flag == Flag.FALSE_ALARM:
        return None
    if any(note.startswith(OTHER_REFERENCE) for note in dive.notes):
        return None  # what it is compared with is not what it measured
    assert dive.lat is not None and dive.lon is not None
    end = start = Fix(dive.t_surface, dive.lat, dive.lon)
    if before is not None and before.lat is not None and before.lon is not None:
        start = Fix(before.t_surface, before.lat, before.lon)
    if not 0 < dive.t_dive - start.t < BETWEEN_DIVES or _way(start, end) > NEAR:
        start = Fix(dive.t_dive, dive.lat, dive.lon)
    numbers = dive.evidence
    steady, mean = numbers.get("heading_steadiness", 0.0), math.radians(numbers.get("heading_mean", 0.0))
    return DiveCurrent(
        dive.glider,
        replace(start, t=dive.t_dive),
        end,
        dive.reference_u,
        dive.reference_v,
        _doubt_of(dive),
        (steady * math.sin(mean), steady * math.cos(mean)),
        DOUBTED_SPEED if dive.flag == Flag.ANOMALY else 0.0,
        numbers.get("own_speed", 0.0) if steady > 0 else 0.0,
    )


def _doubt_of(dive: Assessment) -> float:
    """The factor on the error of the current of a dive: it is provisional, or nothing could be said of it."""
    if dive.flag is None:
        return UNKNOWN_DOUBT
    return 1.0 if dive.reference_final else PROVISIONAL_DOUBT


class _Candidate(NamedTuple):
    """What may have happened: a ``fault`` of a glider (empty: of all) ``since`` then (s), ``dives`` ago;
    ``shape`` is what one unit of it does to all currents ((2 n,))."""

    glider: str
    fault: Fault
    since: float
    dives: int
    shape: Array


def _candidates(currents: Sequence[DiveCurrent]) -> Iterator[_Candidate]:
    for glider in dict.fromkeys(each.glider for each in currents):
        rows = [k for k, each in enumerate(currents) if each.glider == glider and each.speed > 0]
        for n in range(1, min(len(rows), MOST_DIVES) + 1):
            for fault in Fault:
                shape = np.zeros(2 * len(currents))
                for k in rows[-n:]:
                    shape[2 * k : 2 * k + 2] = effect(currents[k], fault)
                yield _Candidate(glider, fault, currents[rows[-n]].start.t, n, shape)
    for fault in Fault:
        parts = [effect(each, fault) for each in currents]
        yield _Candidate("", fault, currents[0].start.t, len(currents), np.concatenate(parts))


class _Fit(NamedTuple):
    """How likely currents are in a sea: ``none`` without a fault (log likelihood), ``better`` with each of
    some, of the likeliest ``size`` with its standard error ``sigma``: (k,) each."""

    none: float
    better: Array
    size: Array
    sigma: Array


class _Seas:
    """How likely some currents are in each sea, with a fault and without; ``usual``: likeliest without."""

    def __init__(self, currents: Sequence[DiveCurrent]) -> None:
        origin = currents[-1].end
        dives = dives_between([(each.start, each.end) for each in currents], origin)
        self._currents, self._healthy = currents, healthy_errors(currents)
        self._covariance = FlowCovariance(dives, dives, origin.lat)
        self._measured = np.array([[each.u, each.v] for each in currents]).ravel()
        self._factors = dict[Sea, tuple[Array, bool]]()
        self.usual = _climb(Sea(), lambda sea: self._fit(sea, []).none)
        self._plain = self._fit(self.usual, []).none

    def likeliest(self, tried: Sequence[_Candidate]) -> Hypothesis | None:
        """The likeliest of some faults, in the sea that suits it; None where none can be."""
        first = self._best(self.usual, tried)
        if first is None:
            return None
        sea = _climb(self.usual, lambda each: float(self._fit(each, [tried[first]]).better[0]))
        at = self._best(sea, tried)
        if at is None:
            return None
        fit, each = self._fit(sea, [tried[at]]), tried[at]
        ratio = 2 * (float(fit.better[0]) - self._plain)
        size, sigma = float(fit.size[0]), float(fit.sigma[0])
        return Hypothesis(each.glider, each.fault, each.since, each.dives, size, sigma, ratio, sea)

    def own_water(self, glider: str, sea: Sea) -> float:
        """Twice the log likelihood ratio, to none, of flow at one glider that no other meets: in the usual
        sea or this one."""
        here = np.array([each.glider == glider for each in self._currents])
        t = np.array([each.end.t for each in self._currents])
        alike = np.exp(-np.abs(t[:, None] - t) / SEA_MEMORY) * (here[:, None] & here)
        water = OWN_WATER**2 * np.kron(alike, np.eye(2))
        found = (self._likelihood(self._covariance_of(each) + water) for each in {self.usual, sea})
        return 2 * (max(found) - self._plain)

    def _likelihood(self, covariance: Array) -> float:
        """The log likelihood of the currents with a covariance."""
        from scipy.linalg import cho_factor, cho_solve  # noqa: PLC0415 (slow; every command loads this module)

        factor = cho_factor(covariance, lower=True, check_finite=False)
        weighed = cho_solve(factor, self._measured, check_finite=False)
        return -0.5 * float(self._measured @ weighed) - float(np.log(np.diag(factor[0])).sum())

    def _covariance_of(self, sea: Sea) -> Array:
        """The covariance of the currents in a sea, their errors included."""
        return self._covariance.of(sea) + noise(self._currents, sea) + self._healthy

    def _best(self, sea: Sea, tried: Sequence[_Candidate]) -> int | None:
        """The place of the likeliest fault in a sea."""
        fit = self._fit(sea, tried)
        # a loss that makes it faster than it reckons, or lets it go backwards, is none
        loss = np.array([each.fault is Fault.LOSS for each in tried], dtype=bool)
        better = np.where(loss & ~((fit.size > 0) & (fit.size < MOST_LOSS)), -np.inf, fit.better)
        if not len(better) or not np.isfinite(better.max()):
            return None
        return int(np.argmax(better))

    def _fit(self, sea: Sea, tried: Sequence[_Candidate]) -> _Fit:
        from scipy.linalg import cho_factor, cho_solve  # noqa: PLC0415 (slow; every command loads this module)

        if sea not in self._factors:
            covariance = self._covariance_of(sea)
            self._factors[sea] = cho_factor(covariance, lower=True, check_finite=False)
        factor = self._factors[sea]
        shapes = np.array([each.shape for each in tried]).reshape(-1, len(self._measured))
        weighed = cho_solve(factor, np.column_stack([self._measured, shapes.T]), check_finite=False)
        none = -0.5 * float(self._measured @ weighed[:, 0]) - float(np.log(np.diag(factor[0])).sum())
        info = np.maximum(np.einsum("ij,ji->i", shapes, weighed[:, 1:]), 1e-9)
        score = self._measured @ weighed[:, 1:]
        return _Fit(none, none + 0.5 * score**2 / info, score / info, info**-0.5)


def _climb(sea: Sea, likelihood: Callable[[Sea], float]) -> Sea:
    """The likeliest sea, by one kind of number after the other until none makes it likelier."""
    best = likelihood(sea)
    for _ in range(len(_KINDS)):
        before = sea
        for kind in _KINDS:
            for numbers in kind:
                other = replace(sea, **numbers)
                if other != sea and (found := likelihood(other)) > best:
                    sea, best = other, found
        if sea == before:
            break
    return sea


def _is_near(each: DiveCurrent, last: DiveCurrent) -> bool:
    return 0 <= last.end.t - each.end.t <= CHECK_WINDOW and _distance(each, last) <= NEAR


def _distance(each: DiveCurrent, other: DiveCurrent) -> float:
    return _way(each.end, other.end)


def _way(a: Fix, b: Fix) -> float:
    """Distance (m) of two fixes."""
    return float(np.hypot(*to_plane(b.lat, b.lon, a.lat, a.lon)))
