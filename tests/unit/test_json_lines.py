"""Assessments and alerts as lines of JSON."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

from alert_support import SLOW, alert
from gliderwatch.export.dives import alert_line, assessment_line, iso_ms, write_lines
from gliderwatch.model import Assessment

PROMISED = {
    "glider",
    "segment",
    "t_dive",
    "t_surface",
    "lat",
    "lon",
    "flag",
    "reason",
    "speed",
    "speed_min",
    "speed_max",
    "flow_u",
    "flow_v",
    "reference_u",
    "reference_v",
    "p_e",
    "clle_max",
    "n_samples",
    "notes",
}


def test_times_are_utc_to_the_millisecond() -> None:
    assert iso_ms(0.0) == "1970-01-01T00:00:00.000Z"
    assert iso_ms(1667639520.0004) == "2022-11-05T09:12:00.000Z"


def test_an_assessment_has_all_its_fields_and_the_ones_promised() -> None:
    line = assessment_line(SLOW)
    assert set(line) == {field.name for field in fields(Assessment)} >= PROMISED
    assert line["t_dive"] == "2022-11-05T09:12:00.000Z"
    assert (line["flag"], line["speed"], line["notes"]) == (1, 0.112, ["magnetic declination from WMM2025"])


def test_what_is_unknown_is_null(tmp_path: Path) -> None:
    nothing = dict.fromkeys(("lat", "lon", "flag", "speed", "flow_u", "flow_v", "p_e", "clle_max"))
    write_lines(tmp_path / "lines", [assessment_line(replace(SLOW, **nothing, reason="no fix"))])
    line = json.loads((tmp_path / "lines").read_text(encoding="utf-8"))
    assert {name: line[name] for name in nothing} == nothing


def test_an_alert_has_the_fields_promised_and_no_page() -> None:
    line = alert_line(alert())
    assert set(line) == {"id", "glider", "time", "kind", "severity", "title", "body", "incident"}
    assert line["time"].endswith("Z")
    assert line["severity"] in ("info", "warning", "critical")


def test_lines_are_one_object_each_also_with_odd_text(tmp_path: Path) -> None:
    odd = replace(alert(), title="naïve\n“title”", body="a\u2028b")
    write_lines(tmp_path / "lines", [alert_line(odd), alert_line(alert())])
    content = (tmp_path / "lines").read_bytes()
    assert content.count(b"\n") == 2
    assert json.loads(content.split(b"\n")[0])["title"] == "naïve\n“title”"
