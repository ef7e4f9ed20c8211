"""What is normal for a glider, and what a dive says of it: the joint estimator with its tests. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from math import degrees, inf, nan
from statistics import median

import numpy as np

from gliderwatch.estimation import kalman
from gliderwatch.estimation.constants import (
    AGREE,
    BASELINE_LEAST,
    CLEARLY,
    COMPASS_OFF,
    CONFIDENCE,
    DEPARTURE,
    ENOUGH,
    EXPLAINED,
    GATE,
    HIDDEN,
    LEAST_ACROSS,
    MISFITS_KEPT,
    OWN_SURE,
    RATIO_SURE,
    RETRIMMED,
    ROLL_CONFIRMS,
    ROLL_LOST,
    ROLL_STAYS,
    ROLL_STEP,
    SLACK,
    TURNED,
    USUAL_DIVE,
    USUAL_PITCH,
    VAGUE,
)
from gliderwatch.estimation.dive_measurement import slip_at
from gliderwatch.estimation.kalman import JointInfo, JointParams, JointState
from gliderwatch.estimation.kinematic_speed import KinematicSpeed, Ratios, kinematic_speed
from gliderwatch.estimation.kinematic_speed import learn as learn_ratios
from gliderwatch.estimation.modes import LOST, ROLLED, Cause
from gliderwatch.estimation.speed_range import (
    Drive,
    Normal,
    RangeParams,
    SpeedRange,
    drive,
    learn,
    renewed,
    speed_range,
)
from gliderwatch.estimation.step_test import cusum, cusum_bound
from gliderwatch.model import Array, Dive, Flag, replace

# ----------------------------------------
# Do the fixes, the compass and the current of a dive agree, and who is wrong if they do not? Pure.
#
# Ground velocity minus current is the way that the glider believes to have made through the water: along its
# heading, at any speed. What is left across the heading has no other cause than a measurement that is
# wrong: the current, the fixes, or the headings (compass, declination). A current that is wrong on many dives
# alike stays where it is when the glider turns; a heading that is wrong turns with it.


class Blame(StrEnum):
    """What is wrong."""

    CURRENT = "the current is wrong"
    COMPASS = "the compass or the declination is wrong"
    UNCLEAR = "the current or the compass is wrong, it cannot be told which"


@dataclass(frozen=True, slots=True)
class Misfit:
    """One dive: ``rest`` is ground velocity minus current (m/s, (2,): east, north), ``along`` its part
    along the heading, ``across`` that across it, left positive, with its standard error ``sigma`` (m/s);
    ``heading`` (rad, counter-clockwise from east) the direction of the mean heading vector."""

    along: float
    across: float
    sigma: float
    heading: float

    @property
    def ratio(self) -> float:
        """The part across in standard errors."""
        return self.across / self.sigma


def misfit(rest: Array, heading: Array, across: tuple[float, float]) -> Misfit:
    """The misfit of a dive: ``rest`` (m/s, (2,)) and mean ``heading`` vector ((2,)), east and north."""
    length = math.hypot(*heading)
    return Misfit(
        along=float(rest @ heading) / length,
        across=across[0],
        sigma=across[1],
        heading=math.atan2(heading[1], heading[0]),
    )


def disagrees(each: Misfit, gate: float, least: float) -> bool:
    """Whether what is across is more than ``gate`` standard errors, and more than ``least`` (m/s).

    >>> disagrees(Misfit(along=0.3, across=0.1, sigma=0.01, heading=0.0), gate=4.0, least=0.05)
    True
    """
    return abs(each.across) > max(gate * each.sigma, least)


def blame(history: tuple[Misfit, ...], gate: float, least: float) -> Blame:
    """Who is wrong on the last of some dives, oldest first; the last one `disagrees`.

    A current is wrong on single dives; a compass that was right before and is right after would be strange.
    Dives in a row that disagree are held against both explanations.
    """
    row = []
    for each in reversed(history):
        if not disagrees(each, gate, least):
            break
        row.append(each)
    if len(row) < 2:
        return Blame.CURRENT if len(history) > 1 else Blame.UNCLEAR
    angles = np.array([each.heading for each in row])
    if np.abs(np.angle(np.exp(1j * (angles[:, None] - angles)))).max() < TURNED:
        return Blame.UNCLEAR
    turned, shifted = _chi_squares(row, angles)
    if shifted + 2 < turned - CLEARLY:
        return Blame.CURRENT
    return Blame.COMPASS if turned < shifted + 2 - CLEARLY else Blame.UNCLEAR


def _chi_squares(row: list[Misfit], angles: Array) -> tuple[float, float]:
    """What is left of the misfits by one turn of all headings (a number), and by one error of all currents
    (two numbers): sums of squares in standard errors."""
    across, sigma = np.array([each.across for each in row]), np.array([each.sigma for each in row])
    along = np.array([[each.along] for each in row])
    aside = np.column_stack([-np.sin(angles), np.cos(angles)])
    return _left(along, across, sigma), _left(aside, across, sigma)


def _left(shape: Array, across: Array, sigma: Array) -> float:
    scaled = shape / sigma[:, None]
    fitted = scaled @ np.linalg.lstsq(scaled, across / sigma)[0]
    return float(np.sum((across / sigma - fitted) ** 2))


# ----------------------------------------
# What is normal for a glider, and what a dive says of it: the joint estimator with its tests. Pure.
#
# Flag 2: a measurement is wrong. Flag 1: the glider is slower than normal (or faster than configured), at
# once or by evidence over several dives. No flag: its speed cannot be known from this dive, and why.

MONTH = 30 * 86400.0
"""s"""
NOT_SEEN = "it turned, and its heading is not in the file: the speed cannot be told"
SLOW_OR_TURNED = "slow, or it turned while its heading was not seen: the next dive will tell"
FASTER = "faster than ever: the current is wrong, or it is driven harder"
NEW_FASTER = "faster than before: a new way of flying, or the current is wrong: the next dives will tell"
NEW_SLOWER = "slower than before, after a change of pitch or ballast: the next dives will tell"
NEW_WAY = "flies in a new way for three dives: "
Trim = tuple[float | None, ...]
"""What a pilot chooses of a dive: pitch diving and climbing (rad), volume pumped diving and climbing (m3)."""


@dataclass(frozen=True, slots=True)
class SpeedParams:
    """How speed is judged.

    ``low`` and ``high`` (m/s) are the configured normal range; ``learning`` how another is learnt that takes
    its place (None: not at all). ``confidence`` is by how many standard errors a speed must be outside;
    ``gate`` (standard errors) and ``least`` (m/s) are of the test across the heading; ``vague`` is the
    standard error, as part of the usual speed, above which a dive says nothing; ``turned`` (rad) the
    least error of a compass that is reported.
    """

    joint: JointParams = JointParams()
    low: float = 0.15
    high: float = 0.75
    learning: RangeParams | None = RangeParams()
    confidence: float = CONFIDENCE
    gate: float = GATE
    least: float = LEAST_ACROSS
    vague: float = VAGUE
    turned: float = COMPASS_OFF


@dataclass(frozen=True, slots=True)
class SpeedState:
    """What is known after a dive.

    ``filter``, the Kalman filter's (None: no dive yet), ``normal`` speeds learnt, ``rolls`` (rad) of the
    first healthy dives, ``rolled`` dives in a row that roll otherwise, ``slow`` Page's sum of small losses,
    ``was_slow`` whether the dive before was slow, surely or in doubt, ``misfits`` of the last dives,
    ``ratios`` of the speed to what the glider tells of it; ``trim`` of the last normal dive, ``other`` speeds
    (m/s) of the last dives in a row that may be a new way of flying.
    """

    filter: JointState | None = None
    normal: Normal = Normal()
    rolls: tuple[float, ...] = ()
    rolled: int = 0
    slow: float = 0.0
    was_slow: bool = False
    misfits: tuple[Misfit, ...] = ()
    ratios: Ratios = Ratios()
    trim: Trim = ()
    other: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a dive says: ``flag`` (None: nothing) with the ``reason`` in words, the ``normal`` range used, and
    what was found (``info``, None: the dive has no track). ``by_reckoning``: the speed through the water
    (m/s) and its standard error by depth rate and pitch, where these alone decided. ``before``: what was the
    usual speed (m/s) until this dive made another one normal."""

    flag: Flag | None
    reason: str
    normal: SpeedRange
    info: JointInfo | None
    by_reckoning: tuple[float, float] | None = None
    before: float | None = None


