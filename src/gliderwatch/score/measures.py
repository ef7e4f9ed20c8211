"""From what came of each glider to what it says of the program. Pure; definitions in `docs/score.md`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

# ----------------------------------------
# What is kept of one run of the program on one glider. Values only.

HEALTHY = "none"
"""Fault of a glider that has none."""


@dataclass(frozen=True, slots=True)
class OpenedIncident:
    """A message that opened an incident.

    ``flag`` 1 or 2; ``t_surface`` the surfacing that opened it and ``reported_at`` when the file
    that showed it was on shore (both s).
    """

    flag: int
    t_surface: float
    reported_at: float


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
    """A forecast of the next surfacing, as first made, beside what came.

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
    openings: tuple[OpenedIncident, ...]
    seconds: float = 0.0
    next: tuple[NextResult, ...] = ()

    @property
    def glider(self) -> tuple[str, str, int]:
        """Who it is: all sizes of a fault befall the same glider in the same sea."""
        return self.sea, self.fault, self.seed


# ----------------------------------------
# From what came of each glider to what it says of the program. Pure; definitions in `docs/score.md`.

MONTH = 30.0 * 86400.0
"""Seconds of a glider-month."""
EXPECTED = {
    "remora": 1,
    "fouling": 1,
    "wing_loss": 1,
    "shark_strike": 1,
    "net": 1,
    "leak_of_oil": 1,
    "ballast": 1,
    "slowed": 1,
    "compass": 2,
    "dac_wrong": 2,
}
"""The flag that tells the truth of a fault; of those not named none does."""
RESAMPLES, LEVEL = 1000, 0.95


