"""`docs/nomenclature.md` has every quantity, field, key and parameter of the code, and nothing else."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest

from gliderwatch.estimation import healthy_baseline
from gliderwatch.estimation.kalman import JointParams
from gliderwatch.estimation.modes import MODES, Mode
from gliderwatch.estimation.speed_range import RangeParams
from gliderwatch.estimation.verdict import SpeedParams
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.model import Assessment, NextSurfacing
from gliderwatch.papers.learner import AdaptiveParams
from gliderwatch.params import AnomalyRule, Attention, FalseAlarmRule, GliderParams, LearnerParams, RuleParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.sea.gauss_markov import FlowParams, Tide
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.slocum.decode import decode
from gliderwatch.slocum.sensors import QUANTITIES

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "nomenclature.md"
SOURCE = ROOT / "src" / "gliderwatch"
SETTINGS = (GliderParams, LearnerParams, RuleParams, AnomalyRule, FalseAlarmRule, Attention, AdaptiveParams)
JOINT = (SpeedParams, JointParams, FlowParams, Tide, Mode, RangeParams)
ENDS = ("_low", "_usual", "_high")


def tables(heading: str) -> list[list[str]]:
    """The rows of all tables of one section, without their heads: the cells as text."""
    text = PAGE.read_text(encoding="utf-8")
    section = re.search(rf"^## {heading}\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE)
    assert section is not None, f"no section {heading} in {PAGE.name}"
    rows = [line.strip("|").split("|") for line in section[1].splitlines() if line.startswith("| `")]
    return [[cell.strip() for cell in row] for row in rows]


def named(heading: str) -> list[str]:
    return [row[0].strip("`") for row in tables(heading)]


def test_quantities_with_units_and_sensors() -> None:
    shown = [(row[0].strip("`"), row[1], row[2], row[4]) for row in tables("Quantities of a file")]
    made = [
        (q.name, q.unit, f"{', '.join(f'`{s}`' for s in q.sensors)} ({q.slocum_unit})", q.about)
        for q in QUANTITIES
    ]
    assert shown == made


def test_ranges_of_quantities() -> None:
    shown = {row[0].strip("`"): row[3] for row in tables("Quantities of a file")}
    values = {"2π": 6.2832, "π": 3.1416, "π/2": 1.5708}
    for quantity in QUANTITIES:
        low, high = (
            (-1.0 if bound.startswith("−") else 1.0)
            * (values.get(bound.lstrip("−")) or float(bound.lstrip("−")))
            for bound in shown[quantity.name].split(" to ")
        )
        assert (low, high) == pytest.approx((quantity.low, quantity.high), rel=1e-4), quantity.name


def test_fields_of_an_assessment() -> None:
    assert named("Assessment") == [field.name for field in fields(Assessment)]


def test_fields_of_the_next_surfacing() -> None:
    assert named("Next surfacing") == [field.name for field in fields(NextSurfacing)]


def test_fields_of_the_advice_on_layers() -> None:
    assert named("Layers") == [field.name for field in fields(LayerAdvice)]


def test_parameters() -> None:
    assert named("Parameters") == [
        f"{kind.__name__}.{field.name}" for kind in (*SETTINGS, *JOINT) for field in fields(kind)
    ]


def test_values_of_the_joint_estimator() -> None:
    shown = {row[0].strip("`"): row[2] for row in tables("Parameters")}
    compared = 0
    for kind in JOINT:
        for field in fields(kind):
            value = shown[f"{kind.__name__}.{field.name}"]
            if re.fullmatch(r"[0-9.]+", value):
                assert float(value) == field.default, f"{kind.__name__}.{field.name}"
                compared += 1
    assert compared > 25
    tides = FlowParams().tides
    assert shown["Tide.omega"] == ", ".join(f"{tide.omega:.7f}" for tide in tides)
    assert shown["Tide.size"] == ", ".join(f"{tide.size:g}" for tide in tides)
    assert shown["Mode.chance"] == ", ".join(f"{mode.chance:g}" for mode in MODES)
    assert shown["Mode.size"] == ", ".join(f"{mode.size:g}" for mode in MODES)


def keys_in_code() -> set[str]:
    """Names under which navigation and estimators put numbers into dictionaries, read from the source."""
    paths = [path for folder in ("navigation", "estimation") for path in (SOURCE / folder).glob("*.py")]
    paths.append(SOURCE / "fleet" / "reference.py")
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in paths]
    functions = [
        node
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and _gives_numbers(node)
    ]
    return {key for function in functions for key in _keys(function)}


def _gives_numbers(function: ast.FunctionDef) -> bool:
    """Whether a function returns evidence, or makes a dive with it."""
    gives = ast.unparse(function.returns) if function.returns is not None else ""
    return gives == "dict[str, float]" or function.name == "_dive"


def _keys(function: ast.FunctionDef) -> Iterator[str]:
    for node in ast.walk(function):
        if isinstance(node, ast.Dict):
            yield from (_text(key) for key in node.keys if _text(key))
        elif isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
            yield from (_text(node.slice),) if _text(node.slice) else ()
        elif isinstance(node, ast.Tuple) and len(node.elts) == 2 and not _text(node.elts[1]):
            yield from (_text(node.elts[0]),) if _text(node.elts[0]) else ()


def _text(node: ast.AST | None) -> str:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def test_keys_of_evidence() -> None:
    assert set(named("Evidence")) == keys_in_code()


def with_usual() -> list[str]:
    """The keys that may come with `ENDS`, as the page lists them."""
    text = PAGE.read_text(encoding="utf-8")
    found = re.search(r"\*\*What is usual\.\*\*.*?They are (.*?)\. ", text, re.DOTALL)
    assert found is not None
    return re.findall(r"`(\w+)`", found[1])


def test_keys_with_what_is_usual() -> None:
    assert with_usual() == [quantity.name for quantity in healthy_baseline.QUANTITIES]


@pytest.mark.parametrize("estimator", ["joint", "adaptive"])
def test_keys_of_evidence_of_a_simulated_mission(estimator: str, tmp_path: Path) -> None:
    state, emitted, params = GliderState(), set[str](), GliderParams(estimator=estimator)  # type: ignore[arg-type]
    for path in write_mission(tmp_path / "gliders", tmp_path / "cache", simulate(Scenario(days=1.5))):
        outcome = process(state, decode(path, [tmp_path / "cache"]), params)
        state = outcome.state
        emitted |= {key for a in outcome.assessments for key in a.evidence}
    own = {"joint": "speed_sigma", "adaptive": "speed_before"}[estimator]
    assert {"along_speed", "depth_rate_climb", "duration_h", "roll_mean_usual", own} <= emitted
    usual = {f"{name}{end}" for name in with_usual() for end in ENDS}
    assert emitted - usual <= set(named("Evidence"))
