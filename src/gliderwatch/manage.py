"""The commands with which people manage the state. Thin: each hands over to the module that does the work."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import click
from rich.console import Console

from gliderwatch.command_options import FILE, config_option, example, json_option

# ruff: noqa: PLC0415
# A health check must not wait for what these commands need: it is imported in them, as in `cli`.


@click.command(epilog=example("gliderwatch incidents --glider electa --all"))
@config_option
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


@click.command(
    epilog=example("gliderwatch mute electa --hours 12", "gliderwatch mute electa --until 2026-12-01")
)
@click.argument("glider")
@click.option("--until", help="A date, or a date and time, in UTC.")
@click.option("--hours", type=float, help="Hours from now on.")
@config_option
def mute(config_path: Path, glider: str, until: str | None, hours: float | None) -> None:
    """Tell nothing of a glider for a time."""
    from gliderwatch.config import load
    from gliderwatch.run.manage import mute as manage

    now = time.time()
    end = manage.until(until, hours, now)
    click.echo("\n".join(manage.mute(load(config_path), glider, end, now)))


@click.command(epilog=example("gliderwatch unmute electa"))
@click.argument("glider")
@config_option
def unmute(config_path: Path, glider: str) -> None:
    """Take back what `mute` did."""
    from gliderwatch.config import load
    from gliderwatch.run.manage import mute as manage

    click.echo("\n".join(manage.unmute(load(config_path), glider, time.time())))


@click.command(epilog=example("gliderwatch ack electa/anomaly/1667639520 --by Ann"))
@click.argument("incident")
@click.option("--by", help="Who takes it on; else the user of this command.")
@click.option("--note", default="", help="What the others should know.")
@config_option
def ack(config_path: Path, incident: str, by: str | None, note: str) -> None:
    """Acknowledge an incident: no reminders of it until it is over or grows worse.

    INCIDENT is its id, as `gliderwatch incidents` shows it.
    """
    import getpass

    from gliderwatch import tables
    from gliderwatch.config import load
    from gliderwatch.run.manage import incidents as manage

    who = by or os.environ.get("SUDO_USER") or getpass.getuser()
    noted, is_new = manage.ack(load(config_path), incident, who, note, time.time())
    click.echo("acknowledged" if is_new else "was acknowledged already, nothing changed")
    tables.incidents([noted], Console())


@click.command(epilog=example("gliderwatch backup /var/backups/gliderwatch.sqlite"))
@click.argument("file", type=FILE)
@config_option
def backup(config_path: Path, file: Path) -> None:
    """Copy the state to a file while the service runs, and see that the copy is whole."""
    from gliderwatch.config import load
    from gliderwatch.run.manage.places import not_on_dockserver
    from gliderwatch.store.backup import backup as make

    config = load(config_path)
    size = make(Path(config.state.path), not_on_dockserver(config, file))
    click.echo(f"{file}: {size / 1e6:.1f} MB, whole")


@click.command(epilog=example("gliderwatch rebuild electa", "gliderwatch rebuild electa --keep"))
@click.argument("glider")
@click.option("--keep", is_flag=True, help="Put the result in place of what is known; the service must rest.")
@config_option
def rebuild(config_path: Path, glider: str, keep: bool) -> None:
    """Assess a glider anew from its files.

    It ends with 1 where that changes something and is not kept.
    """
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


COMMANDS = (incidents, mute, unmute, ack, backup, rebuild)
