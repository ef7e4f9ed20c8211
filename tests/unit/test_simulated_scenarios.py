"""Scenarios as YAML: the shipped ones, what may be written, and what is said of mistakes."""

import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.errors import ConfigError
from gliderwatch.simulate import scenario_files
from gliderwatch.simulate.dinkum import Generation
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.ocean import Constituent
from gliderwatch.simulate.scenario import FaultKind, FixIn, Scenario
from gliderwatch.simulate.telemetry import CADENCE, SCIENCE_CADENCE

SHIPPED = scenario_files.shipped()


def load(text: str, folder: Path) -> Scenario:
    path = folder / "mine.yml"
    path.write_text(text, encoding="utf-8")
    return scenario_files.load_scenario(path)


def complaint(text: str, folder: Path) -> str:
    with pytest.raises(ConfigError) as error:
        load(text, folder)
    return str(error.value).replace(str(folder), "")


# --------------------------------------------------------------------------- shipped


def test_there_is_a_scenario_for_each_sea_and_each_fault() -> None:
    faults = {str(kind) for kind in FaultKind if kind is not FaultKind.NONE}
    assert set(SHIPPED) == faults | {
        "calm",
        "tidal",
        "gulf_stream",
        "thruster",
        "deep",
        "rough_data",
        "field",
    }


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenarios_are_read_and_say_what_they_are(name: str) -> None:
    scenario = scenario_files.load_scenario(scenario_files.find(name))
    about = re.search(r"^about: (.+)$", SHIPPED[name].read_text(), re.MULTILINE)
    assert about and len(about[1]) > 20
    assert scenario.science
    assert scenario.surface_segments
    assert [fault.kind for fault in scenario.faults] == ([FaultKind(name)] if name in list(FaultKind) else [])
    assert all(fault.onset < scenario.start + 86400 * scenario.days for fault in scenario.faults)


def test_shipped_scenarios_have_seeds_of_their_own() -> None:
    seeds = [scenario_files.load_scenario(path).seed for path in SHIPPED.values()]
    assert len(set(seeds)) == len(seeds)


def test_the_gulf_stream_flows_faster_than_the_glider_flies() -> None:
    mission = simulate(scenario_files.load_scenario(scenario_files.find("gulf_stream")))
    speeds = [dive.speed for dive in mission.truth]
    assert 0.5 < min(speeds) < max(speeds) < 0.7
    assert max(np.hypot(*dive.current) for dive in mission.truth) > 1.3 * max(speeds)


def test_a_missing_scenario_names_the_nearest() -> None:
    with pytest.raises(ConfigError, match=r"no scenario gulfstream.*did you mean `gulf_stream`"):
        scenario_files.find("gulfstream")


def test_a_scenario_may_be_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.yml"
    path.write_text("days: 2\n")
    assert scenario_files.find(str(path)) == path


