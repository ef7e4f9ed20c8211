"""The sections of the settings as frozen pydantic models.

Their docstrings and descriptions make `docs/configuration.md`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_origin

from pydantic import BaseModel, ConfigDict, Field, model_validator

from gliderwatch.config.fields import (
    AbsolutePath,
    Count,
    GliderName,
    Loudness,
    Name,
    Number,
    Quieter,
    Speed,
    Url,
)
from gliderwatch.model import Severity
from gliderwatch.params import AnomalyRule, EstimatorParams, FalseAlarmRule, GliderParams, RuleParams

_G = GliderParams()
_E, _R = _G.estimator, _G.rules


def _may_be_empty(schema: dict[str, Any]) -> None:
    """In the JSON Schema too, what has no required keys may be left empty (`electa:`)."""
    required = schema.get("required", [])
    if not required:
        schema["type"] = ["object", "null"]
    for name, property_ in schema["properties"].items():
        if property_.get("type") in {"array", "object"} and name not in required:
            property_["type"] = [property_["type"], "null"]


class Section(BaseModel):
    """Base of all sections: frozen, unknown keys refused, inputs kept out of errors."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", hide_input_in_errors=True, json_schema_extra=_may_be_empty
    )

    @model_validator(mode="before")
    @classmethod
    def _empty_is_left_out(cls, data: object) -> object:
        """A section or list whose lines are all commented out counts as left out."""
        if data is None:
            return {}
        if not isinstance(data, dict):
            return data
        return {key: value for key, value in data.items() if value is not None or not cls._holds_more(key)}

    @classmethod
    def _holds_more(cls, key: str) -> bool:
        field = cls.model_fields.get(key)
        kind = field.annotation if field else None
        return get_origin(kind) in {dict, tuple} or (isinstance(kind, type) and issubclass(kind, Section))


class NormalSpeed(Section):
    """Through-water speeds that are normal for the glider; outside of them a dive is flag 1."""

    min: Speed = Field(default=_G.speed_min, description="Lower bound (m/s).")
    max: Speed = Field(default=_G.speed_max, description="Upper bound (m/s).")


class Estimator(Section):
    """Gains and basis functions of the trajectory learner, and the threshold of its flow test."""

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
    gamma_f: Annotated[Number, Field(ge=0, le=1)] = Field(
        default=_E.gamma_f, description="Flow error (0 to 1) above which a dive is flag 2; 1: never."
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
        description="Dives in a row that open it when the speed is below half of the lower bound.",
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
    """How flags become incidents, and how often an open one is brought to mind."""

    anomaly: Anomaly = Field(default=Anomaly(), description="Flag 1.")
    false_alarm: FalseAlarm = Field(default=FalseAlarm(), description="Flag 2.")
    reminder_hours: Annotated[Number, Field(gt=0, le=8760)] | None = Field(
        default=_R.reminder_hours, description="Hours between reminders of an open incident; null: none."
    )


class Preset(Section):
    """Settings of one published deployment (`config/presets.yml`)."""

    normal_speed: NormalSpeed = Field(default=NormalSpeed(), description="Normal speeds.")
    estimator: Estimator = Field(default=Estimator(), description="Estimator.")


class Settings(Preset):
    """What holds for every glider that does not say otherwise."""

    preset: str | None = Field(default=None, description="Name of a preset; keys given here win over it.")
    rules: Rules = Field(default=Rules(), description="When to alert.")

    def params(self) -> GliderParams:
        """As the values that the pipeline takes."""
        anomaly, false_alarm = self.rules.anomaly, self.rules.false_alarm
        return GliderParams(
            speed_min=self.normal_speed.min,
            speed_max=self.normal_speed.max,
            estimator=EstimatorParams(**dict(self.estimator)),
            rules=RuleParams(
                AnomalyRule(**dict(anomaly)), FalseAlarmRule(**dict(false_alarm)), self.rules.reminder_hours
            ),
        )


class Glider(Settings):
    """One glider; every key may be left out (`electa:` alone is enough)."""

    paths: tuple[AbsolutePath, ...] = Field(
        default=(),
        description="From-glider folders that lie outside of the roots. Relative to this file.",
    )


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
    observer: Literal["inotify", "polling"] = Field(
        default="inotify", description="`polling` for folders on NFS or SMB, where inotify sees nothing."
    )


class State(Section):
    """What gliderwatch remembers."""

    path: AbsolutePath = Field(
        default="/var/lib/gliderwatch/state.sqlite",
        description="The state file; its folder must be writable.",
    )


class Channel(Section):
    """One way to send messages."""

    url: Url = Field(
        description="Apprise URL. Any part may be `${NAME}` (environment), `${file:PATH}` or "
        "`${credential:NAME}` (systemd); or `{file: PATH}` for the whole URL."
    )


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
