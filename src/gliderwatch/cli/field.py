"""`gliderwatch field`: what the gliders have measured together, as a file. What it needs is imported when it
runs."""

from __future__ import annotations

from pathlib import Path

import click

from gliderwatch.cli.options import FILE, config_option, example
from gliderwatch.errors import ConfigError

# ruff: noqa: PLC0415


@click.command(
    epilog=example(
        "gliderwatch field upper --out upper.nc",
        "gliderwatch field upper --at 2026-05-03 --out upper.nc",
    )
)
@click.argument("name")
@click.option("--out", type=FILE, required=True, help="The CF NetCDF file to write.")
@click.option("--at", help="A date, or a date and time, in UTC; else that of the last samples.")
@click.option("--state", type=FILE, help="Another state file, as replay.sqlite of a replay.")
@config_option
def field(config_path: Path, name: str, out: Path, at: str | None, state: Path | None) -> None:
    """Write a field and its uncertainty to a file.

    NAME is that of a field under `fields:` in the configuration. Only samples until the time count.
    """
    from gliderwatch.cli.options import not_on_dockserver
    from gliderwatch.config import load
    from gliderwatch.config.fields import moment
    from gliderwatch.messages.formatting import utc
    from gliderwatch.service.field_file import write_field
    from gliderwatch.service.fields import fields_of
    from gliderwatch.store.state_file import Store

    config = load(config_path)
    found = {each.name: each for each in fields_of(config)}
    if name not in found:
        known = ", ".join(found) or "none"
        raise ConfigError(f"there is no field {name} under `fields` in the configuration; known are: {known}")
    try:
        t = None if at is None else moment(at)
    except ValueError as error:
        raise click.UsageError(f"--at: {at} {error}") from None
    path = not_on_dockserver(config, out)
    path.parent.mkdir(parents=True, exist_ok=True)
    store = Store.reading(state if state is not None else Path(config.state.path))
    try:
        with store.guarded():
            written = write_field(store, found[name], path, t)
    finally:
        store.close()
    click.echo(f"{path}: {name} at {utc(written)}")
