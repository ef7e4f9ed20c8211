"""The likeliest cause of an incident by the evidence of a dive, what would fit it, and what to do. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, hypot

from gliderwatch.estimation.modes import MODES
from gliderwatch.estimation.modes import Cause as Explanation
from gliderwatch.estimation.verdict import FASTER, NEW_FASTER, Blame
from gliderwatch.messages.baseline import BaselineRemark, usual
from gliderwatch.messages.constants import HIDDEN, MISFIT, ROLL_OF_ANY, SURE
from gliderwatch.messages.formatting import angle, finite, speed
from gliderwatch.model import Assessment, Kind


@dataclass(frozen=True, slots=True)
class Cause:
    """``words`` in a sentence and ``short`` in a title; names of numbers that are ``off`` their usual range
    or ``usual`` where it is the cause; ``do``: what to do then, three lines at most."""

    words: str
    short: str
    do: tuple[str, ...]
    off: tuple[str, ...] = ()
    usual: tuple[str, ...] = ()


_COMMANDS = ("pitch_dive", "pitch_climb", "ballast_dive", "ballast_climb")
_RATES = ("depth_rate_climb", "depth_rate_dive")
_SOONER = "Ask for the next surfacing sooner."
WING = Cause(
    "a lost or bent wing",
    "lost wing?",
    (
        "Plot roll and fin: a step since the dives before is a lost wing or a load on one side.",
        "Command a turn: the loss turns with the glider; a wrong current does not.",
        "Plan the recovery: it flies and steers worse, and can not be trimmed well.",
    ),
    off=("roll_mean",),
    usual=_RATES,
)
DRAG = Cause(
    "drag (remora, net or growth)",
    "drag?",
    (
        "Climb at full ballast or oil volume and compare the rate with the first dives.",
        "Drag that comes at once is a remora or a net; deeper dives or a stop at depth can shed a remora.",
        "Give it more pitch and volume, and more time to the waypoint.",
    ),
    off=(*_RATES, "yos_per_hour", "duration_h"),
    usual=("roll_mean", "pitch_dive", "pitch_climb"),
)
HEAVY = Cause(
    "a heavier glider (load, net, or water inside)",
    "heavier?",
    (
        "Look at vacuum and leak detectors now: water inside climbs slowly as well.",
        "Raise the climb volume, and see that it comes up.",
        _SOONER,
    ),
    off=("depth_rate_climb", "rate_ratio", "ballast_climb", "vacuum"),
    usual=("roll_mean",),
)
TRIM = Cause(
    "another way of flying (pitch or ballast)",
    "trim?",
    (
        "Was it you (pitch, ballast, battery position)? Then set normal_speed, or do nothing.",
        "If not, compare commanded and measured pitch and volume: a pump or battery motor may fail.",
        "Check depth reached against depth commanded.",
    ),
    off=_COMMANDS,
    usual=("roll_mean",),
)
GROWTH = Cause(
    "growth, or a small load",
    "growth?",
    (
        "Compare the rates of climb and dive with those of the first days.",
        "Give it more pitch or volume if it makes too little way.",
        "Nothing is urgent unless the speed goes on falling.",
    ),
    off=_RATES,
    usual=("roll_mean",),
)
UNCLEAR = Cause(
    "not clear",
    "",
    (
        "Plot roll, pitch, rates of climb and dive, and depth reached, and look for a step.",
        "Look at vacuum and leak detectors.",
        _SOONER,
    ),
    off=("roll_mean", *_RATES),
)
FAST = Cause(
    "thruster, pitch or ballast, or a wrong current",
    "",
    (
        "Was the thruster on, or did you change pitch or ballast? Then set normal_speed.",
        "If not, compare the current of this dive with those before: a wrong one passes for speed.",
    ),
    off=_COMMANDS,
)
_WAIT = "After a restart or an abort: nothing, wait for one more dive."
_MEANWHILE = "Until it ends judge the glider by roll, pitch and rates of climb."
CURRENT = Cause(
    "the current that the glider reckons is wrong",
    "current wrong",
    (_WAIT, "Else see whether the mission fell back, or the GPS lost its fix.", _MEANWHILE),
)
COMPASS = Cause(
    "the compass or the declination is wrong",
    "compass wrong",
    ("Compare heading and course steered.", "Check the declination in autoexec.mi.", _MEANWHILE),
)
CURRENT_OR_COMPASS = Cause(
    "the current or the compass is wrong, not yet clear which",
    "current or compass wrong",
    (_WAIT, "Command another course: a wrong current stays, a wrong compass turns with it.", _MEANWHILE),
)
FIXES = Cause(
    "fixes or headings are wrong",
    "fixes or compass wrong",
    ("Look for a fix that repeats or jumps.", "Compare heading and course steered.", _MEANWHILE),
)
DRIVEN = Cause(
    "the current is wrong, or it is driven harder",
    "current wrong?",
    (
        "Was the thruster on, or did you change pitch or ballast? Then wait for three dives.",
        "If not: after a restart or an abort the current is often wrong, wait for one more dive.",
    ),
)
FLOW = Cause(
    "the current estimated here and that of the glider differ",
    "current wrong?",
    (_WAIT, "Else look at fixes and compass.", _MEANWHILE),
)


@dataclass(frozen=True, slots=True)
class Likely:
    """The likeliest cause, and the one ``fact`` that points to it (empty: none does)."""

    cause: Cause
    fact: str


def likeliest(kind: Kind, a: Assessment) -> Likely:
    """What a dive says is the likeliest cause of an incident of a kind."""
    if kind is Kind.FALSE_ALARM:
        return _of_disagreement(a)
    value = finite(a.speed)
    if value is not None and value > a.speed_max:
        return Likely(FAST, "")
    off = {remark.name: remark for remark in usual(a.evidence) if remark.side != "none"}
    return _of_rates(off) or _of_roll(a, off) or _of_commands(off) or _of_the_way(a) or _of_size(a)


_SURE_REASONS: dict[str, Cause] = {
    Blame.CURRENT: CURRENT,
    Blame.COMPASS: COMPASS,
    Blame.UNCLEAR: CURRENT_OR_COMPASS,
    FASTER: DRIVEN,
    NEW_FASTER: DRIVEN,
    **{m.words: CURRENT if m.cause is Explanation.CURRENT else FIXES for m in MODES if m.words},
}
"""The cause that the estimator names itself."""


def difference(assessment: Assessment) -> float | None:
    """Length of the estimated current less the glider's (m/s), None where one of them is missing."""
    a = assessment
    u, v, ru, rv = (finite(x) for x in (a.flow_u, a.flow_v, a.reference_u, a.reference_v))
    return None if u is None or v is None or ru is None or rv is None else hypot(u - ru, v - rv)


