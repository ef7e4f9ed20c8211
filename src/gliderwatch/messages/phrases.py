"""Phrases that many messages share: where a glider is, when it calls, numbers of a dive, links. Pure."""

from __future__ import annotations

from gliderwatch.incidents.notices import Situation
from gliderwatch.messages.causes import is_named
from gliderwatch.messages.evidence import normal_range, number, out_of_range
from gliderwatch.messages.formatting import (
    INCIDENTS,
    UNKNOWN,
    clean,
    duration,
    finite,
    flow,
    map_link,
    place,
    short_place,
    speed,
    utc,
)
from gliderwatch.messages.template import command
from gliderwatch.model import Assessment, Incident, NextSurfacing

Pairs = tuple[tuple[str, str], ...]


def name_of(glider: str) -> str:
    """The name of a glider, as one short line."""
    return clean(glider, 40)


def exact_speed(a: Assessment) -> str:
    """The speed, with a third digit where two would make it look within its range though it is not."""
    value = finite(a.speed)
    if value is not None and out_of_range(a, value) and not out_of_range(a, round(value, 2)):
        return f"{value:.3f} m/s"
    return speed(value)


def speed_and_range(a: Assessment) -> str:
    """The speed through the water beside what is normal."""
    value = "speed not known" if finite(a.speed) is None else exact_speed(a)
    return f"{value} ({normal_range(a)})"


def where(a: Assessment | None, *, is_flow_sure: bool = True) -> str:
    """Where a glider came up last, and which way the current sets it."""
    if a is None:
        return "Where it is, is not known."
    spot = short_place(a.lat, a.lon)
    at = f"place not known, surfaced {utc(a.t_surface)}" if spot == UNKNOWN else f"{spot}, {utc(a.t_surface)}"
    sets = _current(a) if is_flow_sure else UNKNOWN
    return f"Last at {at}; current {'not known' if sets == UNKNOWN else sets}."


def _current(a: Assessment) -> str:
    estimated = flow(a.flow_u, a.flow_v)
    return flow(a.reference_u, a.reference_v) if estimated == UNKNOWN else estimated


def next_call(expected: NextSurfacing | None) -> str:
    """When and where a glider calls next."""
    if expected is None:
        return "Next call: not known."
    spot = short_place(expected.lat, expected.lon)
    at = "" if spot == UNKNOWN else f" near {spot}"
    return f"Next call: {utc(expected.t)} ± {duration(1.96 * expected.t_sigma)}{at}."


def trend(situation: Situation) -> str:
    """The last speeds, oldest first; empty where there are none."""
    if not situation.speeds:
        return ""
    values = ", ".join("?" if (v := finite(x)) is None else f"{v:.2f}" for x in situation.speeds)
    return f"{values} m/s"


def map_of(lat: float | None, lon: float | None) -> Pairs:
    """The link to a map, where a place is known."""
    link = map_link(lat, lon)
    return (("Map", link),) if link else ()


def still_open_ones(situation: Situation) -> list[tuple[str, float]]:
    """What else is open, by its name, and since when (s)."""
    dives = [(INCIDENTS[each.kind], each.since) for each in situation.others]
    return [*dives, *((each.rule.replace("_", " "), each.since) for each in situation.health)]


def take_on(incident: Incident, situation: Situation) -> Pairs:
    """How to take an incident on: the glider is enough where no other is open."""
    what = incident.id if situation.others else incident.glider
    return (("Take it on", command(f"ack {what}")),)


def take_on_thread(glider: str) -> Pairs:
    """How to take on what is no incident of dives; of several that are open the command names the ids."""
    return (("Take it on", command(f"ack {glider}")),)


def mute_link(glider: str) -> Pairs:
    """How to keep a glider quiet while somebody works on what is no incident."""
    return (("Quiet while you work on it", command(f"mute {glider} --hours 6")),)


def dive_numbers(a: Assessment, situation: Situation) -> Pairs:
    """Speeds, place and currents of a dive, in numbers."""
    last, sigma, middle = trend(situation), number(a, "speed_sigma"), number(a, "usual_speed")
    exact = exact_speed(a) + (f" ± {sigma:.2f}" if sigma is not None and finite(a.speed) is not None else "")
    often = f", usually {middle:.2f}" if middle is not None else ""
    reference = flow(a.reference_u, a.reference_v)
    if reference != UNKNOWN:
        reference += " (final)" if a.reference_final else " (provisional)"
    reason, came_up = clean(a.reason, 100), clean(situation.came_up, 60)
    return (
        *((("Last speeds", last),) if last else ()),
        ("Speed through water", f"{exact}, {normal_range(a)}{often}"),
        ("Where", place(a.lat, a.lon)),
        ("Dive", f"{utc(a.t_dive)} to {utc(a.t_surface)}, segment {clean(a.segment, 60)}"),
        *((("Came up because", came_up),) if came_up else ()),
        ("Current, estimated", flow(a.flow_u, a.flow_v)),
        ("Current as the glider reckons it", reference),
        *((("Why it is flagged", reason),) if reason and a.flag and not is_named(a.reason) else ()),
    )
