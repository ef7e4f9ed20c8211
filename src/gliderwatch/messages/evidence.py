"""How sure it is, what speaks for and against the likeliest cause, what the data are worth. Pure."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, radians
from statistics import NormalDist
from typing import NamedTuple

from gliderwatch.fleet.constants import DAC_NOISE, USUAL_SLIP
from gliderwatch.messages.baseline import has_usual, usual
from gliderwatch.messages.causes import WING, Cause, difference, misfit_limit
from gliderwatch.messages.constants import (
    CERTAIN,
    DRIFT,
    FIX_GAP,
    LEARNT,
    RATE_RATIO,
    ROLL_OF_ANY,
    SHORT_DIVE,
    STEADY,
    UNOBSERVED,
)
from gliderwatch.messages.formatting import angle, clean, finite, speed
from gliderwatch.model import Assessment, Kind
from gliderwatch.navigation.dives import COMMANDED_USED, COURSE_ASSUMED

# Bounds above (or below) which a number is worth a line; they change no flag.
STRONG, MINOR = 3.0, 0.5  # what decides comes first, what is good to know last; others have 1
LINES = 3  # on each side, for a phone
TWO_SIGMA = 2.45  # standard errors that hold 95 % of two components
_WORDS = ((0.975, "almost sure"), (0.9, "very likely"), (0.75, "likely"), (0.0, "not sure"))


class Remark(NamedTuple):
    """One sentence ``for`` or against a cause, and how telling it is."""

    is_for: bool
    text: str
    weight: float = 1.0


def number(assessment: Assessment, name: str) -> float | None:
    """A number of the evidence; None where it is missing or not a number."""
    return finite(assessment.evidence.get(name))


def out_of_range(assessment: Assessment, value: float | None) -> bool:
    """Whether a speed (m/s) is known and outside the glider's normal range."""
    value = finite(value)
    return value is not None and not assessment.speed_min <= value <= assessment.speed_max


def normal_range(a: Assessment) -> str:
    """The normal range; of one whose upper bound was not learnt, the lower bound alone.

    A bound far above the usual speed is that of the configuration, and says nothing of this glider.
    """
    middle = number(a, "usual_speed")
    if middle is not None and a.speed_max > LEARNT * middle:
        return f"normal above {a.speed_min:.2f}"
    return f"normal {a.speed_min:.2f}-{a.speed_max:.2f}"


# ----------------------------------------
# How sure: a word and a number.


def certainty(kind: Kind, a: Assessment, dives: int) -> str:
    """How sure an incident of `dives` flagged dives in a row is, in a word and a number.

    The number is the chance, by the standard errors of its last dive, that the speed is out of its range (of
    a loss too small for that: below the usual speed), or that the measurements contradict each other.
    """
    chance = _of_misfit(a) if kind is Kind.FALSE_ALARM else _of_speed(a)
    row = "1 dive" if dives == 1 else f"{dives} dives in a row"
    if chance is None:
        return f"likely ({row})" if dives > 1 else "not sure (1 dive)"
    word = next(word for least, word in _WORDS if chance >= least)
    return f"{word} ({100 * min(chance, CERTAIN):.0f} %)"


def _of_speed(a: Assessment) -> float | None:
    value, sigma, middle = finite(a.speed), number(a, "speed_sigma"), number(a, "usual_speed")
    if value is None or not sigma:
        return None
    if value > a.speed_max:
        return NormalDist().cdf((value - a.speed_max) / sigma)
    bound = a.speed_min if value < a.speed_min or middle is None else middle
    return NormalDist().cdf((bound - value) / sigma)


def _of_misfit(a: Assessment) -> float | None:
    across, sigma = number(a, "across_misfit"), number(a, "across_sigma")
    if across is None or not sigma or abs(across) <= misfit_limit(a):
        return _of_speed(a) if out_of_range(a, a.speed) else None
    return 2 * NormalDist().cdf(abs(across) / sigma) - 1


# ----------------------------------------
# For and against the likeliest cause. What is as usual speaks only where the cause would change it.


