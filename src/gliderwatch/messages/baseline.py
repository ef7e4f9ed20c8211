"""Numbers of a dive beside what is usual for the glider, in words. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees
from typing import Literal

from gliderwatch.messages.formatting import finite


@dataclass(frozen=True, slots=True)
class Wording:
    """How a number is written.

    ``words`` hold the value; ``per`` is what a unit of ours is worth in theirs, ``digits`` behind the point.
    ``less`` and ``more`` say what a size below or above its range means; only the ``telling`` of them points
    to the glider, the other is a pilot's choice. ``signed``: the sign counts, not the size alone.
    """

    name: str
    words: str
    less: str
    more: str
    per: float = 1.0
    digits: int = 0
    signed: bool = False
    telling: Literal["both", "less", "more"] = "both"


@dataclass(frozen=True, slots=True)
class BaselineRemark:
    """The number of a ``name`` in words: ``departure`` in half widths of its range (above 1: outside), on
    which ``side`` of it (none: inside), and whether it is ``telling`` of a glider that is not well."""

    name: str
    text: str
    departure: float
    telling: bool
    side: Literal["less", "more", "none"] = "none"


_DEGREES, _CC = degrees(1.0), 1e6
WORDINGS = (
    Wording("depth_rate_climb", "climbs at {} m/s", "slower", "faster", digits=2),
    Wording("roll_mean", "roll {}°", "to the left", "to the right", per=_DEGREES, signed=True),
    Wording("depth_rate_dive", "dives at {} m/s", "slower", "faster", digits=2),
    Wording("rate_ratio", "climbs {} times as fast as it dives", "less", "more", digits=2),
    Wording("pitch_climb", "pitch {}° climbing", "flatter", "steeper", per=_DEGREES),
    Wording("pitch_dive", "pitch {}° diving", "flatter", "steeper", per=_DEGREES),
    Wording(
        "pitch_asymmetry",
        "climb {}° steeper than dive",
        "flatter",
        "steeper",
        per=_DEGREES,
        signed=True,
    ),
    Wording("ballast_climb", "pumps {} cc to climb", "less", "more", per=_CC, telling="less"),
    Wording("ballast_dive", "pumps {} cc to dive", "less", "more", per=_CC, telling="less"),
    Wording("vacuum", "vacuum {} kPa", "less", "more", per=1e-3, digits=1, telling="less"),
    Wording("yos_per_hour", "{} yos an hour", "fewer", "more", digits=1, telling="less"),
    Wording("duration_h", "surfaced after {} h", "earlier", "later", digits=1, telling="more"),
)
"""The most telling first. Names: `docs/nomenclature.md`."""


def usual(evidence: Mapping[str, float]) -> list[BaselineRemark]:
    """All numbers of a dive of which the evidence says what is usual."""
    remarks = (_baseline_remark(evidence, wording) for wording in WORDINGS)
    return [remark for remark in remarks if remark is not None]


def has_usual(evidence: Mapping[str, float], *names: str) -> bool:
    """Whether what is usual is known for all of some numbers."""
    return all(finite(evidence.get(f"{name}_usual")) is not None for name in names)


def _baseline_remark(evidence: Mapping[str, float], wording: Wording) -> BaselineRemark | None:
    """A number in words; None where it or its range is not known."""
    names = (wording.name, *(f"{wording.name}_{end}" for end in ("low", "usual", "high")))
    found = [finite(evidence.get(name)) for name in names]
    numbers = [wording.per * each for each in found if each is not None]
    if len(numbers) < len(names):
        return None
    value, low, middle, high = numbers
    if not wording.signed and middle < 0:
        value, low, middle, high = -value, -high, -middle, -low
    half = (high - middle) if value > middle else (middle - low)
    departure = abs(value - middle) / half if half > 0 else 0.0
    if low <= value <= high:
        words, span = _words(value, low, high, wording, wording.digits)
        return BaselineRemark(wording.name, f"{words}, as usual ({span})", departure, False)
    side: Literal["less", "more"] = "less" if value < low else "more"
    # more digits where rounding would put the value into its range
    digits = next(
        (
            n
            for n in range(wording.digits, wording.digits + 3)
            if not round(low, n) <= round(value, n) <= round(high, n)
        ),
        wording.digits + 3,
    )
    words, span = _words(value, low, high, wording, digits)
    word = wording.less if side == "less" else wording.more
    text, telling = f"{words}, usually {span}: {word}", wording.telling in ("both", side)
    return BaselineRemark(wording.name, text, departure, telling, side)


def _words(value: float, low: float, high: float, wording: Wording, digits: int) -> tuple[str, str]:
    """The value in its words, and the span that is usual."""
    numbers = [f"{round(number, digits) + 0.0:.{digits}f}" for number in (value, low, high)]
    return wording.words.format(numbers[0]), f"{numbers[1]} to {numbers[2]}"
