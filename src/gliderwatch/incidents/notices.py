"""What there is to report: a notice says what happened, of which glider, to whom; `messages` gives it words.

Pure values. That a notice is due is a decision of the rules in this folder; `messages.notice_text.render`
makes the message of it, so that a rule never knows how it reads, and a text never decides.
"""

from __future__ import annotations

from dataclasses import dataclass

from gliderwatch.fleet.advice import Advice
from gliderwatch.fleet.cross_check import Hypothesis
from gliderwatch.fleet.reference import FleetReference
from gliderwatch.health.rule import Finding
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.model import (
    Assessment,
    Call,
    Fix,
    Happening,
    Hindrance,
    Incident,
    Kind,
    NextSurfacing,
    Severity,
    Unusable,
)
from gliderwatch.navigation.clock import ClockStep

# ------------------------------------------------------------------ incidents


@dataclass(frozen=True, slots=True)
class Situation:
    """What a pilot asks beside what a notice is about.

    ``last`` is the last dive that ended with a fix, ``speeds`` those of the last dives (m/s, None where not
    known; oldest first), ``expected`` the next surfacing, ``others`` the other incidents that are open;
    ``came_up`` why the glider came up then, as it said in its call; ``health`` what rules of health found
    that goes on.
    """

    last: Assessment | None = None
    speeds: tuple[float | None, ...] = ()
    expected: NextSurfacing | None = None
    others: tuple[Incident, ...] = ()
    came_up: str = ""
    health: tuple[HealthIncident, ...] = ()


NOTHING_ELSE = Situation()
"""Where nothing else is known."""


@dataclass(frozen=True, slots=True)
class Opened:
    """An incident opened at the surfacing of a dive; it takes the place of the one reported ``before``, or is
    that of its kind ``again`` whose end was reported not long ago."""

    incident: Incident
    dive: Assessment
    situation: Situation = NOTHING_ELSE
    before: Incident | None = None
    again: Incident | None = None


@dataclass(frozen=True, slots=True)
class StillOpen:
    """An incident is open since so many ``hours``; ``dive`` is the last one assessed."""

    incident: Incident
    dive: Assessment
    hours: float
    situation: Situation = NOTHING_ELSE


@dataclass(frozen=True, slots=True)
class Cleared:
    """An incident is over; ``dive`` cleared it. The others of the ``situation`` go on. ``is_first``: it was
    over before anybody could be notified of it."""

    incident: Incident
    dive: Assessment
    situation: Situation = NOTHING_ELSE
    is_first: bool = False


@dataclass(frozen=True, slots=True)
class Corrected:
    """Data that came later changed what was reported of an incident: ``before`` as reported, ``now`` as it is
    (None: withdrawn), the ``dive`` as assessed now, and ``why``, in words."""

    before: Incident
    now: Incident | None
    dive: Assessment
    why: str
    situation: Situation = NOTHING_ELSE


@dataclass(frozen=True, slots=True)
class Acknowledged:
    """Somebody (``by``) has acknowledged what is open in a ``thread`` of a ``kind`` since ``since`` (s),
    with a ``note``; ``is_undone``: has given it back."""

    thread: str
    kind: Kind
    since: float
    by: str
    note: str
    is_undone: bool


@dataclass(frozen=True, slots=True)
class Surfaced:
    """A surfacing; ``previous`` is the time of the one before (s), ``expected`` the next; ``advice`` where to
    look next for a field, by its name, ``layers`` how deep to fly to keep on them."""

    dive: Assessment
    previous: float | None
    expected: NextSurfacing | None
    advice: tuple[tuple[str, Advice], ...] = ()
    layers: LayerAdvice | None = None


@dataclass(frozen=True, slots=True)
class NewRegime:
    """The glider is flown in a new way: dives since ``since`` (s) agree on the speed of the ``dive``, which
    is normal from now on; ``before`` was the usual one (m/s)."""

    dive: Assessment
    before: float
    since: float
    situation: Situation = NOTHING_ELSE


# -------------------------------------------------------------------- overdue


@dataclass(frozen=True, slots=True)
class DriftEllipse:
    """Where a glider is with 95 %: an ellipse about ``lat``, ``lon`` (degrees).

    ``major`` and ``minor`` are its semi-axes (m), ``bearing`` that of the major one (degrees from true
    north, 0 to 180).
    """

    lat: float
    lon: float
    major: float
    minor: float
    bearing: float


