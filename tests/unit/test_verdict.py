import math
from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.estimation.speed_range import RangeParams
from gliderwatch.estimation.verdict import SpeedParams, SpeedState, step
from gliderwatch.model import Flag, readonly
from joint_support import Way, mission, ways

PARAMS, NOTHING = SpeedParams(), SpeedState()


def run(dives, params=PARAMS, state=NOTHING, **more):
    out = []
    for each in dives:
        state, verdict = step(state, each, params, **more)
        out.append(verdict)
    return state, out


def flags(verdicts):
    return [v.flag for v in verdicts]


def slower(way, part, hidden=False):
    return replace(way, speed=(1 - part) * way.speed, own=way.own if hidden else (1 - part) * way.own)


@pytest.mark.parametrize("seed", range(5))
def test_healthy_mission_has_no_flag(seed):
    _, verdicts = run(mission(ways(60, seed, lambda k: 0.9 * (k // 4))))
    assert set(flags(verdicts)) == {Flag.NORMAL}
    assert verdicts[0].normal.low == PARAMS.low
    assert verdicts[10].normal.low == pytest.approx(0.85 * 0.23, abs=0.01)


def test_range_is_the_configured_one_where_nothing_is_learnt():
    _, verdicts = run(mission(ways(10, 0, lambda k: 0.5)), replace(PARAMS, learning=None))
    assert {(v.normal.low, v.normal.high, v.normal.dives) for v in verdicts} == {(0.15, 0.75, 0)}


@pytest.mark.parametrize(("part", "within"), [(0.5, 1), (0.3, 2)])
def test_drag_is_flag_1_at_once(part, within):
    made = ways(24, 1, lambda k: 0.7 * (k // 5))
    _, verdicts = run(mission([w if k < 12 else slower(w, part) for k, w in enumerate(made)]))
    assert flags(verdicts[:12]) == [Flag.NORMAL] * 12
    assert flags(verdicts[12 + within - 1 :]) == [Flag.ANOMALY] * (13 - within)
    assert verdicts[14].reason == "slower than normal"


def test_small_loss_is_told_after_several_dives():
    """14 % less: within the range, but not for long."""
    made = ways(40, 2, lambda k: 0.7 * (k // 5))
    _, verdicts = run(mission([w if k < 15 else slower(w, 0.14) for k, w in enumerate(made)]))
    assert verdicts[15].flag is Flag.NORMAL
    told = flags(verdicts).index(Flag.ANOMALY)
    assert 16 < told < 32
    assert verdicts[told].reason == "a little slow for several dives"


@pytest.mark.parametrize("angle", [0.2, math.pi / 2, 2.0, math.pi, 4.0])
def test_wrong_current_is_flag_2_and_never_flag_1(angle):
    error = (0.3 * math.cos(angle), 0.3 * math.sin(angle))
    made = ways(24, 3, lambda k: 0.2 * k)
    _, verdicts = run(mission([w if k < 12 else replace(w, wrong=error) for k, w in enumerate(made)]))
    assert flags(verdicts[12:]).count(Flag.FALSE_ALARM) >= 11
    assert Flag.ANOMALY not in flags(verdicts)


def test_wrong_current_is_named():
    made = ways(14, 4, lambda k: 0.3)
    _, verdicts = run(mission([*made[:-1], replace(made[-1], wrong=(-0.1, 0.3))]))
    assert verdicts[-1].reason == "the current is wrong"


def test_lost_wing_is_told_where_it_rolls_the_glider():
    made = ways(52, 5, lambda k: 0.3)  # on the fifth day, when the tides of this sea are known
    lost = [w if k < 36 else replace(slower(w, 0.5, hidden=True), roll=0.4) for k, w in enumerate(made)]
    _, verdicts = run(mission(lost))
    assert Flag.ANOMALY in flags(verdicts[36:39])
    assert "wing" in verdicts[-1].reason
    assert Flag.ANOMALY not in flags(verdicts[:36])


@pytest.mark.parametrize("sent", [True, False])
def test_a_loss_that_turns_with_the_heading_is_no_wing_where_the_roll_stays(sent):
    """What the glider does not know of shows when it turns; a roll that is sent would have shown it."""
    made = ways(60, 7, lambda k: 1.6 * (k // 3))
    dives = mission([w if k < 24 else slower(w, 0.5, hidden=True) for k, w in enumerate(made)])
    if not sent:
        dives = [replace(d, features=replace(d.features, roll_mean=None)) for d in dives]
    _, verdicts = run(dives)
    assert (Flag.ANOMALY in flags(verdicts)) != sent


def test_roll_alone_is_no_anomaly():
    made = ways(
        64, 6, lambda k: 0.9 * (k // 3)
    )  # from the fifth day on, when the tides of this sea are known
    _, verdicts = run(mission([w if k < 36 else replace(w, roll=0.4) for k, w in enumerate(made)]))
    assert Flag.ANOMALY not in flags(verdicts)


def test_a_turn_that_no_heading_shows_is_no_wrong_current():
    """The commanded headings say that it went straight on, and the way is half of what it should be."""
    made = [slower(w, 0.5) if k == 15 else w for k, w in enumerate(ways(16, 9, lambda k: 0.3))]
    features = {"heading_commanded": 1.0}
    dives = [replace(d, features=replace(d.features, **features)) for d in mission(made)]
    _, verdicts = run(dives)
    assert set(flags(verdicts[:15])) == {Flag.NORMAL}
    assert verdicts[15].flag is None
    assert "turned" in verdicts[15].reason


def test_turned_compass_is_flag_2():
    made = ways(60, 7, lambda k: 1.6 * (k // 3))
    _, verdicts = run(mission([w if k < 20 else replace(w, turned=0.9) for k, w in enumerate(made)]))
    assert Flag.FALSE_ALARM in flags(verdicts[20:])
    assert any("compass" in v.reason for v in verdicts)
    assert Flag.ANOMALY not in flags(verdicts)


def test_circles_and_missing_currents_have_no_flag_but_a_reason():
    circle = tuple(np.linspace(0, 2 * math.pi, 24, endpoint=False))
    _, verdicts = run(mission([*[Way()] * 5, Way(heading=circle), Way(wrong=None)]))
    assert flags(verdicts[5:]) == [None, None]
    assert verdicts[5].reason == "the speed cannot be known: the glider turned too much"
    assert verdicts[6].reason == "no depth-averaged current"


def test_dive_without_track_keeps_its_reason():
    dives = mission([Way()] * 5)
    state, _ = run(dives[:4])
    after, verdict = step(state, replace(dives[4], track=None, reason="stale fix"), PARAMS)
    assert after is state
    assert (verdict.flag, verdict.reason, verdict.info) == (None, "stale fix", None)


def half_unseen(dive):
    """Without the headings of its second half."""
    track = dive.track
    t = np.concatenate([track.t[:13], track.t[-1:]])
    x = readonly(track.x[[*range(13), -1]])
    return replace(dive, track=replace(track, t=readonly(t), x=x, heading=track.heading[:13]))


def test_slow_dive_with_unseen_headings_waits_for_the_next():
    """george-2024: the glider turned back in the second half of a dive of which no heading was sent."""
    made = ways(16, 8, lambda k: 0.3)
    dives = mission([w if k < 14 else slower(w, 0.5) for k, w in enumerate(made)])
    _, verdicts = run([*dives[:14], half_unseen(dives[14]), half_unseen(dives[15])])
    assert verdicts[14].flag is None
    assert "turned while its heading was not seen" in verdicts[14].reason
    assert verdicts[15].flag is Flag.ANOMALY


def test_after_a_slow_dive_one_with_unseen_headings_is_slow_too():
    made = ways(16, 8, lambda k: 0.3)
    dives = mission([w if k < 14 else slower(w, 0.5) for k, w in enumerate(made)])
    _, verdicts = run([*dives[:15], half_unseen(dives[15])])
    assert flags(verdicts[14:]) == [Flag.ANOMALY] * 2


def test_nothing_is_learnt_while_an_incident_is_open():
    dives = mission([Way()] * 10)
    state, _ = run(dives[:6])
    after, _ = run(dives[6:], state=state, frozen=True)
    assert np.array_equal(after.normal.speeds, state.normal.speeds)


def test_thruster_on_is_not_faster_than_ever():
    sailing = [Way(speed=0.23, own=0.25)] * 8
    pushed = [Way(speed=0.52, own=0.55, thruster=0.3)] * 8
    _, verdicts = run(mission([*sailing, *pushed]))
    assert set(flags(verdicts)) == {Flag.NORMAL}
    _, unexplained = run(mission([*sailing, *[replace(w, thruster=0.0) for w in pushed]]))
    assert flags(unexplained[8:11]) == [None, None, Flag.NORMAL]  # a new way of flying once three dives agree
    assert "faster than before" in unexplained[8].reason


def test_range_can_be_tightened():
    tight = replace(PARAMS, learning=replace(RangeParams(), narrowest=0.05, widest=0.05))
    _, verdicts = run(mission([*[Way()] * 8, *[slower(Way(), 0.12)] * 2]), tight)
    assert verdicts[-1].flag is Flag.ANOMALY


# --------------------------------------------------------------------------- new ways of flying


def test_a_faster_glider_is_flown_in_a_new_way():
    made = ways(40, 9, lambda k: 0.7 * (k // 5))
    made = [w if k < 15 else replace(w, speed=2 * w.speed, own=2 * w.own) for k, w in enumerate(made)]
    _, verdicts = run(mission(made))
    assert flags(verdicts[15:18]) == [None, None, Flag.NORMAL]
    assert "flies in a new way" in verdicts[17].reason
    assert set(flags(verdicts[18:])) == {Flag.NORMAL}
    assert verdicts[20].normal.usual == pytest.approx(0.46, abs=0.03)
    slowed = [w if k < 25 else slower(w, 0.4) for k, w in enumerate(made)]
    _, verdicts = run(mission(slowed))
    assert Flag.ANOMALY in flags(verdicts[25:28])


def test_no_heading_is_judged_by_what_the_current_leaves():
    """The same glider, the headings of which are not sent: on a steady course |g - c| is its speed."""
    dives = mission(ways(40, 3, lambda k: 0.7 * (k // 5)))
    slow = [w if k < 25 else slower(w, 0.5) for k, w in enumerate(ways(40, 3, lambda k: 0.7 * (k // 5)))]
    for made, told in ((dives, False), (mission(slow), True)):
        blind = [replace(d, features=replace(d.features, heading_reckoned=True)) for d in made]
        _, verdicts = run(blind)
        assert None not in flags(verdicts[:25])
        assert verdicts[20].info.estimate.speed == pytest.approx(0.23, abs=0.02)
        assert (Flag.ANOMALY in flags(verdicts[25:28])) == told
        assert Flag.FALSE_ALARM not in flags(verdicts)


def flatter_from(first, made):
    """The dives of some ways, flown at a lower pitch from one of them on, with the depth rates of that."""
    dives = []
    for k, (way, each) in enumerate(zip(made, mission(made), strict=True)):
        pitch = 0.45 if k < first else 0.35
        rate = way.own * math.tan(pitch)
        angles = {"pitch_dive": -pitch, "pitch_climb": pitch}
        rates = {"depth_rate_dive": rate, "depth_rate_climb": -rate}
        dives.append(replace(each, features=replace(each.features, **angles, **rates)))
    return dives


@pytest.mark.parametrize("own", [0.20, 0.22])
def test_a_new_way_of_flying_is_seen_by_depth_rate_and_pitch_where_the_way_hides_it(own):
    """Half of the speed is lost for five dives; then it flies flatter, and what the way leaves is half of
    its speed, as of a glider that turned and no heading says so: depth rate and pitch say all is well."""
    made = ways(30, 3, lambda k: 0.7 * (k // 5))
    made[15:20] = [slower(way, 0.5) for way in made[15:20]]
    hidden = 0.12 * np.array([[math.cos(way.heading), math.sin(way.heading)] for way in made])
    made[20:] = [
        replace(way, speed=0.92 * own, own=own, wrong=tuple(wrong))
        for way, wrong in zip(made[20:], hidden[20:].tolist(), strict=True)
    ]
    dives = flatter_from(20, made)
    blind = [replace(each, features=replace(each.features, heading_reckoned=True)) for each in dives]
    _, verdicts = run(blind)
    assert flags(verdicts[16:20]) == [Flag.ANOMALY] * 4
    assert flags(verdicts[20:23]) == [None, None, Flag.NORMAL]
    assert "flies in a new way" in verdicts[22].reason
    speed, sigma = verdicts[22].by_reckoning
    assert speed == pytest.approx(0.92 * own, abs=0.01) and sigma < 0.03
    assert set(flags(verdicts[22:])) == {Flag.NORMAL}


@pytest.mark.parametrize(("part", "is_new_way"), [(0.8, True), (0.6, False)])
def test_a_change_of_pitch_explains_no_loss_of_two_fifths_of_the_speed(part, is_new_way):
    """The pilot has it fly flatter, and all measurements agree on a lower speed."""
    made = ways(30, 3, lambda k: 0.7 * (k // 5))
    made[20:] = [replace(way, speed=part * way.speed, own=part * way.own) for way in made[20:]]
    _, verdicts = run(flatter_from(20, made))
    assert any("flies in a new way" in verdict.reason for verdict in verdicts) == is_new_way
    assert set(flags(verdicts[26:])) == {Flag.NORMAL if is_new_way else Flag.ANOMALY}


# --------------------------------------------------------------------------- what a speed means


@pytest.mark.parametrize("part", [0.5, 0.3])
def test_a_speed_means_one_thing_whatever_range_is_configured(part):
    made = ways(26, 3, lambda k: 0.7 * (k // 5))
    dives = mission([*made[:20], *(slower(way, part) for way in made[20:])])
    speeds = []
    for params in (PARAMS, replace(PARAMS, learning=None), replace(PARAMS, learning=None, low=0.1, high=0.3)):
        _, verdicts = run(dives, params)
        speeds.append([v.info.estimate.speed for v in verdicts])
    for each in speeds[1:]:
        assert each == pytest.approx(speeds[0], abs=0.002)


def test_a_slow_spell_is_over_with_the_first_dives_that_are_as_usual():
    made = ways(45, 3, lambda k: 0.7 * (k // 5))
    _, verdicts = run(mission([slower(way, 0.15) if 15 <= k < 29 else way for k, way in enumerate(made)]))
    assert flags(verdicts[22:29]) == [Flag.ANOMALY] * 7
    assert flags(verdicts[29:]) == [Flag.NORMAL] * 16


@pytest.mark.parametrize(("major", "minor"), [(0.7, 0.5), (0.7, -0.5), (0.4, 0.1)])
def test_a_tide_of_a_shelf_sea_is_no_fault(major, minor):
    """Half a month in an M2 tide: no flag, and from day 3 the speed to 1 cm/s."""
    omega, made = 2 * math.pi / 44714.16, []
    left = np.sinc(omega * 1.5 * 3600 / math.pi)  # of the tide in the mean over a dive of 3 h
    for k in range(110):
        angle = omega * 11400.0 * k
        made.append(
            Way(
                heading=0.7 * (k // 5),
                flow=(float(left * major * np.cos(angle)), float(left * minor * np.sin(angle))),
            )
        )
    _, verdicts = run(mission(made))
    assert set(flags(verdicts)) == {Flag.NORMAL}
    assert max(abs(v.info.estimate.speed - 0.23) for v in verdicts[24:]) < 0.01
