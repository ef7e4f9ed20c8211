"""The command line. Thin: each command hands over to the module that does the work."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click
from rich.console import Console
from rich.text import Text

from gliderwatch import __version__
from gliderwatch.errors import GliderwatchError
from gliderwatch.manage import COMMANDS
from gliderwatch.score.command import score
from gliderwatch.simulate.command import simulate

# What a command needs is imported in it: `status` in a health check must not wait for what `run` needs.

if TYPE_CHECKING:
    from gliderwatch.run.replay import Report, Request

FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(exists=True, path_type=Path)
config_option = click.option(
    "-c", "--config", "config_path", type=FILE, required=True, help="The YAML configuration."
)
json_option = click.option("--json", "as_json", is_flag=True, help="For machines.")


class _Group(click.Group):
    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except GliderwatchError as error:
            _fail(str(error))
        except BrokenPipeError:  # `| head` has seen enough: click ends without a word
            raise
        except OSError as error:  # a full disk, a folder that is closed
            _fail(f"cannot go on: {error}")


def _fail(text: str) -> NoReturn:
    Console(stderr=True).print(Text(text), soft_wrap=True)
    sys.exit(2)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
def main() -> None:
    """Watch a glider dockserver, and alert the pilot when a glider flies abnormally."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal may not know every sign, a name may be no text
            stream.reconfigure(errors="replace")


main.add_command(simulate)
main.add_command(score)
for command in COMMANDS:
    main.add_command(command)


@main.command()
@click.option("-c", "--config", "config_path", type=FILE, help="The YAML configuration.")
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
    """Run the service; with --replay, put a past mission through the same path."""
    from gliderwatch.config import load
    from gliderwatch.run import logs

    config = load(config_path) if config_path is not None else None
    if folders:
        from gliderwatch.run.replay import Request

        if send and config is None:
            raise click.UsageError("--send needs the channels of a configuration: give one with -c")
        name = glider.lower() if glider is not None else None
        _replay(Request(folders, caches, config, name, out, send))
        return
    if config is None or config_path is None:
        raise click.UsageError("the service needs a configuration: give one with -c")
    if caches or glider or out or send:
        raise click.UsageError("--cache, --glider, --out and --send go with --replay")
    from gliderwatch.run.daemon import Daemon

    logs.configure()
    Daemon(config, config_path).run()


def _replay(request: Request) -> None:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from gliderwatch.alerts.console import show
    from gliderwatch.run.intake import Taken
    from gliderwatch.run.replay import replay

    console = Console()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    # What is written to a file must not be led to the terminal, where the bar is.
    bar = Progress(
        *columns,
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=sys.stdout.isatty(),
        disable=not sys.stderr.isatty(),
    )
    with bar as progress:
        task = progress.add_task("files", total=None)

        def on_file(taken: Taken) -> None:
            progress.advance(task)
            for alert in taken.alerts:
                show(alert, console)

        report = replay(request, on_total=lambda n: progress.update(task, total=n), on_file=on_file)
    _report(report, request, console)


def _report(report: Report, request: Request, console: Console) -> None:
    from gliderwatch import tables
    from gliderwatch.store.sqlite import Status

    for glider in report.store.gliders():
        console.print(f"\n[bold]{glider}[/]")
        console.print(tables.dives(report.store.assessments(glider)))
    left_out = report.store.files(Status.WAITING, Status.QUARANTINED, Status.UNKNOWN)
    tables.files(dict(report.files), left_out, console)
    if request.out is not None:
        console.print(Text(f"written: {request.out}/assessments.jsonl and alerts.jsonl"), soft_wrap=True)
    if report.undelivered:
        raise GliderwatchError(f"{report.undelivered} messages could not be delivered in time")


@main.command()
@config_option
def check(config_path: Path) -> None:
    """Check the configuration, its folders, caches and channels."""
    from gliderwatch import tables
    from gliderwatch.config import check as check_config
    from gliderwatch.config import load

    config = load(config_path)
    found = check_config(config, config_path)
    tables.problems(found, Console())
    errors = sum(p.severity == "error" for p in found)
    gliders = ", ".join(sorted(config.gliders)) or "none"
    click.echo(f"{config_path}: {errors} errors, {len(found) - errors} warnings; gliders: {gliders}")
    sys.exit(1 if errors else 0)


@main.command()
@click.option("-c", "--config", "config_path", type=FILE, help="The YAML configuration.")
@click.option("--send", is_flag=True, help="Send a test message through each channel.")
@json_option
def doctor(config_path: Path | None, send: bool, as_json: bool) -> None:
    """Look at all that gliderwatch needs; ends with 0: all is well, 1: warnings, 2: errors."""
    import msgspec

    from gliderwatch.run.doctor import DEFAULT, as_lines, examine, exit_code, report, summary

    found = []
    for finding in examine(config_path or DEFAULT, send=send):
        found.append(finding)
        if not as_json:
            click.echo("\n".join(as_lines(finding)))
    click.echo(
        msgspec.json.format(msgspec.json.encode(report(found)), indent=2) if as_json else summary(found)
    )
    sys.exit(exit_code(found))


@main.command()
@config_option
@json_option
def status(config_path: Path, as_json: bool) -> None:
    """Tell how the service and its gliders are; exits with 1 when the service is not alive."""
    import msgspec

    from gliderwatch import tables
    from gliderwatch.config import load
    from gliderwatch.run.status import as_json as machine
    from gliderwatch.run.status import overview

    view = overview(load(config_path))
    if as_json:
        click.echo(msgspec.json.format(msgspec.json.encode(machine(view)), indent=2))
    else:
        tables.status(view, Console())
    sys.exit(0 if view.alive else 1)


@main.command("test-alert")
@config_option
@click.option("--channel", "only", help="Only this channel.")
def test_alert(config_path: Path, only: str | None) -> None:
    """Send a test message to every channel, or to one."""
    from gliderwatch.config import load
    from gliderwatch.errors import ConfigError
    from gliderwatch.run.doctor.service import try_channel

    config = load(config_path)
    names = [only] if only is not None else list(config.channels)
    if only is not None and only not in config.channels:
        raise ConfigError(f"there is no channel {only}; known are: {', '.join(config.channels) or 'none'}")
    if not names:
        raise ConfigError(f"{config_path}: no channels are configured")
    failures = 0
    for name in names:
        refused = try_channel(config, name)
        failures += refused is not None
        click.echo(f"{name}: accepted" if refused is None else f"{name}: FAILED: {refused}")
    sys.exit(1 if failures else 0)