def misfit_limit(a: Assessment) -> float:
    """The misfit (m/s) that chance does not explain."""
    return max(MISFIT, SURE * (finite(a.evidence.get("across_sigma")) or 0.0))


def is_named(reason: str) -> bool:
    """Whether the words of the estimator are those of a cause or of the title, and need not be repeated."""
    return reason in _SURE_REASONS or reason in ("slower than normal", "faster than normal")


def _of_disagreement(a: Assessment) -> Likely:
    across = finite(a.evidence.get("across_misfit"))
    side, sigma = finite(a.evidence.get("side")), finite(a.evidence.get("side_sigma"))
    cause = _SURE_REASONS.get(a.reason)
    if cause is None and side is not None and sigma is not None and abs(side) > 3 * sigma:
        return Likely(COMPASS, f"it makes {100 * abs(side):.0f} % of its speed across its heading")
    if cause is DRIVEN:
        return Likely(cause, "")
    if across is not None and abs(across) > misfit_limit(a):
        return Likely(cause or FLOW, f"the track misses by {speed(abs(across))} across the heading")
    apart = difference(a)
    if apart is not None and a.p_e is not None and a.p_e > a.gamma_f:
        return Likely(cause or FLOW, f"reckoned and estimated current are {speed(apart)} apart")
    return Likely(cause or FLOW, "")


def _of_rates(off: dict[str, BaselineRemark]) -> Likely | None:
    """Both rates slow: drag. The climb alone: weight."""
    slow = [name for name in _RATES if name in off and off[name].telling and _is_slower(off[name])]
    if "depth_rate_climb" not in slow:
        return None
    return Likely(DRAG if len(slow) > 1 else HEAVY, off["depth_rate_climb"].text)


def _is_slower(remark: BaselineRemark) -> bool:
    return remark.side == "less"


def _of_roll(a: Assessment, off: dict[str, BaselineRemark]) -> Likely | None:
    if "roll_mean" in off:
        return Likely(WING, off["roll_mean"].text)
    roll = finite(a.evidence.get("roll_mean"))
    if roll is None or abs(degrees(roll)) <= ROLL_OF_ANY or "roll_mean_usual" in a.evidence:
        return None
    return Likely(WING, f"roll {angle(roll)}")


def _of_commands(off: dict[str, BaselineRemark]) -> Likely | None:
    found = [off[name] for name in _COMMANDS if name in off]
    return Likely(TRIM, max(found, key=lambda r: r.departure).text) if found else None


def _of_the_way(a: Assessment) -> Likely | None:
    """Slower through the water than the glider believes: what it believes knows nothing of a lost wing."""
    believed = finite(a.evidence.get("own_speed", a.evidence.get("onboard_speed")))
    value = finite(a.speed)
    if believed is None or value is None or believed - value <= HIDDEN * believed or believed < a.speed_min:
        return None
    return Likely(WING, f"it believes to make {speed(believed)}")


def _of_size(a: Assessment) -> Likely:
    value = finite(a.speed)
    is_small = value is not None and value >= a.speed_min
    return Likely(GROWTH if is_small else UNCLEAR, "small, over several dives" if is_small else "")
