"""A dive beside the gliders about it: what they say of its flow, and of what is wrong with its glider. Pure.

A layer over the assessments of single gliders, which know nothing of each other. It is made of their rows
alone: for a dive, of those of all gliders that ended in the days before its surfacing, not after it. Nothing
is kept. So the same rows give the same, whatever order the files came in, and a current that comes late has
its place.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gliderwatch.fleet.constants import CHECK_WINDOW, FAULTY_DOUBT, FLOW_WINDOW, IN_A_ROW
from gliderwatch.fleet.cross_check import Check, Hypothesis, cross_check, current_of
from gliderwatch.fleet.flow import DiveCurrent, Fault, FleetFlow, fleet_flow
from gliderwatch.model import Array, Assessment, Flag

Mean = tuple[Array, Array]
"""A flow (m/s, (2,)) and its covariance (m2/s2, (2, 2))."""


@dataclass(frozen=True, slots=True)
class Standing:
    """How a glider stands to its neighbours at its last surfacing: the ``check``, and the ``fault`` that was
    sure at it and at the one before (None: nothing)."""

    check: Check
    fault: Hypothesis | None


@dataclass(frozen=True, slots=True)
class FleetReference:
    """The flow on the ``last`` dive of a glider by its fleet.

    ``others``: by the other gliders alone. ``fused``: by these, by what the glider measured before (until its
    fault, if it has one) and by a model, each weighed by its covariance. ``check``, ``fault``: a `Standing`.
    """

    last: DiveCurrent
    others: FleetFlow
    fused: Mean
    check: Check
    fault: Hypothesis | None


def standing(currents: Sequence[DiveCurrent], glider: str) -> Standing | None:
    """How a glider stands to its neighbours; None where nobody is near.

    ``currents`` are those of all gliders, in any order; what ended after its last dive does not count.
    """
    ends = sorted(each.end.t for each in currents if each.glider == glider)[-IN_A_ROW:]
    if not ends:
        return None
    checks = _checks(currents, glider, ends)
    check = next(checks)
    if check is None:
        return None
    fault = check.sure
    if fault is not None and (len(ends) < IN_A_ROW or not all(_shows(each, fault) for each in checks)):
        fault = None
    return Standing(check, fault)


def fleet_reference(
    currents: Sequence[DiveCurrent], glider: str, model: Mean | None = None, stands: Standing | None = None
) -> FleetReference | None:
    """The reference of the last dive of a glider; None where nobody is near.

    ``currents`` as of `standing`; ``model`` is the flow on the dive by an ocean model or a radar; ``stands``
    is how it stands to its neighbours (None: that is still to be found).
    """
    stands = standing(currents, glider) if stands is None else stands
    if stands is None:
        return None
    check = stands.check
    last = max((each for each in currents if each.glider == glider), key=lambda each: each.end.t)
    known = [each for each in currents if each.end.t <= last.end.t]
    believed, own = _without_faults(known, check), check.sure
    is_own = own is not None and own.glider == glider
    sea, until = (own.sea, own.since) if own is not None and is_own else (check.sea, last.start.t)
    others = fleet_flow(believed, glider, last.start, last.end, sea)
    both = fleet_flow(believed, glider, last.start, last.end, sea, until)
    if others is None or both is None:
        return None
    fused = (both.flow, both.cov) if model is None else _fused((both.flow, both.cov), model)
    return FleetReference(last, others, fused, check, stands.fault)


def _checks(currents: Sequence[DiveCurrent], glider: str, ends: Sequence[float]) -> Iterator[Check | None]:
    """How a glider stood to its neighbours at its last surfacings (s), the last one first."""
    for end in reversed(ends):
        yield cross_check([each for each in currents if each.end.t <= end], glider)


def _shows(check: Check | None, fault: Hypothesis) -> bool:
    """Whether a comparison shows the same fault of the same glider, or of all."""
    found = None if check is None else check.sure
    return found is not None and (found.glider, found.fault) == (fault.glider, fault.fault)


def _without_faults(currents: Sequence[DiveCurrent], check: Check) -> list[DiveCurrent]:
    """The currents, with a doubt on those of another glider that likely has a fault, since then."""
    other = check.doubted
    if other is None:
        return list(currents)
    return [
        replace(each, doubt=FAULTY_DOUBT)
        if each.glider == other.glider and each.end.t > other.since
        else each
        for each in currents
    ]


def _fused(a: Mean, b: Mean) -> Mean:
    """Two flows that know nothing of each other, weighed by their covariance."""
    gain = a[1] @ np.linalg.inv(a[1] + b[1])
    return a[0] + gain @ (b[0] - a[0]), a[1] - gain @ a[1]


# ----------------------------------------
# The assessments of dives with that.


def beside_neighbours(dives: Iterable[Assessment], fleet: Iterable[Sequence[Assessment]]) -> list[Assessment]:
    """Dives as the fleet sees them: with the flow by the others, and a hidden fault that they show.

    ``fleet`` are the dives of each glider near them in time, each in order of time. A dive without neighbours
    stays as it is.
    """
    currents = [each for own in fleet for each in map(current_of, own, [None, *own]) if each is not None]
    currents.sort(key=lambda each: (each.end.t, each.glider))
    ends = [each.end.t for each in currents]
    return [_beside(dive, currents, ends) for dive in dives]


def _beside(dive: Assessment, currents: Sequence[DiveCurrent], ends: Sequence[float]) -> Assessment:
    t = dive.t_surface
    near = currents[bisect_left(ends, t - max(CHECK_WINDOW, FLOW_WINDOW)) : bisect_right(ends, t)]
    if not any(each.glider == dive.glider and each.end.t == t for each in near):
        return dive  # it has no current, or one that is wrong
    found = fleet_reference(near, dive.glider, _model(dive))
    return dive if found is None else assessed(dive, found)


def _model(dive: Assessment) -> Mean | None:
    """The flow on a dive by an ocean model."""
    u, v, sigma = (dive.evidence.get(f"model_{key}") for key in ("u", "v", "sigma"))
    if u is None or v is None or sigma is None:
        return None
    return np.array([u, v]), sigma**2 * np.eye(2)


def assessed(dive: Assessment, found: FleetReference) -> Assessment:
    """A dive as the fleet sees it."""
    numbers = {**dive.evidence, **_numbers(found)}
    names = ", ".join(found.others.gliders)
    dive = replace(dive, evidence=numbers, notes=(*dive.notes, f"flow by the fleet: {names}"))
    fault = found.fault
    if fault is None or dive.flag not in (None, Flag.NORMAL):
        return dive
    if not fault.glider:
        words = "the currents of all gliders about it misfit alike: one error that they share"
        return replace(dive, flag=int(Flag.FALSE_ALARM), reason=words)
    if fault.fault is Fault.TURN:
        words = (
            f"the compass is off by {math.degrees(abs(fault.size)):.0f} degrees, by its neighbours {names}"
        )
        return replace(dive, flag=int(Flag.FALSE_ALARM), reason=words)
    u, v = found.fused[0].tolist()
    speed = None if dive.speed is None else dive.speed * max(1 - fault.size, 0.0)
    words = f"{100 * fault.size:.0f} % slower through the water than it believes, by its neighbours {names}"
    return replace(dive, flag=int(Flag.ANOMALY), reason=words, speed=speed, flow_u=u, flow_v=v)


def _numbers(found: FleetReference) -> dict[str, float]:
    """What the fleet says of a dive, as evidence."""
    others, (flow, cov) = found.others, found.fused
    out = {
        "fleet_u": float(others.flow[0]),
        "fleet_v": float(others.flow[1]),
        "fleet_sigma": math.sqrt(float(np.trace(others.cov)) / 2),
        "fleet_gliders": float(len(others.gliders)),
        "fleet_nearest": others.nearest,
        "fused_u": float(flow[0]),
        "fused_v": float(flow[1]),
        "fused_sigma": math.sqrt(float(np.trace(cov)) / 2),
    }
    fault = found.fault
    if fault is not None and fault.glider and fault.fault is Fault.LOSS:
        out |= {"fleet_loss": fault.size, "fleet_loss_sigma": fault.sigma}
    elif fault is not None and fault.glider:
        out |= {"fleet_turn": fault.size, "fleet_turn_sigma": fault.sigma}
    return out
