"""The sections of the settings, as frozen pydantic models."""

from __future__ import annotations

from ipaddress import ip_address
from typing import Annotated, Literal
from zoneinfo import ZoneInfo

from pydantic import AnyHttpUrl, Field, IPvAnyAddress, field_validator, model_validator

from gliderwatch.config.fields import (
    AbsolutePath,
    AttributeName,
    ClockTime,
    Count,
    GliderName,
    Health,
    Louder,
    Loudness,
    Moment,
    Name,
    Number,
    Quieter,
    Section,
    Speed,
    Switch,
    Url,
    Zone,
)
from gliderwatch.fleet.constants import APART
from gliderwatch.incidents import send_schedule
from gliderwatch.model import Severity
from gliderwatch.params import AnomalyRule, Attention, FalseAlarmRule, GliderParams, LearnerParams, RuleParams
from gliderwatch.sea.constants import STALE

# ----------------------------------------
# The sections of the settings that are of gliders, as frozen pydantic models.
#
# Their docstrings and descriptions make `docs/configuration.md`.

_G = GliderParams()
_E, _R = _G.learner, _G.rules
_A = Attention()


class NormalSpeed(Section):
    """Through-water speeds that are normal for the glider; outside of them a dive is flag 1."""

    min: Speed = Field(default=_G.speed_min, description="Lower bound (m/s).")
    max: Speed = Field(default=_G.speed_max, description="Upper bound (m/s).")
    learn: bool | None = Field(
        default=None,
        description="Whether the range is learnt from the first healthy dives of a mission; the bounds hold "
        "until then. null: only where no bound is given.",
    )


class Detection(Section):
    """How easily a dive is flagged."""

    gamma_f: Annotated[Number, Field(ge=0, le=1)] = Field(
        default=_G.gamma_f,
        description="Flow error p_E (0 to 1) above which `adaptive` gives flag 2, and any "
        "estimator where the reference is not the DAC; 1: never.",
    )
    alarms_per_month: Annotated[Number, Field(gt=0, le=30)] = Field(
        default=_G.alarms_per_month,
        description="False alarms in a month of a healthy glider that evidence over several dives may give.",
    )


class Adaptive(Section):
    """Gains and basis functions of the trajectory learner (estimator `adaptive`)."""

    kernel: Literal["exponential", "gaussian"] = Field(
        default=_E.kernel,
        description="Shape of a basis function: exp(-d / (2 sigma)) or exp(-d^2 / (2 sigma^2)), d in m.",
    )
    sigma: Annotated[Number, Field(ge=1, le=1e6)] = Field(
        default=_E.sigma,
        description="Width of a basis function (m): the distance over which the flow is much the same.",
    )
    k: Annotated[Number, Field(gt=0, le=10)] = Field(
        default=_E.k, description="Gain K (1/s): how fast the estimated position is drawn to the track."
    )
    gamma: Annotated[Number, Field(gt=0, le=1)] = Field(
        default=_E.gamma, description="Learning rate of the flow (1/s2)."
    )
    speed_gain: Annotated[Number, Field(gt=0, le=1)] | None = Field(
        default=_E.speed_gain, description="Learning rate of the speed (1/s2); null: the same as `gamma`."
    )
    omega: Annotated[Number, Field(ge=0, le=0.01)] = Field(
        default=_E.omega, description="Angular frequency of the basis functions (rad/s); 0: a steady flow."
    )
    nu: Annotated[Number, Field(ge=-6.3, le=6.3)] = Field(
        default=_E.nu, description="Phase of the basis functions (rad)."
    )
    max_speed: Annotated[Number, Field(gt=0, le=5)] | None = Field(
        default=_E.max_speed, description="Speed (m/s) at which the estimate saturates; null: it does not."
    )
    centres: tuple[
        tuple[Annotated[Number, Field(ge=-90, le=90)], Annotated[Number, Field(ge=-180, le=180)]], ...
    ] = Field(
        default=_E.centres,
        description="Centres of the basis functions, [latitude, longitude] (degrees north, east), over the "
        "planned area; empty: grown along the way.",
    )


class Anomaly(Section):
    """When dives with flag 1 (speed out of range) become an incident."""

    open_after: Count = Field(
        default=_R.anomaly.open_after, description="Flagged dives in a row that open it."
    )
    open_after_severe: Count = Field(
        default=_R.anomaly.open_after_severe,
        description="Dives in a row that open it when the speed is below two thirds of the lower bound.",
    )
    clear_after: Count = Field(
        default=_R.anomaly.clear_after, description="Normal dives in a row that clear it."
    )
    severity: Loudness = Field(default=_R.anomaly.severity, description="How loud its messages are.")


