"""What people read of incidents, surfacings and new ways of flying. Pure.

Written for a pilot with a phone at 3 am: three lines that stand alone (what, since when, how sure, why;
where; next call), what to do, links, and only then numbers. Names and notes come from files, so each is made
one printable line (`formatting.clean`).
"""

from __future__ import annotations

from math import degrees

from gliderwatch.fleet.advice import Advice
from gliderwatch.incidents.notices import (
    Acknowledged,
    Cleared,
    Corrected,
    NewRegime,
    Opened,
    Situation,
    StillOpen,
    Surfaced,
)
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.messages.causes import Likely, likeliest
from gliderwatch.messages.constants import SLOWER
from gliderwatch.messages.evidence import (
    certainty,
    data_quality,
    normal_range,
    number,
    out_of_range,
    symbols,
    weigh,
)
from gliderwatch.messages.formatting import INCIDENTS, clean, duration, finite, place, utc
from gliderwatch.messages.phrases import (
    dive_numbers,
    exact_speed,
    map_of,
    name_of,
    next_call,
    speed_and_range,
    still_open_ones,
    take_on,
    trend,
    where,
)
from gliderwatch.messages.template import Page, Text, command, titled
from gliderwatch.model import Assessment, Flag, Incident, Kind


def opened(glider: str, content: Opened) -> Text:
    """The first message of an incident."""
    incident, dive, now = content.incident, content.dive, content.situation
    likely = likeliest(incident.kind, dive)
    is_disagreement = incident.kind is Kind.FALSE_ALARM
    earlier = _instead(incident, content.before) or _again(content.again)
    page = Page(
        (
            f"{_headline(incident, dive, likely)}{earlier}",
            where(dive, is_flow_sure=not is_disagreement),
            next_call(now.expected),
        ),
        dive_numbers(dive, now),
        _weighed(incident, dive, likely),
        likely.cause.do,
        (*map_of(dive.lat, dive.lon), *take_on(incident, now)),
        data_quality(dive),
        symbols(dive),
    )
    return _title(glider, incident, dive, likely), page


def _instead(incident: Incident, before: Incident | None) -> str:
    """What was reported before, in whose place this incident is now, and why."""
    if before is None:
        return ""
    reported = f" The {_name(before)} since {utc(before.since)}"
    if before.kind is incident.kind and before.cleared_at is None:
        return f"{reported} is this one: its dives are judged otherwise by what has come since."
    if before.kind is incident.kind:
        return f"{reported} is over: this is another."
    if incident.kind is Kind.FALSE_ALARM:
        return f"{reported} is now more likely a wrong measurement, because {_dives(incident)} contradict it."
    return f"{reported} is now more likely this, because its speed explains both."


def _again(over: Incident | None) -> str:
    """What people were told is over and is back, and why it was called over."""
    if over is None or over.cleared_at is None:
        return ""
    why = "agreed" if over.kind is Kind.FALSE_ALARM else "were near the usual speed"
    return f" The {_name(over)} since {utc(over.since)} is back: dives until {utc(over.cleared_at)} {why}."


def still_open(glider: str, content: StillOpen) -> Text:
    """The reminder of an incident: five lines."""
    incident, latest, now = content.incident, content.dive, content.situation
    age, name = duration(content.hours * 3600), name_of(glider)
    (label, take), *_ = take_on(incident, now)
    also = "".join(f" So is the {what} since {utc(since)}." for what, since in still_open_ones(now))
    page = Page(
        (
            f"{name}: the {_name(incident)} since {utc(incident.since)} is still open, after {age}.{also}",
            _course(incident, latest, now),
            where(now.last or latest, is_flow_sure=incident.kind is not Kind.FALSE_ALARM),
            next_call(now.expected),
            f"{label}, if nobody has: {take}",
        )
    )
    return titled(glider, f"STILL {_word(incident, latest)} after {age}", f": {exact_speed(latest)}"), page


def _course(incident: Incident, latest: Assessment, now: Situation) -> str:
    """Whether it grows better or worse."""
    last = f"; last speeds {trend(now)}" if trend(now) else ""
    if incident.kind is Kind.FALSE_ALARM or latest.flag is None:
        return f"Latest dive: {flag_words(latest, short=True)}{last}."
    value, worst = finite(latest.speed), finite(incident.worst.speed)
    if value is None or worst is None:
        how = "Not known whether better or worse"
    elif not out_of_range(latest, value):
        how = "Better: in its range, not yet near its usual speed"
    elif abs(value - worst) <= SLOWER:
        how = "As bad as ever"
    else:
        how = f"Better than its worst, {exact_speed(incident.worst)}"
    return f"{how}: {speed_and_range(latest)}{last}."


