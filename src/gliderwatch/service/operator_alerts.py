"""Messages to those who run gliderwatch: the watch itself is in trouble, and when that is over.

What is open is read back from the messages in the state file, so that a restart says nothing twice.
"""

from __future__ import annotations

import shutil
import socket
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from gliderwatch.config import Config
from gliderwatch.config.schema import Operator as Settings
from gliderwatch.incidents.acknowledgement import with_mute
from gliderwatch.incidents.constants import GONE
from gliderwatch.incidents.overdue import outlook
from gliderwatch.messages import notice_text
from gliderwatch.messages.formatting import duration, utc
from gliderwatch.model import Alert, Severity
from gliderwatch.service.routing import Waits, operators, post_alert, waits
from gliderwatch.store.state_file import Store
from gliderwatch.store.watch_health import (
    Failing,
    Waiting,
    failing,
    last_files,
    operator_messages,
    quarantined,
    waiting,
)

DAY, HOUR = 86400.0, 3600.0
SILENCE, QUARANTINE, WAITING, DISK, CHANNEL = "silence", "quarantine", "waiting", "disk", "channel"
_ROOT, _OVER = "operator/", "/over"


@dataclass(frozen=True, slots=True)
class Vitals:
    """How the watch itself is.

    ``silent`` for so long no file came (s; None: no glider is at sea), and of each glider that is ``missed``
    while others call. By glider ("" where the header does not say): files ``quarantined`` in the last 24 h,
    and files that are ``waiting``. ``failing`` channels by name, ``free`` space for the state (MB; None: not
    known).
    """

    silent: float | None = None
    missed: Mapping[str, float] = field(default_factory=dict)
    quarantined: Mapping[str, int] = field(default_factory=dict)
    waiting: Mapping[str, Waiting] = field(default_factory=dict)
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
    going_on = set(open_)
    found = _silences(vitals, limits, now) | _files(vitals, limits, going_on, now)
    free = limits.free_mb
    if free is not None and vitals.free is not None and vitals.free < free * (1.2 if DISK in going_on else 1):
        found[DISK] = Trouble(
            f"only {vitals.free:.0f} MB free for the state file",
            "When it is full nothing can be assessed and no message be made.\n"
            "What to do: make room, or move the state.",
        )
    for name, channel in vitals.failing.items():
        late = now - channel.since
        if limits.channel_hours is not None and late > limits.channel_hours * HOUR:
            found[f"{CHANNEL}/{name}"] = Trouble(
                f"channel {name} has not delivered for {duration(late)}",
                f"{channel.messages} messages were not taken. All that it did not refuse for good is tried "
                "again.\n"
                f"The reason it gives: {channel.error or 'none'}\n"
                f"What to do: try `gliderwatch test-alert --channel {name}`.",
            )
    return found


def _silences(vitals: Vitals, limits: Settings, now: float) -> dict[str, Trouble]:
    """That no file comes, of any glider or of one."""
    hours = limits.silent_hours
    if hours is None or vitals.silent is None:
        return {}
    if vitals.silent > hours * HOUR:
        title = f"no file of any glider for {duration(vitals.silent)}"
        text = f"The last one came {utc(now - vitals.silent)}. Until one comes no glider is watched.\n"
        text += "What to do: look at the dockserver, its modems, and the share that its folders are on."
        return {SILENCE: Trouble(title, text)}
    return {
        f"{SILENCE}/{glider}": Trouble(
            f"no file of {glider} for {duration(silent)}",
            f"The last one came {utc(now - silent)}; other gliders call.\n"
            "What to do: look at its folder on the dockserver.\n"
            "What to do: if it is out of the water, say so: `recovered: true`, or `gliderwatch mute`.",
        )
        for glider, silent in vitals.missed.items()
        if silent > hours * HOUR
    }


def _files(vitals: Vitals, limits: Settings, going_on: set[str], now: float) -> dict[str, Trouble]:
    """That files of a glider come and are not taken."""
    found, most, hours = {}, limits.quarantined_per_day, limits.waiting_hours
    for glider, count in vitals.quarantined.items():
        key = _key(QUARANTINE, glider)
        if most is not None and count > most / (2 if key in going_on else 1):
            found[key] = Trouble(
                f"{count} files of {glider or 'no known glider'} quarantined in 24 h",
                "They cannot be used as they are. Many at once mean a damaged disk, a transfer that cuts "
                "files, or a folder that is no glider's.\n"
                "What to do: `gliderwatch status` names them with the reason.",
            )
    for glider, files in vitals.waiting.items():
        late = now - files.since
        if hours is not None and late > hours * HOUR:
            found[_key(WAITING, glider)] = Trouble(
                f"files of {glider or 'no known glider'} have waited for {duration(late)}",
                f"{files.files} wait; the oldest since {utc(files.since)}: {files.reason}.\n"
                "What to do: mend that, and they are taken. `gliderwatch status` names them all.",
            )
    return found


