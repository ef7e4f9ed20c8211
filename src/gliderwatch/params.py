"""The parameters of one glider: frozen, never part of a state. Pure.

Made by `gliderwatch.config` from the YAML, presets and defaults; the tables in
`docs/configuration.md` say what each one means.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from gliderwatch.model import Severity


@dataclass(frozen=True, slots=True)
class LearnerParams:
    """Gains and basis functions of Algorithm 1 (001; 000 Table I)."""

    kernel: Literal["exponential", "gaussian"] = "exponential"
    sigma: float = 13e3
    """Width of a basis function (m)."""
    k: float = 0.003
    """Gain K of the learning injection (1/s)."""
    gamma: float = 5e-7
    """Learning rate of the flow (1/s2)."""
    speed_gain: float | None = None
    """Learning rate of the speed (1/s2); None: as `gamma`."""
    omega: float = 0.0
    """Angular frequency of the basis functions (rad/s); 0: they vary in space alone (001, below eq. 6)."""
    nu: float = 0.0
    """Phase of the basis functions (rad)."""
    max_speed: float | None = None
    """Speed at which the glider's through-water speed saturates (m/s); None: it does not."""
    centres: tuple[tuple[float, float], ...] = ()
    """Planned centres (latitude, longitude in degrees); empty: grown along the way."""


@dataclass(frozen=True, slots=True)
class AnomalyRule:
    """When flag 1 becomes an incident."""

    open_after: int = 2
    open_after_severe: int = 1
    """Dives in a row that open it when the speed is below two thirds of the lower bound."""
    clear_after: int = 2
    severity: Severity = Severity.CRITICAL


@dataclass(frozen=True, slots=True)
class FalseAlarmRule:
    """When flag 2 becomes an incident."""

    open_after: int = 2
    clear_after: int = 2
    severity: Severity = Severity.WARNING


@dataclass(frozen=True, slots=True)
class RuleParams:
    """How flags become incidents and how often they are brought to mind."""

    anomaly: AnomalyRule = field(default_factory=AnomalyRule)
    false_alarm: FalseAlarmRule = field(default_factory=FalseAlarmRule)
    reminder_hours: float | None = 24.0


@dataclass(frozen=True, slots=True)
class GliderParams:
    """All that the pipeline needs to know of one glider beside its data."""

    speed_min: float = 0.15
    speed_max: float = 0.75
    speed_learnt: bool = True
    """Whether a range learnt from the first healthy dives takes the place of the two above."""
    estimator: Literal["joint", "adaptive"] = "joint"
    reference: Literal["dac", "fleet", "tides", "learnt", "model"] = "dac"
    """The flow F_M that the estimated one is compared with."""
    gamma_f: float = 0.3
    """Flow error p_E above which the flow does not fit (001 Algorithm 2)."""
    alarms_per_month: float = 0.05
    """How often evidence over several dives may cry wolf on a healthy glider."""
    surfacing_hours: float | None = None
    """Hours from surfacing to surfacing as programmed, until they are learnt; None: not known."""
    learner: LearnerParams = field(default_factory=LearnerParams)
    rules: RuleParams = field(default_factory=RuleParams)

    def __hash__(self) -> int:
        """Of some of the settings: it is asked for several times a dive, and parameters are few."""
        return hash((self.speed_min, self.speed_max, self.estimator, self.reference, self.alarms_per_month))

    @property
    def compares_own_current(self) -> bool:
        """Whether a dive is compared with the current that the glider itself measured."""
        return self.reference in ("dac", "fleet")


@dataclass(frozen=True, slots=True)
class Attention:
    """When a glider's silence, or dives that cannot be judged, are spoken of, and until when nothing is.

    Apart from `GliderParams`: it changes nothing that is estimated, so it leaves their hash as it is.
    """

    overdue_hours: float | None = None
    """Hours past the expected surfacing after which it is overdue; None: as `rules.silence.margin` says."""
    muted_until: float | None = None
    """Time (s) until which nothing is told of it."""
    recovered: bool = False
    """Whether it is out of the water: nothing is told of it."""
    unknown_hours: float | None = 24.0
    """Hours without a dive that could be judged after which that is told; None: hours do not count."""
    unknown_dives: int | None = 8
    """Dives in a row that could not be judged after which that is told; None: their number does not count."""
    neighbours: bool = True
    """Whether it is compared with the gliders about it."""

    def is_quiet(self, now: float) -> bool:
        """Whether nothing is told of it at a time (s)."""
        return self.recovered or (self.muted_until is not None and now < self.muted_until)
