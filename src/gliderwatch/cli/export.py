"""`gliderwatch export`, `where` and `field`: what is known of gliders and of the sea, for other programs."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gliderwatch.cli.options import (
    DEFAULT,
    FILE,
    config_option,
    configured,
    example,
    json_option,
    not_on_dockserver,
)
from gliderwatch.errors import ConfigError, GliderwatchError

# ruff: noqa: PLC0415
# What a command needs is imported in it: `status` in a health check must not wait for what this needs.

if TYPE_CHECKING:
    from gliderwatch.config import Config
    from gliderwatch.model import Assessment
    from gliderwatch.pages.view import GliderView
    from gliderwatch.store.state_file import Store

_ALL = 1_000_000
only_config_option = click.option(
    "-c",
    "--config",
    "config_path",
    type=FILE,
    help=f"The YAML configuration; {DEFAULT} where no --state is named.",
)
state_option = click.option(
    "--state", type=FILE, help="A state file, as a replay leaves; else the service's."
)
at_option = click.option(
    "--at", help="As of this time (UTC); else now, or an hour after the last dive of a --state."
)


def configuration(config_path: Path | None, state: Path | None) -> Config | None:
    """The configuration; None where none is named, and a state file is. Raises ConfigError."""
    from gliderwatch.config import load

    if state is not None and config_path is None:
        return None
    return load(configured(config_path or DEFAULT))


@contextmanager
def looking(config: Config | None, state: Path | None, at: str | None) -> Iterator[tuple[Store, float]]:
    """The state file, for looking, and as of when (s). Raises GliderwatchError where one cannot be had."""
    from gliderwatch.config.fields import moment
    from gliderwatch.pages import reading
    from gliderwatch.store.state_file import Store

    with Store.looking(state or Path(config.state.path if config is not None else "")) as store:
        now = time.time()
        if at is not None:
            try:
                now = moment(at)
            except ValueError as error:
                raise GliderwatchError(f"--at {error}") from None
        elif state is not None:
            now = min(now, (reading.last_news(store) or now) + 3600.0)
        yield store, now


@contextmanager
def viewing(
    config: Config | None, state: Path | None, at: str | None, glider: str | None
) -> Iterator[tuple[Store, tuple[GliderView, ...]]]:
    """The state file, and what is known of one glider or of all. Raises GliderwatchError where nothing is."""
    from gliderwatch.pages import reading
    from gliderwatch.params import Attention

    with looking(config, state, at) as (store, now):
        names = store.gliders()
        if glider is not None and glider.lower() not in names:
            raise GliderwatchError(
                f"nothing is known of a glider {glider}; known are: {', '.join(names) or 'none'}"
            )
        wanted = names if glider is None else [glider.lower()]
        attention = config.attention if config is not None else lambda _name: Attention()
        yield (
            store,
            tuple(
                reading.read_glider(store, name, attention(name), now, dives=_ALL, whole=False)
                for name in wanted
            ),
        )


@click.command(
    epilog=example(
        "gliderwatch export electa --format netcdf --out electa.nc", "gliderwatch export --format kml"
    )
)
@click.argument("glider", required=False)
@click.option(
    "--format",
    "form",
    type=click.Choice(["geojson", "kml", "csv", "netcdf", "layers"]),
    required=True,
    help="The format.",
)
@click.option("--out", type=FILE, help="The file; else it is printed.")
@only_config_option
@state_option
@at_option
def export(
    glider: str | None,
    form: str,
    out: Path | None,
    config_path: Path | None,
    state: Path | None,
    at: str | None,
) -> None:
    """Write tracks, dives, and where gliders are and come up next, for other programs.

    netcdf: one glider, one row a dive, by CF and ACDD. layers: the same of its section and the layers in it.
    csv: one row a dive. geojson, kml: for maps.
    """
    from gliderwatch.export import dives, maps
    from gliderwatch.fleet.reference import beside_neighbours

    config = configuration(config_path, state)
    if out is not None:
        if config is not None:
            not_on_dockserver(config, out)
        out.parent.mkdir(parents=True, exist_ok=True)
    with viewing(config, state, at, glider) as (store, views):
        if form in ("netcdf", "layers"):
            if out is None or len(views) != 1:
                raise click.UsageError(
                    f"{form} is of one glider, into a file: name the GLIDER and --out FILE"
                )
            _write_netcdf(out, form, store, views[0], config.export.attributes if config is not None else {})
            return
        if form == "csv":
            every = [dive for view in views for dive in view.dives]
            text = dives.as_csv(beside_neighbours(every, _fleet(store)))
        else:
            text = maps.as_geojson(views) if form == "geojson" else maps.as_kml(views)
    if out is None:
        click.echo(text, nl=not text.endswith("\n"))
    else:
        out.write_text(text, encoding="utf-8")


def _fleet(store: Store) -> list[list[Assessment]]:
    """The dives of each glider."""
    return [store.assessments(glider) for glider in store.gliders()]


def _write_netcdf(
    out: Path, form: str, store: Store, view: GliderView, attributes: Mapping[str, str]
) -> None:
    from gliderwatch.export import netcdf
    from gliderwatch.fleet.reference import beside_neighbours
    from gliderwatch.pages import reading

    if form == "netcdf":
        dives = beside_neighbours(view.dives, _fleet(store))
        netcdf.write(out, view.name, dives, view.now, attributes)
        return
    found, advice = reading.read_section(store, view.name, _ALL)
    netcdf.write_section(out, view.name, found, advice, view.dives, view.now, attributes)


@click.command(epilog=example("gliderwatch where electa", "gliderwatch where electa --ais 992441234"))
@click.argument("glider", required=False)
@json_option
@click.option("--ais", type=int, help="As a virtual aid to navigation of this number (MMSI): NMEA lines.")
@only_config_option
@state_option
@at_option
def where(
    glider: str | None,
    as_json: bool,
    ais: int | None,
    config_path: Path | None,
    state: Path | None,
    at: str | None,
) -> None:
    """Show where gliders are now, also under water, and how sure that is."""
    import msgspec

    from gliderwatch.export import ais as virtual
    from gliderwatch.export.dives import iso
    from gliderwatch.messages.formatting import clean, place, utc

    if ais is not None and glider is None:
        raise click.UsageError("--ais is of one glider: name it")
    with viewing(configuration(config_path, state), state, at, glider) as (_, views):
        found = [(view, view.whereabouts()) for view in views]
    if as_json:
        listed = [
            {
                "glider": view.name,
                "t": iso(view.now),
                "lat": area.lat if area else None,
                "lon": area.lon if area else None,
                "major_m": area.major if area else None,
                "minor_m": area.minor if area else None,
                "bearing": area.bearing if area else None,
            }
            for view, area in found
        ]
        click.echo(msgspec.json.format(msgspec.json.encode(listed), indent=2))
        return
    for view, area in found:
        if area is None:
            sign = f"; last heard {utc(view.last_sign)}" if view.last_sign is not None else ""
            fix = f", at {place(view.fix.lat, view.fix.lon)}" if sign and view.fix is not None else ""
            click.echo(f"{clean(view.name)}: no position is known now{sign}{fix}")
        elif ais is not None:
            click.echo("\n".join(virtual.lines(view.name, area, ais, view.now)))
        else:
            size = f"{area.major / 1000:.1f} x {area.minor / 1000:.1f} km, long axis {area.bearing:03.0f}°"
            click.echo(f"{clean(view.name)}: {place(area.lat, area.lon)}, 95 % within {size}")


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
    from gliderwatch.config import load
    from gliderwatch.config.fields import moment
    from gliderwatch.messages.formatting import utc
    from gliderwatch.service.fields import fields_of, write_field
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
    with Store.looking(state if state is not None else Path(config.state.path)) as store:
        written = write_field(store, found[name], path, t, time.time(), config.export.attributes)
    click.echo(f"{path}: {name} at {utc(written)}")


COMMANDS = (export, where, field)
