"""What people read: one structure of facts, rendered as title, text and HTML. Pure.

Written for a pilot with a phone at 3 am: the first line says what and how bad, then since when,
where, the numbers, what speaks for and against, what to check. Names and notes come from files, so
each is made one printable line (`formatting.clean`).
"""

from __future__ import annotations

from math import degrees

from gliderwatch.fleet.advice import Advice
from gliderwatch.incidents.notices import Cleared, Corrected, NewRegime, Opened, StillOpen, Surfaced
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.messages.evidence import checks, difference, how_sure, out_of_range, weigh
from gliderwatch.messages.formatting import (
    INCIDENTS,
    UNKNOWN,
    clean,
    duration,
    flow,
    known,
    map_link,
    place,
    speed,
    utc,
)
from gliderwatch.messages.template import Page, Text
from gliderwatch.model import Assessment, Flag, Incident, Kind

TITLES = {Kind.ANOMALY: "ANOMALY", Kind.FALSE_ALARM: "MEASUREMENTS DISAGREE"}


def opened(glider: str, content: Opened) -> Text:
    """The first message of an incident."""
    incident, dive = content.incident, content.dive
    page = Page(
        (_headline(incident.kind, dive),),
        (_since(incident), *_facts(dive, incident.dives)),
        (*_weighed(incident.kind, dive), ("Check", checks(incident, dive))),
    )
    doubt = "do not trust its speed, " if incident.kind is Kind.FALSE_ALARM else ""
    return f"{TITLES[incident.kind]} {clean(glider, 40)}: {doubt}{_against_range(dive)}", page


def still_open(glider: str, content: StillOpen) -> Text:
    """The reminder of an incident."""
    incident, latest = content.incident, content.dive
    age = duration(content.hours * 3600)
    lead = f"{clean(glider, 40)}: the {_name(incident)} is still open after {age}. "
    lead += f"Latest dive: {flag_words(latest)}."
    flagged = latest.flag == (Flag.FALSE_ALARM if incident.kind is Kind.FALSE_ALARM else Flag.ANOMALY)
    page = Page(
        (lead, _headline(incident.kind, latest)) if flagged else (lead,),
        (_since(incident), ("Worst", _worst(incident)), *_facts(latest, incident.dives)),
        (*_weighed(incident.kind, latest), ("Check", checks(incident, latest))),
    )
    return f"REMINDER {clean(glider, 40)}: {_name(incident)} for {age}, {_against_range(latest)}", page


def cleared(glider: str, content: Cleared) -> Text:
    """The all-clear of an incident, which says what goes on."""
    incident, dive, others = content.incident, content.dive, content.others
    end = dive.t_surface if incident.cleared_at is None else incident.cleared_at
    still = " and ".join(f"the {_name(other)} since {utc(other.since)}" for other in others)
    if still:
        lead = f"{clean(glider, 40)}: the {_name(incident)} is over, but not all is well: "
        lead += f"{still} is still open. Latest dive: {flag_words(dive)}."
        title = f"ALL CLEAR {clean(glider, 40)}: {_name(incident)} over, {_name(others[0])} still open"
    elif incident.kind is Kind.FALSE_ALARM:
        lead = f"{clean(glider, 40)}: the measurements agree again, {_against_range(dive)}. "
        lead += f"The {_name(incident)} is over."
        title = f"ALL CLEAR {clean(glider, 40)}: measurements agree, {_against_range(dive)}"
    else:
        lead = f"{clean(glider, 40)} is normal again: {_against_range(dive)}. "
        lead += f"The {_name(incident)} is over."
        title = f"ALL CLEAR {clean(glider, 40)}: {_against_range(dive)}"
    facts = (
        _since(incident),
        ("Lasted", f"{duration(end - incident.since)}, cleared {utc(end)}"),
        ("Worst", _worst(incident)),
        *_facts(dive, 0),
    )
    return title, Page((lead,), facts)


