"""What was reported and is not over: for status, acknowledgements, and people who wait for these. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from gliderwatch.incidents.acknowledgement import Acks, is_acknowledged
from gliderwatch.incidents.constants import EMPTY_CALLS
from gliderwatch.incidents.notifications import (
    NotificationState,
    Thread,
    holds_acknowledgement,
    matched_incidents,
)
from gliderwatch.model import Incident, Kind, Severity


def unacknowledged(
    notified: NotificationState, incidents: tuple[Incident, ...], acks: Acks
) -> frozenset[str]:
    """The threads of what is open and nobody has acknowledged: incidents, and gliders that stay away, cannot
    be judged, have aborted, call and send nothing, or differ from their neighbours."""
    matched = matched_incidents(notified.threads, incidents)
    threads = {
        thread.id
        for thread in notified.threads
        if (now := matched.get(thread.id)) is not None
        and now.cleared_at is None
        and not holds_acknowledgement(thread, now, acks)
    }
    if notified.unknown is not None and not notified.unknown.is_over:
        threads.add(notified.unknown.id)
    threads |= {t.id for t in open_threads(notified) if not is_acknowledged(acks, (t.id,), t.severity)}
    if notified.neighbours is not None and notified.neighbours.id:
        threads.add(notified.neighbours.id)
    return frozenset(threads | {silence.id for silence in notified.silences if silence.called is None})


@dataclass(frozen=True, slots=True)
class OpenThread:
    """What goes on and is no incident of dives: an abort, calls without a file, what a rule of health found.

    ``since`` (s); ``about`` in a few words.
    """

    id: str
    kind: Kind
    severity: Severity
    since: float
    about: str

    @property
    def glider(self) -> str:
        """Whose it is."""
        return self.id.split("/", 1)[0]


def open_threads(notified: NotificationState) -> tuple[OpenThread, ...]:
    """The aborts, calls without a file and findings of health that were reported and go on."""
    aborts = (
        OpenThread(e.id, Kind.ABORT, e.severity, e.reports[0].t, e.reports[0].cause or str(e.reports[0].what))
        for e in notified.aborts
        if e.cleared is None and e.reports
    )
    health = (
        OpenThread(t.id, Kind.HEALTH, t.reported.severity, t.reported.since, t.reported.last.text)
        for t in notified.health
        if not t.is_over
    )
    empty, found = notified.empty, list[OpenThread]()
    if empty is not None and not empty.is_over:
        severity = Severity.INFO if empty.reported < EMPTY_CALLS else Severity.WARNING
        found = [OpenThread(empty.id, Kind.CALL, severity, empty.since, f"{empty.reported} without a file")]
    return (*aborts, *found, *health)


# ----------------------------------------
# What the incidents of a glider keep of it when old data are removed.


def kept_since(incidents: Iterable[Incident], threads: Iterable[Thread], cut: float) -> float:
    """The time (s), at the most `cut`, from which on all is kept for incidents that are not over at `cut`."""
    over = [(i.since, math.inf if i.cleared_at is None else i.cleared_at) for i in incidents]
    over += [(min(t.reported.since, t.dive.t_dive), ended_at(t)) for t in threads]
    floor, before = cut, math.inf
    while floor < before:  # what is kept may reach further back, and then keep more
        before = floor
        floor = min([before, *(since for since, end in over if end >= before)])
    return floor


def ended_at(thread: Thread) -> float:
    """When a thread had its last message (s); infinite while there may be one to come."""
    if thread.withdrawn:
        return thread.time
    return math.inf if thread.reported.cleared_at is None else max(thread.reported.cleared_at, thread.time)


def is_removable(incident: Incident, since: float) -> bool:
    """Whether an incident was over before the time (s) from which on all is kept."""
    return incident.cleared_at is not None and incident.cleared_at < since
