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
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from gliderwatch.fleet.constants import (
    BETWEEN_DIVES,
    CHECK_WINDOW,
    CLEARER,
    DAC_NOISE,
    DOUBTED_SPEED,
    LEAST_DIVES,
    LEAST_LOSS,
    LEAST_TURN,
    MOST_CURRENTS,
    MOST_DIVES,
    MOST_ONE_WAY,
    NEAR,
    SEA_EDDIES,
    SEA_MEAN,
    SEA_SCALES,
    SEA_TIDE,
    SEA_TIDE_GRADIENT,
    SHARED_SURE,
    SURE,
    USUAL_SLIP,
    USUAL_TURN,
)
from gliderwatch.fleet.flow import USUAL, DiveCurrent, FlowSizes, currents_covariance, fleet_flow
from gliderwatch.model import Array, Assessment, Fix, Flag
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.sea.tides import Constituent

_TIDES = (Constituent.M2, Constituent.S2, Constituent.N2, Constituent.K1, Constituent.O1)
_SEAS = tuple(
    FlowSizes(eddy, SEA_MEAN, SEA_TIDE, SEA_TIDE_GRADIENT, _TIDES, scale)
    for scale in SEA_SCALES
    for eddy in SEA_EDDIES
)


class Fault(StrEnum):
    """What the currents of a glider show."""

    LOSS = "loss"
    TURN = "turn"


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
    sea: FlowSizes = USUAL


@dataclass(frozen=True, slots=True)
class Reference:
    """What moved the water on the last dive of a glider: by its ``own`` current, and by the ``flow`` of the
    others and of its own before the fault (m/s; east, north), with the standard error of that (m/s, a
    component)."""

    own: tuple[float, float]
    flow: tuple[float, float]
    sigma: float


@dataclass(frozen=True, slots=True)
class Check:
    """What the comparison of a glider with its ``neighbours`` (names, with ``nearest``, m) shows.

    ``found`` is the likeliest fault of it (None: none is likely), ``others`` the likeliest of another glider,
    ``common`` the likeliest that all have alike (its ``glider`` is empty); ``one_way`` is the length of their
    mean course, ``reference`` what a fault of it that is sure is seen by.
    """

    neighbours: tuple[str, ...]
    nearest: float
    found: Hypothesis | None
    others: Hypothesis | None
    common: Hypothesis | None = None
    one_way: float = 0.0
    reference: Reference | None = None

    @property
    def sure(self) -> Hypothesis | None:
        """The fault that is to be reported: too likely for chance, large enough, and more likely than the
        others."""
        own, other, common = (
            h.ratio if h is not None else 0.0 for h in (self.found, self.others, self.common)
        )
        if common > max(own, other) + CLEARER:
            return self.common if self.one_way < MOST_ONE_WAY and _is_large(self.common) else None
        return self.found if own > max(other, common) + CLEARER and _is_large(self.found) else None


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
    found = list(_hypotheses(chosen))
    nearest = min(_distance(each, last) for each in chosen if each.glider != glider)
    check = Check(
        neighbours,
        nearest,
        _likeliest(each for each in found if each.glider == glider),
        _likeliest(each for each in found if each.glider not in ("", glider)),
        _likeliest(each for each in found if not each.glider),
        float(np.hypot(*np.mean([each.course for each in chosen], axis=0))),
    )
    return check if check.sure is None else replace(check, reference=_reference(chosen, last, check.sure))


def _reference(currents: Sequence[DiveCurrent], last: DiveCurrent, found: Hypothesis) -> Reference | None:
    """What a fault of a glider is seen by on its last dive; None where it is not of one glider."""
    if found.glider != last.glider:
        return None
    flow = fleet_flow(currents, last.glider, last.start, last.end, found.sea, found.since)
    if flow is None:
        return None
    u, v = flow.flow.tolist()
    return Reference((last.u, last.v), (u, v), math.sqrt(float(np.trace(flow.cov)) / 2))


def current_of(dive: Assessment, before: Assessment | None) -> DiveCurrent | None:
    """The current of an assessed dive, and of how it was flown; None where it says nothing of the flow.

    ``before`` is the dive before it, at whose end it began. A dive whose measurements disagree says nothing.
    """
    known = dive.lat is not None and dive.lon is not None
    if not known or dive.reference_u is None or dive.reference_v is None or dive.flag == Flag.FALSE_ALARM:
        return None
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
        DAC_NOISE if dive.reference_final else 2 * DAC_NOISE,
        (steady * math.sin(mean), steady * math.cos(mean)),
        DOUBTED_SPEED if dive.flag == Flag.ANOMALY else 0.0,
        numbers.get("own_speed", 0.0) if steady > 0 else 0.0,
    )


