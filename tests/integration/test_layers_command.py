"""`gliderwatch layers`: what it prints and what it writes."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from gliderwatch.cli.main import main


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["layers", *map(str, arguments)])


def test_simulate_draws_the_run_and_says_what_it_covered(tmp_path: Path) -> None:
    result = run("simulate", "--preset", "simulation", "--out", tmp_path / "figures", "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert found["coverage_least"] > 0.99
    assert found["resets"] == 0
    assert "<svg" in Path(found["figure"]).read_text(encoding="utf-8")[:500]


def test_simulate_says_whether_layers_that_jumped_were_found_again(tmp_path: Path) -> None:
    result = run("simulate", "--jump", "10", "--out", tmp_path, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert found["coverage_after_jump"] == 0.0
    assert found["resets"] == 1
    assert 273 < found["found_again_after_s"] < 273 + 4 * 91  # three periods of patience, then four
    assert found["coverage_at_end"] > 0.99


@pytest.mark.parametrize("jump", ["nan", "inf", "1e9", "deep"])
def test_a_jump_that_cannot_be_is_refused_in_words(jump: str, tmp_path: Path) -> None:
    result = run("simulate", "--jump", jump, "--out", tmp_path)
    assert result.exit_code == 2
    assert "Invalid value for '--jump'" in result.output


@pytest.mark.real
def test_replay_compares_the_methods(shared_data: Path) -> None:
    mission = shared_data / "usf-sam-2019"
    result = run("replay", mission / "from-glider", "--cache", mission / "cache", "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert found["means"]["full yos"]["coverage"] == 1.0
    assert found["means"]["composite, two full casts"]["coverage"] > 0.97
    assert len(found["segments"]["composite"]) == found["means"]["composite"]["segments"] == 18


@pytest.mark.real
def test_replay_of_a_sensor_that_no_file_has_says_so(shared_data: Path) -> None:
    mission = shared_data / "usf-sam-2019"
    result = run("replay", mission / "from-glider", "--cache", mission / "cache", "--sensor", "sci_no_such")
    assert result.exit_code == 2
    assert "no segment with 6 casts of sci_no_such" in result.output
