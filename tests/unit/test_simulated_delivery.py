"""Every artefact of telemetry, at rate 0 and at rate 1, and what a glider makes of its files."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.simulate.delivery import Act, Fate, FileForm, Names, arrivals, make_calls, play, steps
from gliderwatch.simulate.glider import fleet, simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, FixIn, Mission, Rates, Scenario
from gliderwatch.simulate.telemetry import CADENCE, SCIENCE_CADENCE
from simulated import degrees, samples

PLAIN = Scenario(days=1.5, science=SCIENCE_CADENCE, surface_segments=True)
AS_SENT = FileForm(Names.AS_SENT)


def with_rates(**rates: float) -> Mission:
    return simulate(replace(PLAIN, rates=Rates(**rates)))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def mission() -> Mission:
    return simulate(PLAIN)


def n_files(mission: Mission) -> int:
    return len(mission.segments) + len(mission.science)


def fates(mission: Mission) -> Counter[Fate]:
    return Counter(fate for _, fate in make_calls(mission).fates)


# --------------------------------------------------------------------------- on the way


def test_without_rates_every_file_comes_once_whole_and_in_order(mission: Mission) -> None:
    files = list(arrivals(mission, AS_SENT))
    assert fates(mission) == {}
    assert len({file.name for file in files}) == len(files) == n_files(mission)
    assert [file.time for file in files] == sorted(file.time for file in files)
    by_name = {f"{s.header.full_name}.{s.header.extension}": s for s in (*mission.segments, *mission.science)}
    closed = [by_name[file.name].closed for file in files]
    assert closed == sorted(closed)
    whole = {file.name: file.data for file in arrivals(mission)}
    assert whole == {file.name: file.data for file in files}
    assert all(file.mtime == by_name[file.name].closed for file in files)


def test_lost_files_never_come() -> None:
    mission = with_rates(lost=1.0)
    assert list(arrivals(mission)) == []
    assert fates(mission) == {Fate.LOST: n_files(mission)}


def test_late_files_come_with_a_later_call_but_the_last() -> None:
    mission = with_rates(late=1.0, late_calls=3)
    calls = make_calls(mission)
    last = calls.times[-1]
    waits = []
    for time, call in zip(calls.times, calls.sendings, strict=True):
        for sending in call:
            asked = calls.times.index(sending.segment.sent)
            assert time > sending.segment.sent or time == last
            waits.append(calls.times.index(time) - asked)
    assert max(waits) == 3
    assert len(waits) == n_files(mission)


def test_the_newest_comes_first() -> None:
    oldest, newest = simulate(replace(PLAIN, days=1.0)), with_rates(newest_first=1.0)
    for mission, sign in ((oldest, 1), (newest, -1)):
        several = [call for call in make_calls(mission).sendings if len(call) > 2]
        assert len(several) > 4
        for call in several:
            closed = np.array([sending.segment.closed for sending in call])
            assert np.all(sign * np.diff(closed) >= 0)


def test_cut_files_are_the_beginning_of_whole_ones(mission: Mission) -> None:
    whole = {file.name: file.data for file in arrivals(mission)}
    cut = list(arrivals(with_rates(truncated=1.0, mended=0.0)))
    assert len(cut) == len(whole)
    assert all(
        whole[file.name].startswith(file.data) and len(file.data) < len(whole[file.name]) for file in cut
    )
    assert np.std([len(file.data) / len(whole[file.name]) for file in cut]) > 0.15


def test_cut_files_come_whole_with_the_next_call(mission: Mission) -> None:
    whole = {file.name: file.data for file in arrivals(mission)}
    seen: dict[str, list[bytes]] = {}
    broken = with_rates(truncated=1.0, mended=1.0)
    for file in arrivals(broken):
        seen.setdefault(file.name, []).append(file.data)
    last = {sending.segment.header.full_name for sending in make_calls(broken).sendings[-1]}
    for name, copies in seen.items():
        if name.rpartition(".")[0] not in last:
            assert len(copies) == 2
            assert len(copies[0]) < len(copies[1])
            assert copies[1] == whole[name]


def test_files_are_sent_again_as_they_were() -> None:
    copies: dict[str, list[bytes]] = {}
    for file in arrivals(with_rates(resent=1.0)):
        copies.setdefault(file.name, []).append(file.data)
    assert Counter(map(len, copies.values()))[2] > 0.7 * len(copies)
    assert all(len(set(data)) == 1 for data in copies.values())


def test_one_rate_does_not_move_another() -> None:
    few = {s.header.full_name for s, fate in make_calls(with_rates(lost=0.3)).fates if fate is Fate.LOST}
    both = make_calls(with_rates(lost=0.3, late=0.5, truncated=0.2, resent=0.4)).fates
    assert {s.header.full_name for s, fate in both if fate is Fate.LOST} == few
    assert len(few) > 0


@pytest.mark.parametrize(("renamed", "kinds"), [(1.0, "long"), (0.0, "short")])
def test_files_grow_under_short_names_and_are_renamed(renamed: float, kinds: str, tmp_path: Path) -> None:
    mission = with_rates(growing=1.0, renamed=renamed)
    acts = sorted(steps(tmp_path, mission, AS_SENT), key=lambda step: step.time)
    sizes: dict[Path, list[int]] = {}
    for step in play(acts):
        if step.act in (Act.BEGIN, Act.APPEND):
            assert step.path.stem.isdigit()
            sizes.setdefault(step.path, []).append(step.path.stat().st_size)
    assert all(np.all(np.diff(grown) > 0) for grown in sizes.values())
    assert max(map(len, sizes.values())) > 5
    folder = tmp_path / "sim" / "from-glider"
    found = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert found == {file.final_name: file.data for file in arrivals(mission, AS_SENT)}
    assert all(Path(name).stem.isdigit() for name in found) is (kinds == "short")
    assert any(Path(name).stem.isdigit() for name in found) is (kinds == "short")


def test_without_growing_files_have_their_long_name_at_once(mission: Mission, tmp_path: Path) -> None:
    assert {step.act for step in steps(tmp_path, mission, AS_SENT)} == {Act.PUT}


def test_a_file_grows_before_it_has_come(tmp_path: Path) -> None:
    mission = with_rates(growing=1.0)
    for file in arrivals(mission, AS_SENT):
        assert file.begun < file.time < file.renamed_at
    acts = list(steps(tmp_path, mission, AS_SENT))
    ends = [step for step in acts if step.ends]
    assert len(ends) == n_files(mission)


def test_play_waits_for_the_time_of_each_step(mission: Mission, tmp_path: Path) -> None:
    acts = sorted(steps(tmp_path, mission), key=lambda step: step.time)[:10]
    waited: list[float] = []
    for step in play(acts, waited.append):
        assert waited[-1] == step.time
        assert step.path.exists()
    assert waited == [step.time for step in acts]


# --------------------------------------------------------------------------- on board


@pytest.mark.parametrize("fix_in", list(FixIn))
@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_stale_fixes_repeat_the_old_one_at_first(fix_in: FixIn, rate: float) -> None:
    scenario = Scenario(days=1.5, fix_in=fix_in, rates=Rates(stale_fix=rate))
    mission = simulate(scenario)
    t, lat = samples(mission, "m_gps_lat")
    for dive in mission.truth[:-1]:
        assert ("stale_fix" in dive.artefacts) is bool(rate)
        before = degrees(lat)[np.searchsorted(t, dive.t_dive) - 1]
        first = degrees(lat)[np.searchsorted(t, dive.t_surface + 30) + 1]
        assert bool(first == before) is bool(rate)
        assert np.hypot(*dive.through_water) > 0.05
        later = degrees(lat)[(t > dive.t_surface) & (t < dive.t_surface + 7000)]
        assert np.any(later != before)


def test_a_current_without_a_fix_is_published_late_only() -> None:
    sent = {**CADENCE, "m_initial_water_vx": 4.0}
    for rate, least, most in ((0.0, 30, 80), (1.0, 300, 3000)):
        mission = simulate(Scenario(days=1.5, cadence=sent, rates=Rates(stale_fix=rate)))
        t, _ = samples(mission, "m_water_vx")
        firsts = [t[np.searchsorted(t, dive.t_surface)] - dive.t_surface for dive in mission.truth[:-1]]
        assert least < min(firsts) < max(firsts) < most
        assert bool(len(samples(mission, "m_initial_water_vx")[0])) is not bool(rate)


def test_a_restart_begins_a_new_mission_with_new_coordinates() -> None:
    sent = {**CADENCE, "m_x_lmc": 4.0}
    for rate in (0.0, 1.0):
        mission = simulate(replace(PLAIN, cadence=sent, rates=Rates(restart=rate, dac_garbage=0.0)))
        names = [segment.header.full_name for segment in mission.segments]
        numbers = {name.split("-")[-2] for name in names}
        assert len(set(names)) == len(names)
        assert len(numbers) == (len(mission.truth) + 1 if rate else 1)
        shorts = {segment.header.short_name[:4] for segment in mission.segments}
        assert len(shorts) == len(numbers)
        assert all(("restart" in dive.artefacts) is bool(rate) for dive in mission.truth)
        x = samples(mission, "m_x_lmc")[1]
        assert bool(np.abs(x).max() < 4000) is bool(rate)


@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_a_restart_may_report_a_current_that_is_nonsense(rate: float) -> None:
    mission = simulate(replace(PLAIN, days=4.0, rates=Rates(restart=1.0, dac_garbage=rate)))
    errors = [np.hypot(*np.subtract(dive.reported, dive.current)) for dive in mission.truth]
    if rate:
        assert np.median(errors) > 0.2
    else:
        assert max(errors) < 0.04
    assert all(("dac_garbage" in dive.artefacts) is bool(rate) for dive in mission.truth)


def test_a_clock_that_is_ahead_is_so_in_every_time_the_glider_tells(mission: Mission) -> None:
    skewed = with_rates(clock_skew=2880.0)
    for one, two in zip(
        (*mission.segments, *mission.science), (*skewed.segments, *skewed.science), strict=True
    ):
        names = [sensor.name for sensor in one.sensors.columns]
        clock = next(names.index(name) for name in names if name.endswith("present_time"))
        np.testing.assert_allclose(two.values[:, clock] - one.values[:, clock], 2880.0)
        assert two.header.opened - one.header.opened == 2880.0
        assert (two.closed, two.sent) == (one.closed, one.sent)
        np.testing.assert_array_equal(np.delete(one.values, clock, 1), np.delete(two.values, clock, 1))
    ahead = {file.name: file.mtime for file in arrivals(skewed)}
    assert all(ahead[file.name] - file.mtime == 2880.0 for file in arrivals(mission))
    assert [dive.t_surface for dive in mission.truth] == [dive.t_surface for dive in skewed.truth]


@pytest.mark.parametrize("rates", [{"lost": 1.1}, {"late": -0.1}, {"late_calls": 0}, {"clock_skew": 1e6}])
def test_an_impossible_rate_is_refused(rates: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(rates))):
        Rates(**rates)  # type: ignore[arg-type]


# --------------------------------------------------------------------------- files


@pytest.mark.parametrize("fix_in", list(FixIn))
def test_dives_and_stays_at_the_surface_take_turns(fix_in: FixIn) -> None:
    mission = simulate(replace(PLAIN, fix_in=fix_in))
    dives = [segment.header.full_name for segment in mission.segments[:-1:2]]
    assert dives == [dive.segment for dive in mission.truth]
    spans = [(s.header.opened, s.closed) for s in mission.segments]
    assert all(end < begin for (_, end), (begin, _) in pairwise(spans))
    for segment, dive in zip(mission.segments[1::2], mission.truth, strict=True):
        assert dive.t_surface < segment.header.opened < segment.closed
        if fix_in is FixIn.OWN:
            assert 8 <= segment.closed - segment.header.opened <= 62
    shorter = [len(segment.values) for segment in mission.segments[1::2]]
    if fix_in is FixIn.OWN:
        assert max(shorter) < 8 < min(len(segment.values) for segment in mission.segments[:-1:2])


def test_a_surface_file_comes_with_the_next_dive(mission: Mission) -> None:
    for surface, dive in zip(mission.segments[1::2], mission.segments[2::2], strict=True):
        assert surface.sent == dive.sent


def test_science_files_go_with_the_flight_files(mission: Mission) -> None:
    for flight, science in zip(mission.segments, mission.science, strict=True):
        assert flight.header.full_name == science.header.full_name
        assert (flight.header.extension, science.header.extension) == ("sbd", "tbd")
        assert flight.header.opened - science.header.opened == 5.0
        assert flight.sensors.crc != science.sensors.crc
        assert (flight.closed, flight.sent) == (science.closed, science.sent)
    assert simulate(replace(PLAIN, science={})).science == ()


def test_some_sensors_are_sent_on_every_third_yo_only() -> None:
    sent = {"m_pitch": 4.0, "m_roll": 4.0, "m_depth": 4.0}
    mission = simulate(Scenario(days=1.0, cadence={**CADENCE, **sent}, nth_yo={"m_roll": 3}))
    t_roll, _ = samples(mission, "m_roll")
    t, pitch = samples(mission, "m_pitch")
    dive = mission.truth[2]
    under = (t >= dive.t_dive) & (t <= dive.t_surface)
    begins = t[under][1:][(pitch[under][1:] < 0) & (pitch[under][:-1] >= 0)]
    rolled = t_roll[(t_roll >= dive.t_dive) & (t_roll <= dive.t_surface)]
    yo = np.searchsorted(begins, rolled)[np.abs(rolled[:, None] - begins).min(axis=1) > 8]
    assert set(yo) == set(range(0, len(begins) + 1, 3))
    share = len(yo) / under.sum()
    assert 0.2 < share < 0.5


def test_full_rate_files_hold_every_sensor_of_every_cycle() -> None:
    mission = simulate(replace(PLAIN, days=0.3, full_rate=True))
    assert {segment.header.extension for segment in mission.full_rate} == {"dbd", "ebd"}
    for segment, full in zip(mission.segments, mission.full_rate[::2], strict=True):
        assert segment.header.full_name == full.header.full_name
        assert len(full.sensors.columns) == len(full.sensors.sensors) > 40
        names = [sensor.name for sensor in full.sensors.columns]
        columns = [names.index(sensor.name) for sensor in segment.sensors.columns]
        times = full.values[1:, names.index("m_present_time")]
        mine = [sensor.name for sensor in segment.sensors.columns].index("m_present_time")
        at = 1 + np.searchsorted(times, segment.values[1:, mine])
        updated = segment.updated[1:]
        np.testing.assert_array_equal(full.values[at][:, columns][updated], segment.values[1:][updated])
    assert simulate(replace(PLAIN, days=0.3)).full_rate == ()


# --------------------------------------------------------------------------- fleet


def test_a_fleet_has_names_places_and_faults_of_its_own() -> None:
    faults = (Fault(FaultKind.REMORA, 0.0, 2.0), Fault(FaultKind.NET, 0.0, 0.5))
    gliders = fleet(replace(PLAIN, faults=faults), 7)
    assert [glider.glider for glider in gliders] == [f"sim-{i:02d}" for i in range(1, 8)]
    assert len({glider.place for glider in gliders}) == len({glider.waypoints for glider in gliders}) == 7
    assert [glider.faults for glider in gliders] == [faults[:1], faults[1:], *[()] * 5]
    assert {glider.origin for glider in gliders} == {PLAIN.place}
    assert fleet(PLAIN, 1) == [PLAIN]
    with pytest.raises(ValueError, match="one glider"):
        fleet(PLAIN, 0)


def test_gliders_of_a_fleet_do_not_fly_alike() -> None:
    one, two = (simulate(replace(glider, days=0.4)) for glider in fleet(PLAIN, 2))
    assert one.truth[0].speed != two.truth[0].speed
    assert one.truth[0].t_surface != two.truth[0].t_surface
