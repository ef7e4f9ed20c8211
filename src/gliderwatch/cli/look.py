"""The commands that look whether all is well: `check`, `doctor`, `status` and `test-alert`."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from gliderwatch.cli.options import DEFAULT, FILE, config_option, example, json_option
from gliderwatch.errors import ConfigError

# ruff: noqa: PLC0415
# What a command needs is imported in it: `status` in a health check must not wait for what `run` needs.

SAMPLES = (
    "anomaly",
    "false_alarm",
    "overdue",
    "unknown",
    "abort",
    "call",
    "health",
    "neighbours",
    "all_clear",
    "reminder",
    "correction",
    "regime",
    "acknowledged",
    "surfacing",
    "operator",
)
_LINE = re.compile(r"(?P<file>.*?):(?P<line>\d+): (?P<text>.*)")


def _print_json(value: object) -> None:
    import msgspec

    click.echo(msgspec.json.format(msgspec.json.encode(value), indent=2))


@click.command(epilog=example("gliderwatch check -c gliderwatch.yml"))
@config_option
@json_option
def check(config_path: Path, as_json: bool) -> None:
    """Check the configuration, its folders, caches and channels.

    It ends with 0: no errors, 1: errors (the service does not start, or does not watch all), 2: the file
    cannot be read as a configuration.
    """
    from gliderwatch.cli import tables
    from gliderwatch.config import load
    from gliderwatch.service import preconditions

    try:
        config = load(config_path)
    except ConfigError as error:
        if not as_json:
            raise
        lines = [{"severity": "error", **_placed(line, config_path)} for line in str(error).splitlines()]
        _print_json(_checked(lines, ()))
        sys.exit(2)
    found = preconditions.check(config, config_path)
    errors = sum(p.severity == "error" for p in found)
    if as_json:
        lines = [
            {"severity": p.severity, **_placed(f"{p.where}: {p.text}", config_path), "cure": p.cure}
            for p in found
        ]
        _print_json(_checked(lines, sorted(config.gliders)))
    else:
        tables.problems(found, Console())
        gliders = ", ".join(sorted(config.gliders)) or "none"
        click.echo(f"{config_path}: {errors} errors, {len(found) - errors} warnings; gliders: {gliders}")
    sys.exit(1 if errors else 0)


def _placed(text: str, path: Path) -> dict[str, Any]:
    """File, line and words of a problem in one line."""
    match = _LINE.fullmatch(text)
    if match is None:
        return {"file": str(path), "line": None, "text": text}
    return {"file": match["file"], "line": int(match["line"]), "text": match["text"]}


def _checked(problems: Sequence[dict[str, Any]], gliders: Sequence[str]) -> dict[str, Any]:
    severities = {p["severity"] for p in problems}
    result = "errors" if "error" in severities else "warnings" if severities else "ok"
    return {"result": result, "problems": list(problems), "gliders": list(gliders)}


@click.command(
    epilog=example("sudo -u gliderwatch gliderwatch doctor", "gliderwatch doctor -c my.yml --send")
)
@click.option(
    "-c",
    "--config",
    "config_path",
    type=FILE,
    default=DEFAULT,
    help="The YAML configuration.",
    show_default=True,
)
@click.option("--send", is_flag=True, help="Send a test message through each channel.")
@json_option
def doctor(config_path: Path, send: bool, as_json: bool) -> None:
    """Look at all that gliderwatch needs.

    It ends with 0: all is well, 1: warnings, 2: errors.
    """
    from gliderwatch.cli.doctor import as_lines, examine, exit_code, report, summary

    found = []
    for finding in examine(config_path, send=send):
        found.append(finding)
        if not as_json:
            click.echo("\n".join(as_lines(finding)))
    if as_json:
        _print_json(report(found))
    else:
        click.echo(summary(found))
    sys.exit(exit_code(found))


@click.command(epilog=example("gliderwatch status -c gliderwatch.yml", "gliderwatch status --json"))
@config_option
@json_option
def status(config_path: Path, as_json: bool) -> None:
    """Show how the service and its gliders are.

    It ends with 0: the service is alive, 1: it is not, 2: that cannot be found out.
    """
    from gliderwatch.cli import tables
    from gliderwatch.cli.status import overview, status_as_json
    from gliderwatch.config import load

    view = overview(load(config_path))
    if as_json:
        _print_json(status_as_json(view))
    else:
        tables.status(view, Console())
    sys.exit(0 if view.alive else 1)


@click.command(
    "test-alert",
    epilog=example(
        "gliderwatch test-alert -c gliderwatch.yml",
        "gliderwatch test-alert --channel mail --sample overdue",
    ),
)
@config_option
@click.option("--channel", "only", help="Only this channel.")
@click.option(
    "--sample",
    type=click.Choice(SAMPLES),
    metavar="KIND",
    help=f"Send a complete message, marked as a sample: {', '.join(SAMPLES)}.",
)
def test_alert(config_path: Path, only: str | None, sample: str | None) -> None:
    """Send a test message to every channel, or to one.

    It ends with 1 where a channel did not take it.
    """
    from gliderwatch.cli.doctor_checks import sample_for, try_channel
    from gliderwatch.config import load

    config = load(config_path)
    names = [only] if only is not None else list(config.channels)
    if only is not None and only not in config.channels:
        raise ConfigError(f"there is no channel {only}; known are: {', '.join(config.channels) or 'none'}")
    if not names:
        raise ConfigError(f"{config_path}: no channels are configured")
    failures = 0
    for name in names:
        refused = try_channel(config, name, None if sample is None else sample_for(sample))
        failures += refused is not None
        click.echo(f"{name}: accepted" if refused is None else f"{name}: FAILED: {refused}")
    sys.exit(1 if failures else 0)


LOOKING = (check, doctor, status, test_alert)