def _key(kind: str, glider: str) -> str:
    return f"{kind}/{glider}" if glider else kind


def over(key: str) -> str:
    """That a trouble is over, in words."""
    kind, _, name = key.partition("/")
    return {
        SILENCE: f"files of {name} come again" if name else "files of the gliders come again",
        QUARANTINE: f"hardly any files{f' of {name}' if name else ''} are quarantined any more",
        WAITING: f"no files{f' of {name}' if name else ''} wait any more",
        DISK: "there is room on the disk again",
        CHANNEL: f"channel {name} does not fail any more",
    }[kind]


def channels(config: Config, audience: Severity, key: str) -> Waits:
    """The channels of those who hear of a trouble, but not the one that it is about.

    A trouble cannot be acknowledged: it waits for quiet hours alone.
    """
    found = waits(operators(config, audience), can_be_acknowledged=False)
    return {name: wait for name, wait in found.items() if key != f"{CHANNEL}/{name}"}


def sent_messages(state: Path) -> dict[str, tuple[str, float]]:
    """Troubles that were reported and are not over: by key the id of the message and its time (s)."""
    rows = operator_messages(state, _ROOT)
    ids = [identity for identity in rows if not identity.endswith(_OVER) and identity + _OVER not in rows]
    return {i.removeprefix(_ROOT).rpartition("/")[0]: (i, rows[i]) for i in ids}


class Operator:
    """Looks after the watch itself; in the daemon's thread. `now` is in s since 1970.

    Silence goes by the monotonic clock: one that jumps must not look like gliders that do.
    """

    def __init__(self, store: Store, state: Path, config: Config, now: float, monotonic: float) -> None:
        self._store, self._state = store, state
        self._open = sent_messages(state)
        last = last_files(state, config.gliders)
        self._heard = {glider: monotonic - max(0.0, now - at) for glider, at in last.items()}
        self._any = max(self._heard.values(), default=monotonic)

    def came(self, glider: str, monotonic: float) -> None:
        """A file of a glider came; of none ("") where its header does not say."""
        self._heard[glider] = self._any = monotonic

    def vitals(self, config: Config, now: float, monotonic: float) -> Vitals:
        """How the watch is now."""
        watched = {name for name, glider in config.gliders.items() if not glider.recovered}
        late = {name: f for name, f in failing(self._state, now).items() if name in config.channels}
        held = {name: w for name, w in waiting(self._state).items() if not name or name in watched}
        return Vitals(
            monotonic - self._any if watched else None,
            self._missed(config, watched, now, monotonic),
            quarantined(self._state, now - DAY),
            held,
            late,
            _free(self._state.parent),
        )

    def _missed(self, config: Config, watched: set[str], now: float, monotonic: float) -> dict[str, float]:
        """For how long (s) no file came of gliders in the water, where that is no usual pause."""
        missed = {}
        for name in sorted(watched & self._heard.keys()):
            silent = monotonic - self._heard[name]
            if silent < (config.operator.silent_hours or 0.0) * HOUR or silent > GONE:
                continue  # the look into the state is for the few that are silent
            attention = with_mute(config.attention(name), self._store.notes.muted_until(name))
            found = None if attention.is_quiet(now) else outlook(self._store.facts(name), now)
            if found is not None and silent > 2 * (found[0].t - found[0].after):
                missed[name] = silent
        return missed

    def look(self, config: Config, limits: Settings, now: float, monotonic: float) -> tuple[Alert, ...]:
        """Messages about what went wrong, and about what is well again; they are in the outbox then."""
        found = troubles(self.vitals(config, now, monotonic), limits, self._open, now)
        began = {key: _begun(key, trouble, now) for key, trouble in found.items() if key not in self._open}
        ended = {key: _ended(key, *self._open[key], now) for key in self._open.keys() - found.keys()}
        alerts = began | ended
        if alerts:
            with self._store.transaction():
                for key, alert in alerts.items():
                    post_alert(self._store, alert, channels(config, alert.audience, key), now)
        self._open |= {key: (alert.id, now) for key, alert in began.items()}
        for key in ended:
            del self._open[key]
        return tuple(alerts.values())

    def is_unheard(self, config: Config) -> bool:
        """Whether no channel delivers, so that nobody could be notified of anything."""
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
    text = f"It was reported {utc(since)}, {duration(max(0.0, now - since))} ago.\nWhat to do: nothing."
    return _alert(over(key), text, now, identity + _OVER, identity, Severity.INFO)


def _alert(title: str, text: str, now: float, identity: str, thread: str, severity: Severity) -> Alert:
    made = notice_text.operator(
        title,
        text,
        now,
        alert_id=identity,
        severity=severity,
        audience=Severity.WARNING,
        machine=socket.gethostname(),
    )
    return replace(made, incident=thread)  # so that "over" cannot overtake what it ends
