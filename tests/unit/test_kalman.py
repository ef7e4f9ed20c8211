import math
from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.estimation import kalman
from gliderwatch.estimation.dive_measurement import observe, slip_at
from gliderwatch.estimation.kalman import JointParams, step
from gliderwatch.estimation.modes import MODES, ROLLED, Cause
from gliderwatch.model import readonly
from gliderwatch.sea import gauss_markov
from gliderwatch.sea.gauss_markov import FlowParams, passage, prior
from joint_support import HOUR, Way, dive, mission, wandering, ways

PARAMS = JointParams()
QUIET = replace(PARAMS, alarms_per_month=1e-9)


def run(dives, params=PARAMS, **more):
    state, infos = None, []
    for each in dives:
        state, info = step(state, each, params, **more)
        infos.append(info)
    return state, infos


# --------------------------------------------------------------------------- what a dive measures


def test_observation_of_a_straight_dive():
    seen = observe(dive(0, Way(heading=0.0, speed=0.2, own=0.25, flow=(0.1, -0.05))))
    assert seen.ground == pytest.approx([0.3, -0.05])
    assert seen.heading == pytest.approx([1.0, 0.0])
    assert seen.current == pytest.approx([0.05, -0.05])  # what the glider over-rates itself by is in it
    assert seen.own_speed()[0] == pytest.approx(0.25)
    assert seen.across(0.25)[0] == pytest.approx(0.0, abs=1e-12)
    assert seen.slip == slip_at(0.45)


def test_across_is_left_positive():
    seen = observe(dive(0, Way(heading=math.pi / 2, wrong=(0.1, 0.0))))
    assert seen.across(0.25)[0] == pytest.approx(0.1)  # g - c is 0.1 to the west, left of north


def test_a_dive_began_before_its_first_sample_under_water():
    """Samples come every 7.5 min: on average half of that is missing at either end."""
    whole = dive(0, Way(heading=0.0, speed=0.25, own=0.25, flow=(0.0, 0.0)))
    spacing = (whole.t_surface - whole.t_dive) / 24
    sent = replace(whole, t_dive=whole.t_dive + spacing, t_surface=whole.t_surface - spacing)
    vectors = whole.track.heading.copy()
    vectors[[0, -1]] = 0.0
    seen = observe(replace(sent, track=replace(whole.track, heading=readonly(vectors))))
    assert seen.steadiness == pytest.approx(1 - 1 / 24)
    assert seen.own_speed()[0] == pytest.approx(0.25 * 24 / 23)
    assert observe(whole).steadiness == pytest.approx(1.0)


def test_fewer_headings_and_turns_widen_the_uncertainty():
    rng = np.random.default_rng(0)
    swings = rng.normal(0.0, 0.2, 48)
    dense = observe(dive(0, Way(heading=swings), samples=48))
    sparse = observe(dive(0, Way(heading=swings[::8]), samples=6))
    circle = observe(dive(0, Way(heading=np.linspace(0, 2 * math.pi, 24, endpoint=False))))
    assert sparse.own_speed()[1] > 1.3 * dense.own_speed()[1]
    assert circle.steadiness < 1e-9
    assert circle.own_speed() is None


def test_hours_without_data_widen_the_uncertainty():
    whole = dive(0, Way())
    holed = replace(whole, features=replace(whole.features, unobserved=0.6 * 3600))
    assert observe(holed).own_speed()[1] > 4 * observe(whole).own_speed()[1]


def test_headings_that_stop_are_told():
    whole = dive(0, Way(), hours=2.0)
    t = np.concatenate([whole.track.t[:13], whole.track.t[-1:]])  # none in the second half
    track = replace(
        whole.track,
        t=readonly(t),
        x=readonly(whole.track.x[[*range(13), -1]]),
        heading=whole.track.heading[:13],
    )
    assert observe(whole).unseen == 0.0
    assert observe(replace(whole, track=track)).unseen == pytest.approx(0.5)


# --------------------------------------------------------------------------- the filter


