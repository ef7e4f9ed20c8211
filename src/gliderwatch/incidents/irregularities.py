"""What is wrong with the files of a glider and not with its flight: a clock, two gliders of one name. Pure.

Whoever runs gliderwatch is notified of each once (`due`); `status` names those of the last 30 days.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from gliderwatch.incidents.constants import ALTERNATIONS, FAR_APART, FRESH, GONE, STEP_REPORTED
from gliderwatch.incidents.notices import Irregularity, Notice, OldDates, TwoGliders
from gliderwatch.model import Fix, Kind, Severity
from gliderwatch.navigation.clock import DAY, ClockStep, numbered
from gliderwatch.navigation.constants import FASTEST_OVER_GROUND
from gliderwatch.navigation.fixes import distance


@dataclass(frozen=True, slots=True)
class Arrival:
    """A segment that ended at ``t`` by its clock (s), and of which the first file came ``at``; ``watched`` is
    when the first file of its glider came."""

    segment: str
    t: float
    at: float
    watched: float


def irregularities(
    glider: str, steps: Iterable[ClockStep], places: Sequence[Fix], arrivals: Sequence[Arrival] = ()
) -> list[Irregularity]:
    """What is wrong with the files of a glider: ``steps`` of its clock, its last ``places`` in order, and the
    segments that came in the last 30 days."""
    out = [_clock(step) for step in steps if abs(step.step) >= STEP_REPORTED]
    out += _old_dates(glider, arrivals, {numbered(step.segment)[0] for step in steps})
    other = _two_gliders(glider, places)
    return out if other is None else [*out, other]


def due(
    reported: Sequence[str], found: Iterable[Irregularity], now: float
) -> tuple[tuple[str, ...], list[Notice]]:
    """The ids of those that are reported once this is, and the notices to the operator. What is older than 30
    days at `now` (s) is history, and nobody is notified of it."""
    ids, notices, loud = list[str](), list[Notice](), Severity.WARNING
    for each in found:
        if each.id not in reported and now - each.t < GONE:
            notices.append(Notice(each.id, "", "", each.t, Kind.OPERATOR, loud, loud, each))
        if each.id in reported or now - each.t < GONE:
            ids.append(each.id)
    return tuple(ids), notices


# ------------------------------------------------------------------- the clock


def _clock(step: ClockStep) -> Irregularity:
    kind = "right" if step.step < 0 else "corrected" if step.is_corrected else "apart"
    return Irregularity(f"clock/{step.glider}/{step.segment}/{kind}", step.glider, step.t, step)


def _old_dates(glider: str, arrivals: Sequence[Arrival], explained: set[str]) -> Iterator[Irregularity]:
    """Missions that come while the glider is watched, and of which every file is days old.

    After a restart with a wrong clock the numbers of segments say nothing. Missions whose clock was
    set (`explained`) are reported as that.
    """
    missions: dict[str, list[Arrival]] = {}
    for arrival in arrivals:
        missions.setdefault(numbered(arrival.segment)[0], []).append(arrival)
    for mission, of_mission in missions.items():
        first = of_mission[0]
        if (
            mission in explained
            or first.at - first.watched < DAY
            or any(a.at - a.t < FRESH for a in of_mission)
        ):
            continue
        what = OldDates(mission, first.segment, first.at, first.t)
        yield Irregularity(f"old-dates/{glider}/{mission}", glider, first.at, what)


# ------------------------------------------------------- two gliders, one name


def _two_gliders(glider: str, places: Sequence[Fix]) -> Irregularity | None:
    """Whether the places alternate between two that no glider can fly between."""
    returns = [
        (a, b)
        for a, b, c in zip(places, places[1:], places[2:], strict=False)
        if _is_too_far(a, b) and _is_too_far(b, c) and not _is_too_far(a, c)
    ]
    if len(returns) < ALTERNATIONS:
        return None
    a, b = returns[0]
    month = datetime.fromtimestamp(places[-1].t, UTC)
    identity = f"two-gliders/{glider}/{month:%Y-%m}"
    return Irregularity(identity, glider, a.t, TwoGliders(a, b, distance(a, b)))


def _is_too_far(a: Fix, b: Fix) -> bool:
    way = distance(a, b)
    return way > FAR_APART and way > FASTEST_OVER_GROUND * abs(b.t - a.t)
