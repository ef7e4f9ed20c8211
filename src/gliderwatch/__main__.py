"""The command `gliderwatch`, also as `python -m gliderwatch`.

Python starts the processes that decode, process and draw by the same script, so that they load this module
as well: it loads the commands, some 20 MB, only where one is given.
"""

from __future__ import annotations


def main() -> None:
    """Run the command that the arguments of the process name."""
    from gliderwatch.cli.main import main as command  # noqa: PLC0415 (not in worker processes)

    command()


if __name__ == "__main__":
    main()