def step(
    state: SpeedState, dive: Dive, params: SpeedParams, frozen: bool = False
) -> tuple[SpeedState, Verdict]:
    """The state after one more dive, and the verdict on it.

    ``frozen``: an incident is open, so that nothing is learnt of what is normal.
    """
    at = drive(dive.features)
    of_dives = speed_range(state.normal, at, params.learning or RangeParams())
    learnt = of_dives if params.learning else None
    normal = learnt or SpeedRange(params.low, (params.low + params.high) / 2, params.high, 0)
    roll = _roll_step(state, dive)
    rolled = state.rolled + 1 if roll > ROLL_STEP else 0
    usual = of_dives.usual if of_dives else None  # whatever the bounds are: a speed means one thing
    # the first of two dives may have been half over when it happened
    hint = (LOST if roll > ROLL_LOST else ROLLED) if 1 <= rolled <= 2 else None
    kinematic = kinematic_speed(state.ratios, dive.features)
    estimate, info = kalman.step(state.filter, dive, params.joint, usual, hint, kinematic, roll < ROLL_STAYS)
    if info is None:
        flag, reason = _of_reckoning_alone(state, dive, kinematic, normal, params)
        return state, Verdict(flag, reason, normal, None)
    state = replace(state, filter=estimate, rolled=rolled, misfits=_misfits(state, info))
    flag, reason = _wrong(state, info, params)
    if flag is None and not reason:
        state, flag, reason = _slow_or_fast(state, info, kinematic, normal, params)
    # a course that was not steady looks slow: where no heading is known at all depth rate and pitch decide
    assumed = flag is Flag.ANOMALY and dive.features.heading_assumed and kinematic is not None
    if (flag is None and info.seen.is_free) or assumed:
        reason = NOT_SEEN if assumed else reason
        flag, reason = _by_reckoning(reason, state, kinematic, normal, params)
        if flag is not None and kinematic is not None:
            return state, Verdict(flag, reason, normal, info, _reckoned(kinematic, params))
    earlier = normal
    state, flag, reason, normal = _regime(state, dive, info, kinematic, normal, flag, reason, params)
    before = earlier.usual if reason.startswith(NEW_WAY) else None
    if flag is Flag.NORMAL and not frozen and not state.other:
        state = _learnt(state, dive, info, at, normal, params)
    # where the way hardly shows the speed, it is depth rate and pitch that a new way of flying is seen by
    is_hidden = before is not None and info.estimate.speed < normal.low
    reckoned = _reckoned(kinematic, params) if is_hidden and kinematic is not None else None
    return state, Verdict(flag, reason, normal, info, reckoned, before)


