"""What the incidents of a glider keep of it when old data are removed. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable

from gliderwatch.model import Incident
from gliderwatch.rules.announce import Thread


def kept_since(incidents: Iterable[Incident], threads: Iterable[Thread], cut: float) -> float:
    """The time (s), at the most `cut`, from which on all is kept for incidents that are not over at `cut`."""
    over = [(i.since, math.inf if i.cleared_at is None else i.cleared_at) for i in incidents]
    over += [(min(t.told.since, t.dive.t_dive), ended_at(t)) for t in threads]
    floor, before = cut, math.inf
    while floor < before:  # what is kept may reach further back, and then keep more
        before = floor
        floor = min([before, *(since for since, end in over if end >= before)])
    return floor


def ended_at(thread: Thread) -> float:
    """When a thread had its last message (s); infinite while there may be one to come."""
    if thread.withdrawn:
        return thread.time
    return math.inf if thread.told.cleared_at is None else max(thread.told.cleared_at, thread.time)


def is_removable(incident: Incident, since: float) -> bool:
    """Whether an incident was over before the time (s) from which on all is kept."""
    return incident.cleared_at is not None and incident.cleared_at < since
