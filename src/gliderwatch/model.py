"""The values that flow through gliderwatch. Pure: no I/O, no clock, no globals.

Units are SI, times are seconds since 1970-01-01T00:00:00Z, latitudes and longitudes degrees
north and east, angles radians. Velocities are (east, north) relative to true north. The one
exception is `Segment`, whose headings and currents are as the glider reports them, relative to
magnetic north, with the declination beside them: a segment may not hold the position that the
declination depends on, so that `navigation.geodesy` rotates them once it is known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from enum import IntEnum, StrEnum
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def readonly(values: object) -> Array:
    """A read-only float64 array of `values`, so that a value that flows cannot be changed."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


if TYPE_CHECKING:
    # so that names and types of what changes are checked
    from dataclasses import replace as replace  # noqa: PLC0414 (for others)
else:

    def replace(value: Any, **changes: Any) -> Any:
        """As `dataclasses.replace`, for plain frozen values with slots, in half of the time: a dive makes
        some thirty values anew. Raises TypeError for a name that is no field."""
        made, left = object.__new__(type(value)), len(changes)
        for name, get, put in _members(type(value)):
            if name in changes:
                put(made, changes[name])
                left -= 1
            else:
                put(made, get(value))
        if left:
            raise TypeError(f"{type(value).__name__} has not all the fields {', '.join(changes)}")
        return made


@cache
def _members(kind: type) -> tuple[tuple[str, Callable[..., Any], Callable[..., None]], ...]:
    """The fields of a dataclass with slots: name, how it is got and how it is put."""
    slots = ((each.name, kind.__dict__[each.name]) for each in fields(kind))
    return tuple((name, slot.__get__, slot.__set__) for name, slot in slots)


# --------------------------------------------------------------------------- input


@dataclass(frozen=True, slots=True, order=True)
class SegmentId:
    """Identity of a segment, from its header and never from its file name.

    Sorting gives the order of time: by the glider's clock at the opening of the file, then by
    name. ``name`` is the full name in the header (`electa-2022-308-3-2`).
    """

    opened_at: float
    glider: str
    name: str


@dataclass(frozen=True, slots=True)
class Series:
    """Samples of one quantity: times ``t`` (s, shape (n,), increasing) and values ``v`` (shape (n,))."""

    t: Array
    v: Array

    def __len__(self) -> int:
        return len(self.t)

    def between(self, start: float, end: float) -> Series:
        """The samples with start <= t <= end."""
        t = self.t
        i, j = t.searchsorted(start, "left"), t.searchsorted(end, "right")
        return self if i == 0 and j == len(t) else Series(t[i:j], self.v[i:j])


EMPTY = Series(readonly([]), readonly([]))


@dataclass(frozen=True, slots=True)
class Segment:
    """One decoded file: what a glider sent of one segment.

    ``quantities`` maps names of `docs/nomenclature.md` (``fix_lat``, ``heading``, ``depth``, ...)
    to samples; a quantity the file does not hold is absent. ``completeness`` orders copies of
    one segment: the greater replaces the smaller. ``dropped`` counts values out of physical
    range per quantity, ``notes`` say what was corrected. ``declination`` is the angle from true to
    magnetic north (rad, east positive), None where neither the file nor a position in it tells.
    """

    id: SegmentId
    mission: str
    kind: str
    last_t: float
    completeness: tuple[int, int, str]
    quantities: Mapping[str, Series]
    declination: float | None = None
    declination_source: str = ""
    dropped: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def get(self, name: str) -> Series:
        """The samples of a quantity, empty where the file has none."""
        return self.quantities.get(name, EMPTY)


class Hindrance(StrEnum):
    """Why a file was not taken, for decisions."""

    NO_CACHE = "no_cache"
    UNREADABLE = "unreadable"
    GONE = "gone"
    RENAMED = "renamed"
    DAMAGED = "damaged"
    NOT_ASSESSED = "not_assessed"


# --------------------------------------------------------------------------- calls


class Happening(StrEnum):
    """What a glider told in a dialog that a pilot has to know."""

    ABORTING = "aborting"
    FELL_OUT = "fell_out"
    LAST_MISSION = "last_mission"
    GLIDER_DOS = "glider_dos"
    EMERGENCY = "emergency"
    WEIGHT_DROPPED = "weight_dropped"


@dataclass(frozen=True, slots=True)
class Happened:
    """A happening at time ``t`` (s): ``cause`` is the abort, mission or prompt named; ``by_pilot`` whether a
    pilot had stopped the mission from the keyboard before, in the same call."""

    what: Happening
    t: float
    cause: str = ""
    by_pilot: bool = False


@dataclass(frozen=True, slots=True)
class Aborts:
    """The abort history that a glider prints at every call until it is reset: how many since the reset, and
    cause and time (s) of the last. ``at``: when it was printed first (s)."""

    count: int
    at: float
    cause: str = ""
    t: float | None = None


@dataclass(frozen=True, slots=True)
class CallReading:
    """A quantity by ``name`` that a glider printed in a call: measured at ``t`` (s), its ``value`` (SI)."""

    name: str
    t: float
    value: float


