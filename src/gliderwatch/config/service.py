"""The sections of the settings that are of the service: where files come, who is told, how it is watched."""

from __future__ import annotations

from ipaddress import ip_address
from typing import Annotated, Literal
from zoneinfo import ZoneInfo

from pydantic import Field, IPvAnyAddress, model_validator

from gliderwatch.config.fields import (
    AbsolutePath,
    ClockTime,
    GliderName,
    Louder,
    Loudness,
    Name,
    Number,
    Url,
    Zone,
)
from gliderwatch.config.section import Section
from gliderwatch.currents.field import STALE
from gliderwatch.model import Severity
from gliderwatch.rules import waiting


class Dockserver(Section):
    """Where files arrive. Nothing is ever written there."""

    roots: tuple[AbsolutePath, ...] = Field(
        min_length=1,
        description="Folders whose sub-folders are gliders (`ROOT/GLIDER/from-glider`); paths or patterns "
        "(`/var/opt/gmc/*/gliders`), absolute or relative to this file.",
    )
    cache: tuple[AbsolutePath, ...] = Field(
        default=(), description="Folders with cache files (`.cac`, `.ccc`); paths or patterns."
    )
    settle_seconds: Annotated[Number, Field(ge=1, le=3600)] = Field(
        default=60.0, description="A file under its short name is complete when still for so long (s)."
    )
    rescan_seconds: Annotated[Number, Field(ge=1, le=86400)] = Field(
        default=300.0, description="Time between scans for files that the observer missed (s)."
    )
    logs: bool = Field(
        default=True, description="Read the logs of calls too, where a folder `logs` is beside `from-glider`."
    )
    observer: Literal["inotify", "polling"] = Field(
        default="inotify", description="`polling` for folders on NFS or SMB, where inotify sees nothing."
    )


class Area(Section):
    """A part of the earth (degrees north and east); `west` may be greater than `east` (the date line)."""

    south: Annotated[Number, Field(ge=-90, le=90)] = Field(description="Southern edge.")
    north: Annotated[Number, Field(ge=-90, le=90)] = Field(description="Northern edge.")
    west: Annotated[Number, Field(ge=-180, le=360)] = Field(description="Western edge.")
    east: Annotated[Number, Field(ge=-180, le=360)] = Field(description="Eastern edge.")


class Ocean(Section):
    """Files of an ocean model or a radar (CF NetCDF), for gliders with `reference: model`."""

    files: tuple[AbsolutePath, ...] = Field(
        default=(), description="Paths or patterns (`/data/hycom/*.nc`); read again when they change."
    )
    area: Area | None = Field(default=None, description="The part to read; null: all of the files.")
    stale_hours: Annotated[Number, Field(gt=0, le=8760)] = Field(
        default=STALE / 3600, description="Hours beyond the last time of the files until which it is used."
    )


class State(Section):
    """What gliderwatch remembers."""

    path: AbsolutePath = Field(
        default="/var/lib/gliderwatch/state.sqlite",
        description="The state file; its folder must be writable.",
    )
    keep_days: Annotated[Number, Field(ge=60, le=36500)] | None = Field(
        default=None,
        description="Days after which what is over is removed from it, once a day; null: all is kept.",
    )


class Heartbeat(Section):
    """A sign of life for a dead man's switch: given while all parts of the service work, and only then."""

    url: Url | None = Field(
        default=None,
        description="http(s) URL that is fetched. Any part may be a reference, as in the URL of a channel.",
    )
    file: AbsolutePath | None = Field(default=None, description="File that is touched; made if need be.")
    minutes: Annotated[Number, Field(gt=0, le=1440)] = Field(
        default=5.0, description="Time between two signs of life (min)."
    )