class FalseAlarm(Section):
    """When dives with flag 2 (the flow does not fit: current, compass or data, not the glider) become one."""

    open_after: Count = Field(
        default=_R.false_alarm.open_after, description="Flagged dives in a row that open it."
    )
    clear_after: Count = Field(
        default=_R.false_alarm.clear_after, description="Normal dives in a row that clear it."
    )
    severity: Quieter = Field(
        default=_R.false_alarm.severity, description="How loud its messages are; `critical` is for anomalies."
    )


class Rules(Section):
    """How flags become incidents, and how often reminders of an open one come."""

    anomaly: Anomaly = Field(default=Anomaly(), description="Flag 1.")
    false_alarm: FalseAlarm = Field(default=FalseAlarm(), description="Flag 2.")
    reminder_hours: Annotated[Number, Field(gt=0, le=8760)] | None = Field(
        default=_R.reminder_hours,
        description="Hours until the reminder of an open incident; again after 2, 4, 7, 14, ... times "
        "that; null: none.",
    )


class Preset(Section):
    """Settings of one published deployment (`config/presets.yml`)."""

    normal_speed: NormalSpeed = Field(default=NormalSpeed(), description="Normal speeds.")
    estimator: Literal["joint", "adaptive"] = Field(
        default=_G.estimator,
        description="`joint`: speed, flow and their uncertainty from fixes, headings and currents; "
        "`adaptive`: the trajectory learner of the papers.",
    )
    reference: Literal["dac", "fleet", "tides", "learnt", "model"] = Field(
        default=_G.reference,
        description="The flow that the estimated one is compared with: the glider's own depth-averaged "
        "current (`dac`; `fleet`: the same, with `ocean.files` weighed into the flow by the fleet), its "
        "forecast with tides, the flow learnt on the dives before, or `ocean.files` alone.",
    )
    detection: Detection = Field(default=Detection(), description="Detection.")
    adaptive: Adaptive = Field(default=Adaptive(), description="The trajectory learner.")


class Settings(Preset):
    """What holds for every glider that does not say otherwise."""

    surfacing_hours: Annotated[Number, Field(gt=0, le=240)] | None = Field(
        default=_G.surfacing_hours,
        description="Hours from surfacing to surfacing as programmed, until learnt; null: not known.",
    )
    overdue_hours: Annotated[Number, Field(gt=0, le=720)] | None = Field(
        default=None,
        description="Hours past the expected surfacing after which a silent glider is overdue; null: 40 min "
        "and the longest of 3 h, one interval between surfacings, 3 standard errors of the expected time.",
    )

    unknown_hours: Annotated[Number, Field(gt=0, le=720)] | None = Field(
        default=_A.unknown_hours,
        description="Hours without a dive that could be judged, although files come, after which a message "
        "comes (at least two intervals between surfacings); null: hours do not count.",
    )
    unknown_dives: Count | None = Field(
        default=_A.unknown_dives,
        description="Dives in a row without a judgement after which a message comes; null: their number "
        "does not count.",
    )
    neighbours: bool = Field(
        default=_A.neighbours,
        description="Compare its currents with those of the gliders within 60 km, and report what does not "
        "fit (docs/fleet.md).",
    )

    preset: str | None = Field(default=None, description="Name of a preset; keys given here win over it.")
    rules: Rules = Field(default=Rules(), description="When to alert.")
    battery: Literal["alkaline", "lithium", "rechargeable"] | None = Field(
        default=None,
        description="Its chemistry: the voltage of `alkaline` cells falls steadily, so it tells the end "
        "where no charge and no coulombs do. That of `lithium` (primary) and `rechargeable` cells stays flat "
        "almost to the end and tells nothing of it.",
    )
    health: Health = Field(default=Health(), description="Rules of health.")

    def params(self) -> GliderParams:
        """As the values that the pipeline takes."""
        anomaly, false_alarm = self.rules.anomaly, self.rules.false_alarm
        speed = self.normal_speed
        return GliderParams(
            speed_min=speed.min,
            speed_max=speed.max,
            speed_learnt=not {"min", "max"} & speed.model_fields_set if speed.learn is None else speed.learn,
            estimator=self.estimator,
            reference=self.reference,
            gamma_f=self.detection.gamma_f,
            alarms_per_month=self.detection.alarms_per_month,
            surfacing_hours=self.surfacing_hours,
            learner=LearnerParams(**dict(self.adaptive)),
            rules=RuleParams(
                AnomalyRule(**dict(anomaly)), FalseAlarmRule(**dict(false_alarm)), self.rules.reminder_hours
            ),
        )


