"""Halves and doubles each heuristic, and says which test notices.

    python benchmarks/mutations.py [--room navigation] [--constant FASTEST] [--jobs 2]

The constants are those of the pages `src/gliderwatch/ROOM/constants.py`. For each change the fast tests of
the room run against a copy of `src` with that page changed, until one fails; those of the modules that use
the constant come first. A change that none notices SURVIVED: a test is missing, or the constant does nothing.
Ends with 1 where one did, and with 2 where the tests fail without any change.
"""

from __future__ import annotations

import argparse
import ast
import multiprocessing
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

# Loaded once here and inherited by each process; gliderwatch itself is not, as each process has its own.
import hypothesis  # noqa: F401
import msgspec  # noqa: F401
import numpy as np  # noqa: F401
import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "gliderwatch"
TESTS = {
    "navigation": "unit/test_heuristics_navigation unit/test_dac unit/test_dives unit/test_features"
    " unit/test_fixes unit/test_flight unit/test_flight_samples unit/test_track unit/test_clock"
    " unit/test_pressure",
    "sea": "unit/test_heuristics_sea unit/test_gauss_markov unit/test_ocean_field unit/test_tides",
    "estimation": "unit/test_heuristics_estimation unit/test_verdict_misfit unit/test_speed_range"
    " unit/test_healthy_baseline unit/test_kinematic_speed unit/test_step_test unit/test_adaptive"
    " unit/test_verdict unit/test_kalman unit/test_glider_estimate unit/test_surface_drift",
    "layers": "unit/test_heuristics_layers unit/test_layers unit/test_layer_advice unit/test_casts",
    "fleet": "unit/test_heuristics_fleet unit/test_fleet_flow unit/test_cross_check unit/test_fleet_field"
    " unit/test_fleet_advice unit/test_fleet_batches unit/test_fleet_reference unit/test_exchange",
    "forecast": "unit/test_heuristics_forecast unit/test_kalman_expected_flow unit/test_forecast_steering"
    " unit/test_forecast_surfacing unit/test_forecast_timing unit/test_forecast_waypoints"
    " property/test_forecast",
    "messages": "unit/test_heuristics_messages unit/test_evidence unit/test_incident_text",
    "health": "unit/test_heuristics_health unit/test_health_rules unit/test_health_incidents",
    "incidents": "unit/test_heuristics_incidents unit/test_notifications unit/test_state_machine"
    " unit/test_overdue unit/test_unjudged unit/test_send_schedule unit/test_irregularities"
    " unit/test_neighbours",
}
"""The fast tests of each room."""
CHANGES = {"half": 0.5, "double": 2.0}


@dataclass(frozen=True, slots=True)
class Change:
    """A constant of a room's page, the text of its value, and what it is changed to (the same: no change)."""

    room: str
    name: str
    value: str
    how: str = "none"


def constants(room: str) -> list[tuple[str, str]]:
    """Name and text of the value of each constant on a room's page; sets of names are none."""
    page = ast.parse((PACKAGE / room / "constants.py").read_text(encoding="utf-8"))
    return [(name, ast.unparse(value)) for name, value in assigned(page)]


