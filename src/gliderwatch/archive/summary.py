"""What came of many missions: a table for other programs, and a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from jinja2 import PackageLoader

from gliderwatch import __version__
from gliderwatch.archive.hindcast import Hindcast, Judged
from gliderwatch.messages.formatting import utc
from gliderwatch.messages.template import environment

TABLE, PAGE = "summary.parquet", "summary.html"
_SCHEMA = pa.schema(
    [
        ("mission", pa.string()),
        ("glider", pa.string()),
        ("estimator", pa.string()),
        ("files", pa.string()),
        ("dives", pa.int32()),
        ("judged", pa.int32()),
        ("flag_0", pa.int32()),
        ("flag_1", pa.int32()),
        ("flag_2", pa.int32()),
        ("start", pa.timestamp("s", tz="UTC")),
        ("end", pa.timestamp("s", tz="UTC")),
        ("months", pa.float64()),
        ("speed", pa.float64()),
        ("current", pa.float64()),
        ("anomalies", pa.int32()),
        ("false_alarms", pa.int32()),
        ("near_real_time_sigma", pa.float64()),
        ("delayed_sigma", pa.float64()),
    ],
    metadata={"units": "speeds and currents in m/s, months of 30 days"},
)


@dataclass(frozen=True, slots=True)
class Row:
    """A mission by one kind of its files."""

    name: str
    glider: str
    files: str
    judged: Judged
    anomalies: int
    false_alarms: int


def rows(found: Sequence[Hindcast]) -> list[Row]:
    """A row for each kind of files of each mission, in the order of their names."""
    out = list[Row]()
    for one in sorted(found, key=lambda h: h.name):
        for files, judged in (("as sent", one.online), ("full", one.full)):
            if judged is not None:
                kinds = [incident.kind for incident in judged.incidents]
                opened = kinds.count("anomaly"), kinds.count("false_alarm")
                out.append(Row(one.name, one.glider, files, judged, *opened))
    return out


def write(out: Path, found: Sequence[Hindcast]) -> None:
    """Write the table and the page; the same results give the same bytes, whoever worked on them."""
    made, by_name = rows(found), {one.name: one for one in found}
    table = [
        {
            "mission": row.name,
            "glider": row.glider,
            "estimator": by_name[row.name].estimator,
            "files": row.files,
            "dives": row.judged.dives,
            "judged": row.judged.dives - row.judged.flags.get("none", 0),
            **{f"flag_{flag}": row.judged.flags.get(str(flag), 0) for flag in range(3)},
            "start": round(row.judged.start),
            "end": round(row.judged.end),
            "months": row.judged.months,
            "speed": row.judged.speed,
            "current": row.judged.current,
            "anomalies": row.anomalies,
            "false_alarms": row.false_alarms,
            "near_real_time_sigma": by_name[row.name].near_real_time,
            "delayed_sigma": by_name[row.name].delayed,
        }
        for row in made
    ]
    pq.write_table(pa.Table.from_pylist(table, schema=_SCHEMA), out / TABLE)
    months = sum(row.judged.months for row in made)
    pages = environment(PackageLoader("gliderwatch.archive"))
    pages.filters["utc"] = utc
    page = pages.get_template("summary.html").render(
        rows=made,
        months=months,
        anomalies=sum(row.anomalies for row in made),
        false_alarms=sum(row.false_alarms for row in made),
        version=__version__,
    )
    (out / PAGE).write_text(page, encoding="utf-8")
