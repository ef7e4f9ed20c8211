"""`gliderwatch layers`: what it prints and what it writes."""

import json
from pathlib import Path

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