@dataclass(frozen=True, slots=True)
class Interval:
    """A number with its bootstrap interval of 95 %; all may be infinite."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Detection:
    """The first message after the onset with the flag expected: how many surfacings and hours after it."""

    surfacings: int
    hours: float


@dataclass(frozen=True, slots=True)
class FaultScore:
    """One estimator on one fault of one size, in one sea or (``sea`` empty) in all.

    ``expected`` is the flag that tells the truth (None: the glider is healthy), ``detected`` the part of
    gliders of which it was reported, ``chance`` the part that false messages alone would have made. Delays
    are quantiles over all gliders: infinite where too few were detected. ``flag_1``, ``flag_2`` are the
    parts of gliders that got such a message, ``first`` those whose first message was of the flag
    expected; ``unexpected`` counts messages of another flag than that a glider-month.
    """

    estimator: str
    fault: str
    size: float
    sea: str
    is_real: bool
    gliders: int
    expected: int | None
    detected: Interval | None
    chance: float
    surfacings_median: float
    surfacings_90: float
    hours_median: float
    hours_90: float
    flag_1: float
    flag_2: float
    first: float
    unexpected: Interval


@dataclass(frozen=True, slots=True)
class FalseScore:
    """False messages of one estimator a glider-month, in one sea or (``sea`` empty) in all.

    ``dives_1``, ``dives_2`` are the parts of judged dives with a false flag: an incident that is false and
    never ends is one message.
    """

    estimator: str
    sea: str
    is_real: bool
    gliders: int
    months: float
    flag_1: Interval
    flag_2: Interval
    dives_1: float
    dives_2: float


# --------------------------------------------------------------------------- one glider


def after_onset(record: Record) -> list[OpenedIncident]:
    """The messages about surfacings after the onset."""
    return [t for t in record.openings if record.onset is not None and t.t_surface > record.onset]


def detection(record: Record) -> Detection | None:
    """When a fault was reported with the right flag, None if never."""
    expected = EXPECTED.get(record.fault)
    times = [t.reported_at for t in after_onset(record) if t.flag == expected]
    if not times or record.onset is None:
        return None
    first = min(times)
    count = sum(record.onset < t <= first for t in record.surfacings)
    return Detection(count, (first - record.onset) / 3600)


def healthy_time(record: Record) -> float:
    """Seconds in which any message is false."""
    return (record.onset if record.onset is not None else record.end) - record.start


def false_openings(record: Record, flag: int) -> int:
    """Messages of a flag on a healthy glider or before the onset."""
    return sum(t.flag == flag and _is_healthy(record, t.t_surface) for t in record.openings)


def _is_healthy(record: Record, t: float) -> bool:
    return record.onset is None or t <= record.onset


# --------------------------------------------------------------------------- many gliders


def bootstrap(gliders: Sequence[Record], number: Callable[[Sequence[Record]], float]) -> Interval:
    """A number of many gliders with the percentiles of the same of gliders drawn anew with replacement."""
    value = number(gliders)
    if len(gliders) == 1:  # every draw is the same one, which scipy refuses
        return Interval(value, value, value)
    low, high = stats.bootstrap(
        (np.arange(len(gliders)),),
        lambda drawn: number([gliders[i] for i in drawn]),
        vectorized=False,
        n_resamples=RESAMPLES,
        confidence_level=LEVEL,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return Interval(value, float(low), float(high))


def quantile(values: Iterable[float], part: float) -> float:
    """The smallest value that ``part`` of all do not exceed; infinite values are allowed.

    >>> quantile([1.0, 5.0, math.inf], 0.5), quantile([1.0, 5.0, math.inf], 0.9)
    (5.0, inf)
    """
    return float(np.quantile(list(values), part, method="inverted_cdf"))


def share(gliders: Sequence[Record], of: Callable[[Record], bool]) -> float:
    """The part of gliders of which something holds."""
    return sum(map(of, gliders)) / len(gliders)


def fault_scores(records: Iterable[Record]) -> list[FaultScore]:
    """For each estimator, fault and size, in each sea and in all."""
    records = list(records)
    groups: dict[tuple[str, str, float, str, bool], list[Record]] = {}
    for r in records:
        for sea in (r.sea, "") if r.fault != HEALTHY else ():
            groups.setdefault((r.estimator, r.fault, r.size, sea, r.is_real), []).append(r)
    rates = {(f.estimator, f.sea, f.is_real): f for f in false_scores(records) if f.sea}
    return [_fault_score(*group, gliders, rates) for group, gliders in groups.items()]


Rates = Mapping[tuple[str, str, bool], "FalseScore"]


def by_chance(record: Record, rates: Rates) -> float:
    """How likely a false message of the flag expected is after the onset, at the rate of its sea."""
    score = rates.get((record.estimator, record.sea, record.is_real))
    if score is None or record.onset is None or record.fault not in EXPECTED:
        return 0.0
    rate = score.flag_1.value if EXPECTED[record.fault] == 1 else score.flag_2.value
    return 1 - math.exp(-rate * (record.end - record.onset) / MONTH)


def _fault_score(
    estimator: str,
    fault: str,
    size: float,
    sea: str,
    is_real: bool,
    gliders: Sequence[Record],
    rates: Rates,
) -> FaultScore:
    expected = EXPECTED.get(fault)
    found = [detection(r) for r in gliders]
    never = Detection(0, math.inf)
    surfacings = [math.inf if d is None else float(d.surfacings) for d in found]
    hours = [(d or never).hours for d in found]
    return FaultScore(
        estimator,
        fault,
        size,
        sea,
        is_real,
        len(gliders),
        expected,
        None
        if expected is None
        else bootstrap(gliders, lambda some: share(some, lambda r: detection(r) is not None)),
        sum(by_chance(r, rates) for r in gliders) / len(gliders),
        quantile(surfacings, 0.5),
        quantile(surfacings, 0.9),
        quantile(hours, 0.5),
        quantile(hours, 0.9),
        share(gliders, lambda r: any(t.flag == 1 for t in after_onset(r))),
        share(gliders, lambda r: any(t.flag == 2 for t in after_onset(r))),
        share(gliders, lambda r: _first_flag(r) == expected),
        _rate(gliders, _unexpected, lambda r: r.end - (r.onset if r.onset is not None else r.start)),
    )


def _first_flag(record: Record) -> int | None:
    return next((t.flag for t in sorted(after_onset(record), key=lambda t: t.reported_at)), None)


def _unexpected(record: Record) -> int:
    return sum(t.flag != EXPECTED.get(record.fault) for t in after_onset(record))


def _rate(
    gliders: Sequence[Record], count: Callable[[Record], int], seconds: Callable[[Record], float]
) -> Interval:
    """Messages a glider-month; of none the upper bound is that of a Poisson count, 3 / months."""
    months = sum(map(seconds, gliders)) / MONTH

    def rate(some: Sequence[Record]) -> float:
        return sum(map(count, some)) * MONTH / sum(map(seconds, some))

    found = bootstrap(gliders, rate)
    return found if found.value > 0 else Interval(0.0, 0.0, 3.0 / months)


def false_scores(records: Iterable[Record]) -> list[FalseScore]:
    """For each estimator in each sea, and in all. The sizes of a fault share a glider that counts once."""
    gliders: dict[tuple[str, bool, tuple[str, str, int]], Record] = {}
    for r in records:
        if not (r.is_real and r.fault != HEALTHY):  # the same days of the same mission
            gliders.setdefault((r.estimator, r.is_real, r.glider), r)
    groups: dict[tuple[str, str, bool], list[Record]] = {}
    for (estimator, is_real, _), r in gliders.items():
        for sea in (r.sea, ""):
            groups.setdefault((estimator, sea, is_real), []).append(r)
    return [_false_score(*group, some) for group, some in groups.items()]


def _false_score(estimator: str, sea: str, is_real: bool, gliders: Sequence[Record]) -> FalseScore:
    flags = [d.flag for r in gliders for d in r.dives if d.flag is not None and _is_healthy(r, d.t_surface)]
    judged = max(len(flags), 1)
    return FalseScore(
        estimator,
        sea,
        is_real,
        len(gliders),
        sum(map(healthy_time, gliders)) / MONTH,
        _rate(gliders, lambda r: false_openings(r, 1), healthy_time),
        _rate(gliders, lambda r: false_openings(r, 2), healthy_time),
        flags.count(1) / judged,
        flags.count(2) / judged,
    )
