"""What the commands share: options, where they may write, a bar, how they fail, a group with all its help."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from rich.console import Console
from rich.text import Text

from gliderwatch.config import Config, expand
from gliderwatch.errors import GliderwatchError

if TYPE_CHECKING:
    from rich.progress import Progress

# ----------------------------------------
# Where a command may write: never below the folders of a dockserver, whose programs take what lies there.


def not_on_dockserver(config: Config, file: Path) -> Path:
    """The file to be written. Raises GliderwatchError where it lies below a folder that is only read."""
    place = file.parent.resolve() / file.name
    folders = [*config.dockserver.roots, *config.dockserver.cache]
    folders += [path for glider in config.gliders.values() for path in glider.paths]
    for folder in expand(folders):
        if place.is_relative_to(folder.resolve()):
            raise GliderwatchError(
                f"{file} lies below {folder}, where the dockserver's files are: nothing is written there. "
                "Name another place"
            )
    return file


# ----------------------------------------
# What the commands share: options, a bar, how they fail, and a group whose help is whole.

DEFAULT = Path("/etc/gliderwatch/gliderwatch.yml")
"""The configuration where none is named."""
FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(exists=True, path_type=Path)


def configured(path: Path) -> Path:
    """The configuration that is named, or the usual one. Raises UsageError where that is not there."""
    if path == DEFAULT and not path.exists():
        raise click.UsageError(f"there is no configuration {DEFAULT}: name yours with -c")
    return path


config_option = click.option(
    "-c",
    "--config",
    "config_path",
    type=FILE,
    default=DEFAULT,
    callback=lambda _context, _option, path: configured(path),
    help="The YAML configuration.",
    show_default=True,
)
cluster_option = click.option("--cluster", help="Address of a Dask scheduler; else a worker a core here.")
workers_option = click.option("--workers", type=click.IntRange(1), help="Workers here (one a core).")
json_option = click.option("--json", "as_json", is_flag=True, help="For machines.")


def example(*lines: str) -> str:
    """Examples of a command, for the end of its help; they keep their lines."""
    return "\b\n" + "\n".join(
        ["Example:" if len(lines) == 1 else "Examples:", *(f"  {line}" for line in lines)]
    )


class Number(click.FloatRange):
    """A number in a range. That of click lets NaN pass, which is in none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number. Raises click.BadParameter for what is none in the range."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a number with an end.", param, ctx)
        return number


def progress() -> Progress:
    """A bar with the time left, on the standard error where somebody looks."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
        # What is written to a file must not be led to the terminal, where the bar is.
        redirect_stdout=sys.stdout.isatty(),
        disable=not sys.stderr.isatty(),
    )


class Group(click.Group):
    """The group of all commands: errors on purpose are shown in words, and help is never cut."""

    def invoke(self, ctx: click.Context) -> object:
        """Run a command; ends with 2 where it says why it cannot."""
        try:
            return super().invoke(ctx)
        except GliderwatchError as error:
            _fail(str(error))
        except BrokenPipeError:  # `| head` has seen enough: click ends without a word
            raise
        except OSError as error:  # a full disk, a folder that is closed
            _fail(f"cannot go on: {error}")

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """All commands with the first sentence of their help, in as many lines as it takes."""
        commands = [self.commands[name] for name in self.list_commands(ctx)]
        with formatter.section("Commands"):
            formatter.write_dl([(c.name or "", c.get_short_help_str(limit=1000)) for c in commands])


def _fail(text: str) -> NoReturn:
    Console(stderr=True).print(Text(text), soft_wrap=True)
    sys.exit(2)
