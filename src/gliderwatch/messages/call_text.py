"""What people read when a glider tells in a call that something is wrong, or calls and sends nothing. Pure.

The same form as `messages.incident_text`: what and how bad, since when, where, what to check.
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
from gliderwatch.messages.formatting import clean, duration, map_link, place, utc
from gliderwatch.messages.template import Page, Text
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
    main, name = content.reports[0], clean(glider, 40)
    page = Page(
        tuple(f"{name}: {_sentence(one)}." for one in content.reports),
        (("Since", utc(main.t)), *_facts(content.call)),
        (("Check", _checks(content.reports)),),
    )
    return f"{name} {_title(main)}", page


def still_aborted(glider: str, content: StillAborted) -> Text:
    """The glider still flies no mission of its pilots."""
    main, name = content.reports[0], clean(glider, 40)
    since = duration(3600 * content.hours)
    page = Page(
        (f"{name}: for {since} now it flies no mission of yours.", f"It reported: {_sentence(main)}."),
        (("Since", utc(main.t)), *_facts(content.call)),
        (("Check", _checks(content.reports)),),
    )
    return f"REMINDER {name} {_title(main)}", page


def resumed(glider: str, content: Resumed) -> Text:
    """The glider flies a mission of its pilots again."""
    name, mission = clean(glider, 40), clean(content.call.mission, 40)
    page = Page((f"{name} is in its mission again: {mission}.",), _facts(content.call))
    return f"ALL CLEAR {name}: in its mission again ({mission})", page


def without_file(glider: str, content: CalledWithoutFile) -> Text:
    """The glider called and sent no file, once or several times in a row."""
    calls = content.calls
    name, last, n = clean(glider, 40), calls[-1], len(calls)
    if n == 1:
        title, lead = f"{name} CALLED and sent no file", f"{name} called and sent no file. It lives."
    else:
        title = f"{name} CALLS WITHOUT A FILE: {n} in a row"
        lead = f"{name} called {n} times in a row and sent no file. It lives, but is not watched."
    cut = tuple(f"the transfer of {clean(file, 40)} was cut" for file in _cut(calls))
    facts = (("Since", utc(calls[0].began)), ("Last call", f"{utc(last.began)} to {utc(last.last_t)}"))
    check = ("does the login script send files?", "the quality of the connection; the other number")
    lists = (*((("Cut", cut),) if cut else ()), ("Check", check))
    return title, Page((lead,), (*facts, *_facts(last)), lists)


def sends_again(glider: str, content: SendsAgain) -> Text:
    """The glider sent a file, after several calls without."""
    name = clean(glider, 40)
    return f"ALL CLEAR {name}: it sends files again", Page(
        (f"{name} sends files again.",), _facts(content.call)
    )


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
    leak = ("leak detectors and vacuum: plot the last values before you believe them",)
    return (
        *(leak if causes & {"LEAK", "VACUUM"} else ()),
        "the log of the call, and that of the mission (mlg)",
        "is a pilot in the terminal? It waits at the surface and drifts",
    )


def _facts(call: Call) -> tuple[tuple[str, str], ...]:
    """Where the glider is, and what it said of itself."""
    fix = call.fix
    lat, lon = (None, None) if fix is None else (fix.lat, fix.lon)
    link = map_link(lat, lon)
    return (
        ("Where", place(lat, lon)),
        *((("Map", link),) if link else ()),
        *(
            (("Mission", f"{clean(call.mission, 40)}, segment {clean(call.segment, 60)}"),)
            if call.mission
            else ()
        ),
        *((("At the surface because", clean(call.reason, 80)),) if call.reason else ()),
        ("Log", clean(call.log, 100)),
    )


def _cut(calls: Iterable[Call]) -> tuple[str, ...]:
    return tuple(file for call in calls for file in call.announced if file not in call.sent)[:5]
