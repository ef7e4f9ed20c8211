"""The parameters of one glider: frozen, never part of a state. Pure.

Made by `gliderwatch.config` from the YAML, presets and defaults; the tables in
`docs/configuration.md` say what each one means.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from gliderwatch.model import Severity


@dataclass(frozen=True, slots=True)
class EstimatorParams:
    """Gains and basis functions of Algorithm 1 and the threshold of Algorithm 2 (001; 000 Table I)."""

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
    gamma_f: float = 0.3
    """Flow error p_E above which a dive gets flag 2."""


@dataclass(frozen=True, slots=True)
class AnomalyRule:
    """When flag 1 becomes an incident."""

    open_after: int = 2
    open_after_severe: int = 1
    """Dives in a row that open it when the speed is below half of the lower bound."""
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
    estimator: EstimatorParams = field(default_factory=EstimatorParams)
    rules: RuleParams = field(default_factory=RuleParams)
