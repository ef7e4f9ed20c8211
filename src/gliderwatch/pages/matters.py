"""What needs, or needed, somebody: incidents of dives, aborts, silences, what rules of health found. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from gliderwatch.incidents.acknowledgement import Ack, Acks
from gliderwatch.incidents.health import HealthThread
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.messages.formatting import INCIDENTS, clean, utc
from gliderwatch.model import Incident, Kind, Severity


@dataclass(frozen=True, slots=True)
class Matter:
    """One thing that needs somebody: its ``kind``, what it is in a ``word`` and a ``sentence``, from
    ``since`` until ``over`` (s; None: it goes on), how bad; ``id`` is that of its messages, ``ack`` who took
    it on; ``is_worse``: it has grown worse since."""

    id: str
    kind: Kind
    word: str
    sentence: str
    since: float
    over: float | None
    severity: Severity
    ack: Ack | None = None
    is_worse: bool = False

    @property
    def can_be_taken_on(self) -> bool:
        """Whether `gliderwatch ack` takes it; a glider that stays away is muted instead."""
        return self.kind not in (Kind.OVERDUE, Kind.UNKNOWN, Kind.NEIGHBOURS)


def matters(incidents: tuple[Incident, ...], state: NotificationState, acks: Acks) -> tuple[Matter, ...]:
    """All that is known of a glider, in order of time."""
    found = [
        *(_of_dives(i, acks) for i in incidents),
        *_aborts(state, acks),
        *(_of_health(t, acks) for t in state.health),
        *_others(state, acks),
    ]
    return tuple(sorted(found, key=lambda m: (m.since, m.id)))


def in_words(identity: str) -> str:
    """What the id of an incident stands for; the id itself where it is of another form.

    >>> in_words("electa/anomaly/1667639520"), in_words("electa/health/slow_leak/1667639520")
    ('electa: anomaly since 2022-11-05 09:12 UTC', 'electa: slow leak since 2022-11-05 09:12 UTC')
    """
    glider, *kinds = identity.split("/")
    if len(kinds) < 2 or re.fullmatch(r"\d{1,10}", kinds[-1], re.ASCII) is None:
        return clean(identity)
    number = kinds.pop()
    word = INCIDENTS.get(Kind(kinds[0]), kinds[-1]) if kinds[0] in set(Kind) else kinds[-1]
    return clean(f"{glider}: {word.replace('_', ' ')} since {utc(float(number))}")


def _of_dives(incident: Incident, acks: Acks) -> Matter:
    ack = acks.get(incident.id)
    words = INCIDENTS.get(incident.kind, str(incident.kind))
    return Matter(
        incident.id,
        incident.kind,
        words,
        f"{incident.dives} dives",
        incident.since,
        incident.cleared_at,
        incident.severity,
        ack,
        ack is not None and not ack.holds(incident),
    )


def _aborts(state: NotificationState, acks: Acks) -> Iterator[Matter]:
    for episode in state.aborts:
        if episode.reports:
            cause = next((clean(t.cause, 40) for t in episode.reports if t.cause), "")
            ack, severity = acks.get(episode.id), episode.severity
            worse = ack is not None and severity > ack.severity
            since = min(one.t for one in episode.reports)
            yield Matter(episode.id, Kind.ABORT, "abort", cause, since, episode.cleared, severity, ack, worse)


def _of_health(thread: HealthThread, acks: Acks) -> Matter:
    found, ack = thread.reported, acks.get(thread.id) or acks.get(thread.reported.id)
    over = found.cleared_at if found.cleared_at is not None else thread.time
    return Matter(
        thread.id,
        Kind.HEALTH,
        found.rule.replace("_", " "),
        clean(found.last.text, 160),
        found.since,
        over if thread.is_over else None,
        found.severity,
        ack,
        ack is not None and found.severity > ack.severity,
    )


def _others(state: NotificationState, acks: Acks) -> Iterator[Matter]:
    """Gliders that stay away, calls without a file, dives that cannot be judged, and what neighbours show."""
    warning = Severity.WARNING
    for s in state.silences:
        if s.stages and not s.withdrawn:
            yield Matter(s.id, Kind.OVERDUE, "overdue", "", s.missed.due, s.called, Severity.CRITICAL)
    if (empty := state.empty) is not None:
        over = empty.since if empty.is_over else None
        words = f"{empty.reported} without a file"
        yield Matter(empty.id, Kind.CALL, "calls", words, empty.since, over, warning, acks.get(empty.id))
    if (unknown := state.unknown) is not None:
        over = unknown.time if unknown.is_over else None
        yield Matter(unknown.id, Kind.UNKNOWN, "not judged", "", unknown.since, over, warning)
    if (near := state.neighbours) is not None and near.id:
        words = f"its currents do not fit those of its neighbours ({near.fault})"
        yield Matter(near.id, Kind.NEIGHBOURS, "neighbours", words, near.since, None, warning)
