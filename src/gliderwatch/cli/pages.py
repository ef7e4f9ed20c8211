"""`gliderwatch pages`: pages for pilots, written once."""

from __future__ import annotations

from pathlib import Path

import click

from gliderwatch.cli.export import at_option, configuration, looking, only_config_option, state_option
from gliderwatch.cli.options import example, not_on_dockserver

# ruff: noqa: PLC0415
# What a command needs is imported in it: `status` in a health check must not wait for what draws.


@click.command(
    epilog=example("gliderwatch pages --out /tmp/pages", "gliderwatch pages --state replay.sqlite --out p")
)
@only_config_option
@state_option
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), help="The folder.")
@at_option
def pages(config_path: Path | None, state: Path | None, out: Path | None, at: str | None) -> None:
    """Write the pages for pilots once, as files: of the fleet, and of each glider.

    Without --out they go where the service keeps them up to date by itself, to pages.folder.
    """
    from gliderwatch.params import Attention
    from gliderwatch.service import page_writer

    config = configuration(config_path, state)
    folder = out or (Path(config.pages.folder) if config is not None and config.pages.folder else None)
    if folder is None:
        raise click.UsageError("name the folder: --out FOLDER, or pages.folder in the configuration")
    if config is not None:
        not_on_dockserver(config, folder / "index.html")
    with looking(config, state, at) as (store, now):
        known = store.gliders()
        names = {*known, *(config.gliders if config is not None and state is None else ())}
        attention = {n: config.attention(n) if config is not None else Attention() for n in names}
        page_writer.write_fleet(store, folder, attention, now)
        for name in known:
            page_writer.write_glider(store, folder, name, attention[name], now)
    click.echo(f"{folder / 'index.html'}: {len(known)} gliders")
