"""What the score runs: grids, estimators, keys of results."""

from dataclasses import replace
from pathlib import Path

import pytest

from gliderwatch.errors import ConfigError, GliderwatchError
from gliderwatch.score import work
from gliderwatch.score.grid import cells, check, configuration, estimators, folder, load_grid
from gliderwatch.score.work import to_do
from gliderwatch.simulate.scenario import FaultKind

SMALL = load_grid("small")


@pytest.mark.parametrize("path", sorted(folder().glob("*.yml")), ids=lambda p: p.stem)
def test_shipped_grids_have_what_they_say(path):
    grid = load_grid(path.stem)
    found = cells(grid)
    sizes = sum(map(len, grid.faults.values()))
    blind = len(grid.sensors.seas) * len(grid.sensors.left_out)
    healthy = (len(grid.healthy.seas) + blind) * grid.healthy.gliders
    assert len(found) == sizes * (len(grid.seas) + blind) * grid.gliders + healthy
    assert len({cell.name for cell in found}) == len(found)


def test_the_default_grid_holds_every_fault():
    assert set(load_grid("default").faults) == set(FaultKind) - {FaultKind.NONE}


def test_each_glider_in_a_kind_of_sea_has_a_sea_of_its_own():
    rotary = [c for c in cells(load_grid("seas")) if c.sea == "rotary"]
    assert len({c.scenario.sea for c in rotary}) == len(rotary)
    assert all(c.scenario.days == 30 for c in rotary)


def test_without_a_sensor_it_is_the_same_glider_that_does_not_send_it():
    found = {(c.sea, c.fault, c.seed): c for c in cells(load_grid("seas"))}
    whole, blind = found["mixed", "remora", 0], found["mixed, no heading", "remora", 0]
    assert "m_heading" in whole.scenario.cadence
    assert "m_heading" not in blind.scenario.cadence
    assert replace(blind.scenario, cadence=whole.scenario.cadence) == whole.scenario


def test_real_missions_are_run_without_each_of_the_sensors(tmp_path):
    grid = load_grid("seas")
    real = [c for c in cells(grid, (tmp_path / "george",)) if c.mission is not None]
    assert {c.without for c in real} == {"", *grid.sensors.left_out}
    assert len({c.name for c in real}) == len(real)


def test_sizes_share_a_glider_and_nothing_else_does():
    found = [c for c in cells(load_grid("default")) if c.sea == "calm"]
    seeds = {(c.fault, c.seed): c.scenario.seed for c in found}
    assert len(set(seeds.values())) == len(seeds)
    assert all(c.scenario.seed == seeds[c.fault, c.seed] for c in found)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sea: [calm]", "unknown field `sea`"),
        ("seas: [clam]", "there is no scenario clam"),
        ("faults: {remra: [2]}", "remra"),
        ("faults: {remora: [0.5]}", "remora of size 0.5"),
        ("grafts: {slowed: [2]}", "slowed of size 2"),
        ("sensors: {left_out: [headin]}", "nothing is called headin"),
        ("onset: 12", "onset"),
        ("normal: [1.3, 0.7]", "normal"),
        ("a: [", "score.yml"),
    ],
)
def test_a_wrong_grid_is_refused_in_words(tmp_path, text, said):
    path = tmp_path / "score.yml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said):
        cells(load_grid(str(path)))


def test_no_such_grid():
    with pytest.raises(ConfigError, match="there is no grid defalt"):
        load_grid("defalt")


def test_an_unknown_estimator_is_refused_with_the_known_ones():
    assert check("adaptive:franklin") in estimators()
    names = "joint, adaptive, adaptive:franklin"
    with pytest.raises(GliderwatchError, match=f"no estimator adaptve; known are: {names}"):
        check("adaptve")


def test_an_estimator_is_settings_of_a_pilot():
    params = configuration("adaptive:usf-stella", "sim", 0.2, 0.3).glider("sim")
    assert (params.speed_min, params.speed_max) == (0.2, 0.3)
    assert (params.learner.gamma, params.gamma_f) == (1e-7, 1.0)


def test_a_key_changes_with_all_that_a_result_depends_on(monkeypatch):
    cell = cells(SMALL)[0]
    keys = {
        work.key(cell, "adaptive"),
        work.key(cell, "adaptive:franklin"),
        work.key(replace(cell, normal=(0.6, 1.3)), "adaptive"),
        work.key(replace(cell, scenario=replace(cell.scenario, seed=5)), "adaptive"),
    }
    monkeypatch.setattr(work, "version", lambda: "another")
    keys.add(work.key(cell, "adaptive"))
    assert len(keys) == 5


def test_the_key_of_a_real_mission_knows_its_files(tmp_path):
    mission = tmp_path / "unit"
    mission.mkdir()
    (mission / "a.sbd").write_bytes(b"1")
    cell = cells(replace(SMALL, healthy=replace(SMALL.healthy, gliders=0), faults={}), (mission,))[0]
    before = work.key(cell, "adaptive")
    (mission / "b.sbd").write_bytes(b"2")
    assert work.key(cell, "adaptive") != before


def test_what_is_done_or_broken(tmp_path: Path):
    found = cells(SMALL)
    path = work.result_path(tmp_path, found[0], "adaptive")
    path.parent.mkdir(parents=True)
    path.write_text("{ cut")
    assert len(to_do(found, ["adaptive"], tmp_path)) == len(found)
