"""What people read when a glider tells in a call that something is wrong, or calls and sends nothing. Pure.

The same form as `messages.incident_text`: what, since when, how sure; where; next call; what to do.
"""

from __future__ import annotations

from collections.abc import Iterable

from gliderwatch.incidents.notices import (
    Aborted,
    AbortReport,
    CalledWithoutFile,
    Resumed,
    SendsAgain,
    StillAborted,
)
from gliderwatch.messages.formatting import clean, duration, place, short_place, utc
from gliderwatch.messages.phrases import Pairs, map_of, name_of, take_on_thread
from gliderwatch.messages.template import Page, Text, titled
from gliderwatch.model import Call, Happening

CAUSES = {
    "BEH_ERROR": "error in a behaviour",
    "OVERDEPTH": "too deep",
    "OVERTIME": "mission too long",
    "UNDERVOLTS": "battery voltage low",
    "SAMEDEPTH_FOR": "same depth for too long",
    "USER_INTERRUPT": "by a pilot",
    "NOINPUT": "no input from a sensor",
    "NO_TICKLE": "watchdog not served",
    "DEVICE_ERROR": "device error",
    "WPT_TOOFAR": "waypoint too far",
    "NO_HEAP": "no memory left",
    "LEAK": "leak",
    "VACUUM": "vacuum",
    "NO_HEADING_MEASUREMENT": "no heading",
    "STALLED": "stalled",
    "LOW_REL_CHARGE": "battery charge low",
    "WEIGHT_DROPPED": "weight dropped",
    "INITIALIZATION_ERROR": "error at its start",
}
"""Causes of aborts for pilots; any other is shown as the glider writes it."""
_WORDS = {
    Happening.ABORTING: ("ABORTED: {cause}", "aborted its mission {at} ({cause})"),
    Happening.FELL_OUT: ("FELL OUT OF ITS MISSION", "the mission was completed abnormally"),
    Happening.LAST_MISSION: (
        "RUNS {cause}.mi: it fell out of its mission",
        "runs {cause}.mi, which it does by itself only when the mission has failed",
    ),
    Happening.GLIDER_DOS: (
        "WAITS AT GLIDERDOS: it does not fly",
        "waits at the prompt GliderDos {cause} and does not fly",
    ),
    Happening.EMERGENCY: ("IS IN EMERGENCY MODE", "its hardware is in emergency mode"),
    Happening.WEIGHT_DROPPED: (
        "DROPPED ITS WEIGHT",
        "its emergency weight is dropped: it can not dive any more",
    ),
}
"""Title and sentence of what a glider report."""


def aborted(glider: str, content: Aborted) -> Text:
    """The glider reported in a call that something is wrong."""
    main, name, call = content.reports[0], name_of(glider), content.call
    sure = "Not sure that it still matters: an old one" if main.is_history else "Sure (100 %): it said so"
    others = "".join(f" Also: {_sentence(one)}." for one in content.reports[1:])
    since = "" if main.what is Happening.ABORTING else f", since {utc(main.t)}"
    first = f"{name}: {_sentence(main)}{since}. {sure}.{others}"
    page = Page(
        (first, _where(call), _next(call)),
        _facts(call),
        do=_checks(content.reports),
        links=(*_map(call), *take_on_thread(glider)),
    )
    return titled(glider, _title(main)), page


def still_aborted(glider: str, content: StillAborted) -> Text:
    """The glider still flies no mission of its pilots: five lines."""
    main, name, call = content.reports[0], name_of(glider), content.call
    since = duration(3600 * content.hours)
    (label, take), *_ = take_on_thread(glider)
    page = Page(
        (
            f"{name}: for {since} now it flies no mission of yours, since {utc(main.t)}.",
            f"As bad as before: {_sentence(main)}.",
            _where(call),
            _next(call),
            f"{label}, if nobody has: {take}",
        )
    )
    return titled(glider, f"STILL {_title(main)}"), page


def resumed(glider: str, content: Resumed) -> Text:
    """The glider flies a mission of its pilots again."""
    name, mission, call = name_of(glider), clean(content.call.mission, 40), content.call
    page = Page(
        (f"{name} is in its mission again: {mission}.", _where(call), _next(call)),
        _facts(call),
        do=("Nothing, if the cause of the abort is mended.",),
        links=_map(call),
    )
    return titled(glider, "ALL CLEAR: in its mission again", f" ({mission})"), page


