"""What people read when the currents of a glider do not fit those of its neighbours, and what to check.
Pure."""

from __future__ import annotations

from math import degrees, exp, sqrt

from gliderwatch.fleet.cross_check import Hypothesis
from gliderwatch.fleet.flow import Fault
from gliderwatch.fleet.reference import FleetReference
from gliderwatch.incidents.notices import DiffersFromNeighbours
from gliderwatch.messages.constants import CERTAIN
from gliderwatch.messages.formatting import clean, flow, utc
from gliderwatch.messages.phrases import map_of, mute_link, name_of, next_call, where
from gliderwatch.messages.template import Page, Text, titled

_CHECKS = {
    Fault.LOSS: (
        "Plot the roll before and after: a lost or bent wing rolls the glider, most of the time.",
        "Fly another heading for some dives: a current stays, a loss turns with the glider.",
        "If it was launched like that, set `normal_speed`.",
    ),
    Fault.TURN: (
        "Compass: was anything magnetic changed on board, or the pitch battery moved far?",
        "Check the magnetic variation that the glider uses (m_gps_mag_var).",
        "Fly another heading for some dives: a current stays, an error of the compass turns with it.",
    ),
}
_SHARED = (
    "Look for what they share: magnetic variation, configuration, a script that sets headings.",
    "Was there a storm or a front that all of them met? Then nothing.",
)


def differs(glider: str, content: DiffersFromNeighbours) -> Text:
    """The currents of a glider, or of all alike, are not those that its neighbours measure."""
    found, shared, last = content.found, not content.found.glider, content.situation.last
    what = _what(found.fault, found.size)
    chance = min(1 / (1 + exp(-found.ratio / 2)), CERTAIN)  # twice the log of the odds
    since = f"since {utc(found.since)} ({found.dives} dives); almost sure ({100 * chance:.0f} %)"
    if shared:
        first = (
            f"The currents of all gliders about {name_of(glider)} misfit alike, as if each {what}, {since}. "
        )
        first += "That is one error that they share, not many faults."
    else:
        first = f"{name_of(glider)} {what}, {since}: its currents do not fit those of its neighbours."
    page = Page(
        (first, where(content.situation.last), next_call(content.situation.expected)),
        (
            ("How much", _amount(found.fault, found.size, found.sigma)),
            (
                "Compared with",
                f"{_names(content.neighbours)}; the next is {content.nearest / 1e3:.0f} km away",
            ),
            *_water(content.reference),
        ),
        do=_SHARED if shared else _CHECKS[found.fault],
        links=(*(() if last is None else map_of(last.lat, last.lon)), *mute_link(glider)),
        symbols=(f"twice the log likelihood ratio {found.ratio:.0f}",),
    )
    short = "LOSES SPEED" if found.fault is Fault.LOSS else "COMPASS OFF"
    if shared:
        return titled(glider, "and all about it: DIFFERENT CURRENTS", f" ({_short(found)})"), page
    return titled(glider, f"{short} by {_short(found)}, say its neighbours"), page


def _short(found: Hypothesis) -> str:
    size = 100 * found.size if found.fault is Fault.LOSS else abs(degrees(found.size))
    return f"{size:.0f} {'%' if found.fault is Fault.LOSS else 'degrees'}"


def _what(fault: Fault, size: float) -> str:
    if fault is Fault.LOSS:
        return f"makes {100 * size:.0f} % less way through the water than it believes"
    return f"has a compass that is {abs(degrees(size)):.0f} degrees off"


def _amount(fault: Fault, size: float, sigma: float) -> str:
    if fault is Fault.LOSS:
        return f"{100 * size:.0f} % of its speed, ± {196 * sigma:.0f} % (95 %)"
    side = "too much" if size > 0 else "too little"
    return f"{abs(degrees(size)):.0f} degrees {side}, ± {1.96 * degrees(sigma):.0f} (95 %)"


def _water(reference: FleetReference | None) -> tuple[tuple[str, str], ...]:
    """What moved the water on the last dive, by the fleet and by itself."""
    if reference is None:
        return ()
    (u, v), cov = reference.fused[0].tolist(), reference.fused[1]
    by_fleet = f"{flow(u, v)}, ± {1.96 * sqrt(cov.trace() / 2):.2f} m/s (95 %)"
    own = flow(reference.last.u, reference.last.v)
    return (("Current, last dive", f"by the others and its dives before {by_fleet}; by its own {own}"),)


def _names(names: tuple[str, ...]) -> str:
    return ", ".join(clean(name, 40) for name in names[:8])
