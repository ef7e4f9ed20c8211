"""The page of a field of the sea: what the gliders know of it together, and how well. Only `fields_of`
and `read_field` touch the state file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import numpy as np

from gliderwatch.figures.field_svg import FieldPanel, Spot
from gliderwatch.figures.section_svg import UNITS
from gliderwatch.fleet.advice import Box
from gliderwatch.fleet.batches import Sensor, property_of
from gliderwatch.fleet.constants import BIN, NO_MORE_AT_SEA
from gliderwatch.fleet.scalar_field import FieldParams, Information, at, estimate
from gliderwatch.messages.formatting import clean, utc
from gliderwatch.model import Array
from gliderwatch.store.state_file import Store

OVER = 30 * 86400.0
"""Seconds since its last sample after which a field has no page any more."""
ACROSS, DOWN = 24, 16
"""Cells of a map from side to side, and of a section from top to bottom."""
DEPTHS, COARSE = 7, 9
"""Depths of which the one that varies most is shown, and cells from side to side by which that is seen."""


@dataclass(frozen=True, slots=True)
class FieldView:
    """A field as it is known at ``now`` (s) by samples until ``last`` (s): on a map at a ``depth`` (m), and
    in a section from west to east at a latitude ``north`` (degrees). Estimates and standard errors are
    (latitude or depth, longitude). ``spots`` are the gliders in it."""

    name: str
    sensor: str
    box: Box
    now: float
    last: float
    depth: float
    north: float
    map: tuple[Array, Array]
    section: tuple[Array, Array]
    spots: tuple[Spot, ...]


def fields_of(store: Store, now: float) -> list[str]:
    """The fields that have a page at `now` (s): those with samples of the last weeks. Raises StateError."""
    found = ((name, store.fields.extent(name)) for name in store.fields.names())
    return [name for name, extent in found if extent and extent[1] <= now <= extent[2] + OVER]


def read_field(store: Store, name: str, now: float) -> FieldView | None:
    """A field at `now` (s); None where it was made by settings that this release does not know. Raises
    StateError."""
    settings, extent = store.fields.settings(name), store.fields.extent(name)
    try:
        box, sensor, params = msgspec.json.decode(settings or "", type=tuple[Box, Sensor, FieldParams])
    except msgspec.DecodeError:
        return None
    checkpoint = store.fields.before(name, now + BIN, params)
    if checkpoint is None or extent is None:
        return None
    known = at(checkpoint, now, params)
    spots = tuple(_spots(store, name, box, now))
    depth = _varied(known, params)
    part = float(np.mean([(s.y - box.south) / (box.north - box.south) for s in spots])) if spots else 0.5
    across, down = ((np.arange(n) + 0.5) / n for n in (ACROSS, DOWN))
    flat = _grid(known, params, across, across, np.array([depth]))
    deep = _grid(known, params, across, np.array([part]), down)
    return FieldView(
        name=clean(name, 40),
        sensor=property_of(sensor),
        box=box,
        now=now,
        last=min(extent[2], now),
        depth=box.top + depth * (box.bottom - box.top),
        north=box.south + part * (box.north - box.south),
        map=(flat[0][0], flat[1][0]),
        section=(deep[0][:, 0], deep[1][:, 0]),
        spots=spots,
    )


def _varied(known: Information, params: FieldParams) -> float:
    """The depth (0 to 1 in the box) at which the field varies most from place to place."""
    flat = (np.arange(COARSE) + 0.5) / COARSE
    depths = (np.arange(DEPTHS) + 0.5) / DEPTHS
    return float(depths[_grid(known, params, flat, flat, depths)[0].std(axis=(1, 2)).argmax()])


def _grid(
    known: Information, params: FieldParams, east: Array, north: Array, down: Array
) -> tuple[Array, Array]:
    """Estimate and standard error ((depth, north, east)) at coordinates in the box."""
    z, y, x = np.meshgrid(down, north, east, indexing="ij")
    values, errors = estimate(known, np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1), params)
    return values.reshape(x.shape), errors.reshape(x.shape)


def _spots(store: Store, name: str, box: Box, now: float) -> Iterator[Spot]:
    """The gliders in a field where they were last, each with where it should look next, if that is
    advised."""
    for glider in store.gliders():
        last = store.facts(glider).last_surfacing(now)
        if last is None or last.lat is None or last.lon is None or now - last.t_surface > NO_MORE_AT_SEA:
            continue
        place = box.place(np.array([last.lat]), np.array([last.lon]), np.array([box.top]))[0]
        if not ((place >= 0) & (place <= 1)).all():
            continue
        advised = store.fields.advice(glider, last.t_surface)
        to = next(((a.lat, a.lon) for field, t, a in advised if field == name and t <= now), None)
        along = None if to is None else (_east(box, to[1]), to[0])
        yield Spot(clean(glider, 20), _east(box, last.lon), last.lat, along)


def _east(box: Box, lon: float) -> float:
    """A longitude (degrees) as those of a box: greater than that of its western side."""
    return box.west + (lon - box.west + 180.0) % 360.0 - 180.0


# ----------------------------------------
# What the page shows.


def panels(view: FieldView) -> tuple[tuple[FieldPanel, str], ...]:
    """Map and section, each of the estimate and of its standard error, with a sentence of what it shows."""
    box, unit = view.box, UNITS.get(view.sensor, "")
    across = (box.west, box.west + (box.east - box.west) % 360.0)
    name = view.sensor.capitalize()
    flat = f"at {view.depth:.0f} m"
    deep = f"at {abs(view.north):.2f}°{'S' if view.north < 0 else 'N'}"
    unit_of = f" {unit}" if unit else ""
    found = []
    for where, (values, errors), is_section in ((flat, view.map, False), (deep, view.section, True)):
        along = (box.top, box.bottom) if is_section else (box.south, box.north)
        spots = () if is_section else view.spots
        low, high, least, most = (float(x) for x in (values.min(), values.max(), errors.min(), errors.max()))
        why = "in the middle of its gliders" if is_section else "where it differs most from place to place"
        worst = _worst(errors, ("upper", "", "lower") if is_section else ("south", "", "north"))
        titles = f"{name} {where}", f"Standard error {where}"
        shows = (
            f"{name} {where}, {why}: {low:.3g} to {high:.3g}{unit_of}.",
            f"How well that is known: to {least:.2g}{unit_of} at best, to {most:.2g} {worst}.",
        )
        for title, says, shown in zip(titles, shows, (values, errors), strict=True):
            found.append((FieldPanel(title, unit, shown, across, along, is_section, spots), says))
    return tuple(found)


def sentence(view: FieldView) -> str:
    """What the page is of, in one sentence."""
    many = len(view.spots)
    gliders = "no glider is in it now" if not many else f"{many} glider{'' if many == 1 else 's'} in it now"
    name = view.sensor.capitalize()
    return f"{name} as all gliders measured it, by samples until {utc(view.last)}; {gliders}."


def _worst(errors: Array, rows: tuple[str, str, str]) -> str:
    """Where a standard error is greatest, in words; `rows` name the first, the middle, and the last third."""
    i, j = np.unravel_index(int(errors.argmax()), errors.shape)
    row = rows[min(3 * int(i) // errors.shape[0], 2)]
    side = ("west", "", "east")[min(3 * int(j) // errors.shape[1], 2)]
    return f"in the {' '.join(filter(None, (row, side)))}" if row or side else "in the middle"
