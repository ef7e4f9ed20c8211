"""The command line: all commands of gliderwatch. Thin: each hands over to the module that does the work."""

from __future__ import annotations

import io
import sys

import click

from gliderwatch import __version__
from gliderwatch.command_look import LOOKING
from gliderwatch.command_options import Group
from gliderwatch.command_run import run
from gliderwatch.manage import COMMANDS
from gliderwatch.score.command import score
from gliderwatch.simulate.command import simulate


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
def main() -> None:
    """Watch a glider dockserver, and alert the pilot when a glider flies abnormally."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal may not know every sign, a name may be no text
            stream.reconfigure(errors="replace")


for command in (run, *LOOKING, *COMMANDS, simulate, score):
    main.add_command(command)
