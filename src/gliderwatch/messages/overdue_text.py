"""What people read when a glider stays away, and when it calls again. Pure.

The same form as `messages.incident_text`: what, since when, how sure; where to search; next call; what to do.
"""

from __future__ import annotations

from gliderwatch.incidents.notices import Absence, CalledAgain, CalledInTime, DriftEllipse, Fleet, Overdue
from gliderwatch.messages.constants import ROUND
from gliderwatch.messages.formatting import (
    INCIDENTS,
    UNKNOWN,
    clean,
    duration,
    flow,
    place,
    short_place,
    utc,
)
from gliderwatch.messages.phrases import map_of, mute_link, name_of, next_call, where
from gliderwatch.messages.template import Page, Text, titled
from gliderwatch.model import Assessment

_EACH = "This stands for all of them: each that still stays away when one calls gets a message of its own."
_NO_CALL = "Next call: not known any more; the first sign of life is reported at once."


def overdue(glider: str, content: Overdue) -> Text:
    """The glider is overdue, or still is."""
    a = content.absence
    late, silent = duration(a.now - a.expected_at), duration(a.now - a.last_sign)
    still = "" if content.first else "still "
    first = f"{name_of(glider)} is {still}overdue by {late}: its call of {utc(a.expected_at)} did not come, "
    first += f"silent for {silent}. {_side(a.fleet)}"
    if not content.first:
        return titled(glider, f"STILL OVERDUE {late}"), _still(glider, a, first)
    trouble, harmless = _weighed(a)
    lists = (("For trouble of the glider", trouble), ("Against trouble of the glider", harmless))
    page = Page(
        (first, _search(a), _NO_CALL),
        _numbers(a),
        tuple((heading, lines) for heading, lines in lists if lines),
        _todo(a),
        (*(() if a.area is None else map_of(a.area.lat, a.area.lon)), *mute_link(glider)),
    )
    more = f", all {a.fleet.others + 1} silent: dockserver?" if a.fleet.is_silent else ""
    return titled(glider, f"OVERDUE {late}", more), page


def _still(glider: str, a: Absence, first: str) -> Page:
    """A reminder: five lines."""
    (label, command), *_ = mute_link(glider)
    worse = f"Worse: no sign of life since {utc(a.last_sign)}, the area grows."
    return Page((first, worse, _search(a), _NO_CALL, f"{label}: {command}"))


def called_again(glider: str, content: CalledAgain) -> Text:
    """The glider gave a sign of life."""
    silent = duration(content.at - content.last_sign)
    first = f"{name_of(glider)} calls again: {utc(content.at)}, after {silent} of silence. "
    first += "It is not overdue any more."
    still = " and ".join(f"the {INCIDENTS[i.kind]} since {utc(i.since)}" for i in content.incidents)
    first += f" But not all is well: {still} is still open." if still else ""
    page = Page(
        (first, where(content.last), next_call(content.expected), *((_EACH,) if content.for_all else ())),
        (("Silent", f"{utc(content.last_sign)} to {utc(content.at)}"), *_last(content.last)),
        do=(
            (
                "Go on with what is still open."
                if still
                else "Nothing; its dives are judged as its files come."
            ),
        ),
    )
    return titled(glider, f"ALL CLEAR: calls again after {silent}"), page


def called_in_time(glider: str, content: CalledInTime) -> Text:
    """Files that came later show that the glider had called before it was due."""
    at = content.at
    page = Page(
        (
            f"{name_of(glider)} was at the surface {utc(at)}, in time: it was never overdue. "
            "Its files came late or not at all: the delay was on shore.",
        ),
        (("Reported before", f"overdue since {utc(content.due)}"), ("So it is now", f"up {utc(at)}")),
        do=("Look at dockserver, modem and network of that time.",),
    )
    return titled(glider, "CORRECTION: was up in time, its files are late"), page


def _side(fleet: Fleet) -> str:
    """How sure it is that it is the glider, in a word and a number."""
    if not fleet.others:
        return "Glider or shore side: not known, it is the only one at sea."
    calling = fleet.others - fleet.late
    which = "the shore side" if fleet.is_silent else "the glider"
    word = "Likely" if fleet.is_silent or calling > fleet.late else "Perhaps"
    return f"{word} {which}: {calling} of {fleet.others} other gliders call."


def _search(a: Absence) -> str:
    """Where to search, and which way it drifts."""
    sets = flow(*(a.flow or (None, None)))
    drift = "drift not known" if sets == UNKNOWN else f"drifts {sets}"
    if a.area is None:
        return f"Where it is, is not known; {drift}."
    return f"Search here: {short_place(a.area.lat, a.area.lon)}, {_size(a.area)}; {drift}."


def _size(area: DriftEllipse) -> str:
    if area.minor >= ROUND * area.major:
        return f"95 % within {area.major / 1000:.1f} km"
    axes = f"95 % within {area.major / 1000:.1f} x {area.minor / 1000:.1f} km"
    return f"{axes}, the longer towards {round(area.bearing) % 180:03d}°"


def _numbers(a: Absence) -> tuple[tuple[str, str], ...]:
    spot = place(a.lat, a.lon)
    there = "" if spot == UNKNOWN else f" at {spot}"
    area = () if a.area is None else (("Search here", place(a.area.lat, a.area.lon)),)
    return (
        ("Silent since", utc(a.last_sign)),
        ("Expected", f"{utc(a.expected_at)}{there}"),
        *_last(a.last),
        *area,
    )


def _last(dive: Assessment | None) -> tuple[tuple[str, str], ...]:
    if dive is None:
        return ()
    return (("Last position", f"{place(dive.lat, dive.lon)}, surfaced {utc(dive.t_surface)}"),)


def _weighed(a: Absence) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What speaks for trouble of the glider, and what against."""
    names = tuple(f"{INCIDENTS[i.kind]} open since {utc(i.since)}" for i in a.incidents)
    fleet, well = a.fleet, a.fleet.others - a.fleet.late
    calling = (f"{well} of {fleet.others} other gliders call as expected",) if well > 0 else ()
    since = "" if fleet.last is None else f", no file of any of them since {utc(fleet.last)}"
    late = (f"{fleet.late} of {fleet.others} other gliders are late as well{since}",) if fleet.late else ()
    none = () if names else ("no incident was open before",)
    return (*names, *calling)[:3], (*none, *late)[:3]


def _todo(a: Absence) -> tuple[str, ...]:
    """What to do, by who else is silent."""
    if a.fleet.is_silent:
        names = f" ({', '.join(map(name_of, a.fleet.names))})" if a.fleet.names else ""
        who = "the other glider is" if a.fleet.others == 1 else f"all {a.fleet.others} other gliders are"
        return (f"Look at dockserver and modem first: {clean(who, 60)} silent as well{names}.", _EACH)
    open_ = "" if not a.incidents else " An incident was open: plan to go there."
    return (
        f"Read the dockserver's log: did it call without a file?{open_}",
        "Was a longer dive or mission sent? Then set overdue_hours, or mute it until it is due.",
        "Look up positions by Iridium or Argos, if it has a beacon; tell ships near the area.",
    )