def assigned(page: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Each name of a page with its value; some that belong together stand on one line."""
    for node in page.body:
        if not isinstance(node, ast.Assign) or isinstance(node.value, ast.Call):
            continue
        target, value = node.targets[0], node.value
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = zip(target.elts, value.elts, strict=True)
            yield from ((name.id, each) for name, each in pairs if isinstance(name, ast.Name))
        elif isinstance(target, ast.Name):
            yield target.id, value


def changed(value: str, how: str) -> str:
    """The text of a value that is halved or doubled; a whole number stays one and is at least 1."""
    return repr(_times(CHANGES[how], eval(value, {**_values(), "__builtins__": {}})))


def _times(factor: float, now: object) -> object:
    if isinstance(now, tuple):
        return tuple(_times(factor, each) for each in now)
    if isinstance(now, dict):
        return {key: _times(factor, each) for key, each in now.items()}
    assert isinstance(now, int | float)
    return max(int(now * factor), 1) if isinstance(now, int) else factor * now


def _values() -> dict[str, object]:
    """The constants of all pages, as a later one may rest on an earlier one."""
    found: dict[str, object] = {}
    for room in TESTS:
        for name, value in constants(room):
            found[name] = eval(value, {**found, "__builtins__": {}})
    return found


def tests(change: Change) -> list[str]:
    """The files of the tests of a room, those of the modules that use the constant first."""
    page = f"gliderwatch.{change.room}.constants"
    users = [
        ".".join(("gliderwatch", *path.relative_to(PACKAGE).with_suffix("").parts))
        for path in PACKAGE.rglob("*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ImportFrom) and node.module == page
        if change.name in {alias.name for alias in node.names}
    ]
    files = [ROOT / "tests" / f"{name}.py" for name in TESTS[change.room].split()]
    texts = {path: path.read_text(encoding="utf-8") for path in files}
    return sorted(map(str, files), key=lambda path: not any(user in texts[Path(path)] for user in users))


def replaced(text: str, value: ast.expr, by: str) -> str:
    """A page with one of its values replaced."""
    assert value.end_lineno is not None and value.end_col_offset is not None
    lines = [line.encode() for line in text.splitlines(keepends=True)]  # columns are counted in bytes
    first, last = lines[value.lineno - 1], lines[value.end_lineno - 1]
    there = first[: value.col_offset] + by.encode() + last[value.end_col_offset :]
    return b"".join([*lines[: value.lineno - 1], there, *lines[value.end_lineno :]]).decode()


class FirstFailure:
    """Remembers the first test that failed."""

    name = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.name:
            self.name = report.nodeid

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed and not self.name:
            self.name = report.nodeid


def first_failure(change: Change) -> str:
    """The first test that fails with a change; empty: none."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "gliderwatch"
        shutil.copytree(PACKAGE, copy)
        if change.how != "none":
            page = copy / change.room / "constants.py"
            text = page.read_text(encoding="utf-8")
            before = dict(assigned(ast.parse(text)))[change.name]
            after = changed(change.value, change.how)
            assert after != ast.unparse(before), f"{change.name} can not be changed"
            page.write_text(replaced(text, before, after), encoding="utf-8")
        sys.path.insert(0, folder)
        os.chdir(ROOT)
        seen = FirstFailure()
        options = ["-x", "-q", "-p", "no:cacheprovider", "-o", "timeout=60"]
        with Path(os.devnull).open("w") as null, redirect_stdout(null), redirect_stderr(null):
            code = pytest.main([*options, *tests(change)], plugins=[seen])
        assert sys.modules["gliderwatch"].__path__[0].startswith(folder), "the copy was not tested"
        return seen.name or ("" if code == 0 else f"pytest ended with {int(code)}")


def main() -> int:
    """Command line; see above."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--room", choices=[*TESTS], action="append")
    parser.add_argument("--constant", action="append")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    rooms = given.room or [*TESTS]
    wanted = [
        Change(room, name, value, how)
        for room in rooms
        for name, value in constants(room)
        if given.constant is None or name in given.constant
        for how in CHANGES
    ]
    survived = 0
    with multiprocessing.get_context("fork").Pool(given.jobs, maxtasksperchild=1) as pool:
        unchanged = [Change(room, "", "") for room in rooms]
        for room, failure in zip(rooms, pool.imap(first_failure, unchanged), strict=True):
            if failure:
                print(f"{room}: the tests fail without any change: {failure}")
                return 2
        for change, failure in zip(wanted, pool.imap(first_failure, wanted), strict=True):
            survived += not failure
            what = f"{change.room:10} {change.name:20} {change.value:34} {change.how:6}"
            print(f"{what} {failure or 'SURVIVED'}", flush=True)
    print(f"{len(wanted)} changes, {survived} survived")
    return int(survived > 0)


if __name__ == "__main__":
    sys.exit(main())
