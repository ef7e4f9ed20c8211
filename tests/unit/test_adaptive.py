"""The estimator of one glider, dive by dive."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.estimation.adaptive import Learner, step, warm_up
from gliderwatch.model import Assessment, Dive, DiveFeatures
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.params import GliderParams, LearnerParams
from missions import Leg, mission

LEGS = [Leg(heading=0.6 * k, hours=3) for k in range(14)]


def dives(legs=LEGS) -> list[Dive]:
    state, out = Navigation(), {}
    for s in mission(legs):
        state, told = extend(state, s)
        out |= {d.t_dive: d for d in told}
    return [out[t] for t in sorted(out)]


def run(these: list[Dive], params: GliderParams | None = None) -> tuple[Learner, list[Assessment]]:
    state, out = Learner(), []
    for dive in these:
        state, assessment = step(state, dive, params or GliderParams(), "digest")
        out.append(assessment)
    return state, out


def test_speed_and_flow_of_a_healthy_glider():
    _, told = run(dives())
    for a in told[2:]:
        assert a.flag == 0 and a.reason == ""
        assert a.speed == pytest.approx(0.3, abs=0.05)
        assert (a.flow_u, a.flow_v) == pytest.approx((0.1, -0.05), abs=0.06)
    assert told[-1].excitation > 0.01 and told[-1].clle_max > 0.0


def test_it_warms_up_before_it_judges():
    _, told = run(dives())
    assert (told[0].flag, told[0].reason) == (None, "warming up")
    assert told[0].speed is not None  # what it has so far is shown
    hours = warm_up(GliderParams()) / 3600
    judged = [a.reason == "" for a in told]
    assert judged == [3.0 * (k + 1) >= hours for k in range(len(told))]


def test_a_dive_that_cannot_be_used_changes_nothing():
    good = dives()
    state, _ = run(good[:5])
    bad = replace(good[5], track=None, reason="no heading for 3.0 h")
    after, a = step(state, bad, GliderParams(), "digest")
    assert after is state
    assert (a.flag, a.reason, a.speed, a.flow_u) == (None, "no heading for 3.0 h", None, None)
    assert (a.lat, a.lon) == (good[5].end.lat, good[5].end.lon)
    assert a.reference_u == pytest.approx(0.1)  # what is known of it is still told


def test_inputs_are_not_changed():
    good = dives()
    state, _ = run(good[:4])
    before = [state.learner.xi.tobytes(), state.centres.tobytes(), good[4].track.x.tobytes()]
    step(state, good[4], GliderParams(), "digest")
    assert [state.learner.xi.tobytes(), state.centres.tobytes(), good[4].track.x.tobytes()] == before


def test_the_first_guess_is_what_the_first_dive_says():
    state, (a,) = run(dives()[:1])
    assert a.speed == pytest.approx(0.3, abs=0.01)
    assert (a.flow_u, a.flow_v) == pytest.approx((0.1, -0.05), abs=0.02)
    assert state.begun == dives()[0].t_dive


def test_without_a_current_the_first_guess_is_the_speed_on_board():
    first = replace(dives()[0], current=None)
    _, (a,) = run([replace(first, features=replace(first.features, onboard_speed=0.32))])
    assert a.speed == pytest.approx(0.32, abs=0.05)


@pytest.mark.parametrize("absurd", [-0.2, 9.0])
def test_or_the_middle_of_the_range(absurd):
    first = replace(dives()[0], current=None)
    params = GliderParams(speed_min=0.25, speed_max=0.35, speed_learnt=False)
    for onboard in (None, absurd):
        features = DiveFeatures(duration=first.features.duration, onboard_speed=onboard)
        _, (a,) = run([replace(first, features=features)], params)
        assert a.speed == pytest.approx(0.3, abs=0.06)


def test_without_any_current_in_the_files_it_judges_and_says_so():
    _, told = run([replace(d, current=None) for d in dives()])
    assert told[-1].flag is not None and told[-1].p_e is None
    assert any("no depth-averaged current in the files" in note for note in told[-1].notes)


def test_for_a_current_that_has_not_come_that_of_an_earlier_dive_stands_in():
    these = dives()
    these[6] = replace(these[6], current=None)
    _, told = run(these)
    assert (told[6].flag, told[6].reference_final) == (0, False)
    assert told[6].reference_u == pytest.approx(0.1)
    assert any("that of an earlier dive stands in" in note for note in told[6].notes)


def test_but_not_for_long():
    these = dives()
    for k in range(6, 12):
        these[k] = replace(these[k], current=None)
    _, told = run(these)
    assert (told[6].flag, told[11].flag, told[11].reason) == (0, None, "no depth-averaged current")
    assert told[12].flag == 0


def test_a_slow_glider_gets_flag_1():
    """It must fly in many directions: on one course a slower glider and another current are alike."""
    legs = [*LEGS, *(replace(leg, speed=0.02) for leg in LEGS)]
    params = GliderParams(speed_min=0.2, speed_max=0.4, speed_learnt=False, gamma_f=1.0)
    _, told = run(dives(legs), params)
    assert [a.flag for a in told[2:14]] == [0] * 12
    assert {a.flag for a in told[20:]} == {1}
    assert told[-1].speed < 0.1


def test_a_wrong_reference_gets_flag_2():
    these = dives()
    these[9] = replace(these[9], current=replace(these[9].current, u=-0.4, v=0.5))
    _, told = run(these)
    assert [told[8].flag, told[9].flag] == [0, 2]
    assert told[9].p_e > told[9].gamma_f


def test_functions_cover_the_way_and_the_old_ones_are_let_go():
    legs = [Leg(heading=1.5, current=(0.5, 0.0), hours=8) for _ in range(16)]
    params = GliderParams(learner=LearnerParams(sigma=5e3))
    state, told = run(dives(legs), params)
    length = 16 * 8 * 3600 * 0.8
    assert 6 <= len(state.centres) < length / 5e3
    assert state.learner.xi.shape == (2, len(state.centres))
    assert len(state.learner.gram) == len(state.centres) + 2
    assert np.isfinite([a.speed for a in told]).all()


def test_planned_centres_stay_where_they_are():
    """Also the one that the glider is far from."""
    planned = ((36.0, -70.0), (37.5, -68.0))
    params = GliderParams(learner=LearnerParams(sigma=15e3, centres=planned))
    state, told = run(dives(), params)
    assert state.centres[:2].tolist() == [list(p) for p in planned]
    assert told[-1].flag == 0


def test_the_assessment_says_by_what_it_was_judged():
    params = GliderParams(speed_min=0.21, speed_max=0.33, speed_learnt=False, gamma_f=0.4)
    _, told = run(dives()[:1], params)
    a = told[0]
    assert (a.speed_min, a.speed_max, a.gamma_f, a.parameters) == (0.21, 0.33, 0.4, "digest")
    assert a.evidence["along_speed"] == pytest.approx(0.3, abs=1e-3)


def test_a_provisional_current_is_said_to_be():
    _, told = run(dives())
    assert not any("provisional" in n for a in told[:-1] for n in a.notes)
    assert any("provisional" in n for n in told[-1].notes) and not told[-1].reference_final
