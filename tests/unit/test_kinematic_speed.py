"""The speed that a glider tells beside fixes and current, by itself and in the joint estimator."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.estimation.constants import RATIOS_FEW, RATIOS_KEPT
from gliderwatch.estimation.kinematic_speed import (
    KinematicSpeed,
    Ratios,
    kinematic_speed,
    learn,
    vertical,
)
from gliderwatch.estimation.modes import Cause
from gliderwatch.estimation.verdict import SpeedParams, SpeedState, step
from gliderwatch.model import DiveFeatures, Flag, readonly
from joint_support import HOUR, Way, mission, ways

PARAMS, NOTHING = SpeedParams(), SpeedState()
PITCH = 0.45
CIRCLE = tuple(np.linspace(0, 2 * math.pi, 24, endpoint=False))


def telling_dive(*args, **more):
    """The features of a dive that tells its speed, as `told`."""
    return DiveFeatures(**told(*args, **more))


def told(speed, ratio=1.17, pitch=PITCH, onboard=None):
    """What a glider tells that flies at a speed W (m/s). Its depth rate is a ratio too high, as on real ones;
    or it tells its mean speed ``onboard`` alone."""
    if onboard is not None:
        return {"onboard_speed": onboard, "duration": 3 * HOUR}
    rate = ratio * speed * math.tan(pitch)
    return {
        "depth_rate_dive": rate,
        "pitch_dive": -pitch,
        "depth_rate_climb": -rate,
        "pitch_climb": pitch,
        "duration": 3 * HOUR,
    }


def telling(dives, speeds, **more):
    """Dives that tell their speeds (m/s) too; None: no word of it."""
    return [
        dive if speed is None else replace(dive, features=replace(dive.features, **told(speed, **more)))
        for dive, speed in zip(dives, speeds, strict=True)
    ]


def run(dives, state=NOTHING):
    out = []
    for each in dives:
        state, verdict = step(state, each, PARAMS)
        out.append(verdict)
    return state, out


def halved(way):
    return replace(way, speed=0.5 * way.speed, own=0.5 * way.own)


def blinded(dive):
    """The second half of the headings is missing."""
    track = dive.track
    t, x = np.concatenate([track.t[:13], track.t[-1:]]), track.x[[*range(13), -1]]
    return replace(dive, track=replace(track, t=readonly(t), x=readonly(x), heading=track.heading[:13]))


# --------------------------------------------------------------------------- what is told


def test_vertical_speed_is_depth_rate_over_tangent():
    assert vertical(telling_dive(0.25, ratio=1.0)) == pytest.approx(0.25)


def test_ways_down_and_up_count_by_the_time_that_they_take():
    """100 m down in 500 s and up in 1000 s, at 0.4 rad: twice 100 m / tan 0.4 in 1500 s."""
    found = vertical(
        DiveFeatures(1500.0, depth_rate_dive=0.2, pitch_dive=-0.4, depth_rate_climb=-0.1, pitch_climb=0.4)
    )
    assert found == pytest.approx(2 * 100 / math.tan(0.4) / 1500)


@pytest.mark.parametrize(
    "change",
    [
        {"depth_rate_climb": None},
        {"pitch_dive": None},
        {"pitch_climb": 0.1},  # so flat that the tangent is mostly error
        {"depth_rate_dive": 0.0},
    ],
)
def test_no_vertical_speed_where_a_part_of_it_is_missing(change):
    features = DiveFeatures(**{**told(0.25), **change})
    assert vertical(features) is None
    assert kinematic_speed(Ratios(), features) is None


def test_ratio_is_a_guess_until_three_dives_tell():
    known, features = Ratios(), DiveFeatures(**told(0.25, ratio=1.3))
    for k in range(RATIOS_FEW):
        found = kinematic_speed(known, features)
        assert found.speed == pytest.approx(0.25 * 1.3 / 1.17), k
        assert found.sigma == pytest.approx(0.15 * found.speed)
        known = learn(known, features, 0.25)
    found = kinematic_speed(known, features)
    assert found == KinematicSpeed(pytest.approx(0.25), pytest.approx(0.07 * 0.25), 0.01, is_prompt=True)


def test_scatter_of_the_ratios_is_their_uncertainty():
    known = Ratios()
    for ratio in (0.9, 1.0, 1.1, 1.3, 1.2):
        known = learn(known, telling_dive(0.25, ratio=ratio), 0.25)
    found = kinematic_speed(known, telling_dive(0.25, ratio=1.1))
    assert found.speed == pytest.approx(0.25)
    assert found.sigma == pytest.approx(1.4826 * 0.1 * 0.25, rel=0.1)


def test_only_the_last_dives_count():
    known = Ratios()
    for k in range(2 * RATIOS_KEPT):
        known = learn(known, telling_dive(0.25, ratio=1.0 if k < RATIOS_KEPT else 1.3), 0.25)
    assert len(known.vertical) == RATIOS_KEPT
    assert kinematic_speed(known, telling_dive(0.25, ratio=1.3)).speed == pytest.approx(0.25)


def test_mean_of_the_glider_is_not_used_before_three_healthy_dives():
    known, features = Ratios(), DiveFeatures(**told(0.0, onboard=0.26))
    for _ in range(RATIOS_FEW):
        assert kinematic_speed(known, features) is None
        known = learn(known, features, 0.25)
    found = kinematic_speed(known, features)
    assert found == KinematicSpeed(pytest.approx(0.25), pytest.approx(0.12 * 0.25), 0.1, is_prompt=False)


def test_vertical_speed_comes_first():
    known = Ratios((1.0,) * RATIOS_FEW, (1.0,) * RATIOS_FEW)
    assert kinematic_speed(
        known, replace(telling_dive(0.25, ratio=1.0), onboard_speed=0.4)
    ).speed == pytest.approx(0.25)
    assert kinematic_speed(known, telling_dive(0.0, onboard=0.4)).speed == pytest.approx(0.4)


@pytest.mark.parametrize("speed", [0.0, -0.2])
def test_speed_that_cannot_be_tells_nothing_and_teaches_nothing(speed):
    features = DiveFeatures(**told(0.0, onboard=speed))
    assert kinematic_speed(Ratios(onboard=(1.0,) * RATIOS_FEW), features) is None
    assert learn(Ratios(), features, 0.25) == Ratios()


def test_short_dive_tells_nothing_and_teaches_nothing():
    """Its turns and the surface take too much of the time."""
    short = replace(telling_dive(0.25), duration=0.4 * HOUR)
    assert kinematic_speed(Ratios(), short) is None
    assert learn(Ratios(), replace(short, duration=0.9 * HOUR), 0.25) == Ratios()


# --------------------------------------------------------------------------- in the estimator


def test_healthy_dives_teach_the_ratio():
    state, verdicts = run(telling(mission(ways(10, 1, lambda k: 0.7 * k)), [0.25] * 10))
    assert [v.info.kinematic_fits for v in verdicts] == [True] * 10
    assert np.median(state.ratios.vertical) == pytest.approx(1 / 1.17, rel=0.03)
    assert state.ratios.onboard == ()


@pytest.mark.parametrize(("depth_rate", "first"), [("as seen", Flag.ANOMALY), ("none", None)])
def test_halved_depth_rate_makes_a_doubted_slow_dive_believed(depth_rate, first):
    """Without it the glider may have turned back while no heading was seen: the next dive has to tell."""
    made = ways(16, 8, lambda k: 0.3)
    dives = mission([halved(w) if k >= 14 else w for k, w in enumerate(made)])
    dives = [blinded(d) if k >= 14 else d for k, d in enumerate(dives)]
    speeds = [0.25] * 14 + [0.125] * 2 if depth_rate == "as seen" else [None] * 16
    _, verdicts = run(telling(dives, speeds))
    assert verdicts[14].flag is first
    assert verdicts[15].flag is Flag.ANOMALY


def test_full_depth_rate_denies_a_slow_dive():
    """It turned back where no heading was seen: ground velocity or heading is wrong, not the glider."""
    made = ways(16, 8, lambda k: 0.3)
    dives = mission([halved(w) if k == 14 else w for k, w in enumerate(made)])
    dives = [blinded(d) if k == 14 else d for k, d in enumerate(dives)]
    _, verdicts = run(telling(dives, [0.25] * 16))
    assert verdicts[14].flag is not Flag.ANOMALY
    assert verdicts[14].info.cause is Cause.GROUND
    assert verdicts[14].info.estimate.speed == pytest.approx(0.23, abs=0.03)


@pytest.mark.parametrize("tells", [0.12, 0.5])
def test_glider_that_lies_is_not_believed(tells):
    """Its depth rate is another; fixes and current agree that the speed is as before. In the end half of the
    dives that are remembered tell the new ratio."""
    made = ways(20, 5, lambda k: 0.4 * k)
    _, verdicts = run(telling(mission(made), [0.25] * 12 + [tells] * 8))
    assert [v.info.kinematic_fits for v in verdicts[12:]] == [False] * 6 + [True] * 2
    assert {v.flag for v in verdicts} == {Flag.NORMAL}
    speeds = [v.info.estimate.speed for v in verdicts[12:]]
    assert speeds == pytest.approx([0.23] * 8, abs=0.02)


def test_circles_are_known_by_the_depth_rate():
    dives = mission([*ways(8, 6, lambda k: 0.4), *[Way(heading=CIRCLE)] * 3])
    _, blind = run(dives)
    _, seeing = run(telling(dives, [0.25] * 11))
    assert [v.flag for v in blind[8:]] == [None] * 3
    assert [v.flag for v in seeing[8:]] == [Flag.NORMAL] * 3
    assert seeing[-1].info.estimate.speed == pytest.approx(0.23, abs=0.02)


def test_current_that_did_not_come_is_made_up_for():
    dives = mission([*ways(8, 7, lambda k: 0.4), Way(heading=0.4, wrong=None)])
    assert run(dives)[1][-1].reason == "no depth-averaged current"
    assert run(telling(dives, [0.25] * 9))[1][-1].flag is Flag.NORMAL


# --------------------------------------------------------------------------- a dive without a track


def trackless(dive):
    return replace(dive, track=None, reason="no heading for 2.9 h")


def after_healthy(**more):
    """The state after eight healthy dives that told their speed, and a dive without a track after them."""
    dives = telling(mission(ways(9, 9, lambda k: 0.4)), [0.25] * 9, **more)
    return run(dives[:8])[0], trackless(dives[8])


def test_dive_without_heading_is_flag_1_by_its_vertical_speed():
    state, dive = after_healthy()
    slow = replace(dive, features=replace(dive.features, **told(0.125)))
    after, verdict = step(state, slow, PARAMS)
    assert verdict.flag is Flag.ANOMALY
    assert verdict.reason == "slower than normal by depth rate and pitch alone (no heading for 2.9 h)"
    assert after is state


def test_dive_without_heading_is_not_flagged_where_its_vertical_speed_is_as_usual():
    state, dive = after_healthy()
    verdict = step(state, dive, PARAMS)[1]
    assert verdict.flag is Flag.NORMAL
    assert verdict.reason == "as fast as usual by depth rate and pitch alone (no heading for 2.9 h)"
    a_little_slow = replace(dive, features=replace(dive.features, **told(0.19)))
    assert step(state, a_little_slow, PARAMS)[1].flag is None


def test_dive_without_heading_is_not_flagged_by_a_mean_that_lags():
    state, dive = after_healthy(onboard=0.26)
    assert len(state.ratios.onboard) == 8
    slow = replace(dive, features=replace(dive.features, onboard_speed=0.1))
    assert step(state, slow, PARAMS)[1].flag is None


def test_dive_without_heading_is_not_flagged_while_no_range_is_learnt():
    dives = telling(mission([Way()] * 3), [0.25, 0.25, 0.06])
    state, _ = run(dives[:2])
    assert step(state, trackless(dives[2]), PARAMS)[1].flag is None
