"""The sections of the settings that are of gliders, as frozen pydantic models.

Their docstrings and descriptions make `docs/configuration.md`.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from gliderwatch.config.fields import (
    AbsolutePath,
    Count,
    Loudness,
    Moment,
    Number,
    Quieter,
    Speed,
    Switch,
)
from gliderwatch.config.section import Section
from gliderwatch.params import AnomalyRule, Attention, FalseAlarmRule, GliderParams, LearnerParams, RuleParams

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
        default=_R.reminder_hours,
        description="Hours until an open incident is brought to mind; again after 2, 4, 7, 14, ... times "
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
    reference: Literal["dac", "tides", "learnt", "model"] = Field(
        default=_G.reference,
        description="The flow that the estimated one is compared with: the glider's own depth-averaged "
        "current, its forecast with tides, the flow learnt on the dives before, or `ocean.files`.",
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
        description="Hours without a dive that could be judged, although files come, after which that is "
        "told (at least two intervals between surfacings); null: hours do not count.",
    )
    unknown_dives: Count | None = Field(
        default=_A.unknown_dives,
        description="Dives in a row that could not be judged after which that is told; null: their number "
        "does not count.",
    )

    preset: str | None = Field(default=None, description="Name of a preset; keys given here win over it.")
    rules: Rules = Field(default=Rules(), description="When to alert.")

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


class Glider(Settings):
    """One glider; every key may be left out (`electa:` alone is enough)."""

    paths: tuple[AbsolutePath, ...] = Field(
        default=(),
        description="From-glider folders that lie outside of the roots. Relative to this file.",
    )
    muted_until: Moment | None = Field(
        default=None,
        description="Nothing is told of it until then; it is assessed all the same. A date (`2026-12-01`: "
        "from 00:00 UTC on it is told of again) or a date and time in UTC (`2026-12-01 14:30`).",
    )
    recovered: Switch = Field(
        default=False, description="It is out of the water: nothing is told of it, its silence least of all."
    )
