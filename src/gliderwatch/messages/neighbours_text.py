"""What people read when the currents of a glider do not fit those of its neighbours, and what to check.
Pure."""

from __future__ import annotations

from math import degrees

from gliderwatch.fleet.cross_check import Fault
from gliderwatch.incidents.notices import DiffersFromNeighbours
from gliderwatch.messages.formatting import clean, utc
from gliderwatch.messages.template import Page, Text

_CHECKS = {
    Fault.LOSS: (
        "the roll, before and after: a wing that is lost or bent rolls the glider, most of the time",
        "fly another heading for some dives: a current stays, a loss turns with the glider",
        "`normal_speed`, if it was launched like that",
    ),
    Fault.TURN: (
        "the compass: was anything magnetic changed on board, or the pitch battery moved far?",
        "the magnetic variation that the glider uses (m_gps_mag_var)",
        "fly another heading for some dives: a current stays, an error of the compass turns with the glider",
    ),
}
_SHARED = (
    "what the gliders have in common: magnetic variation, configuration, a script that sets headings",
    "a storm or a front that all of them met",
)


def differs(glider: str, content: DiffersFromNeighbours) -> Text:
    """The currents of a glider, or of all alike, are not those that its neighbours measure."""
    found, shared = content.found, not content.found.glider
    name = "the fleet" if shared else clean(glider, 40)
    what = _what(found.fault, found.size)
    lead = f"The currents that {name} reports do not fit those of its neighbours. It {what}."
    if shared:
        lead = f"The currents of all gliders about {clean(glider, 40)} misfit alike: as if each {what}. "
        lead += "That is one error that they share, not many faults."
    page = Page(
        (lead,),
        (
            ("Since", f"{utc(found.since)}, {found.dives} dives"),
            ("How much", _amount(found.fault, found.size, found.sigma)),
            (
                "Compared with",
                f"{_names(content.neighbours)}; the next is {content.nearest / 1e3:.0f} km away",
            ),
            ("Evidence", f"a likelihood ratio of {found.ratio:.0f}"),
        ),
        (("Check", _SHARED if shared else _CHECKS[found.fault]),),
    )
    return f"DIFFERS FROM NEIGHBOURS {name}: {what}", page


def _what(fault: Fault, size: float) -> str:
    if fault is Fault.LOSS:
        return f"makes {100 * size:.0f} % less way through the water than it believes"
    return f"has a compass that is {abs(degrees(size)):.0f} degrees off"


def _amount(fault: Fault, size: float, sigma: float) -> str:
    if fault is Fault.LOSS:
        return f"{100 * size:.0f} % of its speed, +- {196 * sigma:.0f} % (95 %)"
    side = "too much" if size > 0 else "too little"
    return f"{abs(degrees(size)):.0f} degrees {side}, +- {1.96 * degrees(sigma):.0f} (95 %)"


def _names(names: tuple[str, ...]) -> str:
    return ", ".join(clean(name, 40) for name in names[:8])
