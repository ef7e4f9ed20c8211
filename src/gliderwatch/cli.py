"""The command line. Thin: each command hands over to the module that does the work."""

from __future__ import annotations

import io
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click
from rich.console import Console
from rich.text import Text

from gliderwatch import __version__
from gliderwatch.errors import GliderwatchError
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
usual_config_option = click.option(
    "-c",
    "--config",
    "config_path",
    type=FILE,
    default="/etc/gliderwatch/gliderwatch.yml",
    help="The YAML configuration.",
    show_default=True,
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


@main.command()
@usual_config_option
@click.option("--glider", help="Only of this glider.")
@click.option("--all", "every", is_flag=True, help="Also those that are over.")
@json_option
def incidents(config_path: Path, glider: str | None, every: bool, as_json: bool) -> None:
    """Tell which incidents are open, and who has acknowledged them."""
    import msgspec

    from gliderwatch import tables
    from gliderwatch.config import load
    from gliderwatch.run.manage import incidents as manage

    found = manage.incidents(load(config_path), glider, every=every)
    if as_json:
        lines = [manage.as_json(noted) for noted in found]
        click.echo(msgspec.json.format(msgspec.json.encode(lines), indent=2))
    elif found:
        tables.incidents(found, Console())
    else:
        click.echo("no incidents" if every else "no open incidents")


@main.command()
@click.argument("glider")
@click.option("--until", help="A date, or a date and time, in UTC.")
@click.option("--hours", type=float, help="Hours from now on.")
@usual_config_option
def mute(config_path: Path, glider: str, until: str | None, hours: float | None) -> None:
    """Tell nothing of a glider for a time."""
    from gliderwatch.config import load
    from gliderwatch.run.manage import mute as manage

    now = time.time()
    end = manage.until(until, hours, now)
    click.echo("\n".join(manage.mute(load(config_path), glider, end, now)))


@main.command()
@click.argument("glider")
@usual_config_option
def unmute(config_path: Path, glider: str) -> None:
    """Take back what `mute` did."""
    from gliderwatch.config import load
    from gliderwatch.run.manage import mute as manage

    click.echo("\n".join(manage.unmute(load(config_path), glider, time.time())))


@main.command()
@click.argument("incident")
@click.option("--by", help="Who takes it on; else the user of this command.")
@click.option("--note", default="", help="What the others should know.")
@usual_config_option
def ack(config_path: Path, incident: str, by: str | None, note: str) -> None:
    """Acknowledge an incident: no reminders of it until it is over or grows worse."""
    import getpass

    from gliderwatch import tables
    from gliderwatch.config import load
    from gliderwatch.run.manage import incidents as manage

    who = by or os.environ.get("SUDO_USER") or getpass.getuser()
    noted, is_new = manage.ack(load(config_path), incident, who, note, time.time())
    click.echo("acknowledged" if is_new else "was acknowledged already, nothing changed")
    tables.incidents([noted], Console())


@main.command()
@click.argument("file", type=FILE)
@usual_config_option
def backup(config_path: Path, file: Path) -> None:
    """Copy the state to a file while the service runs, and see that the copy is whole."""
    from gliderwatch.config import load
    from gliderwatch.run.manage.backup import backup as make

    size = make(load(config_path), file)
    click.echo(f"{file}: {size / 1e6:.1f} MB, whole")


@main.command()
@click.argument("glider")
@click.option("--keep", is_flag=True, help="Put the result in place of what is known; the service must rest.")
@usual_config_option
def rebuild(config_path: Path, glider: str, keep: bool) -> None:
    """Assess a glider anew from its files; ends with 1 where that changes something and is not kept."""
    from rich.progress import Progress

    from gliderwatch.config import load
    from gliderwatch.run.manage.change import as_lines
    from gliderwatch.run.manage.rebuild import rebuild as make

    config = load(config_path)
    with Progress(
        console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty(), redirect_stdout=False
    ) as bar:
        task = bar.add_task("segments", total=None)
        change = make(
            config, glider, keep=keep, on_step=lambda n, of: bar.update(task, completed=n, total=of)
        )
    click.echo("\n".join(as_lines(change)))
    if keep:
        click.echo("kept. Start the service again: systemctl start gliderwatch")
    elif not change.is_none:
        click.echo("nothing was changed; to keep it, stop the service and add --keep")
    sys.exit(0 if keep or change.is_none else 1)


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
