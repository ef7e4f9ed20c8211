"""Writes man pages and shell completion, made from the commands, as they lie in /usr/local/share.

    python docs/shell.py FOLDER

`make wheelhouse` does it; `docs/install.md` puts them in their places.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from inspect import cleandoc
from pathlib import Path

import click
from click.shell_completion import get_completion_class
from click_man.man import ManPage

from gliderwatch import __version__
from gliderwatch.cli.main import main

NAME = "gliderwatch"
COMPLETION = {
    "bash": "bash-completion/completions/gliderwatch",
    "zsh": "zsh/site-functions/_gliderwatch",
    "fish": "fish/vendor_completions.d/gliderwatch.fish",
}
"""Where each shell looks."""


def documents() -> Iterator[tuple[Path, str]]:
    """Each file, below the folder, and its text."""
    for shell, path in COMPLETION.items():
        found = get_completion_class(shell)
        assert found is not None
        yield Path(path), f"{found(main, {}, NAME, '_GLIDERWATCH_COMPLETE').source()}\n"
    for context in _contexts(click.Context(main, info_name=NAME)):
        yield Path("man/man1") / f"{context.command_path.replace(' ', '-')}.1", man_page(context)


def _contexts(context: click.Context) -> Iterator[click.Context]:
    """A command, and all below it."""
    yield context
    for name, command in getattr(context.command, "commands", {}).items():
        if not command.hidden:
            yield from _contexts(click.Context(command, info_name=name, parent=context))


def man_page(context: click.Context) -> str:
    """The man page of a command: its help, and the examples at its end."""
    command = context.command
    page = ManPage(context.command_path)
    page.version, page.date = __version__, ""
    page.short_help = command.get_short_help_str(limit=200).rstrip(".")
    page.synopsis = " ".join(command.collect_usage_pieces(context))
    page.description = _roff(cleandoc(command.help or "").replace("\b\n", ""))
    records = [param.get_help_record(context) for param in command.params if isinstance(param, click.Option)]
    page.options = [(option, _roff(about)) for option, about in filter(None, records)]
    below = getattr(command, "commands", {})
    page.commands = [
        (name, _roff(each.get_short_help_str(limit=200))) for name, each in below.items() if not each.hidden
    ]
    return f"{page}{_examples(command)}"


def _examples(command: click.Command) -> str:
    """The lines of the examples, as they stand."""
    _, _, lines = cleandoc((command.epilog or "").replace("\b\n", "")).partition("\n")
    return f".SH EXAMPLES\n.nf\n{_roff(lines)}\n.fi\n" if lines else ""


def _roff(text: str) -> str:
    """Text in which nothing is an instruction to roff."""
    escaped = text.replace("\\", "\\e").replace("-", "\\-")
    return "\n".join(f"\\&{line}" if line.startswith((".", "'")) else line for line in escaped.split("\n"))


if __name__ == "__main__":
    for path, text in documents():
        target = Path(sys.argv[1]) / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