Mmsi = Annotated[int, Field(strict=True, ge=200_000_000, le=999_999_999)]


class Layers(Section):
    """Layers of the sea in what the glider measures, and how deep it is advised to fly to keep on them.

    Nothing is ever sent to a glider."""

    sensor: str = Field(
        default="temperature",
        description="The property whose layers are followed: `temperature`, `salinity`, `density`, `oxygen`,"
        " or a science sensor by its name (`sci_...`).",
    )
    max_depth: Annotated[Number, Field(gt=0, le=1000)] = Field(
        description="The deepest that may be advised (m)."
    )
    min_depth: Annotated[Number, Field(ge=0, le=200)] = Field(
        default=10.0, description="The shallowest that may be advised (m): the draught of ships."
    )
    altitude: Annotated[Number, Field(ge=0, le=200)] = Field(
        default=10.0, description="Height above the bottom (m) that is kept."
    )
    method: Literal["composite", "filter"] = Field(
        default="composite",
        description="`composite`: the gradient of all casts together; `filter`: the filter of paper 004.",
    )
    full_casts: Annotated[int, Field(ge=0, le=20)] = Field(
        default=2, description="Casts over all depths at the begin of each segment; 0: only after a reset."
    )
    extension: Annotated[Number, Field(gt=0, le=200)] | None = Field(
        default=None, description="Added above and below the layer (m); null: two samples, 2 m at least."
    )
    outputs: AbsolutePath | None = Field(
        default=None,
        description="Folder for the mission arguments `yo`, for a pilot to check and send; null: none.",
    )

    @field_validator("sensor")
    @classmethod
    def _is_a_sensor(cls, sensor: str) -> str:
        if sensor not in ("temperature", "salinity", "density", "oxygen") and not sensor.startswith("sci_"):
            raise ValueError("is temperature, salinity, density, oxygen, or a name that begins with sci_")
        return sensor

    @model_validator(mode="after")
    def _has_extent(self) -> Layers:
        if not self.min_depth < self.max_depth:
            raise ValueError("min_depth must be above max_depth")
        return self


class Glider(Settings):
    """One glider; every key may be left out (`electa:` alone is enough)."""

    paths: tuple[AbsolutePath, ...] = Field(
        default=(),
        description="From-glider folders that lie outside of the roots. Relative to this file.",
    )
    mmsi: Mmsi | None = Field(
        default=None,
        description="Its number for virtual AIS, as the authority gave it: one that begins with 99 makes "
        "it a virtual aid to navigation (message 21), another a vessel (message 1); null: it has none.",
    )
    muted_until: Moment | None = Field(
        default=None,
        description="No messages about it until then; it is still assessed. A date (`2026-12-01`: "
        "messages from 00:00 UTC on) or a date and time in UTC (`2026-12-01 14:30`).",
    )
    recovery: Moment | None = Field(
        default=None,
        description="When it is planned to be taken out of the water; the end of its battery is held against "
        "that. A date (`2026-12-01`) or a date and time in UTC.",
    )
    recovered: Switch = Field(
        default=False, description="It is out of the water: no messages about it, and it is not overdue."
    )
    layers: Layers | None = Field(
        default=None, description="Layers of the sea ([layers](layers.md)); null: off."
    )


# ----------------------------------------
# The sections of the settings that are of the service: where files come, who gets messages, its own watch.


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


class BoxSetting(Section):
    """A part of the earth (degrees north and east); `west` may be greater than `east` (the date line)."""

    south: Annotated[Number, Field(ge=-90, le=90)] = Field(description="Southern edge.")
    north: Annotated[Number, Field(ge=-90, le=90)] = Field(description="Northern edge.")
    west: Annotated[Number, Field(ge=-180, le=360)] = Field(description="Western edge.")
    east: Annotated[Number, Field(ge=-180, le=360)] = Field(description="Eastern edge.")


