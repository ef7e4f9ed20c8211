"""What `gliderwatch status` tells: is the daemon alive, how is each glider, what is in the way."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gliderwatch.config import Config, Link, linked_gliders
from gliderwatch.model import Assessment, Expected, Incident
from gliderwatch.params import Attention
from gliderwatch.rules.acknowledged import Acks
from gliderwatch.rules.constants import GONE, RECENT
from gliderwatch.rules.irregularities import Irregularity
from gliderwatch.rules.muting import with_mute
from gliderwatch.rules.silence import Awaited, awaited, guess, is_launched
from gliderwatch.run.life import STALE, is_held, silence
from gliderwatch.run.lines import assessment_line, iso
from gliderwatch.run.manage.incidents import ack_json
from gliderwatch.store.sqlite import File, Status, Store, Undelivered

WEEK = 7 * 86400.0
"""Seconds for which `status` tells what a channel refused for good."""


@dataclass(frozen=True, slots=True)
class GliderStatus:
    """One glider: its last dive that ended, the open incidents, how many segments and dives are known.

    ``expected`` and ``awaited``: the next surfacing, as known ``at`` a time (s). ``acks``: who has taken
    incidents on. ``irregularities`` of its files in the last 30 days.
    """

    name: str
    configured: bool
    segments: int
    dives: int
    latest: Assessment | None
    incidents: tuple[Incident, ...]
    at: float
    attention: Attention = Attention()
    expected: Expected | None = None
    awaited: Awaited | None = None
    acks: Acks = field(default_factory=dict)
    irregularities: tuple[Irregularity, ...] = ()

    @property
    def is_over(self) -> bool:
        """Whether nothing was heard for so long that the deployment counts as over."""
        return self.awaited is not None and self.at - self.awaited.heard >= GONE

    @property
    def is_muted(self) -> bool:
        """Whether nothing is told of it now, but will be later."""
        return self.attention.muted_until is not None and self.at < self.attention.muted_until

    @property
    def place(self) -> tuple[float, float] | None:
        """Where the next surfacing is expected (degrees), if the call awaited is the one foreseen."""
        e = self.expected
        if e is None or self.awaited is None or self.awaited.t != e.t or e.lat is None or e.lon is None:
            return None
        return e.lat, e.lon

    @property
    def overdue_since(self) -> float | None:
        """Since when it is overdue (s), None: it is not."""
        if self.awaited is None or self.attention.recovered or self.is_over or self.at < self.awaited.due:
            return None
        return self.awaited.due


@dataclass(frozen=True, slots=True)
class Overview:
    """All that `status` tells: whether the daemon is ``running``, since when it is silent (s; None: ever).

    ``held`` are messages that are to wait; ``undelivered`` those that should have been delivered.
    ``links`` stand where the folders of gliders should be of which nothing is known.
    """

    running: bool
    silent_for: float | None
    gliders: tuple[GliderStatus, ...]
    files: dict[Status, int]
    waiting: tuple[File, ...]
    quarantined: tuple[File, ...]
    unknown: tuple[File, ...]
    undelivered: tuple[Undelivered, ...]
    held: tuple[Undelivered, ...] = ()
    links: dict[str, Link] = field(default_factory=dict)

    @property
    def alive(self) -> bool:
        """Whether the daemon runs and gave a sign of life lately."""
        return self.running and self.silent_for is not None and self.silent_for < STALE


def overview(config: Config) -> Overview:
    """Look into the state file of a configuration. Raises StateError where there is none, or one that the
    service has to migrate first."""
    path = Path(config.state.path)
    store, now = Store.reading(path), time.time()
    try:
        with store.guarded():
            waiting = store.undelivered()
            names = sorted({*config.gliders, *store.gliders()})
            silent = set(config.gliders) - set(store.gliders())
            return Overview(
                running=is_held(path),
                silent_for=silence(path),
                gliders=tuple(_glider(store, name, config, now) for name in names),
                files=store.counts(),
                waiting=tuple(store.files(Status.WAITING)),
                quarantined=tuple(store.files(Status.QUARANTINED)),
                unknown=tuple(store.files(Status.UNKNOWN)),
                undelivered=(*(u for u in waiting if u.held_until <= now), *store.refused(now - WEEK)),
                held=tuple(u for u in waiting if u.held_until > now),
                links=linked_gliders(config, silent) if silent else {},
            )
    finally:
        store.close()


def _glider(store: Store, name: str, config: Config, now: float) -> GliderStatus:
    segments, dives = store.extent(name)
    known = store.known(name)
    latest = known.last_surfacing(float("inf"))
    incidents = tuple(i for i in store.incidents(name) if i.cleared_at is None)
    attention = with_mute(config.attention(name), store.notes.muted_until(name))
    signs, acks = known.signs(now - RECENT), store.notes.acks(name)
    expected = known.expected(now)
    recent_signs = [sign for sign in signs if sign.opened_at >= now - RECENT]
    if expected is None and is_launched(recent_signs, known.has_dived(now - RECENT)):
        expected = guess(recent_signs, now)
    call = awaited(expected, signs, now, attention.overdue_hours) if expected is not None else None
    configured = name in config.gliders
    recent = tuple(i for i in known.irregularities(now) if now - i.t < GONE)
    return GliderStatus(
        name, configured, segments, dives, latest, incidents, now, attention, expected, call, acks, recent
    )


def as_json(view: Overview) -> dict[str, Any]:
    """The overview for machines."""
    return {
        "alive": view.alive,
        "silent_for_seconds": view.silent_for,
        "gliders": {
            g.name: {
                "configured": g.configured,
                "segments": g.segments,
                "dives": g.dives,
                "latest": assessment_line(g.latest) if g.latest is not None else None,
                "incidents": [_incident(i, g.acks) for i in g.incidents],
                "irregularities": [{"since": iso(i.t), "title": i.title} for i in g.irregularities],
                **_silence(g),
            }
            for g in view.gliders
        },
        "files": {str(status): n for status, n in view.files.items()},
        "waiting": [{"path": f.path, "reason": f.reason, "cache": f.crc or None} for f in view.waiting],
        "quarantined": [{"path": f.path, "reason": f.reason} for f in view.quarantined],
        "links": {name: {"path": str(k.path), "target": str(k.target)} for name, k in view.links.items()},
        "unknown_gliders": sorted({f.glider for f in view.unknown}),
        "undelivered": [
            {"alert": u.alert, "channel": u.channel, "attempts": u.attempts, "error": u.error}
            for u in view.undelivered
        ],
        "held": [
            {
                "alert": u.alert,
                "channel": u.channel,
                "until": iso(u.held_until),
                "unless_acknowledged": u.escalates,
            }
            for u in view.held
        ],
    }


def _incident(i: Incident, acks: Acks) -> dict[str, Any]:
    ack = acks.get(i.id)
    return {
        "id": i.id,
        "kind": str(i.kind),
        "severity": i.severity.name.lower(),
        "since": iso(i.since),
        "opened_at": iso(i.opened_at),
        "dives": i.dives,
        "acknowledged": None if ack is None else ack_json(ack, i),
    }


def _silence(g: GliderStatus) -> dict[str, Any]:
    """The next surfacing, and whether the glider is late for it; null where it is not known."""
    call, place, muted_until = g.awaited, g.place, g.attention.muted_until
    return {
        "expected": None
        if call is None or g.expected is None
        else {
            "t": iso(call.t),
            "t_sigma": g.expected.t_sigma,
            "lat": place[0] if place is not None else None,
            "lon": place[1] if place is not None else None,
            "source": g.expected.source,
        },
        "heard": iso(call.heard) if call is not None else None,
        "overdue_at": iso(call.due) if call is not None else None,
        "overdue": g.overdue_since is not None,
        "ended": g.is_over,
        "muted_until": iso(muted_until) if muted_until is not None and g.is_muted else None,
        "recovered": g.attention.recovered,
    }
