"""From the state file to what a page shows. It only reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from math import inf
from pathlib import Path
from types import MappingProxyType

from gliderwatch.fleet.advice import Advice
from gliderwatch.health.battery import End, battery_end
from gliderwatch.health.constants import FIT, REMEMBERED
from gliderwatch.health.readings import History, Readings
from gliderwatch.health.rule import Limits
from gliderwatch.incidents.acknowledgement import with_mute
from gliderwatch.incidents.constants import RECENT
from gliderwatch.incidents.overdue import expected_call, outlook
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.layers.casts import casts_of
from gliderwatch.layers.section import Section, section
from gliderwatch.model import Incident
from gliderwatch.pages.view import GliderView
from gliderwatch.params import Attention
from gliderwatch.store.state_file import Store

SHOWN = 90
"""Dives of a glider that a page shows at the most."""
CALLS = 30 * 86400.0
"""Seconds back for which its calls are read."""
ALERTS = 40
"""Newest messages that are looked through for those of what goes on."""
PROFILES = 40
"""Segments of which a section shows the profile at the most: some 5 ms of processor each."""
LOG = 6000
"""Bytes of the end of the log of its last call that a page shows."""


NONE: Mapping[str, Limits | None] = MappingProxyType({})


def read_glider(
    store: Store,
    name: str,
    attention: Attention,
    now: float,
    *,
    dives: int = SHOWN,
    whole: bool = True,
    battery: Limits | None = None,
) -> GliderView:
    """What a page shows of a glider at `now` (s); not `whole`: without messages, the text of its log, and
    readings of its health. `battery` are the limits of the rule of its end; None: that is not looked at.

    Raises StateError where the state file cannot be read.
    """
    known = store.facts(name)
    attention = with_mute(attention, store.notes.muted_until(name))
    found = outlook(known, now)
    expected = known.expected(now) if found is None else found[0]
    signs = known.signs(now - RECENT) if found is None else found[1]
    awaited = None if expected is None else expected_call(expected, signs, now, attention.overdue_hours)
    calls = known.calls(now - CALLS) if known.last_log() is not None else ()
    calls = tuple(call for call in calls if call.began <= now)
    profiles = read_section(store, name, PROFILES, now) if whole else None
    readings = store.health.readings(name, now - (REMEMBERED if whole else FIT), now)
    return GliderView(
        name=name,
        now=now,
        dives=known.latest_dives(dives, now),
        incidents=tuple(_as_of(i, now) for i in known.incidents() if i.opened_at <= now),
        acks=store.notes.acks(name),
        attention=attention,
        expected=expected,
        awaited=awaited,
        calls=calls,
        log=_tail(known.last_log()) if whole else "",
        alerts=tuple(a for a in known.latest_alerts(ALERTS) if a.time <= now) if whole else (),
        notified=store.notified(name),
        waypoint=calls[-1].waypoint if calls else None,
        readings=readings if whole else {},
        section=profiles[0] if profiles is not None and profiles[1] else None,
        layers=profiles[1] if profiles is not None else (),
        battery=_battery_end(readings, battery),
        advice=_advice(store, name, now) if whole else (),
    )


def _advice(store: Store, name: str, now: float) -> tuple[tuple[str, Advice], ...]:
    """Where a glider should look next, by field, as advised since its last surfacing."""
    last = store.facts(name).last_surfacing(now)
    if last is None:
        return ()
    found = store.fields.advice(name, last.t_surface)
    return tuple((field, advice) for field, t, advice in found if t <= now)


def _as_of(incident: Incident, now: float) -> Incident:
    """An incident as it was at a time (s): one that was cleared later went on."""
    is_later = incident.cleared_at is not None and incident.cleared_at > now
    return replace(incident, cleared_at=None) if is_later else incident


def _battery_end(readings: Readings, limits: Limits | None) -> End | None:
    return None if limits is None or not readings else battery_end(History((), readings), limits)


def read_fleet(
    store: Store,
    names: list[str],
    attention: Callable[[str], Attention],
    now: float,
    dives: int = 1,
    batteries: Mapping[str, Limits | None] = NONE,
) -> tuple[GliderView, ...]:
    """What the page of the fleet shows of each glider."""
    return tuple(
        read_glider(store, name, attention(name), now, dives=dives, whole=False, battery=batteries.get(name))
        for name in names
    )


def read_section(
    store: Store, name: str, segments: int, until: float = inf
) -> tuple[Section, tuple[LayerAdvice, ...]]:
    """The section of the last `segments` of a glider, and what was found and advised after each profile; not
    later than `until` (s).

    It is of the sensor whose layers were found last; both are empty where layers are off.

    Raises StateError where the state file cannot be read.
    """
    rows = [row for row in store.layers.segments(name, segments) if row[1].advice.t <= until]
    sensor = rows[-1][1].advice.sensor if rows else ""
    held = [(casts_of(store.segments.get(identity), sensor), one.advice) for identity, one in rows]
    held = [(casts, advice) for casts, advice in held if casts and advice.sensor == sensor]
    return section([casts for casts, _ in held]), tuple(advice for _, advice in held)


def names_of(store: Store, configured: Iterable[str] = ()) -> list[str]:
    """The gliders that have a page: those that are configured, sent a file, or called."""
    return sorted({*configured, *store.gliders(), *filter(None, store.callers())})


def last_news(store: Store) -> float | None:
    """When the last dive of any glider ended (s): the time of a state file that is over; None: no dive."""
    found = (store.facts(name).last_surfacing(float("inf")) for name in store.gliders())
    return max((dive.t_surface for dive in found if dive is not None), default=None)


def _tail(path: str | None) -> str:
    """The end of a log as text, whole lines; empty where it cannot be read (any more)."""
    if path is None:
        return ""
    try:
        with Path(path).open("rb") as file:
            size = file.seek(0, 2)
            file.seek(max(0, size - LOG))
            text = file.read(LOG).decode("latin-1")
    except OSError:
        return ""
    return text if size <= LOG else text.partition("\n")[2]
