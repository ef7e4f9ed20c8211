"""What a month of one glider takes of one core to simulate and write: `python benchmarks/simulate.py`."""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before numpy is loaded

import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from gliderwatch.simulate.delivery import FileForm, Names, play, steps, write_cache, write_full_rate
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.job import write_truth
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.simulate.scenario_files import load_scenario, shipped

DAYS = 30.0


def seconds(scenario: Scenario, *, compressed: bool = False) -> tuple[float, float, int, float]:
    """Seconds of the core to fly and to write, number of files, and MB written."""
    form = FileForm(Names.AS_SENT, compressed, generation=scenario.generation)
    with TemporaryDirectory() as name:
        folder = Path(name)
        began = time.process_time()
        mission = simulate(scenario)
        flown = time.process_time()
        write_cache(folder / "cache", mission)
        for _ in play(sorted(steps(folder / "gliders", mission, form), key=lambda step: step.time)):
            pass
        write_full_rate(folder / "recovered", mission, form)
        write_truth(folder, [mission])
        ended = time.process_time()
        files = [path for path in folder.rglob("*") if path.is_file()]
        return flown - began, ended - flown, len(files), sum(path.stat().st_size for path in files) / 1e6


def main() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    table = Table("scenario", "files", "MB", "fly (s)", "write (s)", "total (s)")
    for name, path in shipped().items():
        scenario = replace(load_scenario(path), days=DAYS)
        cases = {name: (scenario, False)}
        if name == "calm":
            cases["calm, compressed"] = (scenario, True)
            cases["calm, full rate"] = (replace(scenario, full_rate=True), False)
        for label, (case, compressed) in cases.items():
            fly, write, n, size = seconds(case, compressed=compressed)
            table.add_row(label, str(n), f"{size:.1f}", f"{fly:.2f}", f"{write:.2f}", f"{fly + write:.2f}")
    Console().print(f"{DAYS:g} days of one glider, one core", table)


if __name__ == "__main__":
    main()