def _reckoned(kinematic: KinematicSpeed, params: SpeedParams) -> tuple[float, float]:
    """The speed through the water and its standard error (m/s) by depth rate and pitch alone."""
    left = 1 - _usual_slip(params)
    return kinematic.speed * left, kinematic.sigma * left


def _regime(
    state: SpeedState,
    dive: Dive,
    info: JointInfo,
    kinematic: KinematicSpeed | None,
    normal: SpeedRange,
    flag: Flag | None,
    reason: str,
    params: SpeedParams,
) -> tuple[SpeedState, Flag | None, str, SpeedRange]:
    """What the flag is of a dive out of its range that may be flown in a new way, and the state with that.

    A faster glider is no fault: three dives at one speed, which depth rate and pitch do not deny, are a new
    way of flying with a range of its own. A slower one is that only where the pilot changed pitch or ballast.
    Where the way between the fixes hardly shows the speed, depth rate and pitch show it alone.
    """
    speed, learning = info.estimate.speed, params.learning
    faster = reason == FASTER
    if flag is Flag.FALSE_ALARM and not faster:
        return state, flag, reason, normal  # it says nothing of the way of flying
    has_turned = flag is None and reason in (NOT_SEEN, SLOW_OR_TURNED)
    is_vague = info.estimate.own_sigma > OWN_SURE * normal.usual or has_turned
    if is_vague and not faster and kinematic is not None and kinematic.is_prompt:
        speed = kinematic.speed * (1 - _usual_slip(params))
    explained = speed > EXPLAINED * normal.usual and slowed(state.trim, _trim(dive))
    is_slow = flag is Flag.ANOMALY or has_turned or (is_vague and speed < normal.low)
    slower = is_slow and explained and kinematic is not None and (info.kinematic_fits or has_turned)
    if learning is None or not normal.dives or not (faster or slower):
        return (replace(state, other=()) if state.other else state), flag, reason, normal
    if faster and kinematic is not None and not info.kinematic_fits:
        return replace(state, other=()), flag, reason, normal
    row = (*(each for each in state.other if abs(each / speed - 1) < AGREE), speed)
    if len(row) < ENOUGH:
        if flag is Flag.NORMAL:
            return replace(state, other=row), flag, reason, normal
        return replace(state, other=row), None, NEW_FASTER if faster else NEW_SLOWER, normal
    at = drive(dive.features)
    state = replace(state, normal=renewed(state.normal, row, at), other=(), slow=0.0, was_slow=False)
    new = speed_range(state.normal, at, learning) or normal
    words = f"{NEW_WAY}{speed:.2f} m/s is its normal speed now, unless you say otherwise"
    return state, Flag.NORMAL, words, new