def test_first_dive_gives_speed_and_flow():
    _, (info,) = run([dive(0, Way(heading=1.0, speed=0.23, own=0.25, flow=(0.1, -0.2)))])
    assert info.cause is Cause.USUAL
    assert info.estimate.own_speed == pytest.approx(0.25, abs=0.005)
    assert info.estimate.speed == pytest.approx(0.23, abs=2 * info.estimate.sigma)
    assert info.estimate.flow == pytest.approx([0.1, -0.2], abs=0.02)


def test_filter_is_the_dense_solution(monkeypatch):
    """Without slip the model is linear: the filter must give what one great least-squares problem gives."""
    monkeypatch.setattr(kalman, "learn_process_scale", lambda factor, *_: factor)
    monkeypatch.setattr(kalman, "learn_measurement_scale", lambda factor, *_: factor)
    params = replace(
        QUIET,
        modes=MODES[:1],
        slip=0.0,
        slip_sigma=0.0,
        side_sigma=0.0,
        own_noise=0.0,
        flow=FlowParams(scale=1e12),
    )
    q = np.full(params.flow.parts, 1e-7)
    monkeypatch.setattr(gauss_markov, "intensities", lambda *_: q)
    dives = mission([Way(heading=0.7 * k, flow=tuple(f)) for k, f in enumerate(wandering(9, 3).tolist())])
    state, _ = run(dives, params)
    n, m, size = params.flow.size + 1, len(dives), params.flow.size
    rows, values, end = [], [], None
    # unknowns: the state of every dive, one after another; all equations whitened
    for k, each in enumerate(dives):
        seen = observe(each)
        gap = 0.0 if end is None else seen.start - end
        went = passage(gap, seen.end - seen.start, each.start.lat, q, params.flow)
        cov = np.zeros((n, n))
        cov[:size, :size] = went.noise
        dt = gap + seen.end - seen.start
        cov[-1, -1] = params.speed_wander**2 * dt / (3 * HOUR)
        carried = np.zeros((n, n))
        carried[:size, :size], carried[-1, -1] = went.matrix, 1.0
        block, target = np.zeros((n, n * m)), np.zeros(n)
        block[:, n * k : n * (k + 1)] = np.eye(n)
        if k == 0:
            begin = np.diag([*prior(params.flow), params.speed_sigma**2])
            cov = carried @ begin @ carried.T + cov
            target[-1] = params.speed
        else:
            block[:, n * (k - 1) : n * k] = -carried
        end = seen.end
        white = np.linalg.inv(np.linalg.cholesky(cov))
        rows.append(white @ block)
        values.append(white @ target)
        block = np.zeros((4, n * m))
        mean = slice(n * k + size - 2, n * k + size)
        block[:2, mean] = block[2:, mean] = np.eye(2)
        block[:2, n * (k + 1) - 1] = seen.heading
        # g - c tells W whatever the flow is: the filter weighs the heading's error by the W that it ends with
        own = seen.own_speed()[0]
        r = np.zeros((4, 4))
        r[:2, :2], r[2:, 2:] = seen.ground_cov + own**2 * seen.heading_cov, seen.current_sigma**2 * np.eye(2)
        white = np.linalg.inv(np.linalg.cholesky(r))
        rows.append(white @ block)
        values.append(white @ np.concatenate([seen.ground, seen.current]))
    a, b = np.vstack(rows), np.concatenate(values)
    solution = np.linalg.lstsq(a, b)[0][-n:]
    cov = np.linalg.inv(a.T @ a)[-n:, -n:]
    assert state.x[:n] == pytest.approx(solution, abs=1e-4)
    assert state.cov[:n, :n] == pytest.approx(cov, abs=1e-5)


def test_no_track_changes_nothing():
    state, _ = run([dive(0, Way())])
    blind = replace(dive(1, Way()), track=None, reason="no fix")
    assert step(state, blind, PARAMS) == (state, None)


