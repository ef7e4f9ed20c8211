"""`gliderwatch pages` and `web`: pages for pilots, written once, and live."""

from __future__ import annotations

from pathlib import Path

import click

from gliderwatch.cli.export import at_option, configuration, looking, only_config_option, state_option
from gliderwatch.cli.options import DEFAULT, config_option, example, not_on_dockserver
from gliderwatch.errors import ConfigError, GliderwatchError

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
    from gliderwatch.config.check import check_maps
    from gliderwatch.figures.coast import world
    from gliderwatch.figures.map_files import land_or_world
    from gliderwatch.pages.reading import names_of
    from gliderwatch.params import Attention
    from gliderwatch.service import page_writer

    config = configuration(config_path, state)
    folder = out or (Path(config.pages.folder) if config is not None and config.pages.folder else None)
    if folder is None:
        raise click.UsageError("name the folder: --out FOLDER, or pages.folder in the configuration")
    land, attributes = world(), config.export.attributes if config is not None else {}
    if config is not None:
        not_on_dockserver(config, folder / "index.html")
        land, reason = land_or_world(config.maps.files)
        if reason:
            raise ConfigError("\n".join(map(str, check_maps(config, config_path or DEFAULT))) or reason)
    with looking(config, state, at) as (store, now):
        names = names_of(store, config.gliders if config is not None and state is None else ())
        attention = {n: config.attention(n) if config is not None else Attention() for n in names}
        batteries = {n: page_writer.battery_limits(config, n) for n in names}
        page_writer.write_fleet(store, folder, attention, batteries, now, land)
        for name in names:
            limits = batteries[name]
            page_writer.write_glider(store, folder, name, attention[name], limits, now, land, attributes)
    click.echo(f"{folder / 'index.html'}: {len(names)} glider{'' if len(names) == 1 else 's'}")


@click.command(epilog=example("gliderwatch web", "gliderwatch web --link electa/anomaly/1667639 --for Ann"))
@config_option
@click.option("--link", help="Do not serve: print the link that acknowledges this incident.")
@click.option("--for", "recipient", help="Who acknowledges by it.")
def web(config_path: Path, link: str | None, recipient: str | None) -> None:
    """Serve the pages live, an API, and links that acknowledge, on this machine only.

    It reads the state file; the service need not run, but should.
    """
    from gliderwatch.config import load

    config = load(config_path)
    try:
        import uvicorn

        from gliderwatch.delivery import links
        from gliderwatch.web import app
    except ImportError as error:
        raise GliderwatchError(f"{error.name} is not installed: docs/install.md says how") from None
    if link is not None:
        if recipient is None or config.web.public_url is None:
            raise click.UsageError("--link needs --for NAME, and web.public_url in the configuration")
        token = links.token(links.key_of(Path(config.state.path)), link, recipient)
        click.echo(f"{str(config.web.public_url).rstrip('/')}/ack/{token}")
        return

    def acknowledge(incident: str, by: str, now: float) -> str:
        from gliderwatch.cli.status import acknowledge_incident
        from gliderwatch.pages.matters import in_words

        entry, is_new = acknowledge_incident(config, incident, by, "", now)
        return f"{in_words(entry.incident.id)}: {'taken on' if is_new else 'was taken on already'} by {by}."

    def mute(glider: str, end: float, now: float) -> str:
        from gliderwatch.cli.manage import mute_glider

        return "; ".join(mute_glider(config, glider, end, now))

    click.echo(f"http://{config.web.address}:{config.web.port}/", err=True)
    draw = app.InProcess(Path(config.state.path))
    try:
        uvicorn.run(
            app.application(config, acknowledge, mute, draw),
            host=str(config.web.address),
            port=config.web.port,
            log_level="warning",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=3,
        )
    finally:
        draw.stop()
