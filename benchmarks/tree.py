"""The size of the source tree: modules, which of them have one importer, functions.

    python benchmarks/tree.py [--one] [SRC]

A module is a file that is not an `__init__`. Its importers are the modules that name it, or what is in it, in
an import; `--one` lists those with one importer, and who that is.
"""

from __future__ import annotations

import argparse
import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from statistics import median

SRC = Path(__file__).resolve().parents[1] / "src"


def modules(src: Path) -> dict[str, Path]:
    """All modules by their dotted name, packages by theirs."""
    found = {}
    for path in sorted(src.rglob("*.py")):
        parts = path.relative_to(src).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """What a module imports: from where, and the name (empty: the module itself)."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)


def importers(trees: Mapping[str, ast.AST]) -> dict[str, set[str]]:
    """Who imports each module."""
    found: dict[str, set[str]] = defaultdict(set)
    for name, tree in trees.items():
        for source, part in imported(tree):
            inner = f"{source}.{part}"
            found[inner if inner in trees else source].add(name)
    return found


def run() -> None:
    """Count and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--one", action="store_true", help="list the modules with one importer")
    parser.add_argument("src", nargs="?", type=Path, default=SRC)
    arguments = parser.parse_args()
    paths = modules(arguments.src)
    texts = {name: path.read_text(encoding="utf-8") for name, path in paths.items()}
    trees = {name: ast.parse(text) for name, text in texts.items()}
    of = importers(trees)
    plain = [name for name, path in paths.items() if path.name != "__init__.py"]
    lines = [len(texts[name].splitlines()) for name in plain]
    one = [name for name in plain if len(of[name]) == 1]
    functions = sorted(
        (node.end_lineno - node.lineno + 1, f"{name}.{node.name}")
        for name, tree in trees.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno is not None
    )
    print(f"modules {len(plain)}, and {len(paths) - len(plain)} __init__; lines {sum(lines)}")
    print(f"lines of a module: median {median(lines):.0f}, longest {max(lines)}")
    print(f"modules with one importer: {len(one)}")
    middle = median(n for n, _ in functions)
    print(f"functions {len(functions)}: lines median {middle:.0f}, longest {functions[-1]}")
    for name in one if arguments.one else ():
        print(f"  {name} <- {', '.join(of[name])}")


if __name__ == "__main__":
    run()
