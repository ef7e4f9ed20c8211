"""One message of each kind, anomalies with each cause: for tests of how messages read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alert_support import DISAGREE, DIVE, HEALTHY, SLOW, SURFACE, incident
from gliderwatch.estimation.modes import MODES
from gliderwatch.estimation.verdict import FASTER, Blame
from gliderwatch.fleet.cross_check import Check, Hypothesis
from gliderwatch.fleet.flow import DiveCurrent, Fault, FleetFlow
from gliderwatch.fleet.reference import FleetReference
from gliderwatch.health.rule import Finding
from gliderwatch.incidents.notices import (
    Aborted,
    AbortReport,
    Absence,
    Acknowledged,
    Blind,
    Blindness,
    CalledAgain,
    CalledInTime,
    CalledWithoutFile,
    Cleared,
    Content,
    Corrected,
    DiffersFromNeighbours,
    DriftEllipse,
    Fleet,
    HealthFound,
    HealthIncident,
    HealthOver,
    HealthReminder,
    Irregularity,
    JudgedAgain,
    NewRegime,
    Notice,
    Opened,
    Overdue,
    Resumed,
    SendsAgain,
    Situation,
    StillAborted,
    StillOpen,
    Surfaced,
    TwoGliders,
    Unjudged,
)
from gliderwatch.messages.notice_text import operator, render
from gliderwatch.messages.template import with_machine
from gliderwatch.model import (
    Alert,
    Assessment,
    Call,
    Fix,
    Happening,
    Hindrance,
    Kind,
    NextSurfacing,
    Severity,
)

HOUR = 3600.0
NEXT = NextSurfacing(SURFACE, SURFACE + 4 * HOUR, 1500.0, 24.21, -83.01, 1e6, 0.0, 1e6, "its last dives")
USUAL = {
    **SLOW.evidence,
    "speed_sigma": 0.03,
    "usual_speed": 0.26,
    "roll_mean": 0.02,
    "roll_mean_low": -0.05,
    "roll_mean_usual": 0.01,
    "roll_mean_high": 0.07,
    "depth_rate_climb": -0.16,
    "depth_rate_climb_low": -0.18,
    "depth_rate_climb_usual": -0.16,
    "depth_rate_climb_high": -0.14,
    "depth_rate_dive": 0.17,
    "depth_rate_dive_low": 0.15,
    "depth_rate_dive_usual": 0.17,
    "depth_rate_dive_high": 0.19,
    "pitch_climb": 0.45,
    "pitch_climb_low": 0.40,
    "pitch_climb_usual": 0.45,
    "pitch_climb_high": 0.50,
    "onboard_speed": 0.25,
    "own_speed": 0.25,
}


def situation(dive: Assessment = SLOW, *earlier: float | None) -> Situation:
    """How it stands after a dive, with the speeds of those before it."""
    return Situation(dive, (*earlier, dive.speed), NEXT, came_up="timeout expired")


def message(kind: Kind, content: Content, severity: Severity = Severity.CRITICAL) -> Alert:
    """The message of a content."""
    return render(Notice("a", "t", "electa", SURFACE, kind, severity, severity, content))


def anomaly(speed: float = 0.112, **evidence: float) -> Alert:
    """The first message of an anomaly with some evidence."""
    words = {"reason": "slower than normal", "notes": ("depth-averaged current is provisional",)}
    dive = replace(SLOW, speed=speed, reference_final=False, evidence={**USUAL, **evidence}, **words)
    now = situation(dive, 0.256, 0.249, 0.253, 0.118)
    return message(Kind.ANOMALY, Opened(incident(dive), dive, now))


def disagreement(reason: str, speed: float = 0.112, **evidence: float) -> Alert:
    """The first message that measurements disagree, for a reason of the estimator."""
    numbers = {**DISAGREE.evidence, "across_sigma": 0.05, **evidence}
    dive = replace(DISAGREE, reason=reason, speed=speed, evidence=numbers)
    return message(
        Kind.FALSE_ALARM, Opened(incident(dive, kind=Kind.FALSE_ALARM), dive, situation(dive, 0.25))
    )


def absence(fleet: Fleet, minor: float = 6100.0) -> Absence:
    """A glider that stays away, in an ellipse of a minor semi-axis (m)."""
    area = DriftEllipse(24.24, -82.99, 9200.0, minor, 48.0)
    heard, flow = SURFACE - 9 * HOUR, (0.15, 0.17)
    last = replace(HEALTHY, t_surface=heard, t_dive=heard - 3 * HOUR)
    return Absence("electa", SURFACE, heard, SURFACE - 5 * HOUR, 24.21, -83.01, area, last, flow, (), fleet)


def blind(first: bool) -> Alert:
    """That no dive could be judged for a day."""
    words = "cache file 0a1b2c3d.cac is missing: not in /var/opt/gmc/cache"
    ends = [SURFACE - 4 * HOUR * k for k in range(6)]
    items = tuple(Unjudged(e - 3 * HOUR, e, Hindrance.NO_CACHE, words, "0a1b2c3d") for e in reversed(ends))
    found = Blindness("electa", SURFACE - 24 * HOUR, SURFACE, SURFACE - 24 * HOUR, items)
    kind = Kind.UNKNOWN if first else Kind.REMINDER
    return message(kind, Blind(found, first, situation(HEALTHY)), Severity.WARNING)


CALL = Call(
    glider="electa",
    log="electa_network_net_0.log",
    began=SURFACE - 300.0,
    last_t=SURFACE,
    fix=Fix(SURFACE - 240.0, 24.21, -83.01),
    reason="pitch not commanded",
    mission="coast.mi",
    mission_t=SURFACE - 240.0,
    segment="electa-2022-308-3-2",
)
CUT = replace(CALL, over=True, announced=("0308a3f2.sbd",))


FIX = Fix(SURFACE - 240.0, 24.21, -83.01)
_ERROR = 0.03**2 * np.eye(2)
BESIDE = FleetReference(
    DiveCurrent("electa", FIX, FIX, 0.02, -0.21),
    FleetFlow(np.array([0.01, -0.09]), _ERROR, ("angus", "bruce"), 8e3),
    (np.array([0.01, -0.09]), _ERROR),
    Check(("angus", "bruce"), 8e3, None, None),
    None,
)
_FOUND = Finding(
    "leak",
    Severity.CRITICAL,
    DIVE,
    "leak detector at 2.380 V, twice in a row below 2.400 V",
    "leak_voltage",
    tuple((DIVE + 600.0 * k, 2.48 - 0.01 * k) for k in range(10)),
)
LEAK = HealthIncident(
    "electa/health/leak/1", "electa", "leak", Severity.CRITICAL, DIVE, SURFACE, None, _FOUND, _FOUND
)


def abort(what: Happening, cause: str) -> Alert:
    """That a glider reported something in a call."""
    report = AbortReport(what, SURFACE - 600.0, cause, Severity.CRITICAL)
    return message(Kind.ABORT, Aborted((report,), CALL))


def acknowledged(note: str, *, is_undone: bool) -> Alert:
    """That Ann has taken an incident on, or given it back."""
    content = Acknowledged(incident().id, Kind.ANOMALY, DIVE, "Ann", note, is_undone)
    return message(Kind.ACKNOWLEDGED, content, Severity.INFO)


def kinds() -> dict[str, Alert]:
    """A message of each kind, by name."""
    over = incident(cleared_at=SURFACE)
    other = replace(incident(DISAGREE, kind=Kind.FALSE_ALARM), id="electa/false_alarm/1")
    well = situation(HEALTHY, 0.112, 0.118, 0.24, 0.247)
    why = "the depth-averaged current of the dive was corrected"
    fleet, silent = Fleet(2, 0, SURFACE - HOUR), Fleet(3, 3, SURFACE - 8 * HOUR, ("angus", "bruce", "cora"))
    regime = replace(HEALTHY, speed=0.49, speed_min=0.42, speed_max=0.66)
    info, warning = Severity.INFO, Severity.WARNING
    apart = TwoGliders(Fix(SURFACE, 24.2, -83.0), Fix(SURFACE, 30.0, -79.0), 8e5)
    two = Irregularity("i", "electa", SURFACE, apart)
    fixes = next(mode.words for mode in MODES if mode.words.startswith("the ground"))
    return {
        "anomaly-wing-roll": anomaly(roll_mean=0.31),
        "anomaly-wing-way": anomaly(),
        "anomaly-drag": anomaly(depth_rate_climb=-0.08, depth_rate_dive=0.09, own_speed=0.12),
        "anomaly-heavy": anomaly(depth_rate_climb=-0.08, depth_rate_dive=0.2, own_speed=0.12),
        "anomaly-trim": anomaly(pitch_climb=0.3, own_speed=0.12),
        "anomaly-growth": anomaly(0.225, own_speed=0.23),
        "anomaly-unclear": anomaly(own_speed=0.12, onboard_speed=0.12),
        "anomaly-fast": anomaly(0.45),
        "disagree-current": disagreement(Blame.CURRENT),
        "disagree-compass": disagreement(Blame.COMPASS),
        "disagree-unclear": disagreement(Blame.UNCLEAR),
        "disagree-fixes": disagreement(fixes),
        "disagree-faster": disagreement(FASTER, 0.45, across_misfit=0.01),
        "disagree-flow": disagreement(""),
        "reminder": message(Kind.REMINDER, StillOpen(incident(), SLOW, 26.0, situation(SLOW, 0.1, 0.12))),
        "all-clear": message(Kind.ALL_CLEAR, Cleared(over, HEALTHY, well), info),
        "all-clear-other-open": message(
            Kind.ALL_CLEAR, Cleared(over, HEALTHY, replace(well, others=(other,))), info
        ),
        "correction-withdrawn": message(
            Kind.CORRECTION, Corrected(incident(), None, HEALTHY, why, well), info
        ),
        "correction-stands": message(
            Kind.CORRECTION, Corrected(incident(), incident(), replace(SLOW, speed=0.151), why, situation())
        ),
        "acknowledged": acknowledged("boat leaves at 6", is_undone=False),
        "given-back": acknowledged("", is_undone=True),
        "surfacing": message(Kind.SURFACING, Surfaced(HEALTHY, DIVE - 1800, NEXT), info),
        "surfacing-slow": message(Kind.SURFACING, Surfaced(SLOW, DIVE - 1800, NEXT), info),
        "regime": message(Kind.REGIME, NewRegime(regime, 0.29, DIVE, situation(regime, 0.47, 0.48)), info),
        "overdue": message(Kind.OVERDUE, Overdue(absence(fleet), True), warning),
        "overdue-circle": message(Kind.REMINDER, Overdue(absence(Fleet(), 9100.0), False), warning),
        "overdue-shore": message(Kind.OVERDUE, Overdue(absence(silent), True), warning),
        "calls-again": message(
            Kind.ALL_CLEAR, CalledAgain(SURFACE - 9 * HOUR, SURFACE, HEALTHY, False, NEXT), info
        ),
        "called-in-time": message(Kind.CORRECTION, CalledInTime(SURFACE - HOUR, SURFACE - 2 * HOUR), info),
        "unknown": blind(first=True),
        "unknown-reminder": blind(first=False),
        "judged-again": message(Kind.ALL_CLEAR, JudgedAgain(SURFACE - 30 * HOUR, SURFACE), info),
        "abort-leak": abort(Happening.ABORTING, "LEAK"),
        "abort-prompt": abort(Happening.GLIDER_DOS, "A 24"),
        "resumed": message(Kind.ALL_CLEAR, Resumed(CALL), info),
        "call": message(Kind.CALL, CalledWithoutFile((CUT, CUT)), warning),
        "sends-again": message(Kind.ALL_CLEAR, SendsAgain(CALL), info),
        "neighbours": message(
            Kind.NEIGHBOURS,
            DiffersFromNeighbours(
                Hypothesis("electa", Fault.LOSS, DIVE, 6, 0.41, 0.06, 43.0),
                ("angus", "bruce"),
                8e3,
                situation(HEALTHY),
                BESIDE,
            ),
        ),
        "neighbours-all": message(
            Kind.NEIGHBOURS,
            DiffersFromNeighbours(
                Hypothesis("", Fault.TURN, DIVE, 6, 0.2, 0.03, 30.0),
                ("angus", "bruce"),
                8e3,
                situation(HEALTHY),
            ),
        ),
        "health": message(Kind.HEALTH, HealthFound(LEAK, False, FIX, situation(HEALTHY))),
        "health-reminder": message(Kind.REMINDER, HealthReminder(LEAK, 26.0, FIX, situation(HEALTHY))),
        "health-over": message(Kind.ALL_CLEAR, HealthOver(LEAK, False, FIX), info),
        "still-aborted": message(
            Kind.REMINDER,
            StillAborted((AbortReport(Happening.ABORTING, DIVE, "LEAK", Severity.CRITICAL),), CALL, 26.0),
        ),
        "operator-files": with_machine(message(Kind.OPERATOR, two, warning), "dockserver-2"),
        "operator": operator(
            "no file of any glider for 26.0 h",
            "The last one came 2022-11-04 10:34 UTC. Until one comes no glider is watched.\n"
            "What to do: look at the dockserver, its modems, and the share that its folders are on.",
            SURFACE,
            alert_id="a",
            severity=warning,
            audience=warning,
            machine="dockserver-2",
        ),
    }
