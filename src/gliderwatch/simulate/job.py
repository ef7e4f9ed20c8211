"""What `gliderwatch simulate` does: flies a fleet and writes its files, at once or as time passes."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from gliderwatch.errors import ConfigError, GliderwatchError
from gliderwatch.simulate.calls import CallLog, CallRates, call_logs
from gliderwatch.simulate.delivery import FileForm, Names
from gliderwatch.simulate.dockserver import (
    Step,
    as_called,
    from_glider,
    log_steps,
    play,
    steps,
    write_cache,
    write_full_rate,
)
from gliderwatch.simulate.fleet import fleet
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.scenarios import fault_line, find, load
from gliderwatch.simulate.truth import write_truth

Logs = Mapping[str, Sequence[CallLog]]
"""The logs of the calls of each glider, in order of time."""


@dataclass(frozen=True, slots=True)
class Job:
    """Where to write the files of which gliders, whether compressed, and how much faster than time
    (None: at once). ``calls``: how the calls go whose logs are written (None: none are); it is the last
    glider that aborts."""

    out: Path
    scenarios: Sequence[Scenario]
    compressed: bool = False
    speedup: float | None = None
    calls: CallRates | None = None

    @property
    def dockserver(self) -> Path:
        """The folder of the gliders' folders."""
        return self.out / "gliders"


def gliders(
    name: str, n: int, days: float | None, seed: int | None, faults: Sequence[str], full_rate: bool
) -> list[Scenario]:
    """The scenarios of ``n`` gliders: one by name or file, and what is to be different from it.

    Raises `ConfigError` for a scenario or a fault that is none.
    """
    scenario = load(find(name))
    scenario = replace(
        scenario,
        days=scenario.days if days is None else days,
        seed=scenario.seed if seed is None else seed,
        full_rate=scenario.full_rate or full_rate,
        faults=(*scenario.faults, *(fault_line(text).fault(scenario.start) for text in faults)),
    )
    return fleet(scenario, n)


def call_rates(abort: str | None) -> CallRates:
    """How calls go: as usual, now and then dropped or without a file; with an abort as in `LEAK@2`, if any.

    Raises `ConfigError` for an abort that is none.
    """
    usual = CallRates(dropped=0.03, no_file=0.03, garbled=0.002)
    if abort is None:
        return usual
    match = re.fullmatch(r"([A-Za-z_]{1,40})@(\d+(?:\.\d+)?)", abort)
    if match is None:
        raise ConfigError(f"--abort {abort}: give a cause and a day, as LEAK@2")
    return replace(usual, abort=float(match[2]), cause=match[1].upper())


def run(job: Job) -> None:
    """Do it, and say what was done. Raises `GliderwatchError` where a glider cannot fly."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console, is_seen = Console(stderr=True), sys.stderr.isatty()
    with Progress(*columns, console=console, transient=True, disable=not is_seen) as progress:
        missions = _fly(job, progress)
        logs = _logs(job, missions)
        table, facts = write_truth(job.out, missions, logs)
        count = _write(job, missions, logs, progress)
    print(f"{count} files of {len(missions)} gliders below {job.dockserver}")
    print(f"what is true of them: {table}, {facts}")


def _fly(job: Job, progress: Progress) -> list[Mission]:
    task, missions = progress.add_task("flying", total=len(job.scenarios)), []
    for scenario in job.scenarios:
        try:
            missions.append(simulate(scenario))
        except ValueError as error:
            raise GliderwatchError(f"{scenario.glider} cannot fly this scenario: {error}") from None
        progress.advance(task)
    return missions


def _logs(job: Job, missions: Sequence[Mission]) -> Logs:
    """The logs of the calls of each glider; none where none are wanted."""
    if job.calls is None:
        return {}
    logs = {}
    for mission in missions:
        rates = job.calls if mission is missions[-1] else replace(job.calls, abort=None)
        logs[mission.scenario.glider] = tuple(call_logs(mission, rates, _form(job, mission, Names.AS_SENT)))
    return logs


def _write(job: Job, missions: Sequence[Mission], logs: Logs, progress: Progress) -> int:
    """Write the files as they come, and those read out after the recovery; how many there are."""
    acts: list[Step] = []
    for mission in missions:
        write_cache(job.out / "cache", mission)
        from_glider(job.dockserver, mission).mkdir(parents=True, exist_ok=True)
        called = logs.get(mission.scenario.glider, ())
        acts += as_called(steps(job.dockserver, mission, _form(job, mission, Names.AS_SENT)), called)
        acts += log_steps(job.dockserver, mission, called)
    acts.sort(key=lambda step: step.time)
    count = sum(step.ends for step in acts)
    task = progress.add_task("sending", total=count)
    for step in play(acts, _clock(job)):
        progress.advance(task, step.ends)
    recovered = job.out / "recovered"
    for mission in missions:
        count += len(write_full_rate(recovered, mission, _form(job, mission, Names.LONG)))
    return count


def _form(job: Job, mission: Mission, names: Names) -> FileForm:
    return FileForm(names, job.compressed, generation=mission.scenario.generation)


def _clock(job: Job) -> Callable[[float], None]:
    """Waits until it is a time of the simulation (s)."""
    if job.speedup is None:
        return lambda t: None
    speedup, first, begun = job.speedup, job.scenarios[0].start, time.monotonic()

    def wait(t: float) -> None:
        time.sleep(max(begun + (t - first) / speedup - time.monotonic(), 0.0))

    return wait
