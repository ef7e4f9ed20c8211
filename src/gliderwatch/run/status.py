"""What `gliderwatch status` tells: is the daemon alive, how is each glider, what is in the way."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gliderwatch.config import Config
from gliderwatch.model import Assessment, Incident
from gliderwatch.run.life import STALE, is_held, silence
from gliderwatch.run.lines import assessment_line, iso
from gliderwatch.store.sqlite import File, Status, Store, Undelivered


@dataclass(frozen=True, slots=True)
class GliderStatus:
    """One glider: its last dive that ended, the open incidents, how many segments and dives are known."""

    name: str
    configured: bool
    segments: int
    dives: int
    latest: Assessment | None
    incidents: tuple[Incident, ...]


@dataclass(frozen=True, slots=True)
class Overview:
    """All that `status` tells: whether the daemon is ``running``, since when it is silent (s; None: ever)."""

    running: bool
    silent_for: float | None
    gliders: tuple[GliderStatus, ...]
    files: dict[Status, int]
    waiting: tuple[File, ...]
    quarantined: tuple[File, ...]
    unknown: tuple[File, ...]
    undelivered: tuple[Undelivered, ...]

    @property
    def alive(self) -> bool:
        """Whether the daemon runs and gave a sign of life lately."""
        return self.running and self.silent_for is not None and self.silent_for < STALE


def overview(config: Config) -> Overview:
    """Look into the state file of a configuration. Raises StateError where there is none."""
    path = Path(config.state.path)
    store = Store.reading(path)
    try:
        names = sorted({*config.gliders, *store.gliders()})
        return Overview(
            running=is_held(path),
            silent_for=silence(path),
            gliders=tuple(_glider(store, name, name in config.gliders) for name in names),
            files=store.counts(),
            waiting=tuple(store.files(Status.WAITING)),
            quarantined=tuple(store.files(Status.QUARANTINED)),
            unknown=tuple(store.files(Status.UNKNOWN)),
            undelivered=tuple(store.undelivered()),
        )
    finally:
        store.close()


def _glider(store: Store, name: str, configured: bool) -> GliderStatus:
    segments, dives = store.extent(name)
    latest = store.last_surfacing(name, float("inf"))
    incidents = tuple(i for i in store.incidents(name) if i.cleared_at is None)
    return GliderStatus(name, configured, segments, dives, latest, incidents)


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
                "incidents": [_incident(i) for i in g.incidents],
            }
            for g in view.gliders
        },
        "files": {str(status): n for status, n in view.files.items()},
        "waiting": [{"path": f.path, "reason": f.reason, "cache": f.crc or None} for f in view.waiting],
        "quarantined": [{"path": f.path, "reason": f.reason} for f in view.quarantined],
        "unknown_gliders": sorted({f.glider for f in view.unknown}),
        "undelivered": [
            {"alert": u.alert, "channel": u.channel, "attempts": u.attempts, "error": u.error}
            for u in view.undelivered
        ],
    }


def _incident(i: Incident) -> dict[str, Any]:
    return {
        "id": i.id,
        "kind": str(i.kind),
        "severity": i.severity.name.lower(),
        "since": iso(i.since),
        "opened_at": iso(i.opened_at),
        "dives": i.dives,
    }