def _trim(dive: Dive) -> Trim:
    f = dive.features
    return (f.pitch_dive, f.pitch_climb, f.ballast_dive, f.ballast_climb)


def slowed(before: Trim, now: Trim) -> bool:
    """Whether what the pilot changed between two dives can have slowed the glider: pitch or ballast, but not
    where more of it is pumped.

    >>> slowed((-0.45, 0.45, None, None), (-0.35, 0.36, None, None))
    True
    >>> slowed((-0.45, 0.45, -250e-6, 260e-6), (-0.35, 0.36, -400e-6, 420e-6))
    False
    >>> slowed((), (-0.45, 0.45, None, None))
    False
    """
    volumes = zip(before[2:], now[2:], RETRIMMED[2:], strict=False)
    more = [(abs(b) - abs(a)) / least for a, b, least in volumes if a is not None and b is not None]
    if sum(more) > len(more):
        return False
    pairs = zip(before, now, RETRIMMED, strict=False)
    return any(a is not None and b is not None and abs(a - b) > least for a, b, least in pairs)


def _misfits(state: SpeedState, info: JointInfo) -> tuple[Misfit, ...]:
    """The misfits of the last dives with that of one more."""
    rest = info.seen.rest
    if rest is None or info.across is None:
        return state.misfits
    return (*state.misfits, misfit(rest, info.seen.heading, info.across))[-MISFITS_KEPT:]


def _wrong(state: SpeedState, info: JointInfo, params: SpeedParams) -> tuple[Flag | None, str]:
    """Flag 2 where a measurement is wrong; no flag with a reason where the dive says nothing of the speed."""
    if info.seen.current is None and not info.kinematic_fits:
        return None, "no depth-averaged current"
    if info.across is not None and disagrees(state.misfits[-1], params.gate, params.least):
        return Flag.FALSE_ALARM, str(blame(state.misfits, params.gate, params.least))
    if info.cause is Cause.GROUND and info.seen.is_free:
        return None, NOT_SEEN
    words = next((mode.words for mode in params.joint.modes if mode.cause is info.cause and mode.words), "")
    if words:
        return Flag.FALSE_ALARM, words
    side, sigma = info.estimate.side
    if abs(side) > max(params.turned, 3 * sigma):
        return Flag.FALSE_ALARM, f"the compass seems to be off by {degrees(abs(side)):.0f} degrees"
    return None, ""


def _of_reckoning_alone(
    state: SpeedState, dive: Dive, kinematic: KinematicSpeed | None, normal: SpeedRange, params: SpeedParams
) -> tuple[Flag | None, str]:
    """Flag 1 where a dive without track is slow by what the glider tells at once; else its reason."""
    return _by_reckoning(dive.reason, state, kinematic, normal, params)


def _by_reckoning(
    why: str, state: SpeedState, kinematic: KinematicSpeed | None, normal: SpeedRange, params: SpeedParams
) -> tuple[Flag | None, str]:
    """The flag that depth rate and pitch alone give, where the way says nothing because of ``why``."""
    if kinematic is None or not kinematic.is_prompt or state.filter is None or not normal.dives:
        return None, why
    # no course that was steered can look like this: the bound is wide because nothing else confirms it
    left, sigma = 1 - _usual_slip(params), params.confidence * kinematic.sigma
    if (kinematic.speed + 2 * sigma) * left < normal.low:
        return Flag.ANOMALY, f"slower than normal by depth rate and pitch alone ({why})"
    if (kinematic.speed - sigma / 2) * left > normal.low:
        return Flag.NORMAL, f"as fast as usual by depth rate and pitch alone ({why})"
    return None, why


def _slow_or_fast(
    state: SpeedState,
    info: JointInfo,
    kinematic: KinematicSpeed | None,
    normal: SpeedRange,
    params: SpeedParams,
) -> tuple[SpeedState, Flag | None, str]:
    """The flag that the speed gives, and the state with the sum of small losses and the doubts."""
    believed = kinematic if info.kinematic_fits else None
    sigma_own = min(info.single_sigma, believed.sigma if believed is not None else inf)
    if sigma_own > params.vague * normal.usual:
        return state, None, "the speed cannot be known: the glider turned too much"
    # what is common to all dives is also in a range that was learnt from them
    sigma = info.estimate.own_sigma if normal.dives else info.estimate.sigma
    sigma *= ROLL_CONFIRMS if state.rolled > 1 else params.confidence
    if info.estimate.speed + sigma < normal.low:
        # depth rate and pitch would be slow as well; where they are not sent a second dive has to be slow
        unseen = info.seen.is_free and (kinematic is not None or not state.was_slow)
        if believed is None and (unseen or (not state.was_slow and _may_have_turned(info, normal))):
            return replace(state, was_slow=True), None, SLOW_OR_TURNED
        return replace(state, was_slow=True), Flag.ANOMALY, _how_slow(info, normal, params)
    state = replace(state, was_slow=False) if state.was_slow else state
    if info.estimate.speed - sigma > normal.high:
        if normal.dives:
            return state, Flag.FALSE_ALARM, FASTER
        return state, Flag.ANOMALY, "faster than normal"
    return _small_losses(state, info, normal, params)