def cleared(glider: str, content: Cleared) -> Text:
    """The all-clear of an incident, which says what goes on."""
    incident, dive = content.incident, content.dive
    open_ones = still_open_ones(content.situation)
    name, over = name_of(glider), _name(incident)
    end = dive.t_surface if incident.cleared_at is None else incident.cleared_at
    still = " and ".join(f"the {what} since {utc(since)}" for what, since in open_ones)
    lasted = f"It lasted {duration(end - incident.since)}, since {utc(incident.since)}."
    if still:
        first = f"{name}: the {over} is over, but not all is well: {still} is still open. {lasted}"
        title = titled(glider, f"{open_ones[0][0]} STILL OPEN", f", {over} over")
    else:
        state = (
            "the measurements agree again" if incident.kind is Kind.FALSE_ALARM else "flies as usual again"
        )
        first = f"{name}: {state}, {speed_and_range(dive)}. The {over} is over. {lasted}"
        title = titled(glider, f"ALL CLEAR: {speed_and_range(dive)}")
    if content.is_first:
        first += " It is reported only now, because its files came together."
    todo = "Go on with what is still open." if still else "Nothing. Find out why, before you rely on it."
    page = Page(
        (first, where(dive), next_call(content.situation.expected)),
        (("Worst", _worst(incident)), *dive_numbers(dive, content.situation)),
        do=(todo,),
        links=map_of(dive.lat, dive.lon),
    )
    return title, page


def corrected(glider: str, content: Corrected) -> Text:
    """Data that came later changed what was reported."""
    before, now, dive, situation = content.before, content.now, content.dive, content.situation
    verdict = "is withdrawn" if now is None else "stands, with other numbers"
    first = f"{name_of(glider)}: the {_name(before)} since {utc(before.since)} {verdict}, "
    first += f"because {clean(content.why)}. That dive now: {flag_words(dive)}, {speed_and_range(dive)}."
    todo = "Stop what you began because of it." if now is None else "Go on; read the numbers again."
    still = "".join(f" Still open: {_name(other)}." for other in situation.others)
    page = Page(
        (f"{first}{still}", where(situation.last or dive), next_call(situation.expected)),
        (
            ("Reported before", _summary(before)),
            ("So it is now", "no incident" if now is None else _summary(now)),
            *dive_numbers(dive, situation),
        ),
        () if now is None else _weighed(now, dive, likeliest(now.kind, dive)),
        (todo,),
        (*map_of(dive.lat, dive.lon), *(() if now is None else take_on(now, situation))),
    )
    what = "withdrawn" if now is None else "stands"
    return titled(glider, f"CORRECTION: {_name(before)} {what}", f", {exact_speed(dive)}"), page


def acknowledged(glider: str, content: Acknowledged) -> Text:
    """Somebody has taken an incident on, or given it back: for the others."""
    who, what = clean(content.by, 40), INCIDENTS.get(content.kind, str(content.kind))
    note = f": {clean(content.note)}" if content.note else ""
    about = f"the {what} of {name_of(glider)} since {utc(content.since)}"
    if content.is_undone:
        first, done = f"{who} has given back {about}{note}. Nobody is on it.", f"given back by {who}"
        links: tuple[tuple[str, str], ...] = (("Take it on", command(f"ack {content.thread}")),)
    else:
        first, done = f"{who} has taken on {about}{note}.", f"{who} is on it"
        links = (("To undo it", command(f"ack {content.thread} --undo")),)
    return titled(glider, done, f" ({what})"), Page((first,), links=links)


def surfaced(glider: str, content: Surfaced) -> Text:
    """The notice of one surfacing: four lines."""
    a, previous = content.dive, content.previous
    after = "" if previous is None else f", {duration(a.t_surface - previous)} after the one before"
    page = Page(
        (
            f"{name_of(glider)} surfaced {utc(a.t_surface)}{after}.",
            f"{speed_and_range(a)}: {flag_words(a)}." + (" Nothing to do." if a.flag == Flag.NORMAL else ""),
            where(a),
            next_call(content.expected),
        ),
        (
            *((f"Look next for {clean(name, 64)}", _advice(each)) for name, each in content.advice),
            *((("Fly next", _band(content.layers, a.t_dive)),) if content.layers is not None else ()),
        ),
    )
    when = utc(a.t_surface)[11:]
    return titled(glider, f"surfaced {when}: {exact_speed(a)}", f", {flag_words(a, short=True)}"), page


