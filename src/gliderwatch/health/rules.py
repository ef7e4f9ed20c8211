"""All rules of health, and what they find in the readings so far. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gliderwatch.health import attitude, battery, devices, leaks
from gliderwatch.health.readings import History, Readings, recent
from gliderwatch.health.rule import Finding, Limits, Rule

RULES: tuple[Rule, ...] = (*leaks.RULES, *battery.RULES, *devices.RULES, *attitude.RULES)
"""In the order in which they are shown."""

Judged = Mapping[str, Finding | None]
"""What each rule that could look at something found; None: nothing."""


def judge(history: History, limits: Mapping[str, Limits]) -> Judged:
    """What the rules find in the fresh readings of a `history`. Rules without `limits` are off."""
    return {
        rule.name: rule.judge(history, limits[rule.name])
        for rule in RULES
        if rule.name in limits and rule.sees(history)
    }


def judge_rows(
    rows: Sequence[tuple[float, Readings]], since: float, limits: Mapping[str, Limits]
) -> list[Judged]:
    """What the rules find in each file and call from a time (s) on; `rows` are all, in order of time."""
    return [
        judge(History(recent(rows[: k + 1]), readings), limits)
        for k, (t, readings) in enumerate(rows)
        if t >= since
    ]


def usual_limits(recovery: float | None = None) -> dict[str, Limits]:
    """The limits of all rules where the configuration says nothing; ``recovery`` is planned then (s)."""
    limits = {rule.name: rule.usual() for rule in RULES}
    limits[battery.END.name]["recovery"] = recovery
    return dict(limits)