def _hypotheses(currents: Sequence[DiveCurrent]) -> Iterator[Hypothesis]:
    """For each glider, fault and first dive with it, how likely that is."""
    measured = np.array([[each.u, each.v] for each in currents]).ravel()
    tried = list(_candidates(currents))
    if not tried:
        return
    from scipy.linalg import cho_factor, cho_solve  # noqa: PLC0415 (slow; every command loads this module)

    shapes = np.array([shape for *_, shape in tried]).T
    plain, likelihoods, sizes, sigmas = -math.inf, [], [], []
    healthy = _healthy_errors(currents)
    for sea in _SEAS:
        factor = cho_factor(currents_covariance(currents, sea) + healthy, lower=True)
        weighed = cho_solve(factor, np.column_stack([measured, shapes]))
        none = -0.5 * float(measured @ weighed[:, 0]) - float(np.log(np.diag(factor[0])).sum())
        info = np.maximum(np.einsum("ij,ij->j", shapes, weighed[:, 1:]), 1e-9)
        score = measured @ weighed[:, 1:]
        plain = max(plain, none)
        likelihoods.append(none + 0.5 * score**2 / info)
        sizes.append(score / info)
        sigmas.append(info**-0.5)
    best = np.argmax(likelihoods, axis=0)
    for k, (glider, fault, since, dives, _) in enumerate(tried):
        sea, size = _SEAS[best[k]], float(sizes[best[k]][k])
        ratio = 2 * (float(likelihoods[best[k]][k]) - plain)
        if fault is Fault.LOSS and not 0 < size < 1.2:
            continue  # faster than it reckons, or backwards: no loss does that
        yield Hypothesis(glider, fault, since, dives, size, float(sigmas[best[k]][k]), ratio, sea)


def _candidates(currents: Sequence[DiveCurrent]) -> Iterator[tuple[str, Fault, float, int, Array]]:
    """What may have happened: glider, fault, since (s), dives since, and what one unit of it does to all
    currents."""
    for glider in dict.fromkeys(each.glider for each in currents):
        rows = [k for k, each in enumerate(currents) if each.glider == glider and each.speed > 0]
        for n in range(1, min(len(rows), MOST_DIVES) + 1):
            for fault in Fault:
                shape = np.zeros(2 * len(currents))
                for k in rows[-n:]:
                    shape[2 * k : 2 * k + 2] = _effect(currents[k], fault)
                yield glider, fault, currents[rows[-n]].start.t, n, shape
    for fault in Fault:
        parts = [_effect(each, fault) for each in currents]
        yield "", fault, currents[0].start.t, len(currents), np.concatenate(parts)


def _healthy_errors(currents: Sequence[DiveCurrent]) -> Array:
    """Covariance of what is off in the currents of each healthy glider all the time."""
    out = np.zeros((2 * len(currents), 2 * len(currents)))
    for fault, usual in ((Fault.LOSS, USUAL_SLIP), (Fault.TURN, USUAL_TURN)):
        effects = np.concatenate([_effect(each, fault) for each in currents])
        names = np.repeat([each.glider for each in currents], 2)
        out += usual**2 * np.outer(effects, effects) * (names[:, None] == names)
    return out


def _effect(current: DiveCurrent, fault: Fault) -> Array:
    """What one unit of a fault does to a current."""
    east, north = current.course
    return current.speed * np.array((-east, -north) if fault is Fault.LOSS else (-north, east))


def _likeliest(found: Iterable[Hypothesis]) -> Hypothesis | None:
    return max(found, key=lambda each: each.ratio, default=None)


def _is_near(each: DiveCurrent, last: DiveCurrent) -> bool:
    return 0 <= last.end.t - each.end.t <= CHECK_WINDOW and _distance(each, last) <= NEAR


def _distance(each: DiveCurrent, other: DiveCurrent) -> float:
    return _way(each.end, other.end)


def _way(a: Fix, b: Fix) -> float:
    """Distance (m) of two fixes."""
    return float(np.hypot(*to_plane(b.lat, b.lon, a.lat, a.lon)))