def _usual_slip(params: SpeedParams) -> float:
    """The part of W that a usual angle of attack takes."""
    return params.joint.slip * slip_at(USUAL_PITCH)


def _may_have_turned(info: JointInfo, normal: SpeedRange) -> bool:
    """Whether a turn back while no heading was seen explains a slow dive as well."""
    seen = 1 - 2 * info.seen.unseen
    return seen <= 0 or info.estimate.speed / seen >= normal.low


def _small_losses(
    state: SpeedState, info: JointInfo, normal: SpeedRange, params: SpeedParams
) -> tuple[SpeedState, Flag, str]:
    """Flag 1 where a loss too small for one dive has gone on for several; the state with the sum of it."""
    if not normal.dives or (info.seen.is_free and not info.kinematic_fits):
        return state, Flag.NORMAL, ""
    bound = cusum_bound(SLACK, MONTH / USUAL_DIVE / params.joint.alarms_per_month)
    found = info.estimate
    # a dive that hardly tells the speed adds little, and no dive alone is several
    departure = (1 - found.speed / normal.usual) / max(DEPARTURE, found.own_sigma / normal.usual)
    part = min((info.seen.end - info.seen.start) / USUAL_DIVE, 1.0)
    departure = min(departure, bound / 2 + SLACK)
    total = min(cusum(state.slow, part * departure, part * SLACK), bound + SLACK)
    if departure < SLACK / 2:
        total /= 2  # it flies as usual: what was slow is over soon
    state = replace(state, slow=total) if total != state.slow else state
    if total > bound:
        return state, Flag.ANOMALY, _how_slow(info, normal, params, "a little slow for several dives")
    return state, Flag.NORMAL, ""


def _how_slow(
    info: JointInfo, normal: SpeedRange, params: SpeedParams, words: str = "slower than normal"
) -> str:
    """Words for a speed below normal: that of the glider itself is, or it does not know of it."""
    believed = info.estimate.own_speed * (1 - params.joint.slip * info.seen.slip)
    hidden = believed - info.estimate.speed > HIDDEN * believed
    if hidden and believed >= (normal.low + normal.usual) / 2:
        return "slower through the water than the glider itself believes: a wing may be lost or bent"
    return words


def _roll_step(state: SpeedState, dive: Dive) -> float:
    """By how much (rad) the roll of a dive differs from the usual one; NaN, which is neither above nor below
    a bound, where either is not known."""
    roll = dive.features.roll_mean
    if roll is None or dive.n_samples < BASELINE_LEAST or len(state.rolls) < BASELINE_LEAST:
        return nan
    return abs(roll - median(state.rolls))


def _learnt(
    state: SpeedState, dive: Dive, info: JointInfo, at: Drive, normal: SpeedRange, params: SpeedParams
) -> SpeedState:
    """The state with what a normal dive teaches.

    One below the ``normal`` range, though not surely, teaches no speed: a loss that is half seen would
    become normal.
    """
    roll, rolls, ratios, speeds = dive.features.roll_mean, state.rolls, state.ratios, state.normal
    if roll is not None and len(rolls) < 3 * BASELINE_LEAST:
        rolls = (*rolls, roll)
    own = info.seen.own_speed()
    if own is not None and own[1] < RATIO_SURE * own[0]:
        ratios = learn_ratios(ratios, dive.features, own[0])
    # where a surfacing was not seen several dives are one, perhaps the short ones of a launch
    is_low = normal.dives and info.estimate.speed < normal.low
    if info.proven is None and not dive.features.surfacing_unseen and not is_low:
        before = state.filter.dives - 1 if state.filter else 0
        learning = params.learning or RangeParams()
        speeds = learn(speeds, info.estimate.speed, at, dive.features.duration, learning, before)
    return replace(state, rolls=rolls, ratios=ratios, normal=speeds, trim=_trim(dive))
