"""What a glider can print in the log of a call, as typed events. Pure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Carrier:
    """The connection was ``found`` or lost."""

    found: bool


@dataclass(frozen=True, slots=True)
class Vehicle:
    """The glider that speaks, lower case."""

    name: str


@dataclass(frozen=True, slots=True)
class Clock:
    """The glider's time (s since 1970, UTC) and mission time (s)."""

    t: float
    mission_time: float | None


@dataclass(frozen=True, slots=True)
class Position:
    """A satellite fix (degrees) and its ``age`` (s)."""

    lat: float
    lon: float
    age: float


@dataclass(frozen=True, slots=True)
class Reading:
    """A sensor, its value in its own unit, and its ``age`` (s; None: it is not told)."""

    sensor: str
    value: float
    unit: str
    age: float | None


@dataclass(frozen=True, slots=True)
class Because:
    """Why the glider is at the surface."""

    reason: str


@dataclass(frozen=True, slots=True)
class Mission:
    """The mission that runs (lower case), the full name of the segment and its short one."""

    name: str
    segment: str
    short: str


@dataclass(frozen=True, slots=True)
class Counts:
    """Errors, warnings and oddities of all devices: each in total, of the mission, of the segment."""

    errors: tuple[int, int, int]
    warnings: tuple[int, int, int]
    oddities: tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Device:
    """A row of the listing of devices: its errors, warnings, oddities in total, of mission, segment."""

    name: str
    counts: Counts


@dataclass(frozen=True, slots=True)
class AbortCount:
    """How many aborts since the last reset of the glider."""

    count: int


@dataclass(frozen=True, slots=True)
class AbortCause:
    """The cause of the last abort, as `LEAK`."""

    cause: str


@dataclass(frozen=True, slots=True)
class AbortTime:
    """When the last abort was (s)."""

    t: float


@dataclass(frozen=True, slots=True)
class AbortPlace:
    """In which ``segment`` or ``mission`` the last abort was."""

    what: str
    name: str


@dataclass(frozen=True, slots=True)
class AbortNow:
    """The mission is being aborted."""

    cause: str


@dataclass(frozen=True, slots=True)
class WeightDropped:
    """The drop weight is gone, or goes now."""


@dataclass(frozen=True, slots=True)
class FellOut:
    """The mission was completed abnormally."""


@dataclass(frozen=True, slots=True)
class LastMission:
    """A mission runs that a glider runs by itself only when the pilot's has failed."""

    name: str


@dataclass(frozen=True, slots=True)
class Prompt:
    """It waits at a prompt: how the last mission ended (A: aborted, N: normally, I: none) and the code."""

    end: str
    code: int


@dataclass(frozen=True, slots=True)
class Emergency:
    """The hardware is in emergency mode."""


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where it is bound (degrees)."""

    lat: float
    lon: float


@dataclass(frozen=True, slots=True)
class Diving:
    """Seconds until it dives."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Transfer:
    """The transfer of a file began (``size`` in bytes), or with ``done`` has ended whole."""

    file: str
    size: int | None
    done: bool


@dataclass(frozen=True, slots=True)
class Sent:
    """One of its computers (GLD, SCI) says that all its files were sent."""

    computer: str


@dataclass(frozen=True, slots=True)
class PilotThere:
    """Somebody typed: with ``ends`` to end the mission, else to go on with it."""

    ends: bool


@dataclass(frozen=True, slots=True)
class Unattended:
    """It waited for a pilot in vain and dives."""


@dataclass(frozen=True, slots=True)
class HangUp:
    """It ends the call; with ``minutes`` it says when it calls back."""

    minutes: float | None


@dataclass(frozen=True, slots=True)
class Trouble:
    """A device reports an error, a warning, an oddity, or that it is out of its deadband."""

    what: str
    text: str


@dataclass(frozen=True, slots=True)
class Housekeeping:
    """A quantity of the glider's computer: free disk (megabytes), free heap (bytes), `m_weight_drop`, ..."""

    name: str
    value: float


Event = (
    Carrier
    | Vehicle
    | Clock
    | Position
    | Reading
    | Because
    | Mission
    | Counts
    | Device
    | AbortCount
    | AbortCause
    | AbortTime
    | AbortPlace
    | AbortNow
    | WeightDropped
    | FellOut
    | LastMission
    | Prompt
    | Emergency
    | Waypoint
    | Diving
    | Transfer
    | Sent
    | PilotThere
    | Unattended
    | HangUp
    | Trouble
    | Housekeeping
)
