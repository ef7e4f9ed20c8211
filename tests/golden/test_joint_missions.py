"""The joint estimator on the five real missions, which are taken for healthy."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gliderwatch.estimation.dive_measurement import observe
from gliderwatch.estimation.kinematic_speed import vertical
from gliderwatch.estimation.modes import Cause
from gliderwatch.estimation.verdict import SpeedParams, SpeedState, step
from gliderwatch.model import Current, Flag, readonly
from gliderwatch.navigation.dives import Navigation, extend
from missions import REAL, real

pytestmark = pytest.mark.real

HOUR = 3600.0
PARAMS = SpeedParams()
# Usual speed through the water at the end of the mission (m/s): what domain notes and other dives say.
SPEEDS = {
    "electa-2022": (0.42, 0.56),  # with its thruster at half time
    "usf-sam-2019": (0.19, 0.26),
    "george-2024": (0.22, 0.30),
    "osu-2025": (0.21, 0.27),
    "maria-2022": (0.19, 0.28),
}


@cache
def dives(data, name):
    state, found = Navigation(), {}
    segments = real(data, name)
    for segment in segments:
        state, told = extend(state, segment)
        found |= {dive.t_dive: dive for dive in told if dive.end is not None}
    thruster = [s.get("thruster_on") for s in segments]
    t, on = (np.concatenate([getattr(s, key) for s in thruster]) for key in "tv")
    out = []
    for dive in (found[t_dive] for t_dive in sorted(found)):
        within = on[(t >= dive.t_dive) & (t <= dive.t_surface)]
        more = {"thruster": float(within.mean())} if len(within) > 2 else {}
        out.append(replace(dive, features=replace(dive.features, **more)))
    return tuple(out)


def run(all_dives):
    state, verdicts = SpeedState(), []
    for dive in all_dives:
        state, verdict = step(state, dive, PARAMS)
        verdicts.append(verdict)
    return state, verdicts


def late(all_dives):
    """Dives with a track after the first 12 h."""
    begun = all_dives[0].t_dive
    return [k for k, d in enumerate(all_dives) if d.t_dive - begun > 12 * HOUR and d.track is not None]


PROPORTIONAL = ("depth_rate_dive", "depth_rate_climb", "onboard_speed")


def slowed(dive, part):
    """Drag takes part of the speed, in all directions: the way is shorter, the current stays right."""
    if dive.track is None:
        return dive
    own = observe(dive).own_speed()
    speed = own[0] if own and 0 < own[0] < 1.3 else dive.features.onboard_speed or 0.3
    steps = dive.track.heading * np.diff(dive.track.t)[:, None]
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    track = replace(dive.track, x=readonly(dive.track.x - part * speed * way))
    told = {name: getattr(dive.features, name) for name in PROPORTIONAL}
    slower = {name: (1 - part) * value for name, value in told.items() if value is not None}
    return replace(dive, track=track, features=replace(dive.features, **slower))


@pytest.fixture(params=REAL)
def name(request):
    return request.param


def test_healthy_mission_has_no_flag_1(shared_data, name):
    made = dives(shared_data, name)
    _, verdicts = run(made)
    assert [made[k].t_dive for k in late(made) if verdicts[k].flag is Flag.ANOMALY] == []


WRONG = {"electa-2022": [109], "george-2024": [53]}


def test_flag_2_only_where_the_data_are_wrong(shared_data, name):
    """After a restart electa reported a current of 0.1 m/s in one of 1.3 m/s. On george the fixes do not fit
    the headings of a dive of which 40 % has none; its depth rate is that of the dives before."""
    made = dives(shared_data, name)
    _, verdicts = run(made)
    told = [round((made[k].t_dive - made[0].t_dive) / HOUR) for k in late(made) if verdicts[k].flag == 2]
    assert told == WRONG.get(name, [])


def test_innovations_are_as_large_as_they_should_be(shared_data, name):
    _, verdicts = run(dives(shared_data, name))
    usual = [v.info for v in verdicts if v.info is not None and v.info.cause is Cause.USUAL]
    assert 0.25 < sum(info.nis for info in usual) / sum(info.dof for info in usual) < 1.4


def test_speed_stays_where_it_was_through_head_currents_and_fronts(shared_data, name):
    made = dives(shared_data, name)
    _, verdicts = run(made)
    low, high = SPEEDS[name]
    # the last dives whose speed can be known: the growing Gulf Stream brings electa to a stop over ground
    known = [v for v in verdicts if v.flag is Flag.NORMAL and v.info and v.by_reckoning is None]
    found = [v.info.estimate for v in known if v.info.estimate.sigma < 0.06][-3:]
    assert all(low < each.speed < high for each in found)
    assert all(each.sigma > 0.003 for each in found)


def test_no_step_is_told(shared_data, name):
    _, verdicts = run(dives(shared_data, name))
    assert all(v.info is None or v.info.proven is None for v in verdicts)


@pytest.mark.parametrize(
    ("part", "within", "wanted"), [(0.5, 2, 0.9), pytest.param(0.3, 4, 0.9, marks=pytest.mark.slow)]
)
def test_drag_put_onto_any_dive_is_found(shared_data, part, within, wanted):
    """At all moments of all missions; missed at a change of the thruster, and where data are missing."""
    found = []
    for each in REAL:
        made = dives(shared_data, each)
        for k in late(made)[:-1]:
            _, verdicts = run([*made[:k], *(slowed(d, part) for d in made[k : k + within])])
            found.append(any(v.flag is Flag.ANOMALY for v in verdicts[k:]))
    assert len(found) > 70
    assert np.mean(found) >= wanted


def test_wrong_current_is_flag_2_whatever_its_direction(shared_data, name):
    made = dives(shared_data, name)
    told = []
    for k in late(made):
        if made[k].current is None or made[k].features.heading_assumed:
            continue  # without headings a wrong current cannot be told from a turn
        state, _ = run(made[:k])
        for angle in np.arange(8) * np.pi / 4:
            u, v = made[k].current.u + 0.3 * np.cos(angle), made[k].current.v + 0.3 * np.sin(angle)
            bad = replace(made[k], current=Current(float(u), float(v), made[k].current.final))
            told.append(step(state, bad, PARAMS)[1].flag)
    assert np.mean([flag == Flag.FALSE_ALARM for flag in told]) >= 0.95
    assert np.mean([flag == Flag.ANOMALY for flag in told]) <= 0.02


def test_depth_rate_over_pitch_and_mean_on_board_keep_to_the_own_speed(shared_data, name):
    made = dives(shared_data, name)
    _, verdicts = run(made)
    own = {k: verdicts[k].info.seen.own_speed() for k in late(made) if verdicts[k].flag is Flag.NORMAL}
    sure = {k: each[0] for k, each in own.items() if each is not None and each[1] < 0.1 * each[0]}
    sure = {k: own for k, own in sure.items() if made[k].features.duration > HOUR}
    assert sure
    told = {
        "vertical": [v / w for k, w in sure.items() if (v := vertical(made[k].features)) is not None],
        "on board": [v / w for k, w in sure.items() if (v := made[k].features.onboard_speed)],
    }
    assert any(told.values())
    for source, (low, high) in {"vertical": (1.1, 1.25), "on board": (0.95, 1.1)}.items():
        assert not told[source] or low < np.median(told[source]) < high, source


def circles(made):
    return [k for k, d in enumerate(made) if d.track is not None and observe(d).steadiness < 0.1]


def test_speed_in_spirals_is_that_of_depth_rate_and_pitch(shared_data):
    made = dives(shared_data, "maria-2022")
    _, verdicts = run(made)
    assert circles(made)
    for verdict in (verdicts[k] for k in circles(made)):
        assert verdict.flag is Flag.NORMAL
        assert verdict.info.kinematic_fits
        assert 0.19 < verdict.info.estimate.speed < 0.24


def test_spirals_say_that_the_speed_cannot_be_known(shared_data):
    """Where no depth rate and no mean speed is sent."""
    made = [
        replace(d, features=replace(d.features, **dict.fromkeys(PROPORTIONAL)))
        for d in dives(shared_data, "maria-2022")
    ]
    _, verdicts = run(made)
    circling = circles(made)
    assert circling
    assert {verdicts[k].flag for k in circling} == {None}
    assert all("cannot be known" in verdicts[k].reason for k in circling)


def test_garbage_current_leaves_the_estimate_alone(shared_data):
    made = dives(shared_data, "electa-2022")
    _, verdicts = run(made)
    at = next(k for k, d in enumerate(made) if round((d.t_dive - made[0].t_dive) / HOUR) == 109)
    assert verdicts[at].info.cause is Cause.CURRENT
    assert np.hypot(*verdicts[at].info.estimate.flow) > 1.0  # the current was 0.11 m/s by what was reported
    assert 0.4 < verdicts[at].info.estimate.speed < 0.8
