"""A fleet that maps a field: its places and surfacings, the dockservers it calls, the advice it follows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.errors import ConfigError
from gliderwatch.fleet.advice import Advice
from gliderwatch.simulate import job
from gliderwatch.simulate.delivery import FileForm
from gliderwatch.simulate.flight import Point, displacement, offset
from gliderwatch.simulate.following import by_files, fly, waypoint_of
from gliderwatch.simulate.glider import Underway, fleet, simulate
from gliderwatch.simulate.scenario import Mission
from gliderwatch.simulate.scenario_files import find, load_scenario
from gliderwatch.slocum.mission_arguments import write_goto

FIELD = replace(load_scenario(find("field")), days=0.3)


def test_gliders_begin_anywhere_in_the_box_and_come_up_when_they_like():
    members = fleet(replace(FIELD, days=2.0), 12)
    places = np.array([displacement(FIELD.place, each.place) for each in members])
    assert ((places > 0) & (places < 60e3)).all()
    assert places.std(axis=0).min() > 8e3
    intervals = [each.interval for each in members]
    assert 3600 <= min(intervals) < 5400
    assert 8400 < max(intervals) <= 10800
    assert len({each.waypoints[0] for each in members}) == 12
    assert fleet(replace(FIELD, days=2.0), 12) == members


def test_a_dive_takes_the_interval_by_a_quarter_of_an_hour_more_or_less():
    one = replace(FIELD, days=2.0, interval=2 * 3600.0, interval_range=None, science={})
    took = [dive.t_surface - dive.t_dive for dive in simulate(one).truth]
    assert 100 < np.std(took) < 900
    assert 0 < np.mean(took) - 2 * 3600 < 1200  # it comes up at the end of a climb
    with pytest.raises(ValueError, match="interval_jitter"):
        replace(FIELD, interval=1200.0)


def test_what_is_sent_dive_by_dive_is_the_mission():
    scenario, news = fleet(FIELD, 1)[0], list[Mission]()
    underway = Underway(scenario)
    while underway.time < scenario.start + 86400 * scenario.days:
        underway.fly()
        news.append(underway.news())
    whole = underway.mission()
    sent = [segment.header for each in news for segment in each.segments]
    assert sent == [segment.header for segment in whole.segments][: len(sent)]
    assert 0 < len(whole.segments) - len(sent) <= 2  # the stay at the surface that ends it


def test_gliders_go_where_the_answer_leads_and_the_next_at_the_surface_flies_first():
    goal, times = Point(50.3, -29.6), list[float]()

    def answer(sent: Mission) -> Point:
        times.append(sent.segments[-1].closed)
        return goal

    members = fleet(FIELD, 2)
    flown = {each.glider: each for each in fly(members, answer)}
    assert len(times) > 4
    for member in members:
        truth = flown[member.glider].mission().truth
        before, after = (np.hypot(*displacement(truth[k].end, goal)) for k in (0, -1))
        assert after < before


def test_advice_is_taken_from_the_file_that_the_service_writes(tmp_path: Path):
    lat, lon = offset(FIELD.place, np.array(9e3), np.array(20e3))
    advice = Advice(0.5, float(lat), float(lon), 0.1, None)
    write_goto("sim-01", "upper", FIELD.start, advice, tmp_path)
    found = waypoint_of((tmp_path / "sim-01-upper-goto.ma").read_text())
    assert np.hypot(*displacement(Point(advice.lat, advice.lon), found)) < 1.0
    asked = by_files(tmp_path / "gliders", tmp_path / "cache", tmp_path, FileForm(), patience=0.0)
    one = Underway(fleet(FIELD, 1)[0])
    one.fly()
    assert asked(one.news()) is None  # it is as old as the last surfacing
    assert len(list(tmp_path.rglob("*.sbd"))) >= 1
    assert waypoint_of("behavior_name=goto_list") is None


def test_a_dockserver_that_is_off_is_not_called(tmp_path: Path, capsys):
    off = job.outages(["1@0.1-0.2"], 2, FIELD.start)
    made = job.Job(tmp_path, fleet(replace(FIELD, science={}), 2), relays=2, outages=off)
    assert [made.relay_of(0, FIELD.start + day * 86400) for day in (0.05, 0.15, 0.25)] == [0, 1, 0]
    assert made.relay_of(1, FIELD.start + 0.15 * 86400) == 1
    job.run(made)
    count = {relay: len(list((tmp_path / f"relay-{relay}").rglob("*.sbd"))) for relay in (1, 2)}
    at_second = list((tmp_path / "relay-2").rglob("sim-01*.sbd"))
    assert 0 < len(at_second) < count[1] + len(at_second)
    assert f"{sum(count.values())} files" in capsys.readouterr().out
    for wrong in ("3@1-2", "1@2-1", "1"):
        with pytest.raises(ConfigError, match="--outage"):
            job.outages([wrong], 2, FIELD.start)