@dataclass(frozen=True, slots=True)
class Call:
    """One connection of a glider, as far as its log tells.

    ``began`` and ``last_t`` are the first and the last time it printed (s, its clock), ``over`` whether the
    end of the connection is in the log, ``calls_back`` whether it said that it would. ``fix`` is the last
    position, ``surfaced`` the first that is of this stay at the surface; ``waypoint`` (latitude, longitude,
    degrees) where it is bound; ``reason`` why it is up.
    ``announced`` are the names of files whose transfer began, ``sent`` of those whose transfer was done;
    ``mission`` and ``segment`` (its 8.3 name ``short``) what it named last as running, at ``mission_t`` (s).
    ``readings`` are the last
    ones of each quantity that rules of health look at.
    """

    glider: str
    log: str
    began: float
    last_t: float
    over: bool = False
    calls_back: bool = False
    fix: Fix | None = None
    waypoint: tuple[float, float] | None = None
    reason: str = ""
    mission: str = ""
    mission_t: float | None = None
    segment: str = ""
    short: str = ""
    announced: tuple[str, ...] = ()
    sent: tuple[str, ...] = ()
    aborts: tuple[Aborts, ...] = ()
    happened: tuple[Happened, ...] = ()
    readings: tuple[CallReading, ...] = ()
    surfaced: Fix | None = None


# --------------------------------------------------------------------------- navigation


@dataclass(frozen=True, slots=True)
class Fix:
    """A satellite position: time (s), latitude and longitude (degrees)."""

    t: float
    lat: float
    lon: float


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The way of a dive in its own plane, origin at the fix before it, and the heading along it. It equals
    none but itself, so that what follows from it can be kept: a dive comes again when its current is
    corrected.

    ``t`` (s), ``x`` (m, shape (n, 2): east, north) and ``heading`` (unit vectors east, north;
    shape (n-1, 2)) that holds between t[i] and t[i+1]; a row of zeros where the glider was at
    the surface, not flying.
    """

    t: Array
    x: Array
    heading: Array


@dataclass(frozen=True, slots=True)
class Current:
    """The depth-averaged current of a dive: east, north (m/s, true north); ``final`` once corrected."""

    u: float
    v: float
    final: bool


class Unusable(StrEnum):
    """Why the speed on a dive can not be estimated: for decisions. The words beside it have the numbers."""

    NOT_SURFACED = "not_surfaced"
    NO_FIX_BEFORE = "no_fix_before"
    DATA_MISSING = "data_missing"
    SURFACE_DRIFT = "surface_drift"
    WILD_FIX = "wild_fix"
    STALE_FIX = "stale_fix"
    NO_HEADING = "no_heading"
    TURNING = "turning"


@dataclass(frozen=True, slots=True)
class DiveFeatures:
    """What the files say of how a dive was flown: the numbers that decisions read. None where unknown.

    Times in s: ``duration`` of the flight, ``fix_gap`` from its end to the fix after it, ``drift`` at the
    surface between both fixes, ``heading_gap`` the longest time without a heading where that is long,
    ``unobserved`` the time without any data. ``ground_speed`` between the fixes and ``onboard_speed``, the
    mean of what the glider believes, in m/s. ``heading_steadiness`` is the length of the mean heading vector
    in flight (0: circled, 1: straight), ``heading_mean`` its direction (rad, clockwise from north),
    ``heading_commanded`` the part of headings that were commanded, not measured; ``heading_reckoned``: none
    were measured, the dead-reckoned way has the shape of the dive; ``heading_assumed``: nothing tells the
    course. In a dive with ``surfacing_unseen`` the glider surfaced without a fix. ``depth_max`` in m;
    ``pitch_dive`` and ``pitch_climb`` (medians), mean ``roll_mean`` and spread ``roll_std`` in rad, nose up
    and to starboard positive; ``thruster`` the part of the time that it was on; ``depth_rate_dive`` and
    ``depth_rate_climb`` in m/s, down positive; ``yos`` turns from dive to climb; ``ballast_dive`` and
    ``ballast_climb`` the volume pumped (m3); ``vacuum`` in Pa.
    """

    duration: float
    fix_gap: float | None = None
    drift: float | None = None
    ground_speed: float | None = None
    heading_steadiness: float | None = None
    heading_mean: float | None = None
    heading_commanded: float = 0.0
    heading_reckoned: bool = False
    heading_assumed: bool = False
    surfacing_unseen: bool = False
    depth_max: float | None = None
    pitch_dive: float | None = None
    pitch_climb: float | None = None
    roll_mean: float | None = None
    roll_std: float | None = None
    onboard_speed: float | None = None
    thruster: float | None = None
    depth_rate_dive: float | None = None
    depth_rate_climb: float | None = None
    yos: int | None = None
    ballast_dive: float | None = None
    ballast_climb: float | None = None
    vacuum: float | None = None
    heading_gap: float | None = None
    unobserved: float = 0.0


@dataclass(frozen=True, slots=True)
class Dive:
    """What happened between the fix before and the fix after one dive.

    ``unusable`` is None and ``reason`` empty when the dive can be used for estimation; otherwise they say
    why not, for decisions and in words, and ``track`` is None.
    """

    glider: str
    segment: str
    t_dive: float
    t_surface: float
    start: Fix | None
    end: Fix | None
    track: Track | None
    current: Current | None
    reason: str
    n_samples: int
    features: DiveFeatures
    notes: tuple[str, ...] = ()
    unusable: Unusable | None = None


# --------------------------------------------------------------------------- results


class Flag(IntEnum):
    """Result of Algorithm 2 (001)."""

    NORMAL = 0
    ANOMALY = 1
    FALSE_ALARM = 2


OTHER_REFERENCE = "reference flow:"
"""How a note on a dive begins whose reference flow is not its own depth-averaged current."""


@dataclass(frozen=True, slots=True)
class Assessment:
    """What gliderwatch says of one dive. Fields: `docs/nomenclature.md`.

    ``reason`` says in words why there is no flag, or what a flag other than 0 means here; ``unusable`` is
    that of the dive.
    """

    glider: str
    segment: str
    t_dive: float
    t_surface: float
    lat: float | None
    lon: float | None
    flag: int | None
    reason: str
    speed: float | None
    speed_min: float
    speed_max: float
    flow_u: float | None
    flow_v: float | None
    reference_u: float | None
    reference_v: float | None
    reference_final: bool
    p_e: float | None
    gamma_f: float
    clle_max: float | None
    excitation: float | None
    n_samples: int
    evidence: Mapping[str, float]
    notes: tuple[str, ...]
    parameters: str
    unusable: Unusable | None = None

    # Numbers of the evidence that decide something: a name that is wrong must not be a missing number.

    @property
    def speed_sigma(self) -> float | None:
        """Standard error of the speed (m/s)."""
        return self.evidence.get("speed_sigma")

    @property
    def usual_speed(self) -> float | None:
        """The glider's usual speed (m/s), once it is learnt."""
        return self.evidence.get("usual_speed")

    @property
    def usual_before(self) -> float | None:
        """The usual speed (m/s) before the new way of flying that begins with this dive."""
        return self.evidence.get("usual_before")

    @property
    def rolls(self) -> bool:
        """Whether the dive rolls otherwise than usual; not while either is unknown."""
        roll, low, high = map(self.evidence.get, ("roll_mean", "roll_mean_low", "roll_mean_high"))
        return roll is not None and low is not None and high is not None and not low <= roll <= high


