"""What people read when a glider tells in a call that something is wrong, or calls and sends nothing. Pure.

The same form as `messages.incident_text`: what and how bad, since when, where, what to check.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from gliderwatch.messages.formatting import clean, map_link, place, utc
from gliderwatch.messages.template import Page
from gliderwatch.model import Alert, Call, Happening, Kind, Severity

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
"""Title and sentence of what a glider told."""


@dataclass(frozen=True, slots=True)
class Told:
    """One thing that a glider told in a call: what, when (``t``, s), its ``cause``; how loud that is.

    ``is_history`` where the first log that is known shows it: nobody knows whether it was dealt with.
    """

    what: Happening
    t: float
    cause: str
    severity: Severity
    is_history: bool = False


def aborted(glider: str, told: tuple[Told, ...], call: Call, *, alert_id: str, thread: str) -> Alert:
    """The glider `told` (at least one, the loudest first) in its last `call` that something is wrong."""
    main, name = told[0], clean(glider, 40)
    title = f"{name} {_title(main)}"
    page = Page(
        tuple(f"{name}: {_sentence(one)}." for one in told),
        (("Since", utc(main.t)), *_facts(call)),
        (("Check", _checks(told)),),
    )
    severity = max(one.severity for one in told)
    return _alert(glider, call.last_t, Kind.ABORT, title, page, alert_id, thread, severity, severity)


def resumed(glider: str, call: Call, *, alert_id: str, thread: str, audience: Severity) -> Alert:
    """The glider flies a mission of its pilots again, as it told in a `call`."""
    name, mission = clean(glider, 40), clean(call.mission, 40)
    page = Page((f"{name} is in its mission again: {mission}.",), _facts(call))
    title = f"ALL CLEAR {name}: in its mission again ({mission})"
    return _alert(glider, call.last_t, Kind.ALL_CLEAR, title, page, alert_id, thread, Severity.INFO, audience)


def without_file(
    glider: str, calls: tuple[Call, ...], *, alert_id: str, thread: str, severity: Severity
) -> Alert:
    """The glider called, so often in a row as there are `calls`, and sent no file."""
    name, last, n = clean(glider, 40), calls[-1], len(calls)
    if n == 1:
        title, lead = f"{name} CALLED and sent no file", f"{name} called and sent no file. It lives."
    else:
        title = f"{name} CALLS WITHOUT A FILE: {n} in a row"
        lead = f"{name} called {n} times in a row and sent no file. It lives, but is not watched."
    cut = tuple(f"the transfer of {clean(file, 40)} was cut" for file in _cut(calls))
    page = Page(
        (lead,),
        (
            ("Since", utc(calls[0].began)),
            ("Last call", f"{utc(last.began)} to {utc(last.last_t)}"),
            *_facts(last),
        ),
        (
            *((("Cut", cut),) if cut else ()),
            (
                "Check",
                ("does the login script send files?", "the quality of the connection; the other number"),
            ),
        ),
    )
    return _alert(glider, last.last_t, Kind.CALL, title, page, alert_id, thread, severity, severity)


def sends_again(glider: str, call: Call, *, alert_id: str, thread: str) -> Alert:
    """The glider sent a file in a `call`, after several without."""
    name = clean(glider, 40)
    page = Page((f"{name} sends files again.",), _facts(call))
    title = f"ALL CLEAR {name}: it sends files again"
    return _alert(
        glider, call.last_t, Kind.ALL_CLEAR, title, page, alert_id, thread, Severity.INFO, Severity.WARNING
    )


def _title(told: Told) -> str:
    if told.is_history:
        return f"had ABORTED before: {_cause(told.cause)}, {utc(told.t)}"
    return _WORDS[told.what][0].format(cause=_cause(told.cause))


def _sentence(told: Told) -> str:
    if told.is_history:
        return f"the first log known shows an abort of {utc(told.t)} ({_cause(told.cause)})"
    return _WORDS[told.what][1].format(cause=_cause(told.cause), at=utc(told.t))


def _cause(cause: str) -> str:
    return CAUSES.get(cause, clean(cause, 40) or "cause not told")


def _checks(told: Iterable[Told]) -> tuple[str, ...]:
    causes = {one.cause for one in told}
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


def _alert(
    glider: str,
    time: float,
    kind: Kind,
    title: str,
    page: Page,
    alert_id: str,
    thread: str,
    severity: Severity,
    audience: Severity,
) -> Alert:
    title = clean(title)
    return Alert(
        id=alert_id,
        glider=glider,
        time=time,
        kind=kind,
        severity=severity,
        audience=audience,
        incident=thread,
        title=title,
        body=page.text(),
        html=page.html(title),
    )
