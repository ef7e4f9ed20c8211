"""What nothing in src reads is dead: public functions, methods, constants and fields of classes."""

import ast
from collections.abc import Iterator
from pathlib import Path

SRC = Path(__file__).parents[2] / "src" / "gliderwatch"
ALLOWED = {
    "low_pass_both_ways": "the delayed mode of paper 002",
    "AdaptiveInfo.n_steps": "tests count the substeps of a dive by it",
    "Assessment.parameters": "in every assessment that is written out: the hash of what was used",
    "Group.format_commands": "click calls it",
    "Store.clock_steps": "tests of clocks that fall back look at it",
    "metropolis": "the consensus of paper 003, for comparison: benchmarks/fleet_field.py",
    "mean_variance": "J of paper 003; tests of the gradient look at it",
    "is_sent": "benchmarks/sensors.py asks which sensors a mission has",
    "in_tide": "benchmarks/sensors.py flies missions in tides by it",
    "TIDAL": "benchmarks/sensors.py offers these",
    "with_fault": "benchmarks/seas.py puts faults into missions by it",
    "Sent.computer": "rules of health read it next",
    "_Warnings.emit": "logging calls it",
    "_Handler.on_any_event": "watchdog calls it",
    "_Context.Process": "pebble begins processes by it",
}
"""Defined, not read by name in src, and why it stays."""


def _reads(tree: ast.Module) -> Iterator[str]:
    """Names that are loaded, and words in strings: keys and `__all__` name what is read elsewhere."""
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(attr=name, ctx=ast.Load()) | ast.Name(id=name, ctx=ast.Load()):
                yield name
            case ast.Constant(value=str(word)) if word.isidentifier():
                yield word


def _definitions(body: list[ast.stmt], prefix: str = "") -> Iterator[str]:
    """Functions, classes, constants and fields; what a decorator registers is read by the decorator."""
    for node in body:
        match node:
            case ast.FunctionDef(name=name, decorator_list=[]):
                yield prefix + name
            case ast.ClassDef(name=name):
                if not node.decorator_list:
                    yield name
                yield from _definitions(node.body, f"{name}.")
            case ast.AnnAssign(target=ast.Name(id=name)):
                yield prefix + name
            case ast.Assign(targets=[ast.Name(id=name)]) if not prefix:
                yield name


def unread(trees: list[ast.Module]) -> set[str]:
    read = {name for tree in trees for name in _reads(tree)}
    return {
        full
        for tree in trees
        for full in _definitions(tree.body)
        if (name := full.split(".")[-1]) not in read and not name.startswith("__")
    }


def test_what_is_defined_is_read() -> None:
    assert unread([ast.parse(path.read_text()) for path in SRC.rglob("*.py")]) == ALLOWED.keys()


def test_an_unread_function_and_field_are_found() -> None:
    text = "def used(): ...\ndef dead(): ...\nclass A:\n    x: int\n    y: int\nused(A(1, 2).x)\n"
    assert unread([ast.parse(text)]) == {"dead", "A.y"}
