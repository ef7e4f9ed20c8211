"""A glider whose currents do not fit those of the gliders about it: when that is reported, and when it is
over. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gliderwatch.fleet.cross_check import Check, Fault, Hypothesis
from gliderwatch.incidents.constants import NEIGHBOURS_AGAIN, NEIGHBOURS_IN_A_ROW
from gliderwatch.incidents.notices import DiffersFromNeighbours, Notice
from gliderwatch.model import Kind, Severity


@dataclass(frozen=True, slots=True)
class Comparison:
    """How a glider stood to its neighbours at the surfacing ``checked`` (s).

    ``fault`` is that of the last comparison (None: none is sure), ``in_a_row`` how many said the same; ``id``
    of what was reported (empty: nothing) at the surfacing ``since`` (s).
    """

    checked: float
    fault: Fault | None = None
    in_a_row: int = 0
    id: str = ""
    since: float = 0.0


def announce(
    glider: str, before: Comparison | None, check: Check | None, surfaced: float
) -> tuple[Comparison, list[Notice]]:
    """How a glider stands after one more surfacing (s), and what is to be reported.

    ``check`` is the comparison at it, None where nobody is near. A fault is reported when some comparisons in
    a row show it, and then not again for some days. That it is over is never reported: after as many days a
    fault that lasts is what is usual, and shows no more than none.
    """
    state = replace(before or Comparison(surfaced), checked=surfaced)
    if state.id and surfaced - state.since > NEIGHBOURS_AGAIN:
        state = replace(state, id="")
    if check is None:
        return state, []
    found = check.sure
    fault = None if found is None else found.fault
    state = replace(state, fault=fault, in_a_row=state.in_a_row + 1 if fault == state.fault else 1)
    if found is None or state.id or state.in_a_row < NEIGHBOURS_IN_A_ROW:
        return state, []
    return _begun(glider, state, check, found)


def _begun(
    glider: str, state: Comparison, check: Check, found: Hypothesis
) -> tuple[Comparison, list[Notice]]:
    """A fault is reported; one that all gliders share once for all of them."""
    whose, when = found.glider or "fleet", found.since if found.glider else state.checked // 86400.0
    loud = Severity.CRITICAL if found.fault is Fault.LOSS and found.glider else Severity.WARNING
    identity = f"{whose}/neighbours/{found.fault}/{when:.0f}"
    content = DiffersFromNeighbours(found, check.neighbours, check.nearest, reference=check.reference)
    notice = Notice(identity, identity, glider, state.checked, Kind.NEIGHBOURS, loud, loud, content)
    return replace(state, id=identity, since=state.checked), [notice]