def test_scenarios_are_found_in_a_wheel_and_in_a_checkout(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert scenario_files.folder() == Path(__file__).parents[2] / "config" / "scenarios"
    (tmp_path / "scenarios").mkdir()
    monkeypatch.setattr("gliderwatch.config.__file__", str(tmp_path / "__init__.py"))
    assert scenario_files.folder() == tmp_path / "scenarios"
    pyproject = (Path(__file__).parents[2] / "pyproject.toml").read_text()
    assert '"config/scenarios" = "gliderwatch/config/scenarios"' in pyproject


# --------------------------------------------------------------------------- what may be written


def test_an_empty_file_is_the_usual_glider(tmp_path: Path) -> None:
    scenario, usual = load("", tmp_path), Scenario()
    differ = {
        each.name for each in fields(Scenario) if getattr(scenario, each.name) != getattr(usual, each.name)
    }
    assert differ == {"variation", "science"}
    assert scenario.science == SCIENCE_CADENCE


def test_everything_may_be_written(tmp_path: Path) -> None:
    scenario = load(
        """
about: a test
start: 2022-11-05T06:00:00Z
place: [38.4, -63.0]
waypoints: [[38.9, -63.6]]
variation: 0.28
generation: G2
fix_in: next
thruster: {thrust: 2.0, on_dives: true}
bottom: {depth: 80, slope: [0.001, 0]}
sea:
  tides: [{constituent: O1, major: 0.1}]
  front: {speed: 1.5}
water: {layers: [{depth: 20}, {depth: 50}]}
cadence: {m_roll: null, m_fin: 60}
science: null
nth_yo: {m_fin: 3}
rates: {lost: 0.1}
faults:
  - {kind: fouling, day: 1.5, size: 2}
  - {kind: remora, day: 2, size: 3, ramp_days: 0.5}
""",
        tmp_path,
    )
    assert scenario.start == 1667628000.0
    assert (scenario.generation, scenario.fix_in) == (Generation.G2, FixIn.NEXT)
    assert scenario.waypoints[0].lon == -63.6
    assert scenario.variation == 0.28
    assert scenario.sea.tides[0].constituent is Constituent.O1
    assert scenario.sea.front is not None and scenario.thruster is not None and scenario.bottom is not None
    assert len(scenario.water.layers) == 2
    assert scenario.science == {}
    assert set(scenario.cadence) == set(CADENCE) - {"m_roll"} | {"m_fin"}
    fouling, remora = scenario.faults
    assert (fouling.onset - scenario.start, fouling.ramp) == (1.5 * 86400, 5 * 86400.0)
    assert (remora.onset - scenario.start, remora.ramp) == (2 * 86400, 43200.0)


def test_variation_is_that_of_the_world_magnetic_model(tmp_path: Path) -> None:
    """About 16 degrees West where electa flew in November 2022: its own receiver said 16.2."""
    scenario = load("place: [38.4, -63.1]\nstart: 2022-11-06T00:00:00Z\n", tmp_path)
    assert np.degrees(scenario.variation) == pytest.approx(16.2, abs=1.0)


# --------------------------------------------------------------------------- mistakes


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("dais: 3\n", "/mine.yml:1: dais: unknown key (did you mean `days`?)"),
        ("seed: 1\nsea:\n  sigmaa: 1\n", "/mine.yml:3: sea.sigmaa: unknown key (did you mean `sigma`?)"),
        (
            "sea:\n  tides:\n    - constituent: M2\n      majr: 1\n      major: 1\n",
            "/mine.yml:4: sea.tides.0.majr: unknown key (did you mean `major`?)",
        ),
        (
            "thruster:\n  thurst: 1\n",
            "/mine.yml:2: thruster.thurst: unknown key (did you mean `thrust`?)",
        ),
        ("rates:\n  lost: 2\n", "/mine.yml:1: rates: lost is 2: a rate is 0 to 1"),
        ("seed: 1\ndays: many\n", "/mine.yml:2: days: must be a number"),
        ("days: .nan\n", "/mine.yml:1: days: must be a finite number"),
        ("seed: 1\ndays: 0\n", "/mine.yml:2: days: days are above 0 and at most 366"),
        ("faults:\n  - {kind: remora, day: 1}\n", "/mine.yml:2: faults.0.size: is missing"),
        (
            "faults:\n  - {kind: remora, day: 1, size: 0.5}\n",
            "remora of size 0.5: it is the factor on the drag of the hull, 1 to 12",
        ),
        ("generation: G4\n", "/mine.yml:1: generation: must be G2 or G3"),
        ("seed: 1\nseed: 2\n", "/mine.yml:2: seed: given twice"),
        (
            "seed: 1\ncadence:\n  m_rol: 4\n",
            "/mine.yml:3: cadence.m_rol: m_rol is not simulated: did you mean m_roll?",
        ),
        ("cadence:\n  m_roll: 1\n", "/mine.yml:2: cadence.m_roll: m_roll every 1.0 s: the cycle is 4.0 s"),
        ("nth_yo:\n  m_fin: 2\n", "/mine.yml:2: nth_yo.m_fin: m_fin is not sent at all"),
        ("sea: 3\n", "/mine.yml:1: sea: must be a section"),
        ("a: [\n", "/mine.yml:2"),
    ],
)
def test_mistakes_are_told_with_their_line_and_cure(text: str, said: str, tmp_path: Path) -> None:
    assert said in complaint(text, tmp_path)


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    assert len(complaint("dais: 3\nsedd: 1\nsea: {taw: 1}\n", tmp_path).splitlines()) == 3


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("remoora:2@1", "no fault remoora (did you mean `remora`?)"),
        ("remora:2", "not NAME:SIZE@DAY"),
        ("remora:x@1", "not NAME:SIZE@DAY"),
        ("remora:2@-1", "not NAME:SIZE@DAY"),
        ("wing_loss:2@1", "the part of the horizontal speed that is lost, 0 to 0.9"),
    ],
)
def test_a_fault_in_short_that_is_none(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as error:
        scenario_files.fault_line(text)
    assert said in str(error.value)


def test_a_fault_in_short() -> None:
    fault = scenario_files.fault_line("compass:-0.3@2.5").fault(1000.0)
    assert (fault.kind, fault.size, fault.onset, fault.ramp) == (
        FaultKind.COMPASS,
        -0.3,
        1000.0 + 216000,
        0.0,
    )
