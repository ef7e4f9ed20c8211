"""The command `gliderwatch run`: the service, and the replay of a past mission."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.text import Text

from gliderwatch.cli.options import DEFAULT, FILE, FOLDER, configured, example, progress
from gliderwatch.errors import GliderwatchError

# ruff: noqa: PLC0415
# What a command needs is imported in it: `status` in a health check must not wait for what `run` needs.

if TYPE_CHECKING:
    from gliderwatch.service.replay import Report, Request


@click.command(
    epilog=example(
        "gliderwatch run -c gliderwatch.yml",
        "gliderwatch run --replay from-glider --cache cache --out results",
    )
)
@click.option(
    "-c",
    "--config",
    "config_path",
    type=FILE,
    help="The YAML configuration; a replay goes without one by the built-in settings.",
    show_default=str(DEFAULT),
)
@click.option("--replay", "folders", type=FOLDER, multiple=True, help="Replay the files below a folder.")
@click.option("--cache", "caches", type=FOLDER, multiple=True, help="A folder with cache files.")
@click.option("--glider", help="Replay this glider alone.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), help="Write results here.")
@click.option("--send", is_flag=True, help="Send the alerts of a replay, not only print them.")
def run(
    config_path: Path | None,
    folders: tuple[Path, ...],
    caches: tuple[Path, ...],
    glider: str | None,
    out: Path | None,
    send: bool,
) -> None:
    """Run the service; with --replay, put a past mission through the same path.

    A replay with --out leaves there assessments.jsonl (a line for each dive), alerts.jsonl (a line for each
    message) and replay.sqlite (all that was found, as the state file of the service). It ends with 1 where
    nothing could be assessed.
    """
    from gliderwatch.config import load

    if not folders and (caches or glider or out or send):
        raise click.UsageError("--cache, --glider, --out and --send go with --replay")
    if folders and send and config_path is None:
        raise click.UsageError("--send needs the channels of a configuration: give one with -c")
    if folders:
        from gliderwatch.service.replay import Request

        config = load(config_path) if config_path is not None else None
        name = glider.lower() if glider is not None else None
        _replay(Request(folders, caches, config, name, out, send))
    else:
        _serve(configured(config_path or DEFAULT))


def _serve(path: Path) -> None:
    from gliderwatch.config import load
    from gliderwatch.service import logs
    from gliderwatch.service.daemon import Daemon

    config = load(path)
    logs.configure()
    Daemon(config, path).run()


def _replay(request: Request) -> None:
    from gliderwatch.cli.tables import show_alert
    from gliderwatch.service.replay import STATE, replay
    from gliderwatch.service.transaction import FileOutcome

    console = Console()
    if request.out is not None and (request.out / STATE).exists():
        console.print(
            Text(f"{request.out} holds an earlier replay: this one takes its place"), soft_wrap=True
        )
    with progress() as bar:
        task = bar.add_task("files", total=None)

        def on_file(outcome: FileOutcome) -> None:
            bar.advance(task)
            for alert in outcome.alerts:
                show_alert(alert, console)

        report = replay(request, on_total=lambda n: bar.update(task, total=n), on_file=on_file)
    _report(report, request, console)


def _report(report: Report, request: Request, console: Console) -> None:
    from gliderwatch.cli import tables
    from gliderwatch.service.replay import WRITTEN
    from gliderwatch.service.replay_files import unassessed
    from gliderwatch.store.state_file import Status

    found = {glider: report.store.assessments(glider) for glider in report.store.gliders()}
    for glider, assessments in found.items():
        console.print(f"\n[bold]{glider}[/]")
        tables.show(tables.dives(assessments, whole=not console.is_terminal), console)
    if found:
        console.print(tables.LEGEND, style="dim", highlight=False)
    left_out = report.store.files(Status.WAITING, Status.QUARANTINED, Status.UNKNOWN)
    tables.files(dict(report.files), left_out, console)
    if request.out is not None:
        console.print(Text(f"written to {request.out}: {', '.join(WRITTEN)}"), soft_wrap=True)
    if report.undelivered:
        raise GliderwatchError(f"{report.undelivered} messages could not be delivered in time")
    why = unassessed(report.store, request.folders)
    if why is not None:
        Console(stderr=True).print(Text(why), soft_wrap=True)
        sys.exit(1)
