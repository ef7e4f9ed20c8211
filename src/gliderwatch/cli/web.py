"""`gliderwatch web`: the pages live."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from gliderwatch.cli.options import config_option, example
from gliderwatch.errors import GliderwatchError

# ruff: noqa: PLC0415
# What a command needs is imported in it: `status` in a health check must not wait for a server.


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

        entry, is_new = acknowledge_incident(config, incident, by, "", now)
        return f"{entry.incident.id}: {'taken on' if is_new else 'was taken on already'} by {by}."

    sys.setswitchinterval(0.0005)  # who draws must not hold up who answers
    click.echo(f"http://{config.web.address}:{config.web.port}/", err=True)
    uvicorn.run(
        app.application(config, acknowledge),
        host=str(config.web.address),
        port=config.web.port,
        log_level="warning",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=3,
    )
