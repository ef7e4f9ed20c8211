"""The command `gliderwatch simulate`. What it needs is imported when it runs; others need not wait."""

from __future__ import annotations

from pathlib import Path

import click

from gliderwatch.errors import GliderwatchError


@click.command(epilog="\b\nExample:\n  gliderwatch simulate sea --gliders 2 --days 3 --fault remora:8@2")
@click.argument("out", type=click.Path(file_okay=False, path_type=Path))
@click.option("--scenario", "name", default="calm", help="A shipped scenario, or a YAML file (calm).")
@click.option("--gliders", type=click.IntRange(1, 100), default=1, help="How many gliders fly (1).")
@click.option("--days", type=click.FloatRange(0.01, 366), help="How long they fly.")
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
@click.option("--speedup", type=click.FloatRange(0, min_open=True), help="With --live: how much faster (1).")
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
) -> None:
    """Simulate gliders and write what a dockserver gets of them.

    OUT will hold gliders/NAME/from-glider and cache; truth.nc and truth.json say what is true of them.
    """
    from gliderwatch.simulate import job

    if abort is not None and not logs:
        raise click.UsageError("--abort goes with --logs")
    if speedup is not None and not live:
        raise click.UsageError("--speedup goes with --live")
    if not live and out.is_dir() and any(out.iterdir()):
        raise GliderwatchError(f"{out} is not empty: give another folder, or remove it")
    scenarios = job.gliders(name, gliders, days, seed, faults, full_rate)
    rates = job.call_rates(abort) if logs else None
    ill = job.ailments(ailments, scenarios[-1])
    job.run(job.Job(out, scenarios, compressed, (speedup or 1.0) if live else None, rates, ill))