class Ocean(Section):
    """Files of an ocean model or a radar (CF NetCDF), for gliders with `reference: model` or `fleet`."""

    files: tuple[AbsolutePath, ...] = Field(
        default=(), description="Paths or patterns (`/data/hycom/*.nc`); read again when they change."
    )
    area: BoxSetting | None = Field(default=None, description="The part to read; null: all of the files.")
    stale_hours: Annotated[Number, Field(gt=0, le=8760)] = Field(
        default=STALE / 3600, description="Hours beyond the last time of the files until which it is used."
    )


class FieldAdvice(Section):
    """Where gliders are advised to look next for a field. Nothing is ever sent to a glider."""

    outputs: AbsolutePath = Field(
        description="Folder for the mission arguments `goto` of each glider, for a pilot to check and send."
    )
    way: Literal["look_ahead", "gradient"] = Field(
        default="look_ahead",
        description="`look_ahead`: the best of 12 headings for the whole leg; `gradient`: that of the paper.",
    )
    polygon: tuple[
        tuple[Annotated[Number, Field(ge=-90, le=90)], Annotated[Number, Field(ge=-180, le=360)]], ...
    ] = Field(
        default=(),
        description="Corners [latitude, longitude] of where gliders may be sent; empty: the whole box.",
    )
    shallowest: Annotated[Number, Field(ge=0, le=12000)] | None = Field(
        default=None,
        description="Water depth (m) that is too shallow, by what the gliders have measured nearest to the "
        "way; null: any is deep enough.",
    )
    apart_km: Annotated[Number, Field(ge=0, le=1000)] = Field(
        default=APART / 1e3, description="Distance that waypoints keep from other gliders (km)."
    )

    @model_validator(mode="after")
    def _has_corners(self) -> FieldAdvice:
        if 0 < len(self.polygon) < 3:
            raise ValueError("polygon needs three corners or more")
        return self


class FieldSetting(Section):
    """A field that the gliders measure together in a part of the sea (`fleet`)."""

    box: BoxSetting = Field(description="The part of the sea.")
    depth: tuple[Annotated[Number, Field(ge=0)], Annotated[Number, Field(gt=0, le=2000)]] = Field(
        description="Its top and bottom (m)."
    )
    sensor: Literal["sci_water_temp", "salinity", "density", "oxygen"] = Field(
        default="sci_water_temp",
        description="What is measured; salinity and density (potential, less 1000 kg/m3) follow by TEOS-10.",
    )
    estimator: Literal["fading", "literal"] = Field(
        default="fading",
        description="`fading`: what is known fades, and the mean profile is apart; `literal`: as the paper "
        "has it.",
    )
    advice: FieldAdvice | None = Field(default=None, description="Where to look next; null: none is given.")

    @model_validator(mode="after")
    def _has_extent(self) -> FieldSetting:
        if not (self.box.south < self.box.north and self.box.west % 360 != self.box.east % 360):
            raise ValueError("box is empty: south must be below north, and west another than east")
        if not self.depth[0] < self.depth[1]:
            raise ValueError("depth is empty: write [TOP, BOTTOM]")
        return self


