"""The command `gliderwatch hindcast`: missions of the past judged again, with reports."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import click

from gliderwatch.cli.options import FILE, cluster_option, example, progress, workers_option
from gliderwatch.errors import GliderwatchError


@click.command(
    epilog=example(
        "gliderwatch hindcast archive/electa-2022 --out reports",
        "gliderwatch hindcast archive/* --out reports --cluster tcp://10.0.0.5:8786",
    )
)
@click.argument("missions", nargs=-1, required=True)
@click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder for the reports."
)
@click.option(
    "--estimator", default="joint", help="joint, adaptive, or adaptive:PRESET of the papers (joint)."
)
@click.option("--settings", type=FILE, help="A configuration, for the settings of its gliders.")
@cluster_option
@workers_option
@click.option("--json", "as_json", is_flag=True, help="Results as JSON, a line a mission.")
def hindcast(
    missions: tuple[str, ...],
    out: Path,
    estimator: str,
    settings: Path | None,
    cluster: str | None,
    workers: int | None,
    as_json: bool,
) -> None:
    """Judge missions of the past again, and write a report of each with figures.

    A mission is a folder with dbd or sbd files (or an address: s3://...), with their cache files in or beside
    it. Where it has both kinds, dbd shows what could be known, sbd what was known online. OUT gets a folder a
    mission (report.html, report.pdf, figures.nc, dives.nc), and a summary of all. What is done is not done
    again.
    """
    try:
        from gliderwatch.archive import cluster as dask_cluster  # noqa: PLC0415
        from gliderwatch.archive import hindcast as judging  # noqa: PLC0415
        from gliderwatch.archive import missions as archive  # noqa: PLC0415
        from gliderwatch.archive import report, summary  # noqa: PLC0415
    except ImportError as error:
        raise GliderwatchError(
            f"{error.name} is not installed: hindcast needs the extra gliderwatch[archive], which the "
            "wheelhouse of docs/install.md holds"
        ) from None
    import msgspec  # noqa: PLC0415

    found = archive.find(missions)
    out.mkdir(parents=True, exist_ok=True)
    done = list[judging.Hindcast]()
    with progress() as bar:
        row = bar.add_task("missions", total=len(found))

        def on_done(_task: archive.Mission, result: judging.Hindcast) -> None:
            done.append(result)
            bar.advance(row)

        work = partial(
            report.make_in, out.resolve(), estimator, None if settings is None else settings.resolve()
        )
        failed = dask_cluster.run_all(work, found, on_done, cluster, workers)
    summary.write(out, done)
    for one in sorted(done, key=lambda h: h.name):
        click.echo(msgspec.json.encode(one) if as_json else "\n".join((one.name, *report.lines(one), "")))
    for words in failed:
        click.echo(words, err=True)
    click.echo(f"written to {out}: {summary.PAGE}, {summary.TABLE}, and a folder for each mission", err=True)
    if failed:
        sys.exit(1)
