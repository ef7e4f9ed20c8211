"""The command line: all commands of gliderwatch. Thin: each hands over to the module that does the work."""

from __future__ import annotations

import io
import sys

import click

from gliderwatch import __version__
from gliderwatch.cli.export import COMMANDS as EXPORTING
from gliderwatch.cli.hindcast import hindcast
from gliderwatch.cli.layers import layers
from gliderwatch.cli.look import LOOKING
from gliderwatch.cli.manage import COMMANDS
from gliderwatch.cli.options import Group
from gliderwatch.cli.pages import pages, web
from gliderwatch.cli.run import run
from gliderwatch.cli.simulation import score, simulate


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
def main() -> None:
    """Watch a glider dockserver, and alert the pilot when a glider flies abnormally."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal may not know every sign, a name may be no text
            stream.reconfigure(errors="replace")


for command in (run, *LOOKING, *COMMANDS, *EXPORTING, pages, web, layers, hindcast, simulate, score):
    main.add_command(command)
