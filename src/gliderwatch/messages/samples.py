"""Whole messages about a glider that does not exist, to see how they arrive. Pure.

Each is made as the real ones are, and says in its title and its first line that it is a sample.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gliderwatch.fleet.cross_check import Hypothesis
from gliderwatch.fleet.flow import Fault
from gliderwatch.health.rule import Finding
from gliderwatch.incidents.notices import (
    Aborted,
    AbortReport,
    Absence,
    Acknowledged,
    Blind,
    Blindness,
    CalledWithoutFile,
    Cleared,
    Content,
    Corrected,
    DiffersFromNeighbours,
    DriftEllipse,
    Fleet,
    HealthFound,
    HealthIncident,
    NewRegime,
    Notice,
    Opened,
    Overdue,
    Situation,
    StillOpen,
    Surfaced,
    Unjudged,
)
from gliderwatch.messages.notice_text import operator, render
from gliderwatch.messages.template import with_lead
from gliderwatch.model import (
    Alert,
    Assessment,
    Call,
    Fix,
    Flag,
    Happening,
    Hindrance,
    Incident,
    Kind,
    NextSurfacing,
    Severity,
)

GLIDER = "sample-glider"
_LEAD = "This is a sample, sent by `gliderwatch test-alert`: there is no such glider, and nothing is wrong."
_HOUR = 3600.0
_SLOW = Assessment(
    glider=GLIDER,
    segment=f"{GLIDER}-2026-1-0-7",
    t_dive=-3.4 * _HOUR,
    t_surface=0.0,
    lat=24.20575,
    lon=-83.02057,
    flag=Flag.ANOMALY,
    reason="",
    speed=0.112,
    speed_min=0.22,
    speed_max=0.30,
    flow_u=0.15,
    flow_v=0.17,
    reference_u=0.13,
    reference_v=0.16,
    reference_final=True,
    p_e=0.031,
    gamma_f=0.3,
    clle_max=None,
    excitation=None,
    n_samples=812,
    evidence={
        "duration_h": 3.4,
        "along_speed": 0.115,
        "depth_max": 182.0,
        "pitch_dive": -0.45,
        "pitch_climb": 0.30,
        "roll_mean": 0.31,
        "speed_before": 0.118,
        "speed_sigma": 0.03,
        "usual_speed": 0.255,
    },
    notes=(),
    parameters="",
)
_HEALTHY = replace(_SLOW, flag=Flag.NORMAL, speed=0.251, p_e=0.02, evidence={"duration_h": 3.4})
_DISAGREE = replace(
    _SLOW,
    flag=Flag.FALSE_ALARM,
    p_e=0.412,
    reference_u=-0.3,
    reference_v=-0.2,
    reason="the current is wrong",
    evidence={"duration_h": 3.4, "across_misfit": 0.31, "across_sigma": 0.05},
)


def sample(kind: Kind, now: float) -> Alert:
    """A message of a kind as it would be made at `now` (s)."""
    alert = SAMPLES[kind](now)
    return replace(
        with_lead(alert, _LEAD), id=f"sample/{kind}/{now:.3f}", incident="", title=f"SAMPLE {alert.title}"
    )


def _at(dive: Assessment, now: float) -> Assessment:
    return replace(dive, t_dive=now + dive.t_dive, t_surface=now + dive.t_surface)


def _incident(kind: Kind, worst: Assessment, severity: Severity) -> Incident:
    since = worst.t_dive
    return Incident("", GLIDER, kind, severity, since, worst.t_surface, None, 2, worst, worst)


def _message(kind: Kind, severity: Severity, time: float, content: Content) -> Alert:
    return render(Notice("", "", GLIDER, time, kind, severity, severity, content))


def _opened(kind: Kind, dive: Assessment, severity: Severity) -> Callable[[float], Alert]:
    def make(now: float) -> Alert:
        worst = _at(dive, now)
        situation = _situation(worst, 0.256, 0.249, 0.253, 0.118)
        return _message(kind, severity, now, Opened(_incident(kind, worst, severity), worst, situation))

    return make


def _all_clear(now: float) -> Alert:
    worst = _at(_SLOW, now - 8 * _HOUR)
    over = replace(_incident(Kind.ANOMALY, worst, Severity.CRITICAL), cleared_at=now)
    well = _at(_HEALTHY, now)
    content = Cleared(over, well, _situation(well, 0.112, 0.118, 0.244))
    return _message(Kind.ALL_CLEAR, Severity.INFO, now, content)


def _reminder(now: float) -> Alert:
    incident = _incident(Kind.ANOMALY, _at(_SLOW, now - 24 * _HOUR), Severity.CRITICAL)
    dive = _at(_SLOW, now)
    content = StillOpen(incident, dive, 24.0, _situation(dive, 0.118, 0.12, 0.109, 0.115))
    return _message(Kind.REMINDER, Severity.CRITICAL, now, content)


def _correction(now: float) -> Alert:
    dive = _at(_SLOW, now - 4 * _HOUR)
    content = Corrected(
        _incident(Kind.ANOMALY, dive, Severity.CRITICAL),
        None,
        replace(dive, flag=Flag.NORMAL, speed=0.24),
        "the depth-averaged current of the dive was corrected",
        _situation(_at(_HEALTHY, now), 0.256, 0.24),
    )
    return _message(Kind.CORRECTION, Severity.INFO, dive.t_surface, content)


def _overdue(now: float) -> Alert:
    last = _at(_HEALTHY, now - 9 * _HOUR)
    expected = last.t_surface + 4 * _HOUR
    absence = Absence(
        glider=GLIDER,
        now=now,
        last_sign=last.t_surface,
        expected_at=expected,
        lat=24.21,
        lon=-83.01,
        area=DriftEllipse(24.24, -82.99, 9200.0, 6100.0, 48.0),
        last=last,
        flow=(0.15, 0.17),
        incidents=(),
        fleet=Fleet(2, 0, now - _HOUR),
    )
    return _message(Kind.OVERDUE, Severity.WARNING, now, Overdue(absence, first=True))


def _unknown(now: float) -> Alert:
    words = "cache file 0a1b2c3d.cac is missing: not in /var/opt/gmc/cache"
    waits = [
        Unjudged(now - start * _HOUR, now - end * _HOUR, Hindrance.NO_CACHE, words, "0a1b2c3d")
        for start, end in ((23, 20), (19, 16), (15, 12), (11, 8), (7, 4), (3, 0))
    ]
    found = Blindness(GLIDER, now - 24 * _HOUR, now, now - 24 * _HOUR, tuple(waits))
    content = Blind(found, True, _situation(_at(_HEALTHY, now - 24 * _HOUR)))
    return _message(Kind.UNKNOWN, Severity.WARNING, now, content)


def _call(now: float) -> Call:
    return Call(
        glider=GLIDER,
        log=f"{GLIDER}_network_net_0.log",
        began=now - 300.0,
        last_t=now,
        fix=Fix(now - 240.0, 24.21, -83.01),
        reason="pitch not commanded",
        mission="coast.mi",
        mission_t=now - 240.0,
    )


def _abort(now: float) -> Alert:
    report = AbortReport(Happening.ABORTING, now, "LEAK", Severity.CRITICAL)
    return _message(Kind.ABORT, Severity.CRITICAL, now, Aborted((report,), _call(now)))


def _without_file(now: float) -> Alert:
    calls = (_call(now - 3 * _HOUR), _call(now))
    return _message(Kind.CALL, Severity.WARNING, now, CalledWithoutFile(calls))


def _neighbours(now: float) -> Alert:
    found = Hypothesis("sample", Fault.LOSS, now - 18 * _HOUR, 6, 0.41, 0.06, 43.0)
    content = DiffersFromNeighbours(found, ("other", "third"), 8e3)
    return _message(Kind.NEIGHBOURS, Severity.CRITICAL, now, content)


def _surfacing(now: float) -> Alert:
    dive = _at(_HEALTHY, now)
    return _message(Kind.SURFACING, Severity.INFO, now, Surfaced(dive, now - 4 * _HOUR, _next(now)))


def _next(now: float) -> NextSurfacing:
    return NextSurfacing(now, now + 4 * _HOUR, 1500.0, 24.21, -83.01, 1e6, 0.0, 1e6, "its last dives")


def _situation(dive: Assessment, *earlier: float) -> Situation:
    """How it stands after a dive, with the speeds of those before it."""
    return Situation(dive, (*earlier, dive.speed), _next(dive.t_surface))


def _acknowledged(now: float) -> Alert:
    incident = _incident(Kind.ANOMALY, _at(_SLOW, now - _HOUR), Severity.CRITICAL)
    content = Acknowledged(incident.id, incident.kind, incident.since, "Ann", "boat leaves at 6", False)
    return _message(Kind.ACKNOWLEDGED, Severity.INFO, now, content)


def _regime(now: float) -> Alert:
    dive = replace(_at(_HEALTHY, now), speed=0.49, speed_min=0.42, speed_max=0.66)
    return _message(
        Kind.REGIME, Severity.INFO, now, NewRegime(dive, 0.29, now - 10 * _HOUR, _situation(dive))
    )


def _operator(now: float) -> Alert:
    return operator(
        "no file of any glider for 26.0 h",
        "What to do: look at the dockserver, its modems, and the share that its folders are on.",
        now,
        machine="sample-machine",
        alert_id="",
        severity=Severity.WARNING,
        audience=Severity.WARNING,
    )


def _health(now: float) -> Alert:
    leak = tuple((now - k * _HOUR, volts) for k, volts in ((8, 2.49), (4, 2.41), (0, 1.86)))
    text = "leak detector at 1.860 V, twice in a row below 2.000 V"
    found = Finding("leak", Severity.CRITICAL, now, text, "leak_voltage", leak)
    incident = HealthIncident("", GLIDER, "leak", Severity.CRITICAL, now, now, None, found, found)
    content = HealthFound(incident, False, Fix(now, 24.21, -83.01))
    return _message(Kind.HEALTH, Severity.CRITICAL, now, content)


SAMPLES: dict[Kind, Callable[[float], Alert]] = {
    Kind.ANOMALY: _opened(Kind.ANOMALY, _SLOW, Severity.CRITICAL),
    Kind.FALSE_ALARM: _opened(Kind.FALSE_ALARM, _DISAGREE, Severity.WARNING),
    Kind.OVERDUE: _overdue,
    Kind.UNKNOWN: _unknown,
    Kind.ABORT: _abort,
    Kind.CALL: _without_file,
    Kind.HEALTH: _health,
    Kind.NEIGHBOURS: _neighbours,
    Kind.ALL_CLEAR: _all_clear,
    Kind.REMINDER: _reminder,
    Kind.CORRECTION: _correction,
    Kind.REGIME: _regime,
    Kind.ACKNOWLEDGED: _acknowledged,
    Kind.SURFACING: _surfacing,
    Kind.OPERATOR: _operator,
}
"""How the sample of each kind is made at a time (s)."""
