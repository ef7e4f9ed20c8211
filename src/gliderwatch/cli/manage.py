"""`gliderwatch mute`, `ack`, `backup`, `rebuild`: what people do to the state while the service runs."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from rich.console import Console

from gliderwatch.cli.options import FILE, config_option, example, json_option
from gliderwatch.config import Config
from gliderwatch.config.fields import moment
from gliderwatch.errors import ConfigError, GliderwatchError, StateError
from gliderwatch.incidents.acknowledgement import with_mute
from gliderwatch.messages.formatting import utc
from gliderwatch.service.routing import withdraw_answered
from gliderwatch.store.database import SCHEMA
from gliderwatch.store.state_file import Store
from gliderwatch.store.watch_health import schema_version

# ----------------------------------------
# The state file as commands that change it open it.


@contextmanager
def reading(config: Config) -> Iterator[Store]:
    """The state of a configuration, for looking only. Raises StateError where there is none."""
    with Store.looking(Path(config.state.path)) as store:
        yield store


@contextmanager
def writing(config: Config) -> Iterator[Store]:
    """The state of a configuration, the service running or not; all that is written inside, or nothing.

    Raises StateError where there is none, or one that the service has to migrate first: the one that runs may
    be of the release before.
    """
    path = Path(config.state.path)
    version = schema_version(path)
    if version < SCHEMA:
        raise StateError(
            f"state file {path} is of an earlier release (schema {version}, now {SCHEMA}). "
            "What to do: systemctl restart gliderwatch, which takes it on"
        )
    store = Store.open(path)
    try:
        with store.transaction():
            yield store
    finally:
        store.close()


def known_glider(config: Config, name: str) -> str:
    """The name of a glider as it is kept. Raises ConfigError where it is not in the configuration."""
    if (found := name.lower()) not in config.gliders:
        raise ConfigError(
            f"there is no glider {name} in the configuration; known are: "
            f"{', '.join(sorted(config.gliders)) or 'none'}"
        )
    return found


# ----------------------------------------
# Muting a glider by command: at once, without a change of the configuration.

_YEAR = 366 * 86400.0


def end_of_mute(date: str | None, hours: float | None, now: float) -> float:
    """The end of a mute (s), from a date or from hours from `now` on. Raises GliderwatchError."""
    if (date is None) == (hours is None):
        raise GliderwatchError(
            "say until when: either --until DATE (2026-12-01, or 2026-12-01 14:30) or --hours N"
        )
    if date is not None:
        try:
            end = moment(date)
        except ValueError as error:
            raise GliderwatchError(f"--until {error}") from None
    else:
        end = now + (hours or 0.0) * 3600
    if not math.isfinite(end) or end <= now:
        raise GliderwatchError("that is past: name a time to come, in UTC")
    if end > now + _YEAR:
        raise GliderwatchError(
            "that is more than a year: for a glider that is out of the water write recovered: true "
            "in the configuration"
        )
    return end


def mute_glider(config: Config, glider: str, end: float, now: float) -> list[str]:
    """Tell nothing of a glider until a time (s); what to tell who asked for it, in lines. Who waits for an
    acknowledgement is not notified of it any more either."""
    name = known_glider(config, glider)
    with writing(config) as store:
        store.notes.mute(name, end, now)
        withdraw_answered(store, name, now, quiet=True)
        heeded = with_mute(config.attention(name), store.notes.muted_until(name))
    lines = [f"{name}: muted until {utc(end)}"]
    if heeded.muted_until is not None and heeded.muted_until > end:
        lines.append(f"muted_until of the configuration is later and counts: {utc(heeded.muted_until)}")
    if heeded.recovered:
        lines.append("it is marked recovered: no message about it is sent in any case")
    return lines


def unmute_glider(config: Config, glider: str, now: float) -> list[str]:
    """Take a mute back; what to tell who asked for it, in lines.

    Raises GliderwatchError where the configuration mutes it: that is not undone by a command.
    """
    name = known_glider(config, glider)
    with writing(config) as store:
        before = store.notes.muted_until(name)
        store.notes.unmute(name, now)
    configured = config.attention(name)
    why = None
    if configured.recovered:
        why = "is marked recovered: true"
    elif configured.muted_until is not None and now < configured.muted_until:
        why = f"has muted_until: {utc(configured.muted_until)}"
    if why is not None:
        raise GliderwatchError(
            f"{name} {why} in the configuration, which no command undoes. "
            "What to do: take that line out, then systemctl reload gliderwatch"
        )
    was = before is not None and now < before
    return [f"{name}: not muted any more" if was else f"{name}: was not muted"]


# ----------------------------------------
# The commands with which people manage the state. Thin: each hands over to the module that does the work.

# ruff: noqa: PLC0415
# A health check must not wait for what these commands need: it is imported in them, as in `cli`.


@click.command(epilog=example("gliderwatch incidents --glider electa --all"))
@config_option
@click.option("--glider", help="Only of this glider.")
@click.option("--all", "every", is_flag=True, help="Also those that are over.")
@json_option
def incidents(config_path: Path, glider: str | None, every: bool, as_json: bool) -> None:
    """List the open incidents, and who has acknowledged them."""
    import msgspec

    from gliderwatch.cli import tables
    from gliderwatch.cli.status import incident_entries, incidents_as_json
    from gliderwatch.config import load

    found = incident_entries(load(config_path), glider, every=every)
    if as_json:
        lines = [incidents_as_json(noted) for noted in found]
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
    """Send no messages about a glider for a time."""
    from gliderwatch.config import load

    now = time.time()
    end = end_of_mute(until, hours, now)
    click.echo("\n".join(mute_glider(load(config_path), glider, end, now)))


@click.command(epilog=example("gliderwatch unmute electa"))
@click.argument("glider")
@config_option
def unmute(config_path: Path, glider: str) -> None:
    """End a mute."""
    from gliderwatch.config import load

    click.echo("\n".join(unmute_glider(load(config_path), glider, time.time())))


@click.command(epilog=example("gliderwatch ack electa --by Ann", "gliderwatch ack electa --undo"))
@click.argument("incident")
@click.option("--by", help="Who takes it on; else the user of this command.")
@click.option("--note", default="", help="What the others should know.")
@click.option("--undo", is_flag=True, help="Take the acknowledgement back.")
@config_option
def ack(config_path: Path, incident: str, by: str | None, note: str, undo: bool) -> None:
    """Acknowledge an incident: no reminders of it until it is over or grows worse.

    INCIDENT is a glider, where one incident of it is open, or an id, as `gliderwatch incidents` shows it.
    All who hear of the incident are notified.
    """
    import getpass

    from gliderwatch.cli import tables
    from gliderwatch.cli.status import acknowledge_incident, give_incident_back
    from gliderwatch.config import load

    who = by or os.environ.get("SUDO_USER") or getpass.getuser()
    if undo:
        noted = give_incident_back(load(config_path), incident, who, note, time.time())
        click.echo("not acknowledged any more")
        tables.incidents([noted], Console())
        return
    noted, is_new = acknowledge_incident(load(config_path), incident, who, note, time.time())
    click.echo("acknowledged" if is_new else "was acknowledged already, nothing changed")
    tables.incidents([noted], Console())


@click.command(epilog=example("gliderwatch backup /var/backups/gliderwatch.sqlite"))
@click.argument("file", type=FILE)
@config_option
def backup(config_path: Path, file: Path) -> None:
    """Copy the state to a file while the service runs, and check the copy."""
    from gliderwatch.cli.options import not_on_dockserver
    from gliderwatch.config import load
    from gliderwatch.store.maintenance import backup as make

    config = load(config_path)
    size = make(Path(config.state.path), not_on_dockserver(config, file))
    click.echo(f"{file}: {size / 1e6:.1f} MB, whole")


@click.command(epilog=example("gliderwatch rebuild electa", "gliderwatch rebuild electa --keep"))
@click.argument("glider")
@click.option("--keep", is_flag=True, help="Put the result in place of what is known; the service must rest.")
@config_option
def rebuild(config_path: Path, glider: str, keep: bool) -> None:
    """Assess a glider again from its files.

    It ends with 1 where that changes something and is not kept.
    """
    from rich.progress import Progress

    from gliderwatch.cli.rebuild import as_lines
    from gliderwatch.cli.rebuild import rebuild as make
    from gliderwatch.config import load

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
