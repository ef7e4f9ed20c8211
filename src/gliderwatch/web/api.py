"""What the API says, as values for JSON, and its description by OpenAPI 3.1. Pure."""

from __future__ import annotations

from typing import Any

from gliderwatch import __version__
from gliderwatch.export.dives import assessment_line, iso_ms
from gliderwatch.messages.formatting import clean
from gliderwatch.model import Incident
from gliderwatch.pages.view import GliderView, verdict

Json = dict[str, Any]


def glider(view: GliderView) -> Json:
    """One glider: how it is, in a word; where it was last, where it is, when it calls next."""
    found, now, fix = verdict(view), view.whereabouts(), view.fix
    return {
        "name": clean(view.name),
        "word": found.word,
        "sentence": found.sentence,
        "since": _time(found.since),
        "as_of": iso_ms(view.now),
        "heard": _time(view.last_sign),
        "fix": None if fix is None else {"t": iso_ms(fix.t), "lat": fix.lat, "lon": fix.lon},
        "now": None
        if now is None
        else {
            "lat": now.lat,
            "lon": now.lon,
            "major_m": now.major,
            "minor_m": now.minor,
            "bearing": now.bearing,
        },
        "next_call": _time(None if view.awaited is None else view.awaited.t),
        "overdue_at": _time(None if view.awaited is None else view.awaited.due),
        "latest": None if view.latest is None else assessment_line(view.latest),
        "open_incidents": [i.id for i in view.open],
    }


def incident(view: GliderView, i: Incident) -> Json:
    """One incident, and who has taken it on."""
    ack = view.acks.get(i.id)
    return {
        "id": i.id,
        "glider": clean(view.name),
        "kind": str(i.kind),
        "severity": i.severity.name.lower(),
        "since": iso_ms(i.since),
        "opened_at": iso_ms(i.opened_at),
        "cleared_at": _time(i.cleared_at),
        "dives": i.dives,
        "acknowledged_by": None if ack is None else clean(ack.by),
    }


def _time(t: float | None) -> str | None:
    return None if t is None else iso_ms(t)


def _object(**properties: Any) -> Json:
    return {"type": "object", "required": sorted(properties), "properties": properties}


def _list(what: str) -> Json:
    return {"type": "array", "items": {"$ref": f"#/components/schemas/{what}"}}


_TEXT: Json = {"type": "string"}
_NUMBER: Json = {"type": "number"}
_WHEN: Json = {"type": ["string", "null"], "format": "date-time"}
_SCHEMAS: Json = {
    "Glider": _object(
        name=_TEXT,
        word={"type": "string", "description": "docs/pages.md"},
        sentence=_TEXT,
        since=_WHEN,
        as_of=_WHEN,
        heard=_WHEN,
        fix={"type": ["object", "null"], "properties": {"t": _WHEN, "lat": _NUMBER, "lon": _NUMBER}},
        now={
            "type": ["object", "null"],
            "description": "Where it is with 95 %: an ellipse, semi-axes in m, bearing of the longer one.",
            "properties": dict.fromkeys(("lat", "lon", "major_m", "minor_m", "bearing"), _NUMBER),
        },
        next_call=_WHEN,
        overdue_at=_WHEN,
        latest={"type": ["object", "null"], "description": "An assessment, docs/nomenclature.md"},
        open_incidents={"type": "array", "items": _TEXT},
    ),
    "Incident": _object(
        id=_TEXT,
        glider=_TEXT,
        kind=_TEXT,
        severity={"enum": ["info", "warning", "critical"]},
        since=_WHEN,
        opened_at=_WHEN,
        cleared_at=_WHEN,
        dives={"type": "integer"},
        acknowledged_by={"type": ["string", "null"]},
    ),
    "Assessment": {
        "type": "object",
        "required": ["glider", "segment", "t_dive", "t_surface", "flag", "speed"],
        "description": "A dive; its fields are in docs/nomenclature.md.",
        "properties": {"glider": _TEXT, "segment": _TEXT, "t_dive": _WHEN, "t_surface": _WHEN},
    },
}


def _get(summary: str, schema: Json, kind: str = "application/json", **more: Any) -> Json:
    answer = {"description": summary, "content": {kind: {"schema": schema}}}
    return {"get": {"summary": summary, "responses": {"200": answer}, **more}}


_NAME = {"name": "name", "in": "path", "required": True, "schema": _TEXT}
_LIMIT = {
    "name": "limit",
    "in": "query",
    "schema": {"type": "integer", "minimum": 1, "maximum": 10000, "default": 100},
}
PATHS: Json = {
    "/api/gliders": _get("All gliders, the worst first.", _list("Glider")),
    "/api/gliders/{name}/assessments": _get(
        "The last dives of a glider, in order of time.", _list("Assessment"), parameters=[_NAME, _LIMIT]
    ),
    "/api/incidents": _get("All incidents of all gliders.", _list("Incident")),
    "/api/gliders.geojson": _get(
        "Tracks, dives and places of all gliders.", {"type": "object"}, "application/geo+json"
    ),
}


def openapi() -> Json:
    """The description of the API."""
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "gliderwatch",
            "version": __version__,
            "description": "Reads only. SI units, true north, times ISO 8601 in UTC, null where unknown.",
        },
        "paths": PATHS,
        "components": {"schemas": _SCHEMAS},
    }