class Relays(Section):
    """Other dockservers with which the batches of `fields` are exchanged, over an MQTT broker (version 5).

    Needs the extra `gliderwatch[relays]` ([fleet](fleet.md#relays))."""

    broker: Url | None = Field(
        default=None,
        description="`mqtt://USER:PASSWORD@HOST:1883`, or `mqtts://...:8883` with TLS; any part may be a "
        "reference, as in the URL of a channel. null: nothing is exchanged.",
    )
    name: Name | None = Field(
        default=None, description="Name of this relay, which no other has; null: that of the machine."
    )
    topic: Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^+#\x00]+$")] = Field(
        default="gliderwatch", description="How the topics begin; the same at all relays."
    )
    ca: AbsolutePath | None = Field(
        default=None, description="File of certificates to trust instead of those of the system (PEM)."
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
    """When those who run gliderwatch get a message about a problem of the watch itself."""

    silent_hours: Annotated[Number, Field(gt=0, le=8760)] | None = Field(
        default=24.0,
        description="Hours without a file of any glider, or of one in the water while others call; "
        "null: never.",
    )
    quarantined_per_day: Annotated[int, Field(strict=True, ge=1, le=100_000)] | None = Field(
        default=20,
        description="More files of one glider than this quarantined within 24 h; null: never.",
    )
    waiting_hours: Annotated[Number, Field(gt=0, le=8760)] | None = Field(
        default=6.0,
        description="Hours that files of a glider have waited (for a cache file, ...); null: never.",
    )
    channel_hours: Annotated[Number, Field(gt=0, le=720)] | None = Field(
        default=1.0,
        description="Hours that a channel has not delivered a message (the other channels report it); "
        "null: never.",
    )
    free_mb: Annotated[Number, Field(gt=0, le=1e9)] | None = Field(
        default=500.0,
        description="Less free space than this in the folder of the state file (MB); null: never.",
    )


class Maps(Section):
    """Coast and depths on maps, of pages and of mails, finer than what gliderwatch brings along."""

    files: tuple[AbsolutePath, ...] = Field(
        default=(),
        description="Land as polygons (`.geojson`, `.shp`, in degrees), and heights above the sea on a grid "
        "(`.nc`, as GEBCO and ETOPO give them), for lines of equal depth and the coast. Each counts where it "
        "has data, that named first before the others; read again when it changes.",
    )


class Pages(Section):
    """Pages for pilots as files: of the fleet and of each glider, for any web server."""

    folder: AbsolutePath | None = Field(
        default=None,
        description="The folder in which they are kept up to date; made if need be. null: none are written.",
    )


class Export(Section):
    """Files for other programs, which lie beside the pages and are made by `gliderwatch export`."""

    attributes: dict[AttributeName, str] = Field(
        default_factory=dict,
        description="Global attributes of NetCDF files that gliderwatch cannot know: by ACDD `institution`, "
        "`license`, `project`, `acknowledgement`, `creator_url`, `creator_email`, `publisher_name`, "
        "`publisher_url`, `publisher_email`, ... They go before its own.",
    )


class Ais(Section):
    """Virtual AIS of the gliders that have an `mmsi`: where each is now, also under water; off by default."""

    file: AbsolutePath | None = Field(
        default=None, description="File that holds the newest lines (NMEA 0183); null: none is written."
    )
    udp_port: Annotated[int, Field(strict=True, ge=1, le=65535)] | None = Field(
        default=None,
        description="UDP port of this machine to which they are sent, such as 10110; null: none.",
    )
    seconds: Annotated[Number, Field(ge=10, le=3600)] = Field(
        default=180.0, description="Time between two of them (s); AIS has 180 for aids to navigation."
    )


class Web(Section):
    """The pages live, and links that acknowledge: the command `gliderwatch web`."""

    port: Annotated[int, Field(strict=True, ge=1, le=65535)] = Field(
        default=8463, description="TCP port that it listens on."
    )
    address: IPvAnyAddress = Field(
        default=ip_address("127.0.0.1"), description="Address of this machine that the port is on."
    )
    open_to_network: Annotated[bool, Field(strict=True)] = Field(
        default=False,
        description="Whether `address` may be another than loopback. Whoever reaches the port can read where "
        "all gliders are, without a password.",
    )
    public_url: AnyHttpUrl | None = Field(
        default=None,
        description="URL under which people reach it, through a tunnel or a reverse proxy: messages then end "
        "with links to the page, and to acknowledge; null: without.",
    )
    link_hours: Annotated[Number, Field(gt=0, le=720)] = Field(
        default=48.0, description="Hours for which a link acknowledges."
    )

    @model_validator(mode="after")
    def _stays_at_home(self) -> Web:
        if not self.address.is_loopback and not self.open_to_network:
            raise ValueError(
                "address is not loopback: other machines could read it. Write 127.0.0.1, or add "
                "`open_to_network: true`"
            )
        return self


class Channel(Section):
    """One way to send messages."""

    url: Url = Field(
        description="Apprise URL. Any part may be `${NAME}` (environment), `${file:PATH}` or "
        "`${credential:NAME}` (systemd); or `{file: PATH}` for the whole URL."
    )
    pictures: Annotated[bool, Field(strict=True)] = Field(
        default=False,
        description="Whether its mails hold a plot of the speed and a map, some 80 kB. They go without where "
        "these are not drawn within 2 s. Other services than mail get none.",
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

    def resolved(self) -> send_schedule.QuietHours:
        """With the time zone."""
        return send_schedule.QuietHours(self.start, self.end, ZoneInfo(self.time_zone), self.below)


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

    def wait(self, can_be_acknowledged: bool) -> send_schedule.Wait:
        """What they wait for, with a message that can be acknowledged or not."""
        after = self.unacknowledged_minutes if can_be_acknowledged else None
        quiet = self.quiet_hours.resolved() if self.quiet_hours is not None else None
        return send_schedule.Wait(after * 60.0 if after is not None else None, quiet)