def new_regime(glider: str, content: NewRegime) -> Text:
    """The glider is flown in a new way."""
    a, before, now = content.dive, content.before, content.situation
    assert a.speed is not None
    what = "faster" if a.speed > before else "slower"
    why = "thruster, ballast or pitch" if what == "faster" else "pitch or ballast"
    first = (
        f"{name_of(glider)} flies {what} since {utc(content.since)}: {a.speed:.2f} m/s, {before:.2f} before. "
    )
    first += f"Likely {why}: three dives agree. New {normal_range(a)} m/s, unless you say otherwise."
    page = Page(
        (first, where(a), next_call(now.expected)),
        dive_numbers(a, now),
        do=(
            "Nothing, if it was you.",
            "Else find out why; to say otherwise, set normal_speed for this glider in the configuration.",
        ),
        links=map_of(a.lat, a.lon),
    )
    return titled(glider, f"NEW NORMAL: flies {what}, {a.speed:.2f} m/s", f" ({normal_range(a)})"), page


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
    if assessment.flag == Flag.NORMAL:
        return "normal"
    likely = likeliest(Kind.ANOMALY if assessment.flag == Flag.ANOMALY else Kind.FALSE_ALARM, assessment)
    word = "out of its range" if assessment.flag == Flag.ANOMALY else "measurements disagree"
    return word if short else f"{word}, likeliest {likely.cause.words}"


def _name(incident: Incident) -> str:
    return INCIDENTS[incident.kind]


def _word(incident: Incident, dive: Assessment) -> str:
    """What is wrong, in capitals."""
    if incident.kind is Kind.FALSE_ALARM:
        return "MEASUREMENTS DISAGREE"
    value = finite(dive.speed)
    return "FAST" if value is not None and value > dive.speed_max else "SLOW"


def _title(glider: str, incident: Incident, dive: Assessment, likely: Likely) -> str:
    word, short = _word(incident, dive), likely.cause.short
    cause = f": {short}" if short else ""
    if incident.kind is Kind.FALSE_ALARM:
        return titled(glider, word, cause)
    if finite(dive.speed) is None:
        return titled(glider, f"{word}, speed not known", f" ({normal_range(dive)})", cause)
    return titled(glider, f"{word} {exact_speed(dive)}", f" ({normal_range(dive)})", cause)


def _headline(incident: Incident, a: Assessment, likely: Likely) -> str:
    """What is wrong since when, how badly, how sure, and the likeliest cause with what points to it."""
    fact = f": {likely.fact}" if likely.fact else ""
    sure = certainty(incident.kind, a, incident.dives)
    since = f"since {utc(incident.since)} ({_dives(incident)})"
    if incident.kind is Kind.FALSE_ALARM:
        what = f"{name_of(a.glider)}: measurements disagree {since}: its speed is not known"
    else:
        fast = _word(incident, a) == "FAST"
        what = f"{name_of(a.glider)} is {'fast' if fast else 'slow'} {since}: {speed_and_range(a)}{_share(a)}"
    return f"{what}; {sure}. Likeliest cause: {likely.cause.words}{fact}."


def _share(a: Assessment) -> str:
    """How far the speed is from the usual one."""
    value, middle = finite(a.speed), number(a, "usual_speed")
    if value is None or not middle:
        return ""
    part = abs(1 - max(value, 0.0) / middle)
    return f", {100 * part:.0f} % {'below' if value < middle else 'above'} its usual {middle:.2f}"


def _dives(incident: Incident) -> str:
    return "1 dive" if incident.dives == 1 else f"{incident.dives} dives"


def _worst(incident: Incident) -> str:
    return f"{exact_speed(incident.worst)}, dive of {utc(incident.worst.t_dive)}"


def _summary(incident: Incident) -> str:
    state = "open" if incident.cleared_at is None else f"cleared {utc(incident.cleared_at)}"
    since = f"{_name(incident)} since {utc(incident.since)}"
    return f"{since}, {_dives(incident)}, worst {exact_speed(incident.worst)}, {state}"


def _weighed(incident: Incident, a: Assessment, likely: Likely) -> tuple[tuple[str, tuple[str, ...]], ...]:
    pro, con = weigh(a, incident.kind, likely.cause)
    about = likely.cause.words if likely.cause.short else f"{_word(incident, a).lower()}, whatever the cause"
    lists = ((f"For: {about}", pro), (f"Against: {about}", con))
    return tuple((heading, lines) for heading, lines in lists if lines)
