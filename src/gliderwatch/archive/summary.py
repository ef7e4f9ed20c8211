"""What came of many missions: a table for other programs, and a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from jinja2 import PackageLoader

from gliderwatch import __version__
from gliderwatch.archive.hindcast import Hindcast, Judged, Sea
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
        ("with_step", pa.int32()),
        ("first_seen", pa.timestamp("s", tz="UTC")),
        ("seen_after", pa.float64()),
        ("lat", pa.float64()),
        ("lon", pa.float64()),
        ("depth", pa.float64()),
        ("tide", pa.float64()),
        ("residual", pa.float64()),
        ("near_real_time_sigma", pa.float64()),
        ("delayed_sigma", pa.float64()),
    ],
    metadata={"units": "speeds and currents in m/s, months of 30 days, seen_after in h, depth in m"},
)


@dataclass(frozen=True, slots=True)
class Row:
    """A mission by one kind of its files.

    ``with_step`` counts the anomalies at which depth rate, pitch or roll show a step (full files only),
    ``first_seen`` (s) is the surfacing at which the first incident was opened, ``seen_after`` (h) see
    `_seen_after`.
    """

    name: str
    glider: str
    files: str
    judged: Judged
    anomalies: int
    false_alarms: int
    with_step: int | None
    first_seen: float | None
    seen_after: float | None
    sea: Sea


def rows(found: Sequence[Hindcast]) -> list[Row]:
    """A row for each kind of files of each mission, in the order of their names."""
    out = list[Row]()
    for one in sorted(found, key=lambda h: h.name):
        for files, judged in (("as sent", one.online), ("full", one.full)):
            if judged is not None:
                out.append(_row(one, files, judged))
    return out


def _row(one: Hindcast, files: str, judged: Judged) -> Row:
    kinds = [incident.kind for incident in judged.incidents]
    anomalies = [incident for incident in judged.incidents if incident.kind == "anomaly"]
    steps = sum(incident.onset is not None for incident in anomalies) if files == "full" else None
    seen = min((incident.opened_at for incident in judged.incidents), default=None)
    return Row(
        one.name,
        one.glider,
        files,
        judged,
        len(anomalies),
        kinds.count("false_alarm"),
        steps,
        seen,
        _seen_after(one, files),
        one.sea,
    )


def _seen_after(one: Hindcast, files: str) -> float | None:
    """How long (h) after its onset within a dive the first such incident was seen: by full files at the
    surfacing, by files as sent on shore; None where no onset is known."""
    for incident in () if one.full is None else one.full.incidents:
        if incident.onset is not None and files == "full":
            return (incident.opened_at - incident.onset.t) / 3600
    for delay in () if one.difference is None else one.difference.delays:
        if delay.full.onset is not None and files != "full":
            return delay.after
    return None


@dataclass(frozen=True, slots=True)
class Total:
    """All missions by one kind of their files: how many ``missions`` and ``months``, and what was found."""

    files: str
    missions: int
    months: float
    anomalies: int
    false_alarms: int
    with_step: int | None


def totals(some: Sequence[Row]) -> list[Total]:
    """The sums of the rows of each kind of files."""
    out = []
    for files in ("as sent", "full"):
        of = [row for row in some if row.files == files]
        steps = sum(row.with_step or 0 for row in of) if files == "full" else None
        if of:
            months = sum(row.judged.months for row in of)
            found = sum(row.anomalies for row in of), sum(row.false_alarms for row in of)
            out.append(Total(files, len(of), months, *found, steps))
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
            "with_step": row.with_step,
            "first_seen": None if row.first_seen is None else round(row.first_seen),
            "seen_after": row.seen_after,
            **asdict(row.sea),
            "near_real_time_sigma": by_name[row.name].near_real_time,
            "delayed_sigma": by_name[row.name].delayed,
        }
        for row in made
    ]
    pq.write_table(pa.Table.from_pylist(table, schema=_SCHEMA), out / TABLE)
    pages = environment(PackageLoader("gliderwatch.archive"))
    pages.filters["utc"] = utc
    page = pages.get_template("summary.html").render(
        rows=made,
        totals=totals(made),
        version=__version__,
    )
    (out / PAGE).write_text(page, encoding="utf-8")
