"""`gliderwatch score` as a user runs it, and the guard against loss of what the program detects."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from acceptance.support import TRACEBACK, command, installed

THRESHOLDS = Path(__file__).parents[1] / "golden" / "score.yml"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("score")
    done = installed("score", "--grid", "small", "--out", out)
    assert done.returncode == 0, done.stderr
    assert "joint: faults of simulated gliders" in done.stdout
    return out


@pytest.fixture(scope="module")
def found(small: Path) -> dict[str, Any]:
    return json.loads((small / "score.json").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_nothing_that_was_detected_is_lost(found: dict[str, Any]) -> None:
    limits = YAML(typ="safe").load(THRESHOLDS)
    by_fault = {score["fault"]: score for score in found["faults"] if score["sea"] == ""}
    for fault, least in limits["least_detected"].items():
        assert by_fault[fault]["detected"]["value"] >= least, fault
        assert by_fault[fault]["hours_90"] <= limits["most_hours"][fault], fault
    (overall,) = (score for score in found["false"] if score["sea"] == "")
    assert overall["flag_1"]["value"] <= limits["most_false_flag_1"]
    assert overall["flag_2"]["value"] <= limits["most_false_flag_2"]
    healthy = [score["rms"]["value"] for score in found["speeds"] if not score["is_faulty"]]
    assert max(healthy) <= limits["most_rms_healthy"]


@pytest.mark.slow
def test_what_is_done_is_not_run_again(small: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in (small / "cells").iterdir()}
    (small / "score.json").unlink()
    assert command("score", "--grid", "small", "--out", small, timeout=30).returncode == 0
    assert {path: path.stat().st_mtime_ns for path in (small / "cells").iterdir()} == before
    assert (small / "score.json").exists()


@pytest.mark.slow
def test_the_page_needs_nothing_else(small: Path) -> None:
    page = (small / "score.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 3
    assert "<script" not in page
    assert "src=" not in page


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--estimator", "guess"), "known are: joint"),
        (("--grid", "huge"), "there is no grid huge"),
    ],
)
def test_mistakes_are_told_in_a_line(tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    done = command("score", "--out", tmp_path / "out", *arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert TRACEBACK not in done.stderr
