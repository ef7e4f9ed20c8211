"""What the rules ask of one glider, and how it stands with it beside what a message is about. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from gliderwatch.incidents.constants import TREND_DIVES
from gliderwatch.incidents.notices import (
    DiffersFromNeighbours,
    HealthFound,
    HealthOver,
    HealthReminder,
    Notice,
    Situation,
)
from gliderwatch.model import Assessment, Incident, NextSurfacing


class Facts(Protocol):
    """The facts of one glider now; the store answers. What a rule asks beside these stands in that rule."""

    def incidents(self) -> tuple[Incident, ...]:
        """All its incidents."""

    def expected(self, until: float) -> NextSurfacing | None:
        """What was expected after the last surfacing at `until` (s) or before."""

    def last_surfacing(self, until: float) -> Assessment | None:
        """The last dive that has ended with a fix and surfaced at `until` (s) or before."""

    def came_up(self, t: float) -> str:
        """Why it came up at a time (s), as it said in its call; empty where that is not known."""


def last_dives(facts: Facts, n: int) -> list[Assessment]:
    """The last `n` dives that have ended with a fix, the newest first."""
    dives, until = list[Assessment](), math.inf
    while len(dives) < n and (dive := facts.last_surfacing(until)) is not None:
        dives.append(dive)
        until = dive.t_surface - 1.0
    return dives


def situation(facts: Facts, incident: str = "") -> Situation:
    """The last dives, the next surfacing, and the open incidents but the one of an id."""
    dives = last_dives(facts, TREND_DIVES)
    latest, speeds = dives[0] if dives else None, [dive.speed for dive in reversed(dives)]
    others = tuple(i for i in facts.incidents() if i.id != incident and i.cleared_at is None)
    expected = None if latest is None else next_surfacing(facts, latest)
    came_up = "" if latest is None else facts.came_up(latest.t_surface)
    return Situation(latest, tuple(speeds), expected, others, came_up)


def informed(notices: Sequence[Notice], facts: Facts) -> list[Notice]:
    """Notices that say beside their own matter how it stands with the glider: of rules that see no dives."""
    if not notices:
        return []
    now = situation(facts)
    return [
        replace(each, content=replace(each.content, situation=now))
        if isinstance(each.content, HealthFound | HealthReminder | HealthOver | DiffersFromNeighbours)
        else each
        for each in notices
    ]


def next_surfacing(facts: Facts, latest: Assessment) -> NextSurfacing | None:
    """The surfacing that is expected after the last one; None where that dive cannot be used."""
    expected = facts.expected(math.inf)
    return None if expected is None or expected.after < latest.t_surface else expected
