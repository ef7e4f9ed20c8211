"""From the state file to what a page shows. It only reads."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gliderwatch.incidents.acknowledgement import with_mute
from gliderwatch.incidents.constants import RECENT
from gliderwatch.incidents.overdue import expected_call, outlook
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.layers.section import Section, section
from gliderwatch.layers.water import casts_of
from gliderwatch.pages.view import GliderView
from gliderwatch.params import Attention
from gliderwatch.store.state_file import Store

SHOWN = 90
"""Dives of a glider that a page shows at the most."""
CALLS = 30 * 86400.0
"""Seconds back for which its calls are read."""
ALERTS = 8
LOG = 6000
"""Bytes of the end of the log of its last call that a page shows."""


def read_glider(
    store: Store, name: str, attention: Attention, now: float, *, dives: int = SHOWN, whole: bool = True
) -> GliderView:
    """What a page shows of a glider at `now` (s); not `whole`: without messages and the text of its log.

    Raises StateError where the state file cannot be read.
    """
    known = store.facts(name)
    attention = with_mute(attention, store.notes.muted_until(name))
    found = outlook(known, now)
    expected = known.expected(now) if found is None else found[0]
    signs = known.signs(now - RECENT) if found is None else found[1]
    awaited = None if expected is None else expected_call(expected, signs, now, attention.overdue_hours)
    calls = known.calls(now - CALLS) if known.last_log() is not None else ()
    call = calls[-1] if calls else None
    return GliderView(
        name=name,
        now=now,
        dives=known.latest_dives(dives),
        incidents=known.incidents(),
        acks=store.notes.acks(name),
        attention=attention,
        expected=expected,
        awaited=awaited,
        calls=calls[-20:],
        log=_tail(known.last_log()) if whole else "",
        alerts=known.latest_alerts(ALERTS) if whole else (),
        said=store.notified(name),
        waypoint=call.waypoint if call is not None else None,
    )


def read_fleet(
    store: Store, names: list[str], attention: Callable[[str], Attention], now: float, dives: int = 1
) -> tuple[GliderView, ...]:
    """What the page of the fleet shows of each glider."""
    return tuple(read_glider(store, name, attention(name), now, dives=dives, whole=False) for name in names)


def read_section(store: Store, name: str, segments: int) -> tuple[Section, tuple[LayerAdvice, ...]]:
    """The section of the last `segments` of a glider, and what was found and advised after each profile.

    It is of the sensor whose layers were found last; both are empty where layers are off.

    Raises StateError where the state file cannot be read.
    """
    rows = store.layers.segments(name, segments)
    sensor = rows[-1][1].advice.sensor if rows else ""
    held = [(casts_of(store.segments.get(identity), sensor), one.advice) for identity, one in rows]
    held = [(casts, advice) for casts, advice in held if casts and advice.sensor == sensor]
    return section([casts for casts, _ in held]), tuple(advice for _, advice in held)


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