@dataclass(frozen=True, slots=True)
class NextSurfacing:
    """The next surfacing, as it is expected after the last one.

    ``after`` the last surfacing and ``t`` the next (s), with its standard error ``t_sigma`` (s); ``lat`` and
    ``lon`` (degrees) of the next fix, None where the last one is not known, with the covariance ``east``,
    ``cross``, ``north`` of its east and north components (m2); ``source`` what it rests on, in words.
    """

    after: float
    t: float
    t_sigma: float
    lat: float | None
    lon: float | None
    east: float
    cross: float
    north: float
    source: str


class Severity(IntEnum):
    """How loud a message is; recipients choose the least they want."""

    INFO = 0
    WARNING = 1
    CRITICAL = 2


class Kind(StrEnum):
    """What a message is about."""

    ANOMALY = "anomaly"
    FALSE_ALARM = "false_alarm"
    ALL_CLEAR = "all_clear"
    REMINDER = "reminder"
    CORRECTION = "correction"
    OVERDUE = "overdue"
    UNKNOWN = "unknown"
    REGIME = "regime"
    SURFACING = "surfacing"
    ACKNOWLEDGED = "acknowledged"
    ABORT = "abort"
    CALL = "call"
    HEALTH = "health"
    NEIGHBOURS = "neighbours"
    OPERATOR = "operator"


@dataclass(frozen=True, slots=True)
class Incident:
    """Flagged dives in a row, as the data known now tell it.

    ``id`` is made of glider, kind and the first flagged dive, so that the same data give the same id
    in any order of arrival. ``since`` is the start of the first flagged dive, ``opened_at`` the
    surfacing that opened it, ``cleared_at`` the one that cleared it (None: open). ``worst`` is
    the dive furthest out of range, ``last`` the latest flagged dive.
    """

    id: str
    glider: str
    kind: Kind
    severity: Severity
    since: float
    opened_at: float
    cleared_at: float | None
    dives: int
    worst: Assessment
    last: Assessment


@dataclass(frozen=True, slots=True)
class Alert:
    """One message to people. ``id`` is unique and stable: an alert of the same id is never made twice.

    ``incident`` names the thread (empty for surfacing notices and operator messages), ``time`` is the
    surfacing that caused it, ``audience`` the severity that decides who gets it (an all-clear
    goes to whoever got the alarm). ``body`` is a mail's text, ``html`` the same as HTML, ``brief`` what a
    chat shows of it (empty in messages of earlier releases: all).
    """

    id: str
    glider: str
    time: float
    kind: Kind
    severity: Severity
    audience: Severity
    incident: str
    title: str
    body: str
    html: str
    brief: str = ""
