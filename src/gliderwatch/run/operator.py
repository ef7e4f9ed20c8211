"""Messages to those who run gliderwatch: the watch itself is in trouble, and when that is over.

What is open is read back from the messages in the state file, so that a restart says nothing twice.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from gliderwatch.alerts import message
from gliderwatch.alerts.smtp import PARTLY
from gliderwatch.alerts.words import duration, utc
from gliderwatch.config import Config
from gliderwatch.config.service import Operator as Settings
from gliderwatch.model import Alert, Severity
from gliderwatch.run.speaking import Waits, operators, waits
from gliderwatch.store.database import guarded, read_only
from gliderwatch.store.outbox import REFUSED, released
from gliderwatch.store.sqlite import Store

DAY, HOUR = 86400.0, 3600.0
SILENCE, QUARANTINE, DISK, CHANNEL = "silence", "quarantine", "disk", "channel"
_ROOT, _OVER = "operator/", "/over"


@dataclass(frozen=True, slots=True)
class Failing:
    """A channel with messages that it did not take: the oldest was to go out ``since`` (s)."""

    since: float
    messages: int
    error: str


@dataclass(frozen=True, slots=True)
class Vitals:
    """How the watch itself is.

    ``silent`` for so long no file came (s; None: no glider is at sea), ``quarantined`` files in the last
    24 h, ``failing`` channels by name, ``free`` space for the state (MB; None: not known).
    """

    silent: float | None = None
    quarantined: int = 0
    failing: Mapping[str, Failing] = field(default_factory=dict)
    free: float | None = None


@dataclass(frozen=True, slots=True)
class Trouble:
    """What is wrong, in words."""

    title: str
    text: str


def troubles(vitals: Vitals, limits: Settings, open_: Iterable[str], now: float) -> dict[str, Trouble]:
    """What is wrong at `now` (s), by key. What is `open_` ends only well within its limit, so that it does
    not come and go."""
    found, going_on = {}, set(open_)
    hours, quarantined, free = limits.silent_hours, limits.quarantined_per_day, limits.free_mb
    if hours is not None and vitals.silent is not None and vitals.silent > hours * HOUR:
        found[SILENCE] = Trouble(
            f"no file of any glider for {duration(vitals.silent)}",
            f"The last one came {utc(now - vitals.silent)}. Check the dockserver, its modems and telephone "
            "lines, and the share that its folders are on.\nUntil then no glider is watched.",
        )
    if quarantined is not None and vitals.quarantined > quarantined / (2 if QUARANTINE in going_on else 1):
        found[QUARANTINE] = Trouble(
            f"{vitals.quarantined} files quarantined in 24 h",
            "They cannot be used as they are. `gliderwatch status` names them with the reason. Many at "
            "once mean a damaged disk, a transfer that cuts files, or a folder that is no glider's.",
        )
    if free is not None and vitals.free is not None and vitals.free < free * (1.2 if DISK in going_on else 1):
        found[DISK] = Trouble(
            f"only {vitals.free:.0f} MB free for the state file",
            "When it is full nothing can be assessed and no message be made. Make room, or move the state.",
        )
    for name, channel in vitals.failing.items():
        late = now - channel.since
        if limits.channel_hours is not None and late > limits.channel_hours * HOUR:
            found[f"{CHANNEL}/{name}"] = Trouble(
                f"channel {name} has not delivered for {duration(late)}",
                f"{channel.messages} messages were not taken. All that it did not refuse for good is tried "
                "again.\n"
                f"The reason it gives: {channel.error or 'none'}",
            )
    return found


def over(key: str) -> str:
    """That a trouble is over, in words."""
    kind, _, name = key.partition("/")
    return {
        SILENCE: "files come again",
        QUARANTINE: "hardly any files are quarantined any more",
        DISK: "there is room on the disk again",
        CHANNEL: f"channel {name} does not fail any more",
    }[kind]


def channels(config: Config, audience: Severity, key: str) -> Waits:
    """The channels of those who hear of a trouble, but not the one that it is about.

    A trouble cannot be acknowledged: it waits for quiet hours alone.
    """
    found = waits(operators(config, audience), can_be_acknowledged=False)
    return {name: wait for name, wait in found.items() if key != f"{CHANNEL}/{name}"}


@contextmanager
def reading(state: Path) -> Iterator[Any]:
    """A connection to look with. Raises StateError where the state file cannot be used."""
    with guarded(state), closing(read_only(state)) as db:
        yield db


def failing(state: Path, now: float) -> dict[str, Failing]:
    """Channels that failed to take a message that still waits, or that refused one for good in the day before
    `now` (s) and have delivered none since. What is held does not wait before it is due, and a message that
    some of a channel's addresses took has been told: the report of the refusal names the others."""
    with reading(state) as db:
        since = f"max(a.made_at, {released(db)})"
        sql = (
            "SELECT channel, min(since), count(*), error FROM ("
            f"SELECT o.channel, {since} AS since, o.error FROM outbox o JOIN alerts a ON a.id = o.alert "
            "WHERE o.delivered_at IS NULL AND o.attempts > 0 UNION ALL "
            f"SELECT o.channel, {since} AS since, o.error FROM outbox o JOIN alerts a ON a.id = o.alert "
            "WHERE o.delivered_at > ?1 AND o.error LIKE ?2 || '%' AND o.error NOT LIKE ?2 || ?3 || '%' "
            "AND NOT EXISTS (SELECT 1 FROM outbox l WHERE l.delivered_at > o.delivered_at "
            "AND l.channel = o.channel AND l.error = '')) GROUP BY channel"
        )
        return {row[0]: Failing(*row[1:]) for row in db.execute(sql, (now - DAY, REFUSED, PARTLY))}