def without_file(glider: str, content: CalledWithoutFile) -> Text:
    """The glider called and sent no file, once or several times in a row."""
    calls = content.calls
    name, last, n = name_of(glider), calls[-1], len(calls)
    since = f"since {utc(calls[0].began)}"
    if n == 1:
        title, first = "CALLED and sent no file", f"{name} called and sent no file, {since}. It lives."
        first += " Not sure that it is more than a cut connection (1 call)."
    else:
        title, first = f"CALLS WITHOUT A FILE: {n} in a row", f"{name} called {n} times in a row and sent no "
        first += f"file, {since}: sure ({n} of {n} calls). It lives, but is not watched."
    cut = tuple(f"the transfer of {clean(file, 40)} was cut" for file in _cut(calls))
    page = Page(
        (first, _where(last), _next(last)),
        (("Last call", f"{utc(last.began)} to {utc(last.last_t)}"), *_facts(last)),
        ((("Cut", cut),) if cut else ()),
        (
            "The transfer was cut: look at the connection, try the other number."
            if cut
            else "See whether the login script sends files.",
            "Ask it for its files in the next call.",
        ),
        (*_map(last), *take_on_thread(glider)),
    )
    return titled(glider, title), page


def sends_again(glider: str, content: SendsAgain) -> Text:
    """The glider sent a file, after several calls without."""
    call = content.call
    page = Page(
        (f"{name_of(glider)} sends files again.", _where(call), _next(call)),
        _facts(call),
        do=("Nothing; its dives are judged as its files come.",),
        links=_map(call),
    )
    return titled(glider, "ALL CLEAR: it sends files again"), page


def _where(call: Call) -> str:
    if call.fix is None:
        return f"Place not known; at the surface {utc(call.last_t)}, it drifts."
    spot = short_place(call.fix.lat, call.fix.lon)
    return f"At {spot}, {utc(call.fix.t)}; at the surface it drifts with wind and current."


def _next(call: Call) -> str:
    if not call.over:
        return f"Next call: it is on the line now (last line {utc(call.last_t)})."
    if call.calls_back:
        return f"Next call: soon, it said so when it hung up {utc(call.last_t)}."
    return f"Next call: not known; it hung up {utc(call.last_t)}."


def _map(call: Call) -> Pairs:
    return () if call.fix is None else map_of(call.fix.lat, call.fix.lon)


def _title(report: AbortReport) -> str:
    if report.is_history:
        return f"had ABORTED before: {_cause(report.cause)}, {utc(report.t)}"
    return _WORDS[report.what][0].format(cause=_cause(report.cause))


def _sentence(report: AbortReport) -> str:
    if report.is_history:
        return f"the first log known shows an abort of {utc(report.t)} ({_cause(report.cause)})"
    return _WORDS[report.what][1].format(cause=_cause(report.cause), at=utc(report.t))


def _cause(cause: str) -> str:
    return CAUSES.get(cause, clean(cause, 40) or "cause not told")


def _checks(reports: Iterable[AbortReport]) -> tuple[str, ...]:
    causes = {one.cause for one in reports}
    leak = ("Plot leak detectors and vacuum before you believe them; then plan the recovery.",)
    return (
        "Go to the terminal, if no pilot is there: it waits at the surface and drifts.",
        *(leak if causes & {"LEAK", "VACUUM"} else ()),
        "Read the log of the call, and that of the mission (mlg).",
    )


def _facts(call: Call) -> Pairs:
    """Where the glider is, and what it said of itself."""
    fix = call.fix
    lat, lon = (None, None) if fix is None else (fix.lat, fix.lon)
    segment = f", segment {clean(call.segment, 60)}" if call.segment else ""
    mission = f"{clean(call.mission, 40)}{segment}"
    return (
        ("Where", place(lat, lon)),
        *((("Mission", mission),) if call.mission else ()),
        *((("At the surface because", clean(call.reason, 80)),) if call.reason else ()),
        ("Log", clean(call.log, 100)),
    )


def _cut(calls: Iterable[Call]) -> tuple[str, ...]:
    return tuple(file for call in calls for file in call.announced if file not in call.sent)[:5]
