"""`gliderwatch simulate` and `score`. What they need is imported when they run; others need not wait."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gliderwatch.cli.options import Number, cluster_option, example, progress, workers_option
from gliderwatch.errors import GliderwatchError

if TYPE_CHECKING:
    from gliderwatch.score.work import Task


@click.command(epilog="\b\nExample:\n  gliderwatch simulate sea --gliders 2 --days 3 --fault remora:8@2")
@click.argument("out", type=click.Path(file_okay=False, path_type=Path))
@click.option("--scenario", "name", default="calm", help="A shipped scenario, or a YAML file (calm).")
@click.option("--gliders", type=click.IntRange(1, 100), default=1, help="How many gliders fly (1).")
@click.option("--days", type=Number(0.01, 366), help="How long they fly.")
@click.option(
    "--fault",
    "faults",
    multiple=True,
    metavar="NAME:SIZE@DAY",
    help="One more fault, as remora:2.5@3; the gliders get the faults in turn.",
)
@click.option("--seed", type=click.IntRange(0), help="Chance of its own for each seed.")
@click.option("--compressed", is_flag=True, help="Write scd and tcd files.")
@click.option("--full-rate", is_flag=True, help="Write dbd and ebd files too, into OUT/recovered.")
@click.option("--logs", is_flag=True, help="Write the logs of calls too.")
@click.option(
    "--abort",
    metavar="CAUSE@DAY",
    help="With --logs: the last glider aborts by then, as LEAK@2, and waits at its prompt.",
)
@click.option(
    "--ailment",
    "ailments",
    multiple=True,
    metavar="NAME:SIZE@DAY",
    help="Of the last glider, as slow_leak:0.5@3, battery:6@5 or device_error@2.",
)
@click.option("--live", is_flag=True, help="Let the files come as time passes; OUT may be in use.")
@click.option("--speedup", type=Number(0, min_open=True), help="With --live: how much faster (1).")
@click.option("--relays", type=click.IntRange(1, 100), default=1, help="Dockservers that they call (1).")
@click.option(
    "--outage",
    "outages",
    multiple=True,
    metavar="RELAY@DAY-DAY",
    help="When a dockserver is off, as 2@1-1.5; its gliders call the next one.",
)
@click.option(
    "--follow",
    "advice",
    type=click.Path(file_okay=False, path_type=Path),
    help="They follow the advice that a service writes here (fields.NAME.advice.outputs).",
)
def simulate(
    out: Path,
    name: str,
    gliders: int,
    days: float | None,
    faults: tuple[str, ...],
    seed: int | None,
    compressed: bool,
    full_rate: bool,
    logs: bool,
    abort: str | None,
    ailments: tuple[str, ...],
    live: bool,
    speedup: float | None,
    relays: int,
    outages: tuple[str, ...],
    advice: Path | None,
) -> None:
    """Simulate gliders and write what a dockserver gets of them.

    OUT will hold gliders/NAME/from-glider and cache; truth.nc and truth.json say what is true of them. With
    several --relays it is relay-1/gliders/NAME/from-glider and so on.
    """
    from gliderwatch.simulate import job

    if abort is not None and not logs:
        raise click.UsageError("--abort goes with --logs")
    if speedup is not None and not live:
        raise click.UsageError("--speedup goes with --live")
    if advice is not None and (live or logs or ailments or relays > 1):
        raise click.UsageError("--follow goes without --live, --logs, --ailment and --relays")
    if advice is None and not live and out.is_dir() and any(out.iterdir()):
        raise GliderwatchError(f"{out} is not empty: give another folder, or remove it")
    scenarios = job.gliders(name, gliders, days, seed, faults, full_rate)
    rates = job.call_rates(abort) if logs else None
    ill = job.ailments(ailments, scenarios[-1])
    off = job.outages(outages, relays, scenarios[0].start)
    pace = (speedup or 1.0) if live else None
    job.run(job.Job(out, scenarios, compressed, pace, rates, ill, relays, off, advice))


@click.command(
    epilog=example(
        "gliderwatch score --grid small --out score",
        "gliderwatch score --out score --cluster tcp://10.0.0.5:8786",
    )
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("score"),
    help="Results go here; what is there already is not run again (score).",
)
@click.option("--grid", "name", default="default", help="A shipped grid (default, small), or a YAML file.")
@click.option(
    "--estimator", "names", multiple=True, help="What to score (joint); several are put side by side."
)
@click.option(
    "--mission",
    "missions",
    multiple=True,
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A folder with the files of a real, healthy mission: faults are grafted onto it.",
)
@cluster_option
@workers_option
def score(
    out: Path,
    name: str,
    names: tuple[str, ...],
    missions: tuple[Path, ...],
    cluster: str | None,
    workers: int | None,
) -> None:
    """Score the detection: simulated and real missions through the installed program.

    OUT will hold score.json, score.html and, cell by cell, what they were made of. With the extra
    gliderwatch[archive] all cores work on it, or the machines of a cluster, which must see OUT; without it
    one glider flies after another.
    """
    from rich.console import Console

    from gliderwatch.cli.tables import show
    from gliderwatch.score import grid, plots, summary, work
    from gliderwatch.score.work import version

    chosen = list(dict.fromkeys(grid.check(e) for e in names)) or [grid.ALGORITHMS[0]]
    cells = grid.cells(grid.load_grid(name), missions)
    if not cells:
        raise GliderwatchError(f"the grid {name} is empty: give it faults, healthy gliders, or a --mission")
    _writable(out)
    failed = _run(work.to_do(cells, chosen, out.resolve()), cluster, workers)
    found = work.results(cells, chosen, out)
    if found:
        result = summary.summarise(found, version())
        console = Console()
        for table in summary.tables(result):
            show(table, console)
            console.print()
        summary.write(out / "score.json", result)
        plots.write_page(out / "score.html", result)
        console.print(f"written: {out}/score.json and score.html", soft_wrap=True, highlight=False)
    if failed:
        raise GliderwatchError("could not be run:\n" + "\n".join(failed))


def _writable(out: Path) -> None:
    try:
        (out / "cells").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GliderwatchError(f"{out} cannot be written: {error.strerror}") from None


def _run(tasks: Sequence[Task], address: str | None, workers: int | None) -> list[str]:
    from gliderwatch.archive.cluster import run_all
    from gliderwatch.score.work import work

    with progress() as bar:
        row = bar.add_task("cells", total=len(tasks))
        return run_all(work, tasks, lambda _task, _result: bar.advance(row), address, workers)
