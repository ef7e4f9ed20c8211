"""Muting a glider by command: at once, without a change of the configuration."""

from __future__ import annotations

import math

from gliderwatch.alerts.words import utc
from gliderwatch.config import Config
from gliderwatch.config.fields import moment
from gliderwatch.errors import GliderwatchError
from gliderwatch.rules.muting import with_mute
from gliderwatch.run.manage.opening import known_glider, writing
from gliderwatch.run.posting import withdraw_answered

_YEAR = 366 * 86400.0


def until(date: str | None, hours: float | None, now: float) -> float:
    """The end of a mute (s), from a date or from hours from `now` on. Raises GliderwatchError."""
    if (date is None) == (hours is None):
        raise GliderwatchError(
            "say until when: either --until DATE (2026-12-01, or 2026-12-01 14:30) or --hours N"
        )
    if date is not None:
        try:
            end = moment(date)
        except ValueError as error:
            raise GliderwatchError(f"--until {error}") from None
    else:
        end = now + (hours or 0.0) * 3600
    if not math.isfinite(end) or end <= now:
        raise GliderwatchError("that is past: name a time to come, in UTC")
    if end > now + _YEAR:
        raise GliderwatchError(
            "that is more than a year: for a glider that is out of the water write recovered: true "
            "in the configuration"
        )
    return end


def mute(config: Config, glider: str, end: float, now: float) -> list[str]:
    """Tell nothing of a glider until a time (s); what to tell who asked for it, in lines. Who waits for an
    acknowledgement is not told of it any more either."""
    name = known_glider(config, glider)
    with writing(config) as store:
        store.notes.mute(name, end, now)
        withdraw_answered(store, name, now, quiet=True)
        heeded = with_mute(config.attention(name), store.notes.muted_until(name))
    told = [f"{name}: muted until {utc(end)}"]
    if heeded.muted_until is not None and heeded.muted_until > end:
        told.append(f"muted_until of the configuration is later and counts: {utc(heeded.muted_until)}")
    if heeded.recovered:
        told.append("it is marked recovered: nothing is told of it in any case")
    return told


def unmute(config: Config, glider: str, now: float) -> list[str]:
    """Take a mute back; what to tell who asked for it, in lines.

    Raises GliderwatchError where the configuration mutes it: that is not undone by a command.
    """
    name = known_glider(config, glider)
    with writing(config) as store:
        before = store.notes.muted_until(name)
        store.notes.unmute(name, now)
    configured = config.attention(name)
    why = None
    if configured.recovered:
        why = "is marked recovered: true"
    elif configured.muted_until is not None and now < configured.muted_until:
        why = f"has muted_until: {utc(configured.muted_until)}"
    if why is not None:
        raise GliderwatchError(
            f"{name} {why} in the configuration, which no command undoes. "
            "What to do: take that line out, then systemctl reload gliderwatch"
        )
    was = before is not None and now < before
    return [f"{name}: not muted any more" if was else f"{name}: was not muted"]