class Metrics(Section):
    """Numbers for Prometheus. Nothing listens unless a port is given."""

    port: Annotated[int, Field(strict=True, ge=1, le=65535)] | None = Field(
        default=None, description="TCP port that serves them, such as 9464; null: none."
    )
    address: IPvAnyAddress = Field(
        default=ip_address("127.0.0.1"), description="Address of this machine that the port is on."
    )
    open_to_network: Annotated[bool, Field(strict=True)] = Field(
        default=False,
        description="Whether `address` may be another than loopback. Whoever reaches the port can read "
        "names and times of all gliders, without a password.",
    )

    @model_validator(mode="after")
    def _stays_at_home(self) -> Metrics:
        if not self.address.is_loopback and not self.open_to_network:
            raise ValueError(
                "address is not loopback: other machines could read it. Write 127.0.0.1, or add "
                "`open_to_network: true`"
            )
        return self


class Operator(Section):
    """When those who run gliderwatch are told that the watch itself is in trouble."""

    silent_hours: Annotated[Number, Field(gt=0, le=8760)] | None = Field(
        default=24.0,
        description="Hours without a file of any glider, or of one in the water while others call; "
        "null: never told.",
    )
    quarantined_per_day: Annotated[int, Field(strict=True, ge=1, le=100_000)] | None = Field(
        default=20,
        description="More files of one glider than so many quarantined within 24 h; null: never told.",
    )
    waiting_hours: Annotated[Number, Field(gt=0, le=8760)] | None = Field(
        default=6.0,
        description="Hours that files of a glider have waited (for a cache file, ...); null: never told.",
    )
    channel_hours: Annotated[Number, Field(gt=0, le=720)] | None = Field(
        default=1.0,
        description="Hours that a channel has not delivered a message, told by the others; null: never told.",
    )
    free_mb: Annotated[Number, Field(gt=0, le=1e9)] | None = Field(
        default=500.0,
        description="Less free in the folder of the state file than this (MB); null: never told.",
    )


class Channel(Section):
    """One way to send messages."""

    url: Url = Field(
        description="Apprise URL. Any part may be `${NAME}` (environment), `${file:PATH}` or "
        "`${credential:NAME}` (systemd); or `{file: PATH}` for the whole URL."
    )


class QuietHours(Section):
    """Hours of the day in which only loud messages come; the others come when they end."""

    start: ClockTime = Field(description="When they begin, as `22:00`.")
    end: ClockTime = Field(description="When they end; earlier than `start`: the next day.")
    time_zone: Zone = Field(default="UTC", description="By whose clock: `UTC`, `Europe/Amsterdam`, ...")
    below: Louder = Field(default=Severity.CRITICAL, description="Messages quieter than this wait.")

    @model_validator(mode="after")
    def _last(self) -> QuietHours:
        if self.start == self.end:
            raise ValueError("start and end are the same: min_severity keeps quiet all day")
        return self

    def resolved(self) -> waiting.QuietHours:
        """With the time zone."""
        return waiting.QuietHours(self.start, self.end, ZoneInfo(self.time_zone), self.below)


class Recipient(Section):
    """Who gets what, by which channels."""

    channels: tuple[Name, ...] = Field(min_length=1, description="Names of `channels`.")
    gliders: tuple[GliderName, ...] | None = Field(default=None, description="Their gliders; left out: all.")
    min_severity: Loudness = Field(
        default=Severity.WARNING, description="Quieter messages are not sent to them."
    )
    surfacing: tuple[GliderName, ...] = Field(
        default=(), description="Gliders of which they get one short message at each surfacing."
    )
    operator: Annotated[bool, Field(strict=True)] = Field(
        default=False,
        description="Whether they get the messages about the watch itself, whatever `min_severity` and "
        "`gliders` say. Where no recipient has it, all get those of their `min_severity`.",
    )
    unacknowledged_minutes: Annotated[Number, Field(gt=0, le=10080)] | None = Field(
        default=None,
        description="They hear of an incident only when nobody has acknowledged it (`gliderwatch ack`) "
        "within so many minutes; null: at once.",
    )
    quiet_hours: QuietHours | None = Field(default=None, description="When they want to sleep; null: never.")

    def wait(self, can_be_acknowledged: bool) -> waiting.Wait:
        """What they wait for, with a message that can be acknowledged or not."""
        after = self.unacknowledged_minutes if can_be_acknowledged else None
        quiet = self.quiet_hours.resolved() if self.quiet_hours is not None else None
        return waiting.Wait(after * 60.0 if after is not None else None, quiet)
