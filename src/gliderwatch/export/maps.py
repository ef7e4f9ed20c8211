"""Gliders on the maps of other programs: GeoJSON (RFC 7946) and KML 2.2. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any
from xml.sax.saxutils import escape

import msgspec

from gliderwatch.export.dives import iso
from gliderwatch.figures.chart import Place, outline
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.messages.formatting import clean
from gliderwatch.model import Assessment
from gliderwatch.pages.view import GliderView, verdict

REFRESH = 300
"""Seconds after which a program that shows a KML link looks again."""


def as_geojson(views: Sequence[GliderView]) -> str:
    """Tracks, dives, the last fix, where each glider is now and comes up next, as one collection."""
    features = [feature for view in views for feature in _features(view)]
    return msgspec.json.encode({"type": "FeatureCollection", "features": features}).decode()


def _features(view: GliderView) -> Iterator[dict[str, Any]]:
    name, found = clean(view.name), verdict(view)
    track = _track(view)
    if len(track) > 1:
        parts = [[_point(place) for place in part] for part in _at_date_line(track)]
        yield _feature(name, "track", {"type": "MultiLineString", "coordinates": parts})
    for dive in view.dives:
        if dive.lat is not None and dive.lon is not None:
            where = {"type": "Point", "coordinates": _point((dive.lat, dive.lon))}
            yield _feature(name, "dive", where, **_dive(dive))
    if view.fix is not None:
        where = {"type": "Point", "coordinates": _point((view.fix.lat, view.fix.lon))}
        more = {"t": iso(view.fix.t), "word": found.word, "sentence": found.sentence}
        yield _feature(name, "last_fix", where, **more)
    for what, t, area in areas(view):
        ring = [_point(place) for place in reversed(outline(area))]  # counter-clockwise
        where = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
        size = {"major_m": round(area.major), "minor_m": round(area.minor), "bearing": round(area.bearing, 1)}
        yield _feature(name, what, where, t=iso(t), lat=area.lat, lon=area.lon, confidence=0.95, **size)


def areas(view: GliderView) -> Iterator[tuple[str, float, DriftEllipse]]:
    """Where a glider is now, and where it comes up next, each with its time (s)."""
    if view.is_over or view.attention.recovered:
        return
    now = view.whereabouts()
    if now is not None:
        yield "now", view.now, now
    e = view.expected
    if e is not None and e.lat is not None and e.t > view.now and not view.is_overdue:
        following = view.whereabouts(e.t - view.now)
        if following is not None:
            yield "next_surfacing", e.t, following


def _feature(glider: str, what: str, geometry: dict[str, Any], **more: object) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": {"glider": glider, "what": what, **more}}


def _dive(d: Assessment) -> dict[str, Any]:
    return {
        "segment": clean(d.segment),
        "t_dive": iso(d.t_dive),
        "t_surface": iso(d.t_surface),
        "flag": d.flag,
        "speed": d.speed,
        "speed_sigma": d.speed_sigma,
        "flow_u": d.flow_u,
        "flow_v": d.flow_v,
        "reason": clean(d.reason),
    }


def _track(view: GliderView) -> list[Place]:
    return [(d.lat, d.lon) for d in view.dives if d.lat is not None and d.lon is not None]


def _at_date_line(track: list[Place]) -> list[list[Place]]:
    """The parts of a track on either side of the date line (RFC 7946, 3.1.9: no line crosses it)."""
    parts = [[track[0]]]
    for before, after in pairwise(track):
        if abs(after[1] - before[1]) > 180.0:
            parts.append([])
        parts[-1].append(after)
    return [part if len(part) > 1 else part * 2 for part in parts]


def _point(place: Place) -> list[float]:
    return [round(place[1], 6), round(place[0], 6)]


# ----------------------------------------
# KML.

_COLOURS = {"bad": "ff0d20a8", "warn": "ff004b8a", "ok": "ff8f5800", "quiet": "ff645a50"}
"""Of verdicts, as KML writes colours: alpha, blue, green, red."""


def as_kml(views: Sequence[GliderView]) -> str:
    """The same for Google Earth and its kind."""
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document><name>gliderwatch</name>',
        *(f'<Style id="{name}">{_style(colour)}</Style>' for name, colour in _COLOURS.items()),
        *(part for view in views for part in _folder(view)),
        "</Document></kml>",
    ]
    return "\n".join(parts) + "\n"


def as_kml_link(files: Sequence[str]) -> str:
    """A KML file that loads others, which lie beside it, again and again."""
    links = (
        f"<NetworkLink><name>{escape(file)}</name><Link><href>{escape(file)}</href>"
        f"<refreshMode>onInterval</refreshMode><refreshInterval>{REFRESH}</refreshInterval></Link></NetworkLink>"
        for file in files
    )
    head = '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
    return "\n".join([head, "<name>gliderwatch</name>", *links, "</Document></kml>", ""])


def _style(colour: str) -> str:
    return (
        f"<IconStyle><color>{colour}</color></IconStyle><LineStyle><color>{colour}</color><width>2</width>"
        f"</LineStyle><PolyStyle><color>40{colour[2:]}</color></PolyStyle>"
    )


def _folder(view: GliderView) -> Iterator[str]:
    found = verdict(view)
    yield f"<Folder><name>{escape(clean(view.name))}</name>"
    track = _track(view)
    if len(track) > 1:
        lines = "".join(
            f"<LineString><tessellate>1</tessellate><coordinates>{_coordinates(part)}</coordinates></LineString>"
            for part in _at_date_line(track)
        )
        yield _placemark("track", found.colour, f"<MultiGeometry>{lines}</MultiGeometry>")
    if view.fix is not None:
        point = f"<Point><coordinates>{_coordinates([(view.fix.lat, view.fix.lon)])}</coordinates></Point>"
        words = f"{found.word}: {found.sentence} Last fix {iso(view.fix.t)}"
        yield _placemark(clean(view.name), found.colour, point, words)
    for what, t, area in areas(view):
        ring = outline(area)
        edge = f"<LinearRing><coordinates>{_coordinates([*ring, ring[0]])}</coordinates></LinearRing>"
        shape = f"<Polygon><outerBoundaryIs>{edge}</outerBoundaryIs></Polygon>"
        yield _placemark(what.replace("_", " "), found.colour, shape, f"{iso(t)}, 95 %")
    yield "</Folder>"


def _placemark(name: str, style: str, geometry: str, words: str = "") -> str:
    return (
        f"<Placemark><name>{escape(name)}</name><description>{escape(words)}</description>"
        f"<styleUrl>{escape('#' + style)}</styleUrl>{geometry}</Placemark>"
    )


def _coordinates(places: Sequence[Place]) -> str:
    return " ".join(f"{lon:.6f},{lat:.6f}" for lat, lon in places)
