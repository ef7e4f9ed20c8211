"""What is kept of one run of the program on one glider. Values only."""

from __future__ import annotations

from dataclasses import dataclass

HEALTHY = "none"
"""Fault of a glider that has none."""


@dataclass(frozen=True, slots=True)
class Told:
    """A message that opened an incident.

    ``flag`` 1 or 2; ``t_surface`` the surfacing that opened it and ``told`` when the file that let it be
    said was on shore (both s).
    """

    flag: int
    t_surface: float
    told: float


@dataclass(frozen=True, slots=True)
class DiveResult:
    """A dive as gliderwatch sees it in the end, beside the truth where that is known (speeds in m/s).

    ``sigma`` is the standard error of ``speed`` if the estimator gives one; ``true_speed`` the mean through
    the water and ``believed_speed`` what the glider itself took for it.
    """

    t_dive: float
    t_surface: float
    flag: int | None
    speed: float | None
    sigma: float | None
    true_speed: float | None
    believed_speed: float | None


@dataclass(frozen=True, slots=True)
class NextResult:
    """A forecast of the next surfacing, as first said, beside what came.

    ``late`` (s) by how much it came later, ``miss`` (m) between the places; ``persistence`` (m) the same for
    the way of the dive before gone once more; whether place and time were within what was to hold 95 %.
    ``hours`` lie between the two surfacings.
    """

    late: float
    miss: float
    persistence: float
    in_ellipse: bool
    in_time: bool
    hours: float = 0.0


@dataclass(frozen=True, slots=True)
class Record:
    """One glider, one estimator.

    ``sea`` is the scenario or the real mission, ``fault`` and ``size`` what is wrong with it (`HEALTHY`:
    nothing) since ``onset`` (s), ``seed`` its number. ``usual`` is the healthy speed that the normal range
    ``low`` to ``high`` was set about (m/s). ``surfacings`` are all of its own (s), known on shore or not;
    ``start`` and ``end`` (s) bound the mission, ``seconds`` is what the replay took; ``next`` are the
    forecasts of surfacings before the onset.
    """

    estimator: str
    sea: str
    fault: str
    size: float
    seed: int
    is_real: bool
    start: float
    end: float
    onset: float | None
    usual: float
    low: float
    high: float
    surfacings: tuple[float, ...]
    dives: tuple[DiveResult, ...]
    told: tuple[Told, ...]
    seconds: float = 0.0
    next: tuple[NextResult, ...] = ()

    @property
    def glider(self) -> tuple[str, str, int]:
        """Who it is: all sizes of a fault befall the same glider in the same sea."""
        return self.sea, self.fault, self.seed
