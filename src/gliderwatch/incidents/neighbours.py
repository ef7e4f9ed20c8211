"""A glider whose currents do not fit those of the gliders about it: when that is reported, and when it is
over. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gliderwatch.fleet.cross_check import Check, Fault, Hypothesis
from gliderwatch.incidents.constants import NEIGHBOURS_IN_A_ROW
from gliderwatch.incidents.notices import DiffersFromNeighbours, FitsNeighbours, Notice
from gliderwatch.model import Kind, Severity


@dataclass(frozen=True, slots=True)
class Comparison:
    """How a glider stood to its neighbours at the surfacing ``checked`` (s).

    ``fault`` is that of the last comparison (None: none is sure), ``in_a_row`` how many said the same; ``id``
    of what is reported and not over (empty: nothing), of the fault ``reported``, to whom it ``went``.
    """

    checked: float
    fault: Fault | None = None
    in_a_row: int = 0
    id: str = ""
    reported: Fault | None = None
    went: Severity = Severity.WARNING


def announce(
    glider: str, before: Comparison | None, check: Check | None, surfaced: float
) -> tuple[Comparison, list[Notice]]:
    """How a glider stands after one more surfacing (s), and what is to be reported.

    ``check`` is the comparison at it, None where nobody is near. A fault is reported when some comparisons in
    a row show it; it is over when as many show none. Nothing is over because the neighbours went away.
    """
    state = before or Comparison(surfaced)
    if check is None:
        return replace(state, checked=surfaced), []
    found = check.sure
    fault = None if found is None else found.fault
    row = state.in_a_row + 1 if fault == state.fault else 1
    state = replace(state, checked=surfaced, fault=fault, in_a_row=row)
    if row < NEIGHBOURS_IN_A_ROW:
        return state, []
    if found is not None and not state.id:
        return _begun(glider, state, check, found)
    if found is None and state.id and state.reported is not None:
        notice = Notice(
            f"{state.id}/over", state.id, glider, surfaced, Kind.ALL_CLEAR, Severity.INFO, state.went,
            FitsNeighbours(state.reported, check.neighbours, surfaced),
        )  # fmt: skip
        return replace(state, id="", reported=None), [notice]
    return state, []


def _begun(
    glider: str, state: Comparison, check: Check, found: Hypothesis
) -> tuple[Comparison, list[Notice]]:
    """A fault is reported; one that all gliders share once for all of them."""
    whose, when = found.glider or "fleet", found.since if found.glider else state.checked // 86400.0
    loud = Severity.CRITICAL if found.fault is Fault.LOSS and found.glider else Severity.WARNING
    identity = f"{whose}/neighbours/{found.fault}/{when:.0f}"
    content = DiffersFromNeighbours(found, check.neighbours, check.nearest)
    notice = Notice(identity, identity, glider, state.checked, Kind.NEIGHBOURS, loud, loud, content)
    return replace(state, id=identity, reported=found.fault, went=loud), [notice]
