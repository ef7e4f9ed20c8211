"""What people read when a glider stays away, and when it calls again. Pure.

The same form as `messages.incident_text`: what and how bad, since when, where to look, what speaks
for trouble and against it, what to check.
"""

from __future__ import annotations

from gliderwatch.incidents.notices import Absence, CalledAgain, CalledInTime, Fleet, Overdue
from gliderwatch.messages.formatting import INCIDENTS, clean, duration, flow, map_link, place, utc
from gliderwatch.messages.template import Page, Text
from gliderwatch.model import Assessment

_EACH = (
    "This stands for all of them: each of the others is told by itself if it still stays away when one calls."
)


def overdue(glider: str, content: Overdue) -> Text:
    """The glider is overdue, or still is."""
    a, silent = content.absence, duration(content.absence.now - content.absence.heard)
    lead = f"{_name(glider)} is overdue: it was expected {utc(a.awaited)} and has been silent for {silent}."
    if not content.first:
        lead = f"Still no sign of life. {lead}"
    trouble, harmless = _weighed(a)
    page = Page(
        (lead, *_remark(a.fleet)),
        (
            ("Silent since", utc(a.heard)),
            ("Expected", f"{utc(a.awaited)}, {place(a.lat, a.lon)}"),
            *_last(a.last),
            *_look(a),
        ),
        (("Speaks for trouble", trouble), ("Speaks against", harmless), ("Check", _checks(a))),
    )
    title = f"{'' if content.first else 'STILL '}OVERDUE {_name(glider)}: silent for {silent}, "
    title += f"expected {utc(a.awaited)}"
    if a.fleet.is_silent:
        title += f", as all {a.fleet.others + 1} gliders: shore side?"
    return title, page


def called_again(glider: str, content: CalledAgain) -> Text:
    """The glider gave a sign of life."""
    silent = duration(content.at - content.heard)
    lead = f"{_name(glider)} calls again: {utc(content.at)}, after {silent} of silence. "
    lead += "It is not overdue any more."
    page = Page(
        (lead, *((_EACH,) if content.for_all else ())),
        (("Silent", f"{utc(content.heard)} to {utc(content.at)}"), *_last(content.last)),
    )
    return f"ALL CLEAR {_name(glider)}: it calls again after {silent}", page


def called_in_time(glider: str, content: CalledInTime) -> Text:
    """Files that came later show that the glider had called before it was due."""
    at = content.at
    page = Page(
        (
            f"Correction for {_name(glider)}: it was up {utc(at)}, in time. "
            "Its files came late or not at all: not the glider was slow, but their way to here.",
        ),
        (("Told before", f"overdue since {utc(content.due)}"), ("Known now", f"at the surface {utc(at)}")),
        (("Check", ("dockserver, modem and network of that time",)),),
    )
    return f"CORRECTION {_name(glider)}: it was up in time, {utc(at)}; its files came late", page


def _name(glider: str) -> str:
    return clean(glider, 40)


def _remark(fleet: Fleet) -> tuple[str, ...]:
    """The one thing an operator would say first where no glider calls."""
    if not fleet.is_silent:
        return ()
    others = "the other glider is" if fleet.others == 1 else f"all {fleet.others} other gliders are"
    since = "" if fleet.last is None else f", no file of any of them since {utc(fleet.last)}"
    names = f" ({', '.join(map(_name, fleet.names))})" if fleet.names else ""
    return (f"Look at dockserver and modem first: {others} late as well{since}{names}.", _EACH)


def _last(dive: Assessment | None) -> tuple[tuple[str, str], ...]:
    if dive is None:
        return ()
    return (("Last position", f"{place(dive.lat, dive.lon)}, surfaced {utc(dive.t_surface)}"),)


def _look(a: Absence) -> tuple[tuple[str, str], ...]:
    """Where to look: the middle of the area, its size and direction, the current that it rests upon."""
    if a.area is None:
        return (("Look at", "no position is known"),)
    area = a.area
    size = f"95 % within {area.major / 1000:.1f} x {area.minor / 1000:.1f} km (semi-axes), "
    size += f"longer towards {round(area.bearing) % 180:03d}° true"
    drift = "" if a.last is None else flow(*(a.flow or (None, None)))
    return (
        ("Look at", place(area.lat, area.lon)),
        ("Map", map_link(area.lat, area.lon)),
        ("Area", size),
        *((("Drift", f"last known current, {drift}"),) if drift else ()),
    )


def _weighed(a: Absence) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What speaks for trouble of the glider, and what against."""
    names = [f"{INCIDENTS[i.kind]} open since {utc(i.since)}" for i in a.incidents]
    fleet, well = a.fleet, a.fleet.others - a.fleet.late
    calling = (f"{well} of {fleet.others} other gliders call as expected",) if well > 0 else ()
    late = (f"{fleet.late} of {fleet.others} other gliders are late as well",) if fleet.late else ()
    none = () if names else ("no incident was open before",)
    alone = () if fleet.others else ("no other glider at sea to tell glider and shore side apart",)
    return (*names, *calling) or ("nothing but the silence",), (*none, *late, *alone)


def _checks(a: Absence) -> tuple[str, ...]:
    return (
        "dockserver, modem and network: does a file of any glider come?",
        "the Iridium and Argos positions of the glider, if it has a beacon of its own",
        "the mission that runs: a longer interval, a no-comms or drift behaviour",
        "the last dives: leak, voltage, vacuum, aborts",
        *(("the ships and gliders near the area",) if a.area is not None else ()),
    )
