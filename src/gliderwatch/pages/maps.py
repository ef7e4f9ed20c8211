"""The maps of a page: of a glider, and of the fleet. Pure but for the coast."""

from __future__ import annotations

from collections.abc import Iterator

from gliderwatch.figures.chart import Arrow, Chart, Mark, Place
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.messages.formatting import clean
from gliderwatch.model import Assessment, Flag
from gliderwatch.pages.view import GliderView, Verdict, verdict

HOUR = 3600.0
AHEAD = (1.0, 3.0, 6.0)
"""Hours for which it is shown where a glider that is adrift will be."""
ARROWS = 12
"""Of the last dives, whose currents are shown."""
SHAPES = {"bad": "triangle", "warn": "diamond", "ok": "circle", "quiet": "square"}
"""So that no meaning is in the colour alone."""


_COLOURS: dict[int | None, str] = {Flag.NORMAL: "ok", Flag.ANOMALY: "bad", Flag.FALSE_ALARM: "warn"}
"""Of a leg by the flag of its dive; one that is not judged is dashed."""


def of_glider(view: GliderView) -> Chart:
    """Its track with flags and currents, where it is, and where it is going."""
    name = clean(view.name, 40)
    found = verdict(view)
    placed = [d for d in view.dives if d.lat is not None and d.lon is not None]
    colours, tracks = _legs(placed)
    marks = [mark for dive in placed if (mark := _flagged(dive)) is not None]
    if view.fix is not None:
        label = f"{name} last fix"
        marks.append(Mark((view.fix.lat, view.fix.lon), label, SHAPES[found.colour], found.colour))
    if view.waypoint is not None and view.fix is not None:
        marks.append(Mark(view.waypoint, "waypoint", "cross", "quiet"))
    return Chart(
        f"Map of {name}",
        tracks,
        colours,
        tuple(marks),
        tuple(_arrows(placed[-ARROWS:])),
        tuple(_areas(view, found)),
    )


def _legs(placed: list[Assessment]) -> tuple[tuple[str, ...], tuple[tuple[Place, ...], ...]]:
    """The track as legs of dives of one flag in a row, each with its colour: from fix to fix."""
    legs: list[tuple[str, list[Place]]] = []
    before: Place | None = None
    for dive in placed:
        if dive.lat is None or dive.lon is None:
            continue
        place, colour = (dive.lat, dive.lon), _COLOURS.get(dive.flag, "quiet")
        if before is not None:
            if not legs or legs[-1][0] != colour:
                legs.append((colour, [before]))
            legs[-1][1].append(place)
        before = place
    return tuple(colour for colour, _ in legs), tuple(tuple(leg) for _, leg in legs)


def _flagged(dive: Assessment) -> Mark | None:
    if dive.lat is None or dive.lon is None or dive.flag in (None, Flag.NORMAL):
        return None
    shape, colour = ("triangle", "bad") if dive.flag == Flag.ANOMALY else ("diamond", "warn")
    return Mark((dive.lat, dive.lon), "", shape, colour)


def _arrows(dives: list[Assessment]) -> Iterator[Arrow]:
    for d in dives:
        if d.lat is not None and d.lon is not None and d.flow_u is not None and d.flow_v is not None:
            yield Arrow((d.lat, d.lon), d.flow_u, d.flow_v)


def _areas(view: GliderView, found: Verdict) -> Iterator[tuple[DriftEllipse, str, str]]:
    """Where it is expected, or where it drifts."""
    if found.colour == "quiet" and found.rank < 0:
        return
    if found.word in {"OVERDUE", "ABORTED"}:
        for hours in (0.0, *AHEAD):
            area = view.whereabouts(hours * HOUR)
            if area is not None:
                yield area, "area", "now" if not hours else f"+{hours:g} h"
        return
    e = view.expected
    if e is not None and e.lat is not None and view.awaited is not None and e.t == view.awaited.t:
        area = view.whereabouts(e.t - view.now)
        if area is not None:
            yield area, "next", "next call"


def of_fleet(ranked: tuple[tuple[GliderView, Verdict], ...], links: dict[str, str]) -> Chart:
    """All gliders that are at sea, each where it was last."""
    marks = tuple(
        Mark((v.fix.lat, v.fix.lon), clean(v.name, 20), SHAPES[f.colour], f.colour, links.get(v.name, ""))
        for v, f in ranked
        if v.fix is not None and f.rank >= 0
    )
    return Chart("Map of all gliders", marks=marks)
