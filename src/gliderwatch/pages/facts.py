"""The facts of a glider in the order in which a pilot asks for them, as labelled lines; and the log of its
last call: the lines that matter first, then all. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from math import degrees, isfinite

from markupsafe import Markup

from gliderwatch.health.constants import DAY
from gliderwatch.messages.formatting import clean, duration, flow, map_link, short_place, utc
from gliderwatch.messages.template import DO
from gliderwatch.model import Alert, Assessment, Call, Kind
from gliderwatch.pages.matters import Matter
from gliderwatch.pages.view import GliderView, verdict
from gliderwatch.slocum import log_events as events
from gliderwatch.slocum.logs import parse_line


@dataclass(frozen=True, slots=True)
class Fact:
    """A labelled line: with a time of it (s) that is also shown as how far off it is, ``more`` after it, text
    to copy, a link to a map, or a picture."""

    label: str
    text: str = ""
    t: float | None = None
    more: str = ""
    copies: tuple[str, ...] = ()
    link: str = ""
    picture: Markup | None = None


@dataclass(frozen=True, slots=True)
class Message:
    """What a message of a ``time`` (s) says: its ``title``, the lines that stand alone, and what to do."""

    time: float
    title: str
    lead: tuple[str, ...]
    do: tuple[str, ...]
    body: str


def message_of(alert: Alert) -> Message:
    """A message in its parts."""
    head, _, rest = (alert.brief or alert.body).partition(f"\n\n{DO}\n")
    do = tuple(line.removeprefix("- ") for line in rest.partition("\n\n")[0].splitlines())
    lead = tuple(clean(line, 400) for line in head.splitlines() if line.strip())
    return Message(alert.time, clean(alert.title), lead, tuple(clean(line, 300) for line in do), alert.body)


def actions(view: GliderView) -> Message | None:
    """The newest message that says what to do about the worst of what goes on; None: nothing does, or nothing
    goes on, or its deployment is over."""
    for matter in () if view.is_over else view.open_matters:
        for alert in view.alerts:
            if alert.incident.rstrip("+") == matter.id and (found := message_of(alert)).do:
                return found
    return None


def near(t: float, now: float) -> str:
    """A time (s, UTC) as short as it can be beside another.

    >>> near(1667651640.0, 1667653000.0), near(1667651640.0, 1667999999.0), near(0.0, 1667999999.0)
    ('12:34', '5 Nov 12:34', '1 Jan 1970 00:00')
    """
    at, then = (datetime.fromtimestamp(x, UTC) for x in (t, now))
    if at.date() == then.date():
        return f"{at:%H:%M}"
    year = "" if at.year == then.year else f" {at.year}"
    return f"{at.day} {at:%b}{year} {at:%H:%M}"


# ----------------------------------------
# Of a card on the page of the fleet, and of a glider's own page.


def of_card(view: GliderView) -> list[Fact]:
    """Those of its card on the page of the fleet."""
    return [
        *last_call(view),
        *next_call(view),
        *last_dive(view),
        *current(view),
        *battery(view),
        *others(view),
        *muted(view),
    ]


def of_glider(view: GliderView) -> list[Fact]:
    """Those of its own page."""
    facts = [*others(view), *muted(view), *_position(view), *current(view), *next_call(view)]
    e = view.expected
    if _is_foreseen(view) and e is not None and view.now < e.t and e.lat is not None and e.lon is not None:
        facts += [_place("There", e.lat, e.lon)]
    facts += [*last_call(view), *last_dive(view), *battery(view)]
    facts += [] if view.waypoint is None else [_place("Waypoint", *view.waypoint)]
    return [*facts, *look_next(view)]


def look_next(view: GliderView) -> list[Fact]:
    """Where it should look next for each field: never sent by itself."""
    facts = []
    for field, advice in view.advice:
        text = f"for {clean(field, 30)}: heading {degrees(advice.heading) % 360:.0f}°"
        lower = f"takes {100 * advice.variance:.1f} % off the mean variance"
        facts.append(replace(_place("Look next", advice.lat, advice.lon, text), more=lower))
    return facts


def _place(label: str, lat: float, lon: float, text: str = "") -> Fact:
    """A position in both notations, each to copy by itself."""
    both = (short_place(lat, lon), f"{lat:.5f}, {lon:.5f}")
    return Fact(label, text, copies=both, link=map_link(lat, lon))


def _position(view: GliderView) -> list[Fact]:
    fix, now = view.fix, view.whereabouts()
    if fix is None:
        return []
    facts = [
        _place("Last fix", fix.lat, fix.lon, f"{near(fix.t, view.now)}, {duration(view.now - fix.t)} ago")
    ]
    if now is not None and view.now > fix.t:
        sure = f"95 % within {now.major / 1000:.1f} km"
        facts += [_place("Now about", now.lat, now.lon, sure)]
    return facts


def last_call(view: GliderView) -> list[Fact]:
    """When it was heard last, and why it came up."""
    t, call = view.last_sign, view.calls[-1] if view.calls else None
    if t is None:
        return []
    why = clean(call.reason, 60) if call is not None else ""
    if call is not None and call.happened and not why:
        last = call.happened[-1]
        why = f"{str(last.what).replace('_', ' ')} {clean(last.cause, 40)}".strip()
    return [Fact("Last call", near(t, view.now), t, why)]


def _is_foreseen(view: GliderView) -> bool:
    """Whether the call that is awaited is the surfacing that is expected."""
    call, e = view.awaited, view.expected
    return (
        call is not None
        and e is not None
        and e.t == call.t
        and not view.is_over
        and not view.attention.recovered
    )


def next_call(view: GliderView) -> list[Fact]:
    """When it calls next, and how sure that is."""
    call, e = view.awaited, view.expected
    if call is None or view.is_over or view.attention.recovered:
        return []
    sure = f" ± {duration(1.96 * e.t_sigma)}" if _is_foreseen(view) and e is not None else ""
    label = "Next call" if view.now <= call.t else "Was due"
    return [Fact(label, f"{near(call.t, view.now)}{sure}", call.t)]


def last_dive(view: GliderView) -> list[Fact]:
    """Its speed against what is normal."""
    if view.latest is None:
        return []
    return [Fact("Speed", _speed(view.latest), picture=bullet(view.latest))]


def current(view: GliderView) -> list[Fact]:
    """Which way it is set."""
    return [] if view.flow is None else [Fact("Current", flow(*view.flow))]


def battery(view: GliderView) -> list[Fact]:
    """Days that are left in its battery."""
    end = view.battery
    if end is None:
        return []
    gone = view.now - end.t
    left, first = ((x - gone) / DAY for x in (end.left, end.earliest))
    last = f"{(end.latest - gone) / DAY:.0f}" if isfinite(end.latest) else "more"
    if left <= 0:
        return [Fact("Battery", f"empty since {near(end.t + end.left, view.now)}, as reckoned")]
    return [Fact("Battery", f"{left:.0f} days left ({max(first, 0):.0f} to {last})")]


def others(view: GliderView) -> list[Fact]:
    """What goes on beside the worst, since when, and who has it."""
    worst = verdict(view).matter
    found = (m for m in view.open_matters if m.id != worst and m.kind is not Kind.OVERDUE)
    return [Fact("Also", f"{m.word} since {near(m.since, view.now)}. {who(m)}".strip()) for m in found]


def who(matter: Matter) -> str:
    """Who has taken something on; empty where nobody can."""
    if not matter.can_be_taken_on:
        return ""
    if matter.ack is None:
        return "Nobody has it."
    return f"{clean(matter.ack.by, 40)} has it{', but it is WORSE SINCE' if matter.is_worse else ''}."


def muted(view: GliderView) -> list[Fact]:
    """Until when no message about it is sent."""
    until = view.attention.muted_until
    return [Fact("Muted", f"until {utc(until)}")] if until is not None and until > view.now else []


def since(view: GliderView) -> str:
    """Since when a glider is as it is, and who has that; empty where neither is known."""
    found = verdict(view)
    matter = next((m for m in view.open_matters if m.id == found.matter), None)
    when = (
        ""
        if found.since is None
        else f"Since {near(found.since, view.now)}, {duration(view.now - found.since)}."
    )
    return f"{when} {'' if matter is None else who(matter)}".strip()


def _speed(dive: Assessment) -> str:
    sigma = dive.speed_sigma
    if dive.speed is None or not isfinite(dive.speed):
        return f"not known, normal {dive.speed_min:.2f}-{dive.speed_max:.2f} m/s"
    error = "" if sigma is None else f" ± {sigma:.2f}"
    where = "below" if dive.speed < dive.speed_min else "above" if dive.speed > dive.speed_max else "in"
    return f"{dive.speed:.2f}{error}, {where} {dive.speed_min:.2f}-{dive.speed_max:.2f} m/s"


def bullet(dive: Assessment) -> Markup | None:
    """The speed of a dive against its normal range, as a bullet chart."""
    if dive.speed is None or not isfinite(dive.speed):
        return None
    top = 1.25 * max(dive.speed_max, dive.speed, 1e-3)
    low, high, at = (200 * max(x, 0.0) / top for x in (dive.speed_min, dive.speed_max, dive.speed))
    is_out = not dive.speed_min <= dive.speed <= dive.speed_max
    colour = "bad" if is_out else "ok"
    sigma = 200 * (dive.speed_sigma or 0.0) / top
    label = f"{dive.speed:.2f} m/s of {dive.speed_min:.2f} to {dive.speed_max:.2f}"
    return Markup(
        '<svg class="bullet" viewBox="0 0 200 14" role="img" aria-label="{label}">'
        '<rect class="range" x="{low:.1f}" y="1" width="{width:.1f}" height="12"/>'
        '<rect class="{colour}" x="0" y="5" width="{at:.1f}" height="4"/>'
        '<rect class="{colour}" x="{left:.1f}" y="6.5" width="{both:.1f}" height="1"/></svg>'
    ).format(
        label=label,
        low=low,
        width=high - low,
        colour=colour,
        at=at,
        left=max(at - sigma, 0.0),
        both=2 * sigma,
    )


TEXT = 12_000
"""Characters of a log at the most: a page stays small whatever comes."""
MOST_MARKED = 15
_ALWAYS = (
    events.AbortCause,
    events.AbortTime,
    events.AbortPlace,
    events.AbortNow,
    events.WeightDropped,
    events.FellOut,
    events.LastMission,
    events.Prompt,
    events.Emergency,
    events.Trouble,
    events.Because,
)
"""What a line tells that is shown first."""


@dataclass(frozen=True, slots=True)
class CallLog:
    """The ``marked`` lines of a log, and its ``text``; of the files of the call those ``sent`` whole, and
    those that were ``cut``."""

    marked: tuple[str, ...]
    text: str
    sent: tuple[str, ...]
    cut: tuple[str, ...]


def call_log(text: str, call: Call | None) -> CallLog:
    """The log of a call, of which `text` is the end. Every line is made printable."""
    lines = text.splitlines()
    marked = dict.fromkeys(clean(line, 160) for line in lines if is_marked(line))
    shown = "\n".join(clean(line, 300) for line in lines)[-TEXT:]
    sent, announced = (call.sent, call.announced) if call is not None else ((), ())
    cut = tuple(clean(name, 40) for name in announced if name not in sent)
    return CallLog(tuple(marked)[-MOST_MARKED:], shown, tuple(clean(name, 40) for name in sent), cut)


def is_marked(line: str) -> bool:
    """Whether a pilot should see a line of a log first: aborts, prompts, errors, fresh warnings.

    >>> [is_marked(f"ABORT HISTORY: {words}") for words in ("total since reset: 0", "last abort cause: LEAK")]
    [False, True]
    """
    return any(_matters(event) for event in parse_line(line.encode("latin-1", "replace")))


def _matters(event: events.Event) -> bool:
    match event:
        case events.AbortCount():
            return event.count > 0
        case events.Counts():
            return _is_fresh(event)
        case events.Device():
            return _is_fresh(event.counts)
    return isinstance(event, _ALWAYS)


def _is_fresh(counts: events.Counts) -> bool:
    """Whether there were errors at all, or warnings in the segment."""
    return any(counts.errors) or counts.warnings[2] > 0


def transferred(names: Sequence[str]) -> str:
    """Names of files as words.

    >>> transferred(()), transferred(("a.sbd", "b.tbd"))
    ('nothing', 'a.sbd, b.tbd')
    """
    return ", ".join(names) or "nothing"
