"""Dives as columns, which a table and a NetCDF file have in common; dives and messages as lines of JSON."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from gliderwatch.messages.formatting import clean
from gliderwatch.model import Alert, Assessment


@dataclass(frozen=True, slots=True)
class Column:
    """One quantity of a dive: its ``name`` and ``unit`` (UDUNITS) as in docs/nomenclature.md, what it is in
    words, its CF standard name, if there is one, and how it is found."""

    name: str
    unit: str
    long_name: str
    value: Callable[[Assessment], float | None]
    standard_name: str = ""


def _evidence(key: str) -> Callable[[Assessment], float | None]:
    return lambda dive: dive.evidence.get(key)


COLUMNS = (
    Column("t_dive", "seconds since 1970-01-01T00:00:00Z", "first sample under water", lambda d: d.t_dive),
    Column(
        "speed",
        "m s-1",
        "horizontal speed through the water",
        lambda d: d.speed,
        "platform_speed_wrt_sea_water",
    ),
    Column(
        "speed_sigma",
        "m s-1",
        "standard error of the speed",
        _evidence("speed_sigma"),
        "platform_speed_wrt_sea_water standard_error",
    ),
    Column("speed_min", "m s-1", "lower bound of the normal speed", lambda d: d.speed_min),
    Column("speed_max", "m s-1", "upper bound of the normal speed", lambda d: d.speed_max),
    Column(
        "own_speed",
        "m s-1",
        "speed that the glider itself reckons with",
        _evidence("own_speed"),
        "platform_speed_wrt_sea_water",
    ),
    Column("flow_u", "m s-1", "estimated current, east", lambda d: d.flow_u, "eastward_sea_water_velocity"),
    Column("flow_v", "m s-1", "estimated current, north", lambda d: d.flow_v, "northward_sea_water_velocity"),
    Column(
        "flow_sigma",
        "m s-1",
        "standard error of a component of the current, east or north",
        _evidence("flow_sigma"),
        "eastward_sea_water_velocity standard_error",
    ),
    Column(
        "reference_u",
        "m s-1",
        "current it is compared with, east",
        lambda d: d.reference_u,
        "eastward_sea_water_velocity",
    ),
    Column(
        "reference_v",
        "m s-1",
        "current it is compared with, north",
        lambda d: d.reference_v,
        "northward_sea_water_velocity",
    ),
    Column(
        "fleet_u",
        "m s-1",
        "current by the gliders about it alone, east",
        _evidence("fleet_u"),
        "eastward_sea_water_velocity",
    ),
    Column(
        "fleet_v",
        "m s-1",
        "current by the gliders about it alone, north",
        _evidence("fleet_v"),
        "northward_sea_water_velocity",
    ),
    Column(
        "fleet_sigma",
        "m s-1",
        "standard error of a component of that, east or north",
        _evidence("fleet_sigma"),
        "eastward_sea_water_velocity standard_error",
    ),
    Column(
        "fused_u",
        "m s-1",
        "current by the fleet, its own dives before and a model, east",
        _evidence("fused_u"),
        "eastward_sea_water_velocity",
    ),
    Column(
        "fused_v",
        "m s-1",
        "current by the fleet, its own dives before and a model, north",
        _evidence("fused_v"),
        "northward_sea_water_velocity",
    ),
    Column(
        "fused_sigma",
        "m s-1",
        "standard error of a component of that, east or north",
        _evidence("fused_sigma"),
        "eastward_sea_water_velocity standard_error",
    ),
    Column("p_e", "1", "difference of the two currents, 0 to 1", lambda d: d.p_e),
    Column("across_misfit", "m s-1", "misfit across the heading", _evidence("across_misfit")),
    Column("depth_max", "m", "greatest depth of the dive", _evidence("depth_max")),
    Column("pitch_dive", "rad", "median pitch going down", _evidence("pitch_dive"), "platform_pitch_fore_up"),
    Column(
        "pitch_climb", "rad", "median pitch coming up", _evidence("pitch_climb"), "platform_pitch_fore_up"
    ),
    Column(
        "roll_mean",
        "rad",
        "mean roll, right side down positive",
        _evidence("roll_mean"),
        "platform_roll_starboard_down",
    ),
)
"""What is written of each dive beside time, place and flag."""


def as_csv(dives: Sequence[Assessment]) -> str:
    """A table, one dive a line: times as ISO 8601, what is unknown left empty."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    names = [column.name for column in COLUMNS if column.name != "t_dive"]
    table.writerow(["glider", "segment", "t_dive", "t_surface", "lat", "lon", "flag", *names, "reason"])
    for d in dives:
        numbers = [column.value(d) for column in COLUMNS if column.name != "t_dive"]
        times = (iso(d.t_dive), iso(d.t_surface))
        where = ("" if d.lat is None else d.lat, "" if d.lon is None else d.lon)
        flag = "" if d.flag is None else d.flag
        values = ["" if x is None else f"{x:.6g}" for x in numbers]
        table.writerow([_text(d.glider), _text(d.segment), *times, *where, flag, *values, _text(d.reason)])
    return out.getvalue()


def _text(value: str) -> str:
    """Text for a cell: a spreadsheet runs what begins as a formula does."""
    line = clean(value)
    return f"'{line}" if line.startswith(("=", "+", "-", "@")) else line


def iso(t: float) -> str:
    """A time (s) as ISO 8601, to the second.

    >>> iso(1667696205.25)
    '2022-11-06T00:56:45Z'
    """
    return datetime.fromtimestamp(t, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


# ----------------------------------------
# Dives and messages as lines of JSON, for `--out` and for machines.


def iso_ms(t: float) -> str:
    """A time (s since 1970) as ISO 8601 in UTC, to the millisecond.

    >>> iso_ms(1667696205.25)
    '2022-11-06T00:56:45.250Z'
    """
    return datetime.fromtimestamp(t, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def assessment_line(a: Assessment) -> dict[str, Any]:
    """The fields of an assessment; SI, true north, times ISO 8601, null where unknown."""
    fields = {name: getattr(a, name) for name in a.__dataclass_fields__}
    return fields | {
        "t_dive": iso_ms(a.t_dive),
        "t_surface": iso_ms(a.t_surface),
        "evidence": dict(a.evidence),
        "notes": list(a.notes),
    }


def alert_line(a: Alert) -> dict[str, Any]:
    """The fields of an alert that are for reading; not its HTML."""
    return {
        "id": a.id,
        "glider": a.glider,
        "time": iso_ms(a.time),
        "kind": str(a.kind),
        "severity": a.severity.name.lower(),
        "title": a.title,
        "body": a.body,
        "incident": a.incident,
    }


def write_lines(path: Path, lines: Iterable[dict[str, Any]]) -> None:
    """Write one JSON object a line."""
    path.write_bytes(b"".join(msgspec.json.encode(line) + b"\n" for line in lines))
