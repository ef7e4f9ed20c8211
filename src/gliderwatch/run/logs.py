"""Logging: JSON under a service manager, readable on a terminal."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable

import structlog

from gliderwatch.model import Alert
from gliderwatch.run.intake import Taken

log = structlog.get_logger(__name__)


def configure() -> None:
    """Set up structlog and the log of the libraries, which is heard from warnings on."""
    logging.basicConfig(level=logging.WARNING, stream=sys.stderr, format="%(name)s: %(message)s")
    terminal = sys.stderr.isatty()
    renderer = structlog.dev.ConsoleRenderer() if terminal else structlog.processors.JSONRenderer()
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            renderer,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.WriteLoggerFactory(file=sys.stderr),
        cache_logger_on_first_use=True,
    )


def taken(input_: Taken) -> None:
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
        log.warning("alert", glider=alert.glider, kind=str(alert.kind), alert=alert.id, title=alert.title)