@dataclass(frozen=True, slots=True)
class Fleet:
    """The other gliders at sea: how many, how many of them ``late`` too, the last sign of life of any (s).

    ``names`` are theirs. ``shore`` is the thread of a message about one of them that was for all, because
    none called; empty where there is none, or it is over. ``back`` is when the first called after that (s).
    """

    others: int = 0
    late: int = 0
    last: float | None = None
    names: tuple[str, ...] = ()
    shore: str = ""
    back: float | None = None

    @property
    def is_silent(self) -> bool:
        """Whether no glider calls at all."""
        return self.others > 0 and self.late == self.others


@dataclass(frozen=True, slots=True)
class Absence:
    """A glider that stays away, as known at ``now`` (s).

    ``last_sign`` is its last sign of life and ``expected_at`` the time of the call that did not come (s);
    ``lat`` and ``lon`` (degrees) where that was expected. ``last`` is the last dive that ended, ``flow`` the
    last known current (east, north; m/s), ``incidents`` what was open.
    """

    glider: str
    now: float
    last_sign: float
    expected_at: float
    lat: float | None
    lon: float | None
    area: DriftEllipse | None
    last: Assessment | None
    flow: tuple[float, float] | None
    incidents: tuple[Incident, ...]
    fleet: Fleet


@dataclass(frozen=True, slots=True)
class Overdue:
    """A glider stays away; not the ``first`` notice of it: it still does."""

    absence: Absence
    first: bool


@dataclass(frozen=True, slots=True)
class CalledAgain:
    """The first sign of life, ``at`` (s), since the ``last_sign`` before (s); ``last`` is its last dive that
    ended, ``expected`` the next surfacing. ``for_all``: the notice that it stayed away stood for all gliders,
    because none called. ``incidents`` are those that are open."""

    last_sign: float
    at: float
    last: Assessment | None
    for_all: bool
    expected: NextSurfacing | None = None
    incidents: tuple[Incident, ...] = ()


@dataclass(frozen=True, slots=True)
class CalledInTime:
    """A glider that was reported overdue since ``due`` (s) had called in time, ``at`` (s)."""

    due: float
    at: float


# ----------------------------------------------------------- cannot be judged


@dataclass(frozen=True, slots=True)
class Unjudged:
    """What should have led to a judgement and did not: a dive without a flag, or a file that was not decoded.

    ``start`` and ``end`` (s); ``cause`` for decisions (None: the estimator's own, as in ``words``) and in
    ``words``; ``crc`` of the cache file that is missing.
    """

    start: float
    end: float
    cause: Unusable | Hindrance | None
    words: str
    crc: str = ""

    @property
    def is_file(self) -> bool:
        """Whether it is a file that was not decoded."""
        return isinstance(self.cause, Hindrance)


@dataclass(frozen=True, slots=True)
class Blindness:
    """Nothing of a glider could be judged from ``since`` to ``until`` (s).

    ``judged`` is the last surfacing (s) whose dive could be (None: none), ``items`` what could not, in order.
    """

    glider: str
    since: float
    until: float
    judged: float | None
    items: tuple[Unjudged, ...]


@dataclass(frozen=True, slots=True)
class Blind:
    """No dive can be judged; not the ``first`` notice of it: it still is so."""

    found: Blindness
    first: bool
    situation: Situation = NOTHING_ELSE


@dataclass(frozen=True, slots=True)
class JudgedAgain:
    """A dive that surfaced ``at`` a time (s) could be judged, the first after ``since`` (s)."""

    since: float
    at: float


# ---------------------------------------------------------------------- calls


@dataclass(frozen=True, slots=True)
class AbortReport:
    """One thing that a glider reported in a call: what, when (``t``, s), its ``cause``; how bad that is.

    ``is_history`` where the first log that is known shows it: nobody knows whether it was dealt with.
    """

    what: Happening
    t: float
    cause: str
    severity: Severity
    is_history: bool = False


@dataclass(frozen=True, slots=True)
class Aborted:
    """What a glider reported (at least one, the loudest first) in its last ``call``."""

    reports: tuple[AbortReport, ...]
    call: Call


