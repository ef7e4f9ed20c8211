"""`gliderwatch status` and `gliderwatch incidents`: is the daemon alive, how is each glider, what is in the
way, who has acknowledged."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gliderwatch.cli.manage import reading, writing
from gliderwatch.config import Config, linked_gliders
from gliderwatch.errors import GliderwatchError
from gliderwatch.export.dives import assessment_line, iso_ms
from gliderwatch.incidents.acknowledgement import Ack, Acks, acknowledge, acknowledge_thread, with_mute
from gliderwatch.incidents.constants import GONE, RECENT
from gliderwatch.incidents.notices import Acknowledged, Irregularity, Notice
from gliderwatch.incidents.open_threads import OpenThread, open_threads
from gliderwatch.incidents.overdue import ExpectedCall, expected_call, guess, is_launched
from gliderwatch.messages import irregularity_text
from gliderwatch.messages.formatting import clean
from gliderwatch.messages.notice_text import render
from gliderwatch.model import Assessment, Call, Incident, Kind, NextSurfacing, Severity
from gliderwatch.params import Attention
from gliderwatch.service.liveness import STALE, is_held, seconds_silent
from gliderwatch.service.routing import channels, post_alert, withdraw_answered
from gliderwatch.slocum.folders import Link
from gliderwatch.store.relays import RelayState
from gliderwatch.store.state_file import File, Status, Store, Undelivered

# ----------------------------------------
# The incidents of all gliders, and who has taken them on.


@dataclass(frozen=True, slots=True)
class IncidentEntry:
    """An incident, or what goes on and is none of dives, and its acknowledgement, if there is one."""

    incident: Incident | OpenThread
    ack: Ack | None

    @property
    def is_open(self) -> bool:
        """Whether it goes on."""
        return isinstance(self.incident, OpenThread) or self.incident.cleared_at is None

    @property
    def is_quiet(self) -> bool:
        """Whether nobody is reminded of it because of the acknowledgement."""
        return self.ack is not None and _holds(self.ack, self.incident)


def _holds(ack: Ack, incident: Incident | OpenThread) -> bool:
    """Whether what was acknowledged has not grown worse since."""
    if isinstance(incident, OpenThread):
        return incident.severity <= ack.severity
    return ack.holds(incident)


def incident_entries(
    config: Config, glider: str | None = None, *, every: bool = False
) -> list[IncidentEntry]:
    """The open incidents (`every`: all) of one glider or of all, by glider and time.

    Raises GliderwatchError where nothing is known of the glider asked for.
    """
    with reading(config) as store:
        names = sorted({*config.gliders, *store.gliders()})
        if glider is not None and glider.lower() not in names:
            raise GliderwatchError(
                f"there is no glider {glider}; known are: {', '.join(map(clean, names)) or 'none'}"
            )
        wanted = names if glider is None else [glider.lower()]
        return [noted for name in wanted for noted in _of(store, name, every)]


def _of(store: Store, glider: str, every: bool) -> list[IncidentEntry]:
    acks = store.notes.acks(glider)
    found = (i for i in store.incidents(glider) if every or i.cleared_at is None)
    entries = [IncidentEntry(i, acks.get(i.id)) for i in found]
    return entries + [IncidentEntry(t, acks.get(t.id)) for t in open_threads(store.notified(glider))]


def acknowledge_incident(
    config: Config, wanted: str, by: str, note: str, now: float
) -> tuple[IncidentEntry, bool]:
    """Take an open incident on; with it, and whether that is new: the same once more changes nothing.

    `wanted` is its id, or a glider of which one incident is open. Who waits for an acknowledgement is not
    notified of the incident any more; who was is notified of who is on it.
    Raises GliderwatchError, naming those that are open, where it is none of them.
    """
    with writing(config) as store:
        noted = _open_entry(store, wanted)
        before = noted.ack
        if noted.is_quiet and before is not None and (before.by, before.note) == (by, note):
            return noted, False
        i = noted.incident
        if isinstance(i, OpenThread):
            made = acknowledge_thread(i.id, i.severity, by, note, now)
        else:
            made = acknowledge(i, by, note, now)
        store.notes.acknowledge(noted.incident.glider, made)
        withdraw_answered(store, noted.incident.glider, now)
        _notify_others(store, config, noted.incident, by, note, now, is_undone=False)
    return IncidentEntry(noted.incident, made), True


def give_incident_back(config: Config, wanted: str, by: str, note: str, now: float) -> IncidentEntry:
    """Take back the acknowledgement of an open incident, and notify the others.

    Raises GliderwatchError where it is none that is open, or nobody has acknowledged it.
    """
    with writing(config) as store:
        noted = _open_entry(store, wanted)
        if noted.ack is None:
            raise GliderwatchError(f"nobody has acknowledged {clean(noted.incident.id)}: nothing to undo")
        store.notes.give_back(noted.incident.id)
        _notify_others(store, config, noted.incident, by, note, now, is_undone=True)
    return IncidentEntry(noted.incident, None)


def _open_entry(store: Store, wanted: str) -> IncidentEntry:
    """The open incident of an id, or the only one of a glider. Raises GliderwatchError."""
    known = [noted for glider in store.gliders() for noted in _of(store, glider, every=True)]
    wanted = wanted.strip()
    found = [n for n in known if n.incident.glider == wanted.lower() and n.is_open]
    if len(found) == 1:
        return found[0]
    noted = next((n for n in known if n.incident.id == wanted), None)
    if noted is None or not noted.is_open:
        raise GliderwatchError(_refusal(wanted, noted, known))
    return noted


def _notify_others(
    store: Store,
    config: Config,
    incident: Incident | OpenThread,
    by: str,
    note: str,
    now: float,
    *,
    is_undone: bool,
) -> None:
    """Put into the outbox that somebody is on an incident, or no more, for all who hear of it."""
    content = Acknowledged(incident.id, incident.kind, incident.since, by, note, is_undone)
    what, kind, info = "undone" if is_undone else "acknowledged", Kind.ACKNOWLEDGED, Severity.INFO
    identity, glider = f"{incident.id}/{what}/{now:.3f}", incident.glider
    alert = render(Notice(identity, incident.id, glider, now, kind, info, incident.severity, content))
    post_alert(store, alert, channels(alert, config), now)


def _refusal(wanted: str, noted: IncidentEntry | None, known: list[IncidentEntry]) -> str:
    opened = [n.incident for n in known if n.is_open]
    mine = [i for i in opened if i.glider == wanted.lower()]
    if len(mine) > 1:
        wrong = f"several incidents of {clean(wanted)} are open: name one by its id"
    elif noted is not None:
        wrong = f"there is nothing left to do: cleared is incident {clean(wanted)}"
    else:
        wrong = f"there is no incident {clean(wanted)}"
    listed = "".join(f"\n  {clean(i.id)}" for i in mine or opened) if opened else " none"
    return f"{wrong}; open are:{listed}"


def incidents_as_json(noted: IncidentEntry) -> dict[str, Any]:
    """An incident for machines."""
    i = noted.incident
    common = {
        "id": i.id,
        "glider": i.glider,
        "kind": str(i.kind),
        "severity": i.severity.name.lower(),
        "since": iso_ms(i.since),
        "acknowledged": None if noted.ack is None else ack_json(noted.ack, i),
    }
    if isinstance(i, OpenThread):
        return {**common, "about": i.about}
    return {
        **common,
        "opened_at": iso_ms(i.opened_at),
        "cleared_at": None if i.cleared_at is None else iso_ms(i.cleared_at),
        "dives": i.dives,
        "worst": _dive(i.worst),
        "last": _dive(i.last),
    }


def ack_json(made: Ack, incident: Incident | OpenThread) -> dict[str, Any]:
    """An acknowledgement for machines; `worse`: the incident has grown worse since."""
    return {"by": made.by, "note": made.note, "at": iso_ms(made.at), "worse": not _holds(made, incident)}


def _dive(a: Assessment) -> dict[str, Any]:
    return {
        "t_dive": iso_ms(a.t_dive),
        "t_surface": iso_ms(a.t_surface),
        "flag": a.flag,
        "speed": a.speed,
        "speed_min": a.speed_min,
        "speed_max": a.speed_max,
        "p_e": a.p_e,
    }


# ----------------------------------------
# What `gliderwatch status` tells: is the daemon alive, how is each glider, what is in the way.

HOUR = 3600.0
WEEK = 7 * 86400.0
"""Seconds for which `status` tells what a channel refused for good."""


@dataclass(frozen=True, slots=True)
class GliderStatus:
    """One glider: its last dive that ended, the open incidents, how many segments and dives are known.

    ``expected`` and ``awaited``: the next surfacing, as known ``at`` a time (s). ``acks``: who has taken
    incidents on. ``irregularities`` of its files in the last 30 days. ``threads`` are what goes on and is no
    incident of dives, ``not_come`` the files that it announced in a call (its time, s) and that never came.
    ``call`` is its last, where that is later than its last dive that ended: what it reported there is news.
    """

    name: str
    configured: bool
    segments: int
    dives: int
    latest: Assessment | None
    incidents: tuple[Incident, ...]
    at: float
    attention: Attention = Attention()
    expected: NextSurfacing | None = None
    awaited: ExpectedCall | None = None
    acks: Acks = field(default_factory=dict)
    irregularities: tuple[Irregularity, ...] = ()
    threads: tuple[OpenThread, ...] = ()
    not_come: tuple[tuple[float, str], ...] = ()
    call: Call | None = None

    @property
    def is_over(self) -> bool:
        """Whether no sign of life came for so long that the deployment counts as over."""
        return self.awaited is not None and self.at - self.awaited.last_sign >= GONE

    @property
    def is_muted(self) -> bool:
        """Whether nobody is notified of it now, but will be later."""
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
    ``links`` stand where the folders of gliders should be of which nothing is known. ``relays``: how
    the exchange with other dockservers stands; None: there is none.
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
    relays: RelayState | None = None

    @property
    def alive(self) -> bool:
        """Whether the daemon runs and gave a sign of life lately."""
        return self.running and self.silent_for is not None and self.silent_for < STALE


def overview(config: Config) -> Overview:
    """Look into the state file of a configuration. Raises StateError where there is none, or one that the
    service has to migrate first."""
    path = Path(config.state.path)
    with Store.looking(path) as store:
        now = time.time()
        waiting = store.undelivered()
        names = sorted({*config.gliders, *store.gliders()})
        silent = set(config.gliders) - set(store.gliders())
        return Overview(
            running=is_held(path),
            silent_for=seconds_silent(path),
            gliders=tuple(_glider(store, name, config, now) for name in names),
            files=store.counts(),
            waiting=tuple(store.files(Status.WAITING)),
            quarantined=tuple(store.files(Status.QUARANTINED)),
            unknown=tuple(store.files(Status.UNKNOWN)),
            undelivered=(*(u for u in waiting if u.held_until <= now), *store.refused(now - WEEK)),
            held=tuple(u for u in waiting if u.held_until > now),
            links=linked_gliders(config, silent) if silent else {},
            relays=None if config.relays.broker is None else store.relays(),
        )


def _glider(store: Store, name: str, config: Config, now: float) -> GliderStatus:
    segments, dives = store.extent(name)
    known = store.facts(name)
    latest = known.last_surfacing(float("inf"))
    incidents = tuple(i for i in store.incidents(name) if i.cleared_at is None)
    attention = with_mute(config.attention(name), store.notes.muted_until(name))
    signs, acks = known.signs(now - RECENT), store.notes.acks(name)
    expected = known.expected(now)
    recent_signs = [sign for sign in signs if sign.opened_at >= now - RECENT]
    if expected is None and is_launched(recent_signs, known.has_dived(now - RECENT)):
        expected = guess(recent_signs, now)
    call = expected_call(expected, signs, now, attention.overdue_hours) if expected is not None else None
    configured = name in config.gliders
    recent = tuple(i for i in known.irregularities(now) if now - i.t < GONE)
    return GliderStatus(
        name,
        configured,
        segments,
        dives,
        latest,
        incidents,
        now,
        attention,
        expected,
        call,
        acks,
        recent,
        open_threads(store.notified(name)),
        known.not_come(now - GONE, now),
        _news(known.calls(now - GONE), latest),
    )


def _news(calls: tuple[Call, ...], latest: Assessment | None) -> Call | None:
    """The last call, where it tells of a fix that is later than the last dive that ended."""
    last = calls[-1] if calls else None
    if last is None or last.fix is None or (latest is not None and last.fix.t <= latest.t_surface + HOUR):
        return None
    return last


def _call_as_json(call: Call | None) -> dict[str, Any] | None:
    """What a glider reported in a call, for machines."""
    if call is None or call.fix is None:
        return None
    return {
        "at": iso_ms(call.last_t),
        "fix": {"at": iso_ms(call.fix.t), "lat": call.fix.lat, "lon": call.fix.lon},
        "waypoint": None if call.waypoint is None else {"lat": call.waypoint[0], "lon": call.waypoint[1]},
        "because": call.reason or None,
        "mission": call.mission or None,
    }


def status_as_json(view: Overview) -> dict[str, Any]:
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
                "irregularities": [
                    {"since": iso_ms(i.t), "title": irregularity_text.title(i)} for i in g.irregularities
                ],
                "open": [incidents_as_json(IncidentEntry(t, g.acks.get(t.id))) for t in g.threads],
                "last_call": _call_as_json(g.call),
                "announced_and_not_come": [{"call": iso_ms(t), "file": name} for t, name in g.not_come],
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
        "relays": None if view.relays is None else _relays_as_json(view.relays),
        "held": [
            {
                "alert": u.alert,
                "channel": u.channel,
                "until": iso_ms(u.held_until),
                "unless_acknowledged": u.escalates,
            }
            for u in view.held
        ],
    }


def _relays_as_json(relays: RelayState) -> dict[str, Any]:
    """The exchange with other dockservers for machines."""
    link = relays.link
    return {
        "name": None if link is None else link.name,
        "broker": None if link is None else link.broker,
        "connected": link is not None and link.is_up,
        "since": None if link is None else iso_ms(relays.t),
        "error": None if link is None or not link.error else link.error,
        "batches_to_send": relays.waiting,
        "others": {
            name: {"heard": iso_ms(t), "batches": other.batches, "not_exchanged": list(other.apart)}
            for name, (t, other) in relays.others.items()
        },
    }


def _incident(i: Incident, acks: Acks) -> dict[str, Any]:
    ack = acks.get(i.id)
    return {
        "id": i.id,
        "kind": str(i.kind),
        "severity": i.severity.name.lower(),
        "since": iso_ms(i.since),
        "opened_at": iso_ms(i.opened_at),
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
            "t": iso_ms(call.t),
            "t_sigma": g.expected.t_sigma,
            "lat": place[0] if place is not None else None,
            "lon": place[1] if place is not None else None,
            "source": g.expected.source,
        },
        "heard": iso_ms(call.last_sign) if call is not None else None,
        "overdue_at": iso_ms(call.due) if call is not None else None,
        "overdue": g.overdue_since is not None,
        "ended": g.is_over,
        "muted_until": iso_ms(muted_until) if muted_until is not None and g.is_muted else None,
        "recovered": g.attention.recovered,
    }
