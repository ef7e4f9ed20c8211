"""What speaks for and against a flag, how sure it is, what is usual, and what a pilot can check. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import degrees, hypot
from typing import Literal

from gliderwatch.estimation.constants import ROLL_STEP
from gliderwatch.messages.formatting import angle, clean, known, speed, utc
from gliderwatch.model import Assessment, Flag, Incident, Kind

# ----------------------------------------
# Numbers of a dive beside what is usual for the glider, in words.


@dataclass(frozen=True, slots=True)
class Wording:
    """How a number is told.

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
    """A number in words: ``departure`` in half widths of its range (above 1: outside), and whether it is
    ``telling`` of a glider that is not well."""

    text: str
    departure: float
    telling: bool


_DEGREES, _CC = degrees(1.0), 1e6
WORDINGS = (
    Wording("depth_rate_climb", "climbs at {} m/s", "slower", "faster", digits=2),
    Wording("roll_mean", "roll {} degrees", "to the left", "to the right", per=_DEGREES, signed=True),
    Wording("depth_rate_dive", "dives at {} m/s", "slower", "faster", digits=2),
    Wording("rate_ratio", "climbs {} times as fast as it dives", "less", "more", digits=2),
    Wording("pitch_climb", "pitch {} degrees climbing", "flatter", "steeper", per=_DEGREES),
    Wording("pitch_dive", "pitch {} degrees diving", "flatter", "steeper", per=_DEGREES),
    Wording(
        "pitch_asymmetry",
        "climb {} degrees steeper than dive",
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
    return [told for wording in WORDINGS if (told := _baseline_remark(evidence, wording)) is not None]


def has_usual(evidence: Mapping[str, float], *names: str) -> bool:
    """Whether what is usual is known for all of some numbers."""
    return all(known(evidence.get(f"{name}_usual")) is not None for name in names)


def _baseline_remark(evidence: Mapping[str, float], wording: Wording) -> BaselineRemark | None:
    """A number in words; None where it or its range is not known."""
    names = (wording.name, *(f"{wording.name}_{end}" for end in ("low", "usual", "high")))
    found = [known(evidence.get(name)) for name in names]
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
        return BaselineRemark(f"{words}, as usual ({span})", departure, False)
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
    return BaselineRemark(f"{words}, usually {span}: {word}", departure, wording.telling in ("both", side))


def _words(value: float, low: float, high: float, wording: Wording, digits: int) -> tuple[str, str]:
    """The value in its words, and the span that is usual."""
    numbers = [f"{round(number, digits) + 0.0:.{digits}f}" for number in (value, low, high)]
    return wording.words.format(numbers[0]), f"{numbers[1]} to {numbers[2]}"


# ----------------------------------------
# What speaks for and against a flag, how sure it is, and what a pilot can check. Pure.
#
# A remark points to one of three things: the ``glider`` (it really flies out of its range), the
# ``data`` (fix, compass, reference flow or sampling may mislead), or ``normal`` flight. For flag 1 the
# first speaks for it and the others against; for flag 2 it is the other way round. Numbers are held
# against what is usual for this glider where that is known (`messages.evidence`), else against fixed bounds.

# Bounds above (or below) which a number is worth a line; they change no flag.
MISFIT = 0.05  # m/s across the heading; a few mm/s to 2 cm/s when fixes, compass and current agree
ROLL_OF_ANY = 15.0  # degrees: unusual on any glider, for one whose usual roll is not known
PITCH_DIFFERENCE = 5.0  # degrees between dive and climb
RATE_RATIO = 1.5  # between descent and climb
STEADY = 0.98  # length of the mean heading vector
SHORT_DIVE = 1.0  # h
DRIFT = 0.5  # h
FIX_GAP = 15.0  # min
UNOBSERVED = 0.1  # h
SURE = 4.0  # standard errors beyond which a misfit is one
STRONG, USUAL, MINOR = 3.0, 0.5, 0.2  # weights of what decides, is as usual, is good to know; others: 1
LINES = 6  # on each side, for a phone


@dataclass(frozen=True, slots=True)
class Remark:
    """One sentence, what it points to, and how telling it is."""

    points_to: Literal["glider", "data", "normal"]
    text: str
    weight: float = 1.0


def weigh(assessment: Assessment, kind: Kind) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What speaks for and what against an incident of `kind`, from one dive: the most telling first."""
    found = sorted(remarks(assessment), key=lambda remark: -remark.weight)
    glider = tuple(r.text for r in found if r.points_to == "glider")[:LINES]
    other = tuple(r.text for r in found if r.points_to != "glider")[:LINES]
    return (other, glider) if kind is Kind.FALSE_ALARM else (glider, other)


def remarks(assessment: Assessment) -> list[Remark]:
    """All that can be said of one dive."""
    rules = (
        _verdict,
        _agreement,
        _closure,
        _along,
        _onboard,
        _before,
        _usual,
        _roll,
        _pitch,
        _rates,
        _reference,
        _coverage,
    )
    notes = [Remark("data", f"data: {clean(note)}", MINOR) for note in assessment.notes]
    return [remark for rule in rules for remark in rule(assessment)] + notes


def out_of_range(assessment: Assessment, value: float | None) -> bool:
    """Whether a speed (m/s) is known and outside the glider's normal range."""
    value = known(value)
    return value is not None and not assessment.speed_min <= value <= assessment.speed_max


def difference(assessment: Assessment) -> float | None:
    """Length of learnt flow less reference flow (m/s), None where one of them is missing."""
    a = assessment
    u, v, ru, rv = (known(x) for x in (a.flow_u, a.flow_v, a.reference_u, a.reference_v))
    return None if u is None or v is None or ru is None or rv is None else hypot(u - ru, v - rv)


def _number(assessment: Assessment, name: str) -> float | None:
    return known(assessment.evidence.get(name))


def _verdict(a: Assessment) -> list[Remark]:
    """What the estimator itself says of a flagged dive."""
    side: dict[int | None, Literal["glider", "data"]] = {Flag.ANOMALY: "glider", Flag.FALSE_ALARM: "data"}
    if not a.reason or a.flag not in side:
        return []
    return [Remark(side[a.flag], clean(a.reason), 2 * STRONG)]


def _usual(a: Assessment) -> list[Remark]:
    """Numbers against what is usual for this glider."""
    return [
        Remark("glider", told.text, min(told.departure, STRONG) + 1)
        if told.telling
        else Remark("normal", told.text, USUAL if told.departure <= 1 else 1.0)
        for told in usual(a.evidence)
    ]


def _agreement(a: Assessment) -> list[Remark]:
    p_e, apart = known(a.p_e), difference(a)
    if p_e is None or apart is None:
        return []
    agree = p_e <= a.gamma_f
    words = f"learnt flow and reference {'agree' if agree else 'disagree'}: {speed(apart)} apart"
    weight = 1.0 if agree else STRONG
    return [Remark("glider" if agree else "data", f"{words}, p_E {p_e:.3f} (limit {a.gamma_f:.3f})", weight)]


def _closure(a: Assessment) -> list[Remark]:
    misfit = _number(a, "across_misfit")
    if misfit is None:
        return []
    if abs(misfit) > _limit(a):
        cause = "reference current, compass or a fix is wrong, which a slow glider cannot cause"
        words = f"across the heading the track misses by {speed(abs(misfit))}: {cause}"
        return [Remark("data", words, STRONG)]
    words = f"fixes, compass and current fit together: {speed(abs(misfit))} misfit across the heading"
    return [Remark("glider", words, MINOR)]


def _limit(a: Assessment) -> float:
    """The misfit (m/s) that chance does not explain."""
    return max(MISFIT, SURE * (_number(a, "across_sigma") or 0.0))


def _along(a: Assessment) -> list[Remark]:
    value, misfit = _number(a, "along_speed"), _number(a, "across_misfit")
    if value is None or (misfit is not None and abs(misfit) > _limit(a)):
        return []
    return [_speed_remark(a, value, "ground velocity less current gives {} along the heading")]


def _onboard(a: Assessment) -> list[Remark]:
    value = _number(a, "onboard_speed")
    return [] if value is None else [_speed_remark(a, value, "the glider itself reports {}")]


def _speed_remark(a: Assessment, value: float, words: str) -> Remark:
    if out_of_range(a, value):
        return Remark("glider", f"{words.format(speed(value))}, out of the normal range", STRONG)
    return Remark("normal", f"{words.format(speed(value))}, within the normal range", STRONG)


def _before(a: Assessment) -> list[Remark]:
    before, now = _number(a, "speed_before"), known(a.speed)
    if before is None or now is None or not out_of_range(a, now):
        return []
    if out_of_range(a, before):
        return [Remark("glider", f"the dive before was out of range too: {speed(before)}")]
    return [Remark("glider", f"the dive before was normal: {speed(before)}, then {speed(now)}")]


def _roll(a: Assessment) -> list[Remark]:
    roll = _number(a, "roll_mean")
    if roll is None or abs(degrees(roll)) <= ROLL_OF_ANY or has_usual(a.evidence, "roll_mean"):
        return []
    return [
        Remark(
            "glider",
            f"mean roll {angle(roll)}, more than {ROLL_OF_ANY:.0f}: a lost wing or a load on one side",
        )
    ]


def _pitch(a: Assessment) -> list[Remark]:
    down, up = _number(a, "pitch_dive"), _number(a, "pitch_climb")
    if has_usual(a.evidence, "pitch_asymmetry") or down is None or up is None:
        return []
    if abs(degrees(abs(down) - abs(up))) <= PITCH_DIFFERENCE:
        return []
    return [Remark("glider", f"pitch differs between dive ({angle(down)}) and climb ({angle(up)})")]


def _rates(a: Assessment) -> list[Remark]:
    down, up = _number(a, "depth_rate_dive"), _number(a, "depth_rate_climb")
    if not down or not up or has_usual(a.evidence, "rate_ratio"):
        return []
    down, up = abs(down), abs(up)
    if max(down, up) / min(down, up) <= RATE_RATIO:
        return []
    return [Remark("glider", f"dives at {speed(down)} but climbs at {speed(up)} (vertical)")]


def _reference(a: Assessment) -> list[Remark]:
    if known(a.reference_u) is None or known(a.reference_v) is None:
        return [Remark("data", "no reference flow for this dive")]
    if not a.reference_final:
        return [
            Remark("data", "the reference current is provisional: its final value comes with a later file")
        ]
    return []


def _coverage(a: Assessment) -> list[Remark]:
    """Sampling of the dive: how much of it the numbers rest on."""
    lines: tuple[tuple[str, Callable[[float], bool], str], ...] = (
        (
            "heading_steadiness",
            lambda x: x > STEADY,
            "heading hardly changed (steadiness {:.2f}): a slow glider looks like a head current",
        ),
        ("duration_h", lambda x: x < SHORT_DIVE, "short dive ({:.1f} h): errors of the fixes weigh more"),
        ("unobserved_h", lambda x: x > UNOBSERVED, "{:.1f} h of the dive are missing from the data"),
        ("fix_gap_minutes", lambda x: x > FIX_GAP, "{:.0f} min between surfacing and fix"),
        ("drift_h", lambda x: x > DRIFT, "{:.1f} h of surface drift between the fixes"),
    )
    values = ((_number(a, name), worth, words) for name, worth, words in lines)
    return [Remark("data", words.format(x)) for x, worth, words in values if x is not None and worth(x)]


def how_sure(assessment: Assessment, dives: int) -> str:
    """What the result rests on, in numbers; `dives` are the flagged ones in a row (0: not told)."""
    a = assessment
    parts = []
    value, sigma = known(a.speed), _number(a, "speed_sigma")
    if value is not None and sigma is not None:
        parts.append(f"{value:.2f} ± {sigma:.2f} m/s")
    if dives:
        parts.append("first flagged dive" if dives == 1 else f"{dives} flagged dives in a row")
    if known(a.reference_u) is not None:
        parts.append(f"reference current {'final' if a.reference_final else 'provisional'}")
    hours = _number(a, "duration_h")
    parts.append(f"{a.n_samples} samples" + (f" in {hours:.1f} h" if hours is not None else ""))
    clle = known(a.clle_max)
    if clle is not None:
        parts.append(f"learner within {clle:.0f} m of the track")
    excitation = known(a.excitation)
    if excitation is not None:
        parts.append(f"excitation {excitation:.2g} (near 0: speed and flow cannot be told apart)")
    return "; ".join(parts)


def checks(incident: Incident, assessment: Assessment) -> tuple[str, ...]:
    """Three to five things a pilot can look at now, with this dive's numbers."""
    if incident.kind is Kind.FALSE_ALARM:
        return _check_reference(incident)
    value = known(assessment.speed)
    fast = value is not None and value > assessment.speed_max
    return _check_fast(assessment) if fast else _check_slow(incident, assessment)


def _here(*parts: str) -> str:
    told = [part for part in parts if part]
    return f" (this dive: {', '.join(told)})" if told else ""


def _beside_usual(a: Assessment, name: str, words: str, form: Callable[[float], str]) -> str:
    value = _number(a, name)
    return "" if value is None else words.format(form(value))


def _check_slow(incident: Incident, a: Assessment) -> tuple[str, ...]:
    roll = _here(_beside_usual(a, "roll_mean", "mean {}", angle))
    rates = _here(
        _beside_usual(a, "depth_rate_climb", "climbs at {}", lambda x: speed(abs(x))),
        _beside_usual(a, "depth_rate_dive", "dives at {}", speed),
    )
    pitch = _here(
        _beside_usual(a, "pitch_dive", "{} diving", angle),
        _beside_usual(a, "pitch_climb", "{} climbing", angle),
    )
    depth = _here(_beside_usual(a, "depth_max", "{} m", lambda x: f"{x:.0f}"))
    return (
        f"Roll: a step above {_DEGREES * ROLL_STEP:.0f} degrees since the dives before is a lost wing or a "
        f"load{roll}",
        f"Climb time at full ballast or oil volume: slow means drag or weight (remora, net, growth){rates}",
        f"Pitch in dive against climb, and the battery position it takes{pitch}",
        f"Depth reached against depth commanded, and altitude: bottom contact or entanglement{depth}",
        f"Vacuum, leak detection and power use since {utc(incident.since)}",
    )


def _check_fast(a: Assessment) -> tuple[str, ...]:
    pitch = _here(
        _beside_usual(a, "pitch_dive", "{} diving", angle),
        _beside_usual(a, "pitch_climb", "{} climbing", angle),
    )
    return (
        "Thruster: was it on? The normal range may be one for gliding only",
        f"Does the range of {a.speed_min:.2f} to {a.speed_max:.2f} m/s fit this mission's pitch and ballast?",
        f"Pitch and ballast commands changed since the dives before{pitch}",
        "Current of this dive against the dives before: a wrong current passes for speed",
    )


def _check_reference(incident: Incident) -> tuple[str, ...]:
    return (
        "Current of this dive against the dives before and after: a jump is a wrong current",
        f"Log since {utc(incident.since)}: a mission restart, abort or lost fix makes the current wrong",
        "Fixes before and after the dive: a repeated or jumping position",
        "Compass: heading against the course steered, and magnetic declination",
        "Take the speed for unknown until flow and reference agree; if they do not, check roll and climb",
    )
