"""A glider whose currents do not fit those of the gliders about it: when that is reported, and when it is
over. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gliderwatch.fleet.flow import Fault
from gliderwatch.fleet.reference import FleetReference, Standing
from gliderwatch.incidents.constants import NEIGHBOURS_AGAIN
from gliderwatch.incidents.notices import DiffersFromNeighbours, Notice
from gliderwatch.model import Kind, Severity


@dataclass(frozen=True, slots=True)
class Comparison:
    """How a glider stood to its neighbours at the surfacing ``checked`` (s).

    ``fault`` is what they show (None: nothing); ``id`` of what was reported (empty: nothing) at the surfacing
    ``since`` (s).
    """

    checked: float
    fault: Fault | None = None
    id: str = ""
    since: float = 0.0


def announce(
    glider: str,
    before: Comparison | None,
    stands: Standing | None,
    reference: FleetReference | None,
    surfaced: float,
) -> tuple[Comparison, list[Notice]]:
    """How a glider stands after one more surfacing (s), and what is to be reported.

    ``stands``: how it stood to its neighbours at it, None where nobody is near; ``reference``: the flow at it
    by them, where they show a fault. A fault is reported once, and then not again
    for some days. That it is over is never reported: after as many days a fault that lasts is what is usual,
    and shows no more than none.
    """
    state = replace(before or Comparison(surfaced), checked=surfaced)
    if state.id and surfaced - state.since > NEIGHBOURS_AGAIN:
        state = replace(state, id="")
    if stands is None:
        return state, []
    state = replace(state, fault=None if stands.fault is None else stands.fault.fault)
    return (state, []) if reference is None or state.id else _begun(glider, state, reference)


def _begun(glider: str, state: Comparison, reference: FleetReference) -> tuple[Comparison, list[Notice]]:
    """A fault is reported; one that all gliders share once for all of them."""
    found, check = reference.fault, reference.check
    assert found is not None
    whose, when = found.glider or "fleet", found.since if found.glider else state.checked // NEIGHBOURS_AGAIN
    loud = Severity.CRITICAL if found.fault is Fault.LOSS and found.glider else Severity.WARNING
    identity = f"{whose}/neighbours/{found.fault}/{when:.0f}"
    content = DiffersFromNeighbours(found, check.neighbours, check.nearest, reference=reference)
    notice = Notice(identity, identity, glider, state.checked, Kind.NEIGHBOURS, loud, loud, content)
    return replace(state, id=identity, since=state.checked), [notice]
