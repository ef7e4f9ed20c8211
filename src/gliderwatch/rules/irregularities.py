"""What is wrong with the files of a glider and not with its flight: a clock, two gliders of one name. Pure.

Whoever runs gliderwatch hears of each once (`due`); `status` names those of the last 30 days.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from gliderwatch.alerts import message
from gliderwatch.alerts.words import duration, place, utc
from gliderwatch.model import Alert, Fix, Severity
from gliderwatch.navigation.clock import DAY, HOUR, ROLLOVER, ClockStep, numbered, span
from gliderwatch.navigation.constants import FASTEST_OVER_GROUND
from gliderwatch.navigation.fixes import distance
from gliderwatch.rules.constants import FRESH, GONE

LEAST_STEP = 3 * HOUR
"""Seconds: a clock that was set by less is named in the notes of the dives alone."""
PLACES = 12
"""Surfacings among which two gliders of one name are looked for."""
ALTERNATIONS = 3
"""Times that a glider is elsewhere and back again: once and twice may be a wild position."""
FAR = 5000.0
"""Metres: two places nearer than this are not told apart by their speed, so close in time they may be."""


@dataclass(frozen=True, slots=True)
class Irregularity:
    """One thing that is wrong with the files of a glider since ``t`` (s), under a stable ``id``."""

    id: str
    t: float
    title: str
    text: str


@dataclass(frozen=True, slots=True)
class Coming:
    """A segment that ended at ``t`` by its clock (s), and of which the first file came ``at``; ``watched`` is
    when the first file of its glider came."""

    segment: str
    t: float
    at: float
    watched: float


def found(
    glider: str, steps: Iterable[ClockStep], places: Sequence[Fix], comings: Sequence[Coming] = ()
) -> list[Irregularity]:
    """What is wrong with the files of a glider: ``steps`` of its clock, its last ``places`` in order, and the
    segments that came in the last 30 days."""
    out = [_clock(step) for step in steps if abs(step.step) >= LEAST_STEP]
    out += _old_dates(glider, comings, {numbered(step.segment)[0] for step in steps})
    other = _two_gliders(glider, places)
    return out if other is None else [*out, other]


def due(
    told: Sequence[str], irregularities: Iterable[Irregularity], now: float
) -> tuple[tuple[str, ...], list[Alert]]:
    """The ids of those that are told once this is said, and the messages. What is older than 30 days at `now`
    (s) is history, and nobody is told of it."""
    ids, alerts = list[str](), list[Alert]()
    for each in irregularities:
        if each.id not in told and now - each.t < GONE:
            alerts.append(
                message.operator(
                    each.title,
                    each.text,
                    each.t,
                    alert_id=each.id,
                    severity=Severity.WARNING,
                    audience=Severity.WARNING,
                )
            )
        if each.id in told or now - each.t < GONE:
            ids.append(each.id)
    return tuple(ids), alerts


# ------------------------------------------------------------------- the clock


def _clock(step: ClockStep) -> Irregularity:
    size = span(abs(step.step))
    if step.step < 0:
        title = f"the clock of {step.glider} is right again"
        text = f"It was {size} behind until {utc(step.t)}. Nothing is corrected from {step.segment} on."
    elif step.is_corrected:
        title = f"the clock of {step.glider} fell back by {size}"
        text = (
            f"By its number segment {step.segment} follows the one before, so it opened about "
            f"{utc(step.t)}; its own times are {size} earlier. {_why(step.step)}\n"
            "Its dives, and those that follow, are put on the right time and assessed as before. A note "
            "with each says so.\n"
            "What to do: set the glider's clock when it calls next, and see what its log says of the time."
        )
    else:
        title = f"the clock of {step.glider} fell back, by how much is not known"
        text = (
            f"Segment {step.segment} has a higher number than those before, but its times are at least "
            f"{size} earlier. {_why(step.step)}\n"
            "Segments before it are missing, so the right time is not known. Its dives are kept apart, "
            "under the dates that the glider gave, until the missing files come.\n"
            "What to do: set the glider's clock when it calls next, and have the missing files sent again."
        )
    kind = "right" if step.step < 0 else "corrected" if step.is_corrected else "apart"
    return Irregularity(f"clock/{step.glider}/{step.segment}/{kind}", step.t, title, text)


def _old_dates(glider: str, comings: Sequence[Coming], known: set[str]) -> Iterator[Irregularity]:
    """Missions that come while the glider is watched, and of which every file is days old.

    After a restart with a wrong clock the numbers of segments tell nothing. Of missions with `known` steps
    all is said.
    """
    missions: dict[str, list[Coming]] = {}
    for coming in comings:
        missions.setdefault(numbered(coming.segment)[0], []).append(coming)
    for mission, there in missions.items():
        first = there[0]
        if mission in known or first.at - first.watched < DAY or any(c.at - c.t < FRESH for c in there):
            continue
        size = span(round((first.at - first.t) / DAY) * DAY)
        yield Irregularity(
            f"old-dates/{glider}/{mission}",
            first.at,
            f"files of {glider} are dated {size} before they came",
            f"The first of mission {mission} came {utc(first.at)}: {first.segment}, of {utc(first.t)}. "
            "Either the glider has a wrong clock, or somebody has put old files into its folder.\n"
            "Its dives are kept apart, under the dates that the glider gave; the glider counts as heard.\n"
            "What to do: set the glider's clock when it calls next. If the files are old, nothing.",
        )


def _why(step: float) -> str:
    if step == ROLLOVER:
        return (
            "1024 weeks are the period after which GPS counts its weeks from 0 again: the receiver's "
            "firmware is too old to know the present one."
        )
    return "The clock was set, or lost its time in a restart."


# ------------------------------------------------------- two gliders, one name


def _two_gliders(glider: str, places: Sequence[Fix]) -> Irregularity | None:
    """Whether the places alternate between two that no glider can fly between."""
    there = [
        (a, b)
        for a, b, c in zip(places, places[1:], places[2:], strict=False)
        if _is_too_far(a, b) and _is_too_far(b, c) and not _is_too_far(a, c)
    ]
    if len(there) < ALTERNATIONS:
        return None
    a, b = there[0]
    apart, between = distance(a, b) / 1000, duration(max(b.t - a.t, 60.0))
    return Irregularity(
        f"two-gliders/{glider}/{datetime.fromtimestamp(places[-1].t, UTC):%Y-%m}",
        a.t,
        f"files of two gliders come under the name {glider}",
        f"Its positions alternate between {place(a.lat, a.lon)} and {place(b.lat, b.lon)}, "
        f"{apart:.0f} km apart within {between}: no glider flies so fast. None of its dives can be trusted.\n"
        "What to do: see which other glider has this name in the header of its files (a simulator, a glider "
        "on the bench, a copied autoexec.mi), and keep its files out of this folder.",
    )


def _is_too_far(a: Fix, b: Fix) -> bool:
    way = distance(a, b)
    return way > FAR and way > FASTEST_OVER_GROUND * abs(b.t - a.t)
