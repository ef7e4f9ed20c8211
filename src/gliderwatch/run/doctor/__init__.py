"""`gliderwatch doctor`: what a technician would check, in order, each with the cure.

Nothing is written (SQLite may put its `-shm` beside the state file to read it), and nothing is sent unless
asked for. What can be read depends on the user: ask as the one that runs the service.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from gliderwatch.config import Config, Problem, load
from gliderwatch.errors import ConfigError
from gliderwatch.run import preconditions
from gliderwatch.run.doctor import data, machine, service
from gliderwatch.run.doctor.finding import Finding, as_lines, error, exit_code, ok, report, summary

__all__ = ["Finding", "as_lines", "examine", "exit_code", "report", "summary"]


def examine(path: Path, *, send: bool = False) -> Iterator[Finding]:
    """All findings with the configuration at `path`; `send` a test message through each channel."""
    yield from _safely("program", machine.program)
    try:
        config = load(path)
    except (ConfigError, OSError) as problem:
        for line in str(problem).splitlines():
            yield error("configuration", line, "gliderwatch check -c FILE; docs/configuration.md")
        yield from _safely("clock", lambda: machine.clock({}))
        return
    yield ok("configuration", f"{path} can be read, {len(config.gliders)} gliders")
    problems: list[Problem] = []
    yield from _safely("folders", lambda: _checked(config, path, problems))
    yield from _safely("user", lambda: machine.user(config))
    yield from _safely("inotify", lambda: machine.inotify(config))
    files = data.Inventory()
    yield from _safely("files", lambda: _counted(config, files))
    yield from _safely("files", lambda: data.names(config, files))
    yield from _safely("caches", lambda: data.caches(config, files))
    yield from _safely("sensors", lambda: data.sensors(config, files))
    yield from _safely("clock", lambda: machine.clock(files.newest))
    least = config.operator.free_mb or 0.0
    yield from _safely("disk", lambda: machine.disk(config, least))
    yield from _safely("state", lambda: service.state(config, problems))
    yield from _safely("channels", lambda: service.channels(config, problems, send))
    yield from _safely("heartbeat", lambda: service.sign(config, problems))
    yield from _safely("service", lambda: service.daemon(config))


def _safely(topic: str, look: Callable[[], Iterable[Finding]]) -> Iterator[Finding]:
    """The findings of one part; what nobody foresaw in it hides nothing of the others."""
    try:
        yield from look()
    except Exception as problem:
        text = f"could not be looked at: {type(problem).__name__}: {problem}"
        yield error(topic, text, "if it says nothing to you, please report it")


def _checked(config: Config, path: Path, problems: list[Problem]) -> Iterator[Finding]:
    """Folders and permissions; `problems` gets all that `check` finds."""
    problems += preconditions.check(config, path)
    found = service.of_check("folders", problems, "dockserver", "gliders")
    yield from found or [ok("folders", "all are there and can be read")]


def _counted(config: Config, files: data.Inventory) -> Iterator[Finding]:
    data.take_stock(config, files)
    yield ok("files", f"{files.found} found")