def test_healthy_mission_is_estimated_with_a_true_uncertainty():
    """Errors of speed and flow, normalised, over many gliders whose slips differ as the prior says."""
    speed, flow = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        slip = 0.75 * slip_at(0.45) + PARAMS.slip_sigma * rng.standard_normal()
        made = ways(40, seed, lambda k: 2.1 * (k // 5), speed=0.25 * (1 - slip))
        _, infos = run(mission(made))
        for way, info in zip(made[8:], infos[8:], strict=True):
            assert info.cause is Cause.USUAL
            speed.append((info.estimate.speed - way.speed) / info.estimate.sigma)
            error = info.estimate.flow - np.array(way.flow)
            flow.append(error @ np.linalg.solve(info.estimate.flow_cov, error) / 2)
    assert 0.3 < np.mean(np.square(speed)) < 1.3
    assert 0.3 < np.mean(flow) < 1.3
    assert 0.9 < np.mean(np.abs(speed) < 1.96) <= 1.0


def test_growing_head_current_is_not_a_slow_glider():
    """electa-2022: the current against the glider grows to six times its speed through the water."""
    made = [Way(heading=math.pi, flow=(0.1 + 0.04 * k, 0.0)) for k in range(36)]
    _, infos = run(mission(made))
    speeds = [info.estimate.speed for info in infos[1:]]
    assert min(speeds) > 0.2
    assert max(speeds) < 0.26


def test_drag_shows_at_the_first_surfacing_and_stays():
    made = ways(30, 1, lambda k: 0.5)
    slowed = [w if k < 15 else replace(w, speed=0.5 * w.speed, own=0.5 * w.own) for k, w in enumerate(made)]
    _, infos = run(mission(slowed), usual=0.23)
    assert infos[15].cause is Cause.SPEED
    assert infos[15].estimate.own_speed == pytest.approx(0.125, abs=0.02)
    assert all(0.07 < info.estimate.speed < 0.13 for info in infos[15:])
    assert not any(info.cause.is_error for info in infos)


@pytest.mark.parametrize("angle", [0.0, 0.8, math.pi / 2, 2.5, math.pi, 5.0])
def test_wrong_current_is_left_out(angle):
    """Also along the heading, where it looks like another speed: but then the ground velocity fits."""
    made = ways(12, 2, lambda k: 0.3)
    good = mission(made)
    error = (0.3 * math.cos(angle), 0.3 * math.sin(angle))
    bad = mission([*made[:-1], replace(made[-1], wrong=error)])
    before, _ = run(good[:-1])
    after, info = step(before, bad[-1], PARAMS)
    blind, without = step(before, replace(good[-1], current=None), PARAMS)
    assert info.cause is Cause.CURRENT
    # the mixture leaves other explanations the little that they are worth
    assert after.x == pytest.approx(blind.x, abs=0.02)
    assert info.estimate.speed == pytest.approx(0.23, abs=0.03)
    assert without.across is None
    assert without.single_sigma == math.inf


def test_flow_that_changed_is_followed():
    made = ways(20, 4, lambda k: 0.3)
    shifted = [
        w if k < 10 else replace(w, flow=(w.flow[0] - 0.3, w.flow[1] + 0.3)) for k, w in enumerate(made)
    ]
    _, infos = run(mission(shifted))
    assert infos[10].cause is Cause.FLOW
    assert infos[10].estimate.flow == pytest.approx(shifted[10].flow, abs=0.05)
    assert all(info.estimate.speed == pytest.approx(0.23, abs=0.02) for info in infos)


def test_ground_velocity_that_does_not_fit_is_told():
    made = ways(12, 5, lambda k: 0.3)
    dives = mission(made)
    last = dives[-1]
    wild = np.linspace(
        [0.0, 0.0], [-1500.0, 4000.0], len(last.track.t)
    )  # 0.4 m/s off, and the current is right
    state, _ = run(dives[:-1])
    off = replace(last, track=replace(last.track, x=readonly(last.track.x + wild)))
    assert step(state, off, PARAMS)[1].cause is Cause.GROUND


def test_circles_tell_nothing_of_the_speed():
    circle = tuple(np.linspace(0, 2 * math.pi, 24, endpoint=False))
    state, infos = run(mission([*[Way()] * 5, *[Way(heading=circle)] * 8]))
    assert all(info.single_sigma == math.inf for info in infos[5:])
    sigmas = [info.estimate.sigma for info in infos[4:]]
    assert sigmas == sorted(sigmas)
    assert state.x[-3] == pytest.approx(0.25, abs=0.01)


# --------------------------------------------------------------------------- what the glider does not know


def lost_wing(seed, heading, onset=20, n=44):
    made = ways(n, seed, heading)
    return [w if k < onset else replace(w, speed=0.5 * w.speed) for k, w in enumerate(made)]


@pytest.mark.parametrize("seed", range(4))
def test_hidden_loss_is_found_when_the_heading_changes(seed):
    made = lost_wing(seed, lambda k: 1.6 * (k // 3))
    _, infos = run(mission(made))
    told = [k for k, info in enumerate(infos) if info.proven is not None]
    assert told
    assert 20 < told[0] <= 36  # within two days
    assert infos[told[0]].proven.size > 0.1
    assert infos[-1].estimate.speed == pytest.approx(0.115, abs=3 * infos[-1].estimate.sigma)


@pytest.mark.parametrize("seed", range(5))
def test_drift_at_the_surface_tells_a_lost_wing_from_a_sea_that_turns_with_the_glider(seed):
    """All that dives measure is alike: the reported current is the sea's, or what the wing takes."""
    lost, well = [], []
    for k, flow in enumerate(wandering(40, seed, size=0.04)):
        heading = 0.0 if k < 24 else 1.6
        taken = 0.37 * 0.25 * np.array([math.cos(heading), math.sin(heading)]) * (k >= 14)
        lost.append(Way(heading, speed=0.23 - 0.37 * 0.25 * (k >= 14), flow=tuple(flow)))
        well.append(Way(heading, flow=tuple(flow - taken)))
    dives = mission(lost), mission(well)
    assert dives[0][30].current.u == pytest.approx(dives[1][30].current.u)
    ratios = [max(info.loss.ratio for info in run(each)[1]) for each in dives]
    assert ratios[0] > 14
    assert ratios[1] < 8


def test_hidden_loss_on_a_steady_course_is_not_made_up():
    """Nothing can tell it from a flow that changed: the test stays silent."""
    _, infos = run(mission(lost_wing(1, lambda k: 0.4)))
    assert all(info.proven is None for info in infos)
    assert infos[-1].loss.ratio < 16


def test_a_hint_opens_what_cannot_be_seen():
    made = lost_wing(3, lambda k: 0.4)
    state = None
    for k, each in enumerate(mission(made)):
        state, info = step(state, each, QUIET, hint=ROLLED if k in (20, 21) else None)
    assert info.estimate.own_speed == pytest.approx(0.25, abs=0.01)
    assert info.estimate.speed == pytest.approx(0.115, abs=2.5 * info.estimate.sigma)
    assert info.estimate.sigma > 0.015


@pytest.mark.parametrize("turned", [-0.8, 0.8])
def test_wrong_compass_turns_with_the_heading(turned):
    made = ways(44, 6, lambda k: 1.6 * (k // 3))
    made = [w if k < 20 else replace(w, turned=turned) for k, w in enumerate(made)]
    _, infos = run(mission(made))
    assert any(info.proven is not None for info in infos[20:])
    side, sigma = infos[-1].estimate.side
    # the way is to the right of the heading where side is positive
    assert side == pytest.approx(0.92 * math.sin(turned), abs=3 * sigma)


@pytest.mark.parametrize("seed", range(6))
def test_healthy_mission_tells_no_step(seed):
    _, infos = run(mission(ways(80, 100 + seed, lambda k: 1.6 * (k // 4))))
    assert all(info.proven is None for info in infos)


# --------------------------------------------------------------------------- begin and end


def test_step_does_not_change_its_inputs():
    dives = mission([Way()] * 4)
    state, _ = run(dives[:3])
    before = [state.x.copy(), state.cov.copy(), state.bank.shift.copy()]
    step(state, dives[3], PARAMS)
    for kept, now in zip(before, (state.x, state.cov, state.bank.shift), strict=True):
        assert np.array_equal(kept, now)
        assert not now.flags.writeable


def test_the_odds_of_a_dive_are_odds():
    _, infos = run(mission(ways(20, 7, lambda k: 0.5 * k)))
    assert sum(infos[3].odds.values()) == pytest.approx(1.0)