def quarantined(state: Path, since: float) -> int:
    """How many files were quarantined since a time (s)."""
    sql = "SELECT count(*) FROM files WHERE status = 'quarantined' AND noted_at > ?"
    with reading(state) as db:
        return int(db.execute(sql, (since,)).fetchone()[0])


def last_files(state: Path, gliders: Iterable[str]) -> dict[str, float]:
    """When the last file of each glider came (s), whatever its date."""
    sql = "SELECT max(at) FROM heard WHERE glider = ?"
    with reading(state) as db:
        found = {glider: db.execute(sql, (glider,)).fetchone()[0] for glider in gliders}
    return {glider: at for glider, at in found.items() if at is not None}


def told(state: Path) -> dict[str, tuple[str, float]]:
    """Troubles that were told and are not over: by key the id of the message and its time (s)."""
    sql = "SELECT id, time FROM alerts WHERE glider = '' AND id >= ? AND id < ? ORDER BY rowid"
    with reading(state) as db:
        rows = {row[0]: row[1] for row in db.execute(sql, (_ROOT, _ROOT[:-1] + "0"))}
    ids = [identity for identity in rows if not identity.endswith(_OVER) and identity + _OVER not in rows]
    return {i.removeprefix(_ROOT).rpartition("/")[0]: (i, rows[i]) for i in ids}


class Operator:
    """Looks after the watch itself; in the daemon's thread. `now` is in s since 1970.

    Silence goes by the monotonic clock: one that jumps must not look like gliders that do.
    """

    def __init__(self, store: Store, state: Path, config: Config, now: float, monotonic: float) -> None:
        self._store, self._state = store, state
        self._open = told(state)
        last = max(last_files(state, config.gliders).values(), default=now)
        self._heard = monotonic - max(0.0, now - last)

    def came(self, monotonic: float) -> None:
        """A file came."""
        self._heard = monotonic

    def vitals(self, config: Config, now: float, monotonic: float) -> Vitals:
        """How the watch is now."""
        at_sea = any(not glider.recovered for glider in config.gliders.values())
        waiting = {name: f for name, f in failing(self._state, now).items() if name in config.channels}
        return Vitals(
            monotonic - self._heard if at_sea else None,
            quarantined(self._state, now - DAY),
            waiting,
            _free(self._state.parent),
        )

    def look(self, config: Config, limits: Settings, now: float, monotonic: float) -> tuple[Alert, ...]:
        """Messages about what went wrong, and about what is well again; they are in the outbox then."""
        found = troubles(self.vitals(config, now, monotonic), limits, self._open, now)
        began = {key: _begun(key, trouble, now) for key, trouble in found.items() if key not in self._open}
        ended = {key: _ended(key, *self._open[key], now) for key in self._open.keys() - found.keys()}
        alerts = began | ended
        if alerts:
            with self._store.transaction():
                for key, alert in alerts.items():
                    self._store.post(alert, channels(config, alert.audience, key), now)
        self._open |= {key: (alert.id, now) for key, alert in began.items()}
        for key in ended:
            del self._open[key]
        return tuple(alerts.values())

    def is_unheard(self, config: Config) -> bool:
        """Whether no channel delivers, so that nobody could be told of anything."""
        return bool(config.channels) and all(f"{CHANNEL}/{name}" in self._open for name in config.channels)


def _free(folder: Path) -> float | None:
    try:
        return shutil.disk_usage(folder).free / 1e6
    except OSError:
        return None


def _begun(key: str, trouble: Trouble, now: float) -> Alert:
    identity = f"{_ROOT}{key}/{now:.0f}"
    return _alert(trouble.title, trouble.text, now, identity, identity, Severity.WARNING)


def _ended(key: str, identity: str, since: float, now: float) -> Alert:
    text = f"It was told {utc(since)}, {duration(max(0.0, now - since))} ago."
    return _alert(over(key), text, now, identity + _OVER, identity, Severity.INFO)


def _alert(title: str, text: str, now: float, identity: str, thread: str, severity: Severity) -> Alert:
    made = message.operator(title, text, now, alert_id=identity, severity=severity, audience=Severity.WARNING)
    return replace(made, incident=thread)  # so that "over" cannot overtake what it ends
