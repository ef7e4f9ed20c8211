"""Logging: JSON under a service manager, readable on a terminal."""

from __future__ import annotations

import io
import logging
import sys
from collections.abc import Iterable, MutableMapping
from contextlib import suppress
from typing import Any, TextIO, cast

import structlog

from gliderwatch.messages.formatting import clean
from gliderwatch.model import Alert, Severity
from gliderwatch.service.transaction import FileOutcome

log = structlog.get_logger(__name__)

_LONGEST = 1000
"""Characters of one value on a terminal."""


class _Patient(io.TextIOBase):
    """A stream, but a line that cannot be written is left out: a full disk must not end the watch."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            self._stream.flush()


def configure() -> None:
    """Set up structlog and the log of the libraries, from warnings on."""
    is_terminal, json = sys.stderr.isatty(), structlog.processors.JSONRenderer()
    common: list[structlog.typing.Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        structlog.processors.format_exc_info,
    ]
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        _OneLine("%(name)s: %(message)s")
        if is_terminal
        else structlog.stdlib.ProcessorFormatter(
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, json],
            foreign_pre_chain=[structlog.stdlib.add_logger_name, *common],
        )
    )
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    structlog.configure(
        processors=[*common, *([_printable, structlog.dev.ConsoleRenderer()] if is_terminal else [json])],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.WriteLoggerFactory(file=cast(TextIO, _Patient(sys.stderr))),
        cache_logger_on_first_use=True,
    )


class _OneLine(logging.Formatter):
    """What libraries say, which may hold names of files, in one printable line; tracebacks as they are."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 (logging)
        return clean(super().formatMessage(record), _LONGEST)


def _printable(_logger: object, _method: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    """Names from files must not move the cursor, nor begin a line; a traceback keeps its lines."""
    for key, value in event.items():
        if isinstance(value, str):
            lines = value.splitlines() if key == "exception" else [value]
            event[key] = "\n".join(_indented(line) for line in lines)
    return event


def _indented(line: str) -> str:
    return line[: len(line) - len(line.lstrip(" "))] + clean(line, _LONGEST)


def processed(input_: FileOutcome) -> None:
    """What became of a file."""
    file = input_.file
    log.info(
        f"file {file.status}",
        path=file.path,
        glider=file.glider,
        segment=file.segment,
        **({"reason": file.reason} if file.reason else {}),
        **({"dives": len(input_.assessments)} if input_.assessments else {}),
    )


def alerts(made: Iterable[Alert]) -> None:
    """Messages that are on their way."""
    for alert in made:
        about = {"glider": alert.glider} if alert.glider else {}  # else it is for the operator
        about |= {"alert": alert.id, "kind": str(alert.kind), "title": alert.title}
        if alert.severity is Severity.INFO:
            log.info("alert", **about)
        else:
            log.warning("alert", **about)