def weigh(a: Assessment, kind: Kind, cause: Cause) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What speaks for and against a cause, three lines each at most, the most telling first."""
    found = (
        _disagreement(a)
        if kind is Kind.FALSE_ALARM
        else [*_speeds(a, cause), *_fits(a, cause), *_of_any(a, cause)]
    )
    found.sort(key=lambda remark: -remark.weight)
    pro = tuple(dict.fromkeys(r.text for r in found if r.is_for))
    con = tuple(dict.fromkeys(r.text for r in found if not r.is_for))
    return pro[:LINES], con[:LINES]


def _fits(a: Assessment, cause: Cause) -> list[Remark]:
    """Numbers against what is usual for this glider, where the cause says how they should be."""
    found = []
    for remark in usual(a.evidence):
        weight = min(remark.departure, STRONG) + 1
        if remark.name in cause.off:
            found.append(Remark(remark.telling, remark.text, weight if remark.telling else 1.0))
        elif remark.name in cause.usual:
            is_usual = remark.side == "none"
            found.append(Remark(is_usual, remark.text, 1.0 if is_usual else weight))
    return found


def _speeds(a: Assessment, cause: Cause) -> list[Remark]:
    """What else tells the speed, against the same range."""
    across = number(a, "across_misfit")
    rows = []
    if across is None or abs(across) <= misfit_limit(a):
        rows.append(("along_speed", "ground velocity less current gives {} through the water"))
    rows.append(("onboard_speed", "the glider itself reports {} through the water"))
    found = []
    for name, words in rows:
        value = through_water(number(a, name))
        if value is not None:
            is_out = out_of_range(a, value)
            text = f"{words.format(speed(value))}, {'out of' if is_out else 'within'} the normal range"
            # what a glider reports of itself does not know of a lost wing
            is_for = is_out != (cause is WING and name == "onboard_speed")
            found.append(Remark(is_for, text, STRONG if name == "along_speed" else 1.0))
    if {COMMANDED_USED, COURSE_ASSUMED} & set(a.notes):
        words = "its heading is not in the file: a glider that circles looks like a slow one"
        found.append(Remark(False, words, 2.0))
    before, now = number(a, "speed_before"), finite(a.speed)
    if before is not None and out_of_range(a, now) and out_of_range(a, before):
        found.append(Remark(True, f"the dive before was out of range too: {speed(before)}"))
    return found


def _of_any(a: Assessment, cause: Cause) -> list[Remark]:
    """Numbers against bounds that hold for any glider, where what is usual for this one is not known."""
    found = []
    roll = number(a, "roll_mean")
    if roll is not None and not has_usual(a.evidence, "roll_mean") and "roll_mean" in cause.off:
        is_large = abs(roll) > radians(ROLL_OF_ANY)
        found.append(Remark(is_large, f"mean roll {angle(roll)}", STRONG if is_large else 1.0))
    down, up = number(a, "depth_rate_dive"), number(a, "depth_rate_climb")
    if down and up and not has_usual(a.evidence, "rate_ratio"):
        down, up = abs(down), abs(up)
        if max(down, up) / min(down, up) > RATE_RATIO and set(cause.off) & {"rate_ratio", "depth_rate_climb"}:
            found.append(Remark(up < down, f"dives at {speed(down)} but climbs at {speed(up)} (vertical)"))
    return found


def _disagreement(a: Assessment) -> list[Remark]:
    """For and against that a measurement is wrong."""
    found = []
    across, apart, p_e = number(a, "across_misfit"), difference(a), finite(a.p_e)
    if across is not None and abs(across) > misfit_limit(a):
        text = (
            f"across the heading the track misses by {speed(abs(across))}, which a slow glider cannot cause"
        )
        found.append(Remark(True, text, STRONG))
    elif across is not None:
        text = f"fixes, compass and current fit within {speed(abs(across))} across the heading"
        found.append(Remark(False, text))
    if apart is not None and p_e is not None:
        agree = p_e <= a.gamma_f
        text = f"the current estimated here and that of the glider are {speed(apart)} apart"
        if agree:  # p_E is less than the limit beside strong currents, whatever the errors are
            small = apart <= TWO_SIGMA * hypot(number(a, "flow_sigma") or 0.0, DAC_NOISE)
            text += ", within their errors" if small else ", which is little beside the currents met so far"
        found.append(Remark(not agree, text, MINOR if agree else 2.0))
    onboard = through_water(number(a, "onboard_speed"))
    if onboard is not None and not out_of_range(a, onboard):
        text = f"the glider itself reports {speed(onboard)} through the water, within the normal range"
        found.append(Remark(True, text, MINOR))
    return found


def through_water(own: float | None) -> float | None:
    """The speed through the water (m/s) of a healthy glider that reckons with its ``own`` one: less what the
    angle of attack takes. The normal range is of that speed.

    >>> round(through_water(0.25), 3)
    0.23
    """
    return None if own is None else own * (1 - USUAL_SLIP)


# ----------------------------------------
# What the data are worth, and numbers in the papers' symbols.


def data_quality(a: Assessment) -> tuple[str, ...]:
    """Remarks on the data of a dive, the weightiest first."""
    if finite(a.reference_u) is None or finite(a.reference_v) is None:
        current: tuple[str, ...] = ("the glider reckons no current for this dive",)
    else:
        current = (
            () if a.reference_final else ("the current is provisional: a later file brings the final one",)
        )
    lines: tuple[tuple[str, Callable[[float], bool], str], ...] = (
        ("unobserved_h", lambda x: x > UNOBSERVED, "{:.1f} h of the dive are missing from the data"),
        ("fix_gap_minutes", lambda x: x > FIX_GAP, "{:.0f} min between surfacing and fix"),
        ("drift_h", lambda x: x > DRIFT, "{:.1f} h of surface drift between the fixes"),
        ("duration_h", lambda x: x < SHORT_DIVE, "short dive ({:.1f} h): errors of the fixes weigh more"),
        (
            "heading_steadiness",
            lambda x: x > STEADY,
            "heading hardly changed ({:.2f}): a slow glider looks like a head current",
        ),
    )
    values = ((number(a, name), worth, words) for name, worth, words in lines)
    found = tuple(words.format(x) for x, worth, words in values if x is not None and worth(x))
    hours = number(a, "duration_h")
    samples = f"{a.n_samples} samples" + (f" in {hours:.1f} h" if hours is not None else "")
    notes = (clean(note) for note in a.notes if note != "depth-averaged current is provisional")
    return (*current, *found, samples, *notes)


def symbols(a: Assessment) -> tuple[str, ...]:
    """What who knows the papers asks for (`docs/nomenclature.md`)."""
    apart, p_e, clle, excitation = difference(a), finite(a.p_e), finite(a.clle_max), finite(a.excitation)
    slip, side = number(a, "slip"), number(a, "side")
    alike = "near 0: speed and flow look alike"
    return (
        *((f"p_E {p_e:.3f} (limit {a.gamma_f:.3f}), flows {speed(apart)} apart",) if p_e is not None else ()),
        *((f"CLLE at most {clle:.0f} m",) if clle is not None else ()),
        *((f"excitation {excitation:.2g} ({alike})",) if excitation is not None else ()),
        *((f"slip {slip:.2f}, side {side:.2f}",) if slip is not None and side is not None else ()),
    )
