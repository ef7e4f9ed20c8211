"""The command `gliderwatch score`. What it needs is imported when it runs; others need not wait."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gliderwatch.errors import GliderwatchError

if TYPE_CHECKING:
    from gliderwatch.score.work import Task


@click.command(epilog="\b\nExample:\n  gliderwatch score --grid small --out score")
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
def score(out: Path, name: str, names: tuple[str, ...], missions: tuple[Path, ...]) -> None:
    """Score the detection: simulated and real missions through the installed program.

    OUT will hold score.json, score.html and, cell by cell, what they were made of.
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
    failed = _run(work.to_do(cells, chosen, out))
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


def _run(tasks: Sequence[Task]) -> list[str]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from gliderwatch.score.work import run_all

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console, is_seen = Console(stderr=True), sys.stderr.isatty()
    with Progress(*columns, console=console, transient=True, disable=not is_seen) as progress:
        task = progress.add_task("cells", total=len(tasks))
        return run_all(tasks, lambda: progress.advance(task))