def corrected(glider: str, content: Corrected) -> Text:
    """Data that came later changed what was reported."""
    before, now, dive = content.before, content.now, content.dive
    lead = f"Correction for {clean(glider, 40)}: {clean(content.why)}. "
    lead += f"The {_name(before)} {'is withdrawn' if now is None else 'stands'}. "
    lead += f"The dive as assessed now: {flag_words(dive)}."
    page = Page(
        (lead,),
        (
            ("Told before", _summary(before)),
            ("Known now", "no incident" if now is None else _summary(now)),
            *_facts(dive, 0 if now is None else now.dives),
        ),
        () if now is None else _weighed(before.kind, dive),
    )
    verdict = "withdrawn" if now is None else "stands"
    return f"CORRECTION {clean(glider, 40)}: {_name(before)} {verdict}, {_against_range(dive)}", page


def surfaced(glider: str, content: Surfaced) -> Text:
    """The notice of one surfacing."""
    a, previous, expected = content.dive, content.previous, content.expected
    after: tuple[tuple[str, str], ...] = ()
    if previous is not None:
        after = (("After the one before", duration(a.t_surface - previous)),)
    if expected is not None:
        when = f"{utc(expected.t)}, within {duration(1.96 * expected.t_sigma)} (95 %)"
        after += (("Next surfacing", f"{when}, {place(expected.lat, expected.lon)}"),)
    after += tuple((f"Look next for {clean(name, 64)}", _advice(each)) for name, each in content.advice)
    if content.layers is not None:
        after += (("Fly next", _band(content.layers, a.t_dive)),)
    page = Page(
        (f"{clean(glider, 40)} surfaced {utc(a.t_surface)}: {flag_words(a)}.",),
        (*after, *_facts(a, 0)),
        (("Data", tuple(clean(note) for note in a.notes)),) if a.notes else (),
    )
    return f"SURFACED {clean(glider, 40)} {utc(a.t_surface)}: {_speed(a)}, {flag_words(a, short=True)}", page


def new_regime(glider: str, content: NewRegime) -> Text:
    """The glider is flown in a new way."""
    a, before, name = content.dive, content.before, clean(glider, 40)
    assert a.speed is not None
    what = "faster" if a.speed > before else "slower"
    normal = f"{a.speed_min:.2f} to {a.speed_max:.2f} m/s"
    why = "A thruster, ballast or pitch does that" if what == "faster" else "Pitch or ballast changed as well"
    since = utc(content.since)
    lead = f"{name} flies {what} since {since}: {a.speed:.2f} m/s, {before:.2f} m/s before."
    check = (
        f"{why}; if it was not you, see what is wrong.",
        "To say otherwise, set normal_speed for this glider in the configuration.",
    )
    page = Page(
        (lead, f"New normal range: {normal}, unless you say otherwise."),
        (("Since", since), *_facts(a, 0)),
        (("Check", check),),
    )
    return f"NEW NORMAL {name}: flies {what}, {a.speed:.2f} m/s (now normal: {normal})", page


def _advice(advice: Advice) -> str:
    """Heading and waypoint of an advice, and what it is good for."""
    steer = f"steer {degrees(advice.heading):03.0f} deg true to {place(advice.lat, advice.lon)}"
    return f"{steer}: takes {100 * advice.variance:.1f} % off the uncertainty"


def _band(advice: LayerAdvice, since: float) -> str:
    """How deep to fly, and why; of which segment, if that was before the dive that began `since` (s)."""
    found = ", ".join(f"{x.top:.0f} to {x.bottom:.0f} m ({x.confidence:.0%})" for x in advice.layers)
    what = f"{clean(advice.sensor, 40)} layer: {found}" if found else f"no {clean(advice.sensor, 40)} layer"
    depths = advice.full if advice.band is None else advice.band
    words = f"{depths.top:.0f} to {depths.bottom:.0f} m"
    if advice.band is None:
        words = f"all depths, {words}{f' ({advice.mode.value}: {advice.why})' if advice.why else ''}"
    elif advice.full_casts:
        words += f", after {advice.full_casts} casts from {advice.full.top:.0f} to {advice.full.bottom:.0f} m"
    when = f" [after the segment until {utc(advice.t)}]" if advice.t < since else ""
    return "; ".join((f"{words}; {what}", *advice.notes)) + when


def flag_words(assessment: Assessment, *, short: bool = False) -> str:
    """The flag of a dive in words."""
    if assessment.flag is None:
        reason = clean(assessment.reason, 60)
        return f"not assessed ({reason})" if reason else "not assessed"
    words = {
        Flag.NORMAL: ("normal", ""),
        Flag.ANOMALY: ("anomaly", "speed out of its normal range"),
        Flag.FALSE_ALARM: ("measurements disagree", "flow and reference disagree"),
    }[Flag(assessment.flag)]
    if short or assessment.flag == Flag.NORMAL:
        return words[0]
    return f"{words[0]}: {clean(assessment.reason, 100) or words[1]}"


