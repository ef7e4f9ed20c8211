"""All notices of a glider that are due after an input: each rule in turn, by the facts. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Protocol

from gliderwatch.fleet.advice import Advice
from gliderwatch.fleet.flow import DiveCurrent
from gliderwatch.fleet.reference import fleet_reference, standing
from gliderwatch.health.rules import Judged
from gliderwatch.incidents import aborts, calls, health, irregularities, neighbours, overdue, unjudged
from gliderwatch.incidents.acknowledgement import Acks
from gliderwatch.incidents.constants import GONE
from gliderwatch.incidents.facts import informed
from gliderwatch.incidents.notices import Irregularity, Notice
from gliderwatch.incidents.notifications import (
    IncidentFacts,
    NotificationState,
    due_notifications,
    holds_acknowledgement,
)
from gliderwatch.incidents.open_threads import unacknowledged
from gliderwatch.incidents.overdue import SilenceFacts
from gliderwatch.incidents.unjudged import WatchFacts
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.model import Call, Fix
from gliderwatch.params import Attention


class NoticeFacts(IncidentFacts, SilenceFacts, WatchFacts, Protocol):
    """All facts of a glider that notices follow from."""

    def irregularities(self, now: float) -> list[Irregularity]:
        """What is wrong with its files at `now` (s)."""

    def calls(self, since: float) -> tuple[Call, ...]:
        """Its calls that went on at `since` (s) or later, in order of time."""

    def last_fix(self, since: float) -> Fix | None:
        """Its last fix, by its surfacings, and its calls since a time (s)."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What people want of a glider: what they have acknowledged, how much ``attention`` it gets, after how
    many hours they are reminded (None: never), whether anyone wants a notice of each surfacing."""

    acks: Acks
    attention: Attention
    reminder_hours: float | None
    surfacings: bool


@dataclass(frozen=True, slots=True)
class Findings:
    """What was found beside the incidents of dives: by the rules of health in each segment and call (s), the
    currents of all gliders about the last surfacing (None: they are not compared), where to look next by the
    name of a field (``advice``), how deep to fly next (``layers``)."""

    health: Sequence[tuple[float, Judged]] = ()
    currents: Sequence[DiveCurrent] | None = None
    advice: tuple[tuple[str, Advice], ...] = ()
    layers: LayerAdvice | None = None


@dataclass(frozen=True, slots=True)
class Due:
    """The ``notices`` that are due, what people were ``notified`` of after them, and the threads of what is
    open then and nobody has acknowledged."""

    notified: NotificationState
    notices: tuple[Notice, ...]
    open_threads: frozenset[str]


def due(before: NotificationState, facts: NoticeFacts, wanted: Wanted, findings: Findings, now: float) -> Due:
    """The notices that are due of a glider at `now` (s), in the order in which they are sent."""
    acks, hours = wanted.acks, wanted.reminder_hours
    silences, of_silences = overdue.on_calls(before.silences, facts, now)
    notified, of_incidents = due_notifications(
        replace(before, silences=silences),
        facts,
        hours,
        wanted.surfacings,
        acks,
        findings.advice,
        findings.layers,
        now,
    )
    unknown, of_watch = unjudged.announce(notified.unknown, facts, wanted.attention, hours, now)
    ids, of_files = irregularities.due(before.irregularities, facts.irregularities(now), now)
    notified = replace(notified, unknown=unknown, irregularities=ids)
    notified, of_fleet = _of_fleet(notified, facts, findings.currents)
    notified, of_calls = _of_calls(notified, facts, wanted, now)
    notified, of_health = _of_health(notified, facts, wanted, findings.health, now)
    return Due(
        notified,
        (
            *of_silences,
            *of_files,
            *of_incidents,
            *of_watch,
            *informed(of_fleet, facts),
            *of_calls,
            *informed(of_health, facts),
        ),
        unacknowledged(notified, facts.incidents(), acks),
    )


def _of_fleet(
    notified: NotificationState, facts: NoticeFacts, currents: Sequence[DiveCurrent] | None
) -> tuple[NotificationState, list[Notice]]:
    """A glider beside its neighbours."""
    last = None if currents is None else facts.last_surfacing(inf)
    if currents is None or last is None:
        return notified, []
    stands, reference = standing(currents, last.glider), None
    if stands is not None and stands.fault is not None:  # the flow is for its message alone
        reference = fleet_reference(currents, last.glider, stands=stands)
    compared, notices = neighbours.announce(
        last.glider, notified.neighbours, stands, reference, last.t_surface
    )
    return replace(notified, neighbours=compared), notices


def _of_calls(
    notified: NotificationState, facts: NoticeFacts, wanted: Wanted, now: float
) -> tuple[NotificationState, list[Notice]]:
    """What a glider reported in its calls, and that it calls and sends no file."""
    recent = facts.calls(now - GONE)
    episodes, notices = aborts.announce(
        facts.glider, notified.aborts, recent, now, wanted.acks, wanted.reminder_hours
    )
    signs = facts.signs(now - GONE) if recent else ()
    empty, more = calls.announce(facts.glider, notified.empty, recent, signs, now, wanted.acks)
    return replace(notified, aborts=episodes, empty=empty), [*notices, *more]


def _of_health(
    notified: NotificationState,
    facts: NoticeFacts,
    wanted: Wanted,
    rows: Sequence[tuple[float, Judged]],
    now: float,
) -> tuple[NotificationState, list[Notice]]:
    """What the rules of health found; the fix is asked for where there is anything to say."""
    if not notified.health and not any(any(judged.values()) for _, judged in rows):
        return notified, []
    fix, open_ones = facts.last_fix(now - GONE), [t for t in notified.threads if t.is_open]
    reminded = [
        t.reported.severity for t in open_ones if not holds_acknowledgement(t, t.reported, wanted.acks)
    ]
    threads, notices = health.announce(
        notified.health,
        facts.glider,
        rows,
        fix,
        wanted.acks,
        wanted.reminder_hours,
        facts.incidents(),
        max(reminded, default=None),
    )
    return replace(notified, health=threads), notices
