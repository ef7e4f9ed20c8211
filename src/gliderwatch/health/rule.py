"""What a rule is, and what it finds. Pure. How to add one: CONTRIBUTING.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gliderwatch.health.constants import CLEAR_AFTER, ROBUST, SHOWN
from gliderwatch.health.readings import History
from gliderwatch.model import EMPTY, Array, Series, Severity

Limits = Mapping[str, float | None]
"""The limits of a rule by name (SI), as configured; None: that one is not looked at."""


@dataclass(frozen=True, slots=True)
class Limit:
    """One limit: its ``name`` and usual ``value`` in ``unit`` (None: none), what may stand in the YAML
    (``low`` to ``high``), what it is ``about``, and by what a value is multiplied to be SI (``si``)."""

    name: str
    value: float | None
    unit: str
    low: float
    high: float
    about: str
    si: float = 1.0


@dataclass(frozen=True, slots=True)
class Finding:
    """What a rule found: how bad, since when (``t``, s), and ``text``, a short sentence with value and limit.

    ``quantity`` names the readings that show it, ``last`` are the last of them (s, SI).
    """

    rule: str
    severity: Severity
    t: float
    text: str
    quantity: str = ""
    last: tuple[tuple[float, float], ...] = ()


Judge = Callable[[History, Limits], Finding | None]


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule by ``name``: ``judge`` is asked where one of its ``quantities`` has a fresh reading (a name that
    ends with a colon stands for all that begin with it); ``about`` says what it is about. After so many
    segments or calls in a row in which it finds nothing (``clear_after``) its incident is over."""

    name: str
    quantities: tuple[str, ...]
    judge: Judge
    limits: tuple[Limit, ...]
    about: str
    clear_after: int = CLEAR_AFTER

    def sees(self, history: History) -> bool:
        """Whether there is anything new that it could look at."""
        names = history.fresh
        return any(q in names or (q.endswith(":") and _any_begins(names, q)) for q in self.quantities)

    def usual(self) -> dict[str, float | None]:
        """Its limits as they are where the configuration says nothing (SI)."""
        return {x.name: None if x.value is None else x.value * x.si for x in self.limits}


def _any_begins(names: Mapping[str, Series], beginning: str) -> bool:
    return any(name.startswith(beginning) for name in names)


def run(
    history: History, name: str, is_bad: Callable[[Array], NDArray[np.bool_]], n: int = 2
) -> Series | None:
    """The last `n` or more readings in a row that are bad, of which at least one is fresh; None: there are
    no such."""
    fresh = history.fresh.get(name, EMPTY)
    if not is_bad(fresh.v).any() and history.is_later(name):
        return None  # those before need not be joined
    series, since = history.get(name), history.fresh_from(name)
    if len(series) < n:
        return None
    bad = is_bad(series.v)
    ends = np.flatnonzero(np.diff(np.concatenate([[0], bad.astype(int), [0]])))
    for start, end in reversed(ends.reshape(-1, 2).tolist()):
        if end - start >= n and series.t[end - 1] >= since:
            return Series(series.t[start:end], series.v[start:end])
    return None


def below(history: History, name: str, limit: float | None) -> Series | None:
    """The same of two or more readings below a limit (None: it is not looked at)."""
    return None if limit is None else run(history, name, lambda v: v < limit)


def above(history: History, name: str, limit: float | None) -> Series | None:
    """The same of two or more readings above a limit (None: it is not looked at)."""
    return None if limit is None else run(history, name, lambda v: v > limit)


def found(rule: str, severity: Severity, t: float, text: str, history: History, quantity: str) -> Finding:
    """A finding with the last readings of its quantity."""
    series = history.get(quantity)
    last = zip(series.t[-SHOWN:].tolist(), series.v[-SHOWN:].tolist(), strict=True)
    return Finding(rule, severity, t, text, quantity, tuple(last))


def loudest(findings: list[Finding]) -> Finding | None:
    """The worst of some findings, the earliest of these; None where there is none."""
    return min(findings, key=lambda f: (-f.severity, f.t, f.quantity), default=None)


def spread(values: Array, least: float) -> tuple[float, float]:
    """Median and robust standard deviation of some values, this at least so much."""
    middle = float(np.median(values))
    return middle, max(ROBUST * float(np.median(np.abs(values - middle))), least)