def _name(incident: Incident) -> str:
    return INCIDENTS[incident.kind]


def _normal(a: Assessment) -> str:
    return f"normal {a.speed_min:.2f} to {a.speed_max:.2f}"


def _speed(a: Assessment) -> str:
    """The speed, with a third digit where two would make it look within its range though it is not."""
    value = known(a.speed)
    if value is not None and out_of_range(a, value) and not out_of_range(a, round(value, 2)):
        return f"{value:.3f} m/s"
    return speed(value)


def _against_range(a: Assessment) -> str:
    value = "speed unknown" if known(a.speed) is None else f"{_speed(a)} through water"
    return f"{value} ({_normal(a)})"


def _headline(kind: Kind, a: Assessment) -> str:
    """What is wrong and how badly, in one sentence or two."""
    value = known(a.speed)
    if kind is Kind.FALSE_ALARM:
        apart, p_e = difference(a), known(a.p_e)
        size = ""
        if apart is not None and p_e is not None and p_e > a.gamma_f:
            size = f" by {speed(apart)} (p_E {p_e:.3f}, limit {a.gamma_f:.3f})"
        why = clean(a.reason, 100) or "flow and reference disagree"
        return f"{clean(a.glider, 40)}: {why}{size}. Its speed of {_speed(a)} cannot be trusted."
    sentence = f"{clean(a.glider, 40)} flies at {_speed(a)} through the water"
    if value is None or not out_of_range(a, value):
        why = clean(a.reason, 100) if a.flag == Flag.ANOMALY else ""
        return f"{sentence}, {_normal(a)} m/s" + (f": {why}." if why else ".")
    bound, word = (a.speed_max, "highest") if value > a.speed_max else (a.speed_min, "lowest")
    share = f"{int(100 * max(value, 0.0) / bound)} % of" if bound > 0 else "against"
    return f"{sentence}: {share} its {word} normal speed of {speed(bound)}."


def _since(incident: Incident) -> tuple[str, str]:
    return "Since", f"{utc(incident.since)} ({_dives(incident)})"


def _dives(incident: Incident) -> str:
    return "1 dive" if incident.dives == 1 else f"{incident.dives} dives"


def _worst(incident: Incident) -> str:
    return f"{_speed(incident.worst)}, dive of {utc(incident.worst.t_dive)}"


def _summary(incident: Incident) -> str:
    state = "open" if incident.cleared_at is None else f"cleared {utc(incident.cleared_at)}"
    since = f"{_name(incident)} since {utc(incident.since)}"
    return f"{since}, {_dives(incident)}, worst {_speed(incident.worst)}, {state}"


def _facts(a: Assessment, dives: int) -> tuple[tuple[str, str], ...]:
    """Where, the dive, speed against range, flow against reference, how sure."""
    link, apart, p_e = map_link(a.lat, a.lon), difference(a), known(a.p_e)
    reference = flow(a.reference_u, a.reference_v)
    if reference != UNKNOWN:
        reference += " (final)" if a.reference_final else " (provisional)"
    disagreement = ""
    if apart is not None and p_e is not None:
        disagreement = f"{speed(apart)}, p_E {p_e:.3f} (limit {a.gamma_f:.3f})"
    return (
        ("Where", place(a.lat, a.lon)),
        *((("Map", link),) if link else ()),
        ("Dive", f"{utc(a.t_dive)} to {utc(a.t_surface)}, segment {clean(a.segment, 60)}"),
        ("Speed through water", f"{_speed(a)}, {_normal(a)} m/s"),
        ("Flow learnt", flow(a.flow_u, a.flow_v)),
        ("Reference flow", reference),
        *((("Disagreement", disagreement),) if disagreement else ()),
        ("How sure", how_sure(a, dives)),
    )


def _weighed(kind: Kind, a: Assessment) -> tuple[tuple[str, tuple[str, ...]], ...]:
    pro, con = weigh(a, kind)
    nothing = ("nothing found in this dive",)
    return ("Speaks for", pro or nothing), ("Speaks against", con or nothing)
