"""Faults put onto missions made by hand, whose every number is known."""

from __future__ import annotations

import numpy as np
import pytest

from gliderwatch.navigation.track import closure
from gliderwatch.score.graft import Graft, GraftKind, grafted, navigate, own_speeds
from missions import Leg, mission, opened, real

LEGS = [Leg(speed=0.3, heading=h, current=(0.1, -0.05)) for h in (1.0, 2.5, 1.0, 2.5, 4.0, 1.0, 2.5, 4.0)]
ONSET = opened(LEGS, 4)


def closures(segments):
    return [
        closure(dive.track, dive.current)
        for dive in navigate(segments)
        if dive.track is not None and dive.current is not None
    ]


def test_before_the_onset_nothing_changes():
    before, after = (navigate(s)[:4] for s in (mission(LEGS), slowed(0.5)))
    for a, b in zip(before, after, strict=True):
        assert np.array_equal(a.track.x, b.track.x)


def slowed(size):
    return grafted(mission(LEGS), Graft(GraftKind.SLOWED, size), ONSET, 0.3)


def test_a_slowed_glider_is_slower_and_its_current_still_right():
    found = closures(slowed(0.4))
    speeds = [c.along_speed for c in found]
    assert speeds[:4] == pytest.approx([0.3] * 4, rel=0.02)
    assert speeds[4:] == pytest.approx([0.18] * len(speeds[4:]), rel=0.02)
    assert max(abs(c.across_misfit) for c in found[:-1]) < 0.005  # the last current is provisional


def test_a_slowed_glider_sinks_slower_too():
    dives = navigate(slowed(0.4))
    assert dives[0].features.depth_max == pytest.approx(205.0)
    assert dives[-1].features.depth_max == pytest.approx(5 + 0.6 * 200.0)


def test_a_wrong_current_is_across_and_the_way_as_it_was():
    plain, wrong = mission(LEGS), grafted(mission(LEGS), Graft(GraftKind.DAC_WRONG, 0.2), ONSET, 0.3)
    found = closures(wrong)
    assert [c.across_misfit for c in found[:4]] == pytest.approx([0.0] * 4, abs=0.005)
    assert [c.across_misfit for c in found[4:-1]] == pytest.approx([-0.2] * 3, abs=0.005)
    assert [c.along_speed for c in found] == pytest.approx([0.3] * len(found), rel=0.02)
    for a, b in zip(navigate(plain), navigate(wrong), strict=True):
        assert np.array_equal(a.track.x, b.track.x)


def test_own_speeds_are_those_of_the_reckoning():
    assert list(own_speeds(navigate(mission(LEGS))).values()) == pytest.approx([0.3] * len(LEGS), rel=0.02)


@pytest.mark.parametrize(("kind", "size"), [(GraftKind.SLOWED, 1.0), (GraftKind.DAC_WRONG, 3.0)])
def test_a_size_that_cannot_be_is_refused(kind, size):
    with pytest.raises(ValueError, match=f"{kind} of size"):
        Graft(kind, size)


@pytest.mark.real
@pytest.mark.parametrize("name", ["electa-2022", "usf-sam-2019"])
def test_a_real_mission_is_slowed_by_what_was_asked(shared_data, name):
    segments = real(shared_data, name)
    dives = navigate(segments)
    onset = dives[len(dives) // 2].t_dive
    whole = own_speeds(dives)
    less = own_speeds(navigate(grafted(segments, Graft(GraftKind.SLOWED, 0.4), onset, 0.3)))
    ratios = {t: less[t] / whole[t] for t in whole if t in less}
    assert np.median([r for t, r in ratios.items() if t < onset]) == 1.0
    after = np.array([r for t, r in ratios.items() if t >= onset])
    assert np.median(after) == pytest.approx(0.6, abs=0.01)
    assert np.mean(np.abs(after - 0.6) < 0.05) > 0.9