@dataclass(frozen=True, slots=True)
class StillAborted:
    """For so many ``hours`` after what a glider reported it flies no mission of its pilots.

    ``call`` is its last.
    """

    reports: tuple[AbortReport, ...]
    call: Call
    hours: float


@dataclass(frozen=True, slots=True)
class Resumed:
    """The glider flies a mission of its pilots again, as it reported in a call."""

    call: Call


@dataclass(frozen=True, slots=True)
class CalledWithoutFile:
    """The glider called and sent no file; so often in a row as there are ``calls``."""

    calls: tuple[Call, ...]


@dataclass(frozen=True, slots=True)
class SendsAgain:
    """The glider sent a file in a call, after several without."""

    call: Call


# --------------------------------------------------------------------- health


@dataclass(frozen=True, slots=True)
class HealthIncident:
    """What a rule of health found in segments and calls in a row.

    ``since`` (s) is when it began by the first finding, ``opened_at`` the end of the segment or call that
    showed it, ``cleared_at`` of the one that cleared it (None: open). ``severity`` is the worst so far.
    """

    id: str
    glider: str
    rule: str
    severity: Severity
    since: float
    opened_at: float
    cleared_at: float | None
    worst: Finding
    last: Finding


@dataclass(frozen=True, slots=True)
class HealthFound:
    """A rule of health found something, with ``is_worse`` something worse; ``fix`` is the glider's last."""

    incident: HealthIncident
    is_worse: bool
    fix: Fix | None
    situation: Situation = NOTHING_ELSE


@dataclass(frozen=True, slots=True)
class HealthReminder:
    """What a rule found is so for so many ``hours``, and nobody has acknowledged it."""

    incident: HealthIncident
    hours: float
    fix: Fix | None
    situation: Situation = NOTHING_ELSE


@dataclass(frozen=True, slots=True)
class HealthOver:
    """The rule finds nothing any more; ``is_withdrawn``: as known now it never did."""

    incident: HealthIncident
    is_withdrawn: bool
    fix: Fix | None
    situation: Situation = NOTHING_ELSE


# -------------------------------------------------------- the files of a glider


@dataclass(frozen=True, slots=True)
class OldDates:
    """All files of a mission are days older than their arrival: the ``first`` segment came ``at`` (s), and is
    of ``t`` by its clock (s)."""

    mission: str
    first: str
    at: float
    t: float


@dataclass(frozen=True, slots=True)
class TwoGliders:
    """Positions alternate between two places that no glider can fly between; they are ``apart`` (m)."""

    a: Fix
    b: Fix
    apart: float


@dataclass(frozen=True, slots=True)
class Irregularity:
    """One thing that is wrong with the files of a glider since ``t`` (s), under a stable ``id``."""

    id: str
    glider: str
    t: float
    what: ClockStep | OldDates | TwoGliders


# ----------------------------------------------------------------- neighbours


@dataclass(frozen=True, slots=True)
class DiffersFromNeighbours:
    """The currents of a glider do not fit those of its ``neighbours``, of which the next is ``nearest`` (m)
    away: ``found`` explains it. Where that is of no glider all have it alike. ``reference``: the flow on its
    last dive by them."""

    found: Hypothesis
    neighbours: tuple[str, ...]
    nearest: float
    situation: Situation = NOTHING_ELSE
    reference: FleetReference | None = None


Content = (
    Opened
    | StillOpen
    | Cleared
    | Corrected
    | Acknowledged
    | Surfaced
    | NewRegime
    | Overdue
    | CalledAgain
    | CalledInTime
    | Blind
    | JudgedAgain
    | Aborted
    | Resumed
    | CalledWithoutFile
    | SendsAgain
    | StillAborted
    | HealthFound
    | HealthReminder
    | HealthOver
    | Irregularity
    | DiffersFromNeighbours
)


@dataclass(frozen=True, slots=True)
class Notice:
    """Something to report, once: its ``content`` decides how it reads.

    ``id`` is the key that keeps it from going out twice, ``thread`` the incident it belongs to (empty: none),
    ``glider`` whose it is (empty: it is for the operator), ``time`` when it became so (s), ``severity`` how
    bad it is, ``audience`` how bad what it is about was: who was notified of that gets this too.
    """

    id: str
    thread: str
    glider: str
    time: float
    kind: Kind
    severity: Severity
    audience: Severity
    content: Content
