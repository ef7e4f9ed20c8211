"""The way of one file that opens an incident: functions that it passes, and crossings between packages.

    python benchmarks/opening.py [--edges]

A remora is simulated and its files are replayed. Of the one file that opens the incident every call between
functions of gliderwatch is counted once: a crossing is a call from a function of one package to one of
another (`gliderwatch.store` to `gliderwatch.messages`, say; modules beside the packages count as one). Those
to methods of the values that all rooms share (`model.py`: the length of a series, say) lead to no other room;
the second number is without them.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path
from types import CodeType, FrameType

from click.testing import CliRunner

import gliderwatch
from gliderwatch.cli.main import main

ROOT = str(Path(gliderwatch.__file__).parent)
BEGIN, OPENED = {"process_file", "take"}, {("message.py", "opened"), ("incident_text.py", "opened")}
Edge = tuple[CodeType, CodeType]


def package(code: CodeType) -> str:
    """The package that a function lies in, "" beside the packages."""
    parts = Path(code.co_filename).relative_to(ROOT).parts
    return parts[0] if len(parts) > 1 else ""


def is_ours(code: CodeType) -> bool:
    """Whether a function is one of gliderwatch; comprehensions and lambdas are not counted."""
    return code.co_filename.startswith(ROOT) and not code.co_name.startswith("<")


class Trace:
    """Collects the calls of each file; keeps those of the file that opened the incident."""

    def __init__(self) -> None:
        self.edges: set[Edge] = set()
        self.opening: set[Edge] | None = None
        self._inside: CodeType | None = None
        self._opened = False

    def __call__(self, frame: FrameType, event: str, _arg: object) -> None:
        """See one call or return (`sys.setprofile`)."""
        code = frame.f_code
        if event not in ("call", "return") or not is_ours(code):
            return
        if event == "call" and self._inside is None and code.co_name in BEGIN:
            self._inside, self._opened, self.edges = code, False, set()
            return
        if self._inside is None:
            return
        if event == "return":
            if code is self._inside:
                if self._opened and self.opening is None:
                    self.opening = self.edges
                self._inside = None
            return
        self._opened |= (Path(code.co_filename).name, code.co_name) in OPENED
        caller = frame.f_back
        while caller is not None and not is_ours(caller.f_code):
            caller = caller.f_back
        if caller is not None:
            self.edges.add((caller.f_code, code))


def shown(code: CodeType) -> str:
    """Where a function is, and what it is called."""
    return f"{Path(code.co_filename).relative_to(ROOT)}:{code.co_qualname}"


def run() -> None:
    """Simulate, replay, count, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edges", action="store_true", help="print each crossing")
    arguments = parser.parse_args()
    trace, runner = Trace(), CliRunner()
    with tempfile.TemporaryDirectory() as folder:
        words = [
            "simulate",
            folder,
            "--scenario",
            "calm",
            "--fault",
            "remora:5@3",
            "--seed",
            "1",
            "--days",
            "5",
        ]
        made = runner.invoke(main, words)
        if made.exit_code:
            sys.exit(made.output)
        files = str(Path(folder))
        caches = [str(path) for path in Path(folder).rglob("cache") if path.is_dir()]
        words = ["run", "--replay", files, *(w for c in caches for w in ("--cache", c))]
        sys.setprofile(trace)
        try:
            made = runner.invoke(main, words)
        finally:
            sys.setprofile(None)
    if trace.opening is None:
        sys.exit(f"no incident was opened:\n{made.output}")
    functions = {code for edge in trace.opening for code in edge}
    crossings = [edge for edge in trace.opening if package(edge[0]) != package(edge[1])]
    between = Counter((package(a) or "(top)", package(b) or "(top)") for a, b in crossings)
    rooms = [(a, b) for a, b in crossings if Path(b.co_filename).name != "model.py"]
    print(
        f"functions {len(functions)}, calls {len(trace.opening)}, crossings {len(crossings)}, "
        f"{len(rooms)} of them not to a value of model.py"
    )
    for (a, b), n in between.most_common():
        print(f"  {a} -> {b}: {n}")
    if arguments.edges:
        for a, b in sorted(crossings, key=lambda e: (shown(e[0]), shown(e[1]))):
            print(f"  {shown(a)} -> {shown(b)}")


if __name__ == "__main__":
    run()
