"""Assessments and alerts as lines of JSON, for `--out` and for machines."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from gliderwatch.model import Alert, Assessment


def iso(t: float) -> str:
    """A time (s since 1970) as ISO 8601 in UTC, to the millisecond.

    >>> iso(1667696205.25)
    '2022-11-06T00:56:45.250Z'
    """
    return datetime.fromtimestamp(t, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def assessment_line(a: Assessment) -> dict[str, Any]:
    """The fields of an assessment; SI, true north, times ISO 8601, null where unknown."""
    fields = {name: getattr(a, name) for name in a.__dataclass_fields__}
    return fields | {
        "t_dive": iso(a.t_dive),
        "t_surface": iso(a.t_surface),
        "evidence": dict(a.evidence),
        "notes": list(a.notes),
    }


def alert_line(a: Alert) -> dict[str, Any]:
    """The fields of an alert that are for reading; not its HTML."""
    return {
        "id": a.id,
        "glider": a.glider,
        "time": iso(a.time),
        "kind": str(a.kind),
        "severity": a.severity.name.lower(),
        "title": a.title,
        "body": a.body,
        "incident": a.incident,
    }


def write_lines(path: Path, lines: Iterable[dict[str, Any]]) -> None:
    """Write one JSON object a line."""
    path.write_bytes(b"".join(msgspec.json.encode(line) + b"\n" for line in lines))
