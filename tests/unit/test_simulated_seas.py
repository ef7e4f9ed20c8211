"""Kinds of sea: what is drawn for each seed, and that gliders fly in it."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.simulate.faults import Fault, FaultKind
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.ocean import Constituent
from gliderwatch.simulate.seas import SEAS, sea_mission, with_fault

DAY = 86400.0
SEEDS = range(12)


def major(scenario, constituent):
    return sum(e.major for e in scenario.sea.tides if e.constituent is constituent)


@pytest.mark.parametrize("name", SEAS)
def test_what_is_drawn_is_within_the_ranges_of_the_kind(name):
    kind = SEAS[name]
    for scenario in (sea_mission(name, seed) for seed in SEEDS):
        assert kind.m2[0] <= major(scenario, Constituent.M2) <= kind.m2[1]
        assert kind.k1[0] <= major(scenario, Constituent.K1) <= kind.k1[1]
        assert kind.depth[0] <= scenario.depths[1] <= kind.depth[1]
        assert kind.latitude[0] <= abs(scenario.place.lat) <= kind.latitude[1]
        assert kind.inertial[0] <= scenario.sea.inertial <= kind.inertial[1]
        assert 3600 <= scenario.interval <= 12 * 3600
        assert all(abs(e.minor) <= e.major for e in scenario.sea.tides)


@pytest.mark.parametrize("name", SEAS)
def test_seeds_differ_and_each_is_always_the_same(name):
    drawn = [sea_mission(name, seed) for seed in SEEDS]
    assert len({s.place for s in drawn}) == len(drawn)
    assert drawn == [sea_mission(name, seed) for seed in SEEDS]
    assert {s.interval for s in drawn[::2]} == {3 * 3600.0}


def test_a_rotary_tide_turns_and_a_rectilinear_one_goes_to_and_fro():
    for seed in SEEDS:
        turning, straight = (
            next(e for e in sea_mission(name, seed).sea.tides if e.constituent is Constituent.M2)
            for name in ("rotary", "rectilinear")
        )
        assert abs(turning.minor) > 0.5 * turning.major
        assert abs(straight.minor) < 0.25 * straight.major


@pytest.mark.parametrize("name", SEAS)
def test_a_glider_flies_in_every_kind_of_sea(name):
    mission = simulate(sea_mission(name, 1, days=2.0))
    speeds = [dive.speed for dive in mission.truth]
    assert all(0.15 < speed < 0.5 for speed in speeds)
    wander = np.std(np.array(speeds)) / np.mean(speeds)
    assert wander < 0.05


def test_a_mission_is_as_it_was_until_its_fault_begins():
    healthy = sea_mission("mixed", 0, days=3.0)
    onset = healthy.start + 1.5 * DAY
    faulty = simulate(with_fault(healthy, Fault(FaultKind.WING_LOSS, onset, 0.4)))
    same = [d for d in faulty.truth if d.t_surface < onset]
    assert same == list(simulate(healthy).truth[: len(same)])
    assert faulty.truth[-1].speed == pytest.approx(0.6 * same[-1].speed, rel=0.1)


def test_the_water_makes_the_speed_wander():
    scenario = sea_mission("slack", 0, days=6.0)
    still, moved = (
        np.array([d.speed for d in simulate(replace(scenario, drive_sigma=sigma)).truth])
        for sigma in (0.0, 0.1)
    )
    assert np.std(still) / np.mean(still) < 0.01
    assert 0.02 < np.std(moved) / np.mean(moved) < 0.08  # speed goes with the root of the drive
