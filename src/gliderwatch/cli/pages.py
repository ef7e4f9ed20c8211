"""`gliderwatch pages`: pages for pilots, written once."""

from __future__ import annotations

import time
from pathlib import Path

import click

from gliderwatch.cli.options import DEFAULT, FILE, configured, example
from gliderwatch.errors import GliderwatchError

# ruff: noqa: PLC0415
# What a command needs is imported in it: `status` in a health check must not wait for what draws.


@click.command(
    epilog=example(
        "gliderwatch pages --out /tmp/pages", "gliderwatch pages --state replay.sqlite --out pages"
    )
)
@click.option(
    "-c", "--config", "config_path", type=FILE, help="The YAML configuration.", show_default=str(DEFAULT)
)
@click.option(
    "--state", type=FILE, help="A state file, as that of a replay, in place of the configuration's."
)
@click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path), help="The folder; else pages.folder."
)
@click.option("--at", help="As of this time (UTC); else now, and of a --state an hour after its last dive.")
def pages(config_path: Path | None, state: Path | None, out: Path | None, at: str | None) -> None:
    """Write the pages for pilots once, as files: of the fleet, and of each glider.

    The service keeps those in pages.folder up to date by itself.
    """
    from gliderwatch.config import load
    from gliderwatch.config.fields import moment
    from gliderwatch.pages import reading, writing
    from gliderwatch.params import Attention
    from gliderwatch.store.state_file import Store

    config = None
    if state is None or config_path is not None or DEFAULT.exists():
        config = load(configured(config_path or DEFAULT))
    folder = out or (Path(config.pages.folder) if config is not None and config.pages.folder else None)
    if folder is None:
        raise click.UsageError("name the folder: --out FOLDER, or pages.folder in the configuration")
    if config is not None:
        from gliderwatch.cli.options import not_on_dockserver

        not_on_dockserver(config, folder / writing.FLEET)
    path = state or Path(config.state.path if config is not None else "")
    store = Store.reading(path)
    try:
        with store.guarded():
            now = time.time()
            if at is not None:
                try:
                    now = moment(at)
                except ValueError as error:
                    raise GliderwatchError(f"--at {error}") from None
            elif state is not None:
                now = min(now, (reading.last_news(store) or now) + 3600.0)
            known = store.gliders()
            names = {*known, *(config.gliders if config is not None and state is None else ())}
            attention = {n: config.attention(n) if config is not None else Attention() for n in names}
            writing.write_fleet(store, folder, attention, now)
            for name in known:
                writing.write_glider(store, folder, name, attention[name], now)
    finally:
        store.close()
    click.echo(f"{folder / writing.FLEET}: {len(known)} gliders")
