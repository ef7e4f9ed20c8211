"""The fields of the configuration: what a new segment adds to them, where its glider should look next, and a
field as a file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import atan2, hypot, inf
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from gliderwatch.config import Config
from gliderwatch.errors import GliderwatchError
from gliderwatch.fleet.advice import Advice, Bounds, Box, Leg, Point, Way, advise, with_planned
from gliderwatch.fleet.batches import Sensor, batch_of, params_of, property_of, whereabouts
from gliderwatch.fleet.constants import BIN, NO_MORE_AT_SEA, USUAL_LEG
from gliderwatch.fleet.scalar_field import Batch, Checkpoint, FieldParams, at, estimate
from gliderwatch.forecast.outlook import look_ahead
from gliderwatch.layers.casts import PROPERTIES
from gliderwatch.model import Array, Segment, readonly
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.pipeline import GliderState
from gliderwatch.store.state_file import Store

if TYPE_CHECKING:
    from netCDF4 import Dataset

CATCH_UP = 6
"""Hours of samples by which a field is brought up to date at a time: files that come do not wait for more."""


@dataclass(frozen=True, slots=True)
class FleetField:
    """A field of the configuration; ``outputs`` is the folder for advice, None where none is wanted.
    ``is_shared``: its batches go to other relays."""

    name: str
    box: Box
    sensor: Sensor
    params: FieldParams
    bounds: Bounds = Bounds()
    way: Way = "look_ahead"
    outputs: Path | None = None
    is_shared: bool = False

    @property
    def key(self) -> str:
        """What of the settings the field is made by."""
        return msgspec.json.encode((self.box, self.sensor, self.params)).decode()


@dataclass(frozen=True, slots=True)
class FieldAdvice:
    """What is advised to a glider for a field, by name, at a surfacing ``t`` (s); a file of it goes to the
    folder ``outputs``."""

    field: str
    glider: str
    t: float
    advice: Advice
    outputs: Path


def fields_of(config: Config) -> tuple[FleetField, ...]:
    """The fields of a configuration, by name."""
    return tuple(_field(config, name) for name in sorted(config.fields))


def _field(config: Config, name: str) -> FleetField:
    setting = config.fields[name]
    area, (top, bottom) = setting.box, setting.depth
    box = Box(area.south, area.west, area.north, area.east, top, bottom)
    params, is_shared = params_of(setting.sensor, setting.estimator), config.relays.broker is not None
    if setting.advice is None:
        return FleetField(name, box, setting.sensor, params, is_shared=is_shared)
    wanted = setting.advice
    bounds = Bounds(wanted.polygon, wanted.shallowest, apart=wanted.apart_km * 1e3)
    outputs = Path(wanted.outputs)
    return FleetField(name, box, setting.sensor, params, bounds, wanted.way, outputs, is_shared)


def take_from_relays(store: Store, field: FleetField, batches: Sequence[Batch]) -> bool:
    """Put batches of other relays into a field, in a transaction of its own; whether there was news."""
    with store.transaction():
        _begin(store, field)
        return store.fields.put(field.name, batches)


def catch_up(store: Store, field: FleetField) -> float:
    """Bring a field up to date by `CATCH_UP` hours of samples, in a transaction of its own; the time (s) that
    it is of then: the same as before where there was nothing to do."""
    with store.transaction():
        newest = store.fields.advance(field.name, field.params, CATCH_UP)
    return -inf if newest is None else newest.t


def add(store: Store, fields: Sequence[FleetField], segment: Segment) -> None:
    """Put the samples of a segment into the fields; inside of a transaction.

    A field whose settings have changed is made again from all segments that are held.
    """
    for field in fields:
        _begin(store, field)
        batch = batch_of(segment, field.sensor, field.box)
        if batch is not None:
            store.fields.put(field.name, [batch], is_shared=field.is_shared)
        if field.bounds.shallowest is not None:
            store.fields.sound(field.name, _soundings(segment))


def look(
    store: Store, fields: Sequence[FleetField], glider: str, state: GliderState
) -> tuple[FieldAdvice, ...]:
    """Bring the fields up to date; where a glider that has just surfaced should look next, if it lies in
    them."""
    out = list[FieldAdvice]()
    leg = _leg(store, glider, state)
    for field in fields:
        if field.outputs is None:  # nobody looks at it now
            store.fields.keep_up(field.name, field.params)
            continue
        newest = store.fields.advance(field.name, field.params)
        if newest is None or leg is None:
            continue
        t, way = leg
        found = _advice(store, field, glider, newest, t, way)
        store.fields.advise(field.name, glider, t, found)
        if found is not None:
            out.append(FieldAdvice(field.name, glider, t, found, field.outputs))
    return tuple(out)


def _begin(store: Store, field: FleetField) -> None:
    """Make a field again from all segments that are held where its settings have changed."""
    if store.fields.begin(field.name, field.key):
        store.fields.put(field.name, _all_batches(store, field), is_shared=field.is_shared)


def _all_batches(store: Store, field: FleetField) -> Iterator[Batch]:
    for glider in store.gliders():
        for identity in store.segments.of(glider):
            batch = batch_of(store.segments.get(identity), field.sensor, field.box)
            if batch is not None:
                yield batch


def _soundings(segment: Segment) -> Array:
    """Water depths of a segment ((n, 3): latitude, longitude, m)."""
    where, depth = whereabouts(segment), segment.get("water_depth")
    if not len(where.t) or not len(depth):
        return readonly(np.empty((0, 3)))
    lat, lon = np.interp(depth.t, where.t, where.lat), np.interp(depth.t, where.t, where.lon)
    return readonly(np.column_stack([lat, lon, depth.v]))


def _leg(store: Store, glider: str, state: GliderState) -> tuple[float, Leg] | None:
    """The last surfacing of a glider (s), and what it can do until the next one; None: that is not known."""
    last, outlook = store.facts(glider).last_surfacing(inf), look_ahead(state.memory.estimate, None)
    if last is None or last.lat is None or last.lon is None or outlook is None:
        return None
    expected, t = state.memory.expected, last.t_surface
    duration = expected.t - expected.after if expected is not None else USUAL_LEG
    speed, _, flow = outlook
    east, north = flow(t, t + duration)[0].tolist()
    return t, Leg(last.lat, last.lon, speed, duration, (east, north))


def _advice(
    store: Store, field: FleetField, glider: str, newest: Checkpoint, t: float, leg: Leg
) -> Advice | None:
    place = field.box.place(np.array([leg.lat]), np.array([leg.lon]), np.array([field.box.top]))[0]
    if not ((place >= 0) & (place <= 1)).all() or leg.speed <= 0:
        return None
    others, planned = _others(store, glider, t)
    bounds = Bounds(
        field.bounds.polygon,
        field.bounds.shallowest,
        store.fields.soundings(field.name),
        others,
        field.bounds.apart,
    )
    known = with_planned(at(newest, t, field.params), planned, field.box, field.params)
    return advise(known, leg, field.box, bounds, field.params, field.way)


def _others(store: Store, glider: str, t: float) -> tuple[tuple[Point, ...], list[tuple[Leg, float]]]:
    """Where other gliders come up next, or came up last, and the legs that they fly, at a time (s)."""
    ends, legs = list[Point](), list[tuple[Leg, float]]()
    for other in store.gliders():
        known = store.facts(other)
        last = known.last_surfacing(inf)
        if other == glider or last is None or last.lat is None or last.lon is None:
            continue
        if abs(t - last.t_surface) > NO_MORE_AT_SEA:
            continue
        expected = known.expected(inf)
        if expected is None or expected.lat is None or expected.lon is None or expected.t <= t:
            ends.append((last.lat, last.lon))
            continue
        ends.append((expected.lat, expected.lon))
        east, north = to_plane(expected.lat, expected.lon, last.lat, last.lon).tolist()
        duration = expected.t - expected.after
        leg = Leg(last.lat, last.lon, hypot(east, north) / duration, duration)
        legs.append((leg, atan2(east, north)))
    return tuple(ends), legs


# ----------------------------------------
# A field and its uncertainty as a CF NetCDF file.

ACROSS, DOWN = 31, 21
"""Points of the file from side to side and from top to bottom: five between two Gaussians, and a top and a
bottom."""


def write_field(
    store: Store, field: FleetField, path: Path, t: float | None, now: float, attributes: Mapping[str, str]
) -> float:
    """Write what is known of a field at a time (s; None: of its last samples) by the samples until then, to
    the hour, with `attributes` of those whose data they are, at `now` (s); that time.

    Raises GliderwatchError where there are no samples, or the file cannot be written.
    """
    if t is None:
        extent = store.fields.extent(field.name)
        t = extent[2] if extent is not None else None
    checkpoint = None if t is None else store.fields.before(field.name, t + BIN, field.params)
    if t is None or checkpoint is None:
        raise GliderwatchError(
            f"there are no samples for the field {field.name}: do the gliders send science files (tbd, tcd, "
            "ebd), and are their caches there? gliderwatch status says what came"
        )
    known = at(checkpoint, t, field.params)
    box = field.box
    lat = np.linspace(box.south, box.north, ACROSS)
    lon = box.west + np.linspace(0, (box.east - box.west) % 360.0, ACROSS)
    depth = np.linspace(box.top, box.bottom, DOWN)
    z, y, x = np.meshgrid(depth, lat, lon, indexing="ij")
    values = estimate(known, box.place(y.ravel(), x.ravel(), z.ravel()), field.params)
    from netCDF4 import Dataset  # noqa: PLC0415 (the daemon writes none)

    try:
        with Dataset(path, "w", format="NETCDF4") as file:
            _fill(file, field, t, (depth, lat, lon), values)
            file.setncatts(_about(field, t, (depth, lat, lon), now) | {**attributes})
    except OSError as error:
        raise GliderwatchError(f"{path} cannot be written: {error.strerror or error}") from None
    return t


def _fill(
    file: Dataset, field: FleetField, t: float, axes: tuple[Array, Array, Array], values: tuple[Array, Array]
) -> None:
    spaces = {
        "time": (
            np.array([t]),
            {"units": "seconds since 1970-01-01T00:00:00Z", "axis": "T", "standard_name": "time"},
        ),
        "depth": (axes[0], {"units": "m", "standard_name": "depth", "positive": "down", "axis": "Z"}),
        "latitude": (axes[1], {"units": "degrees_north", "standard_name": "latitude", "axis": "Y"}),
        "longitude": (axes[2], {"units": "degrees_east", "standard_name": "longitude", "axis": "X"}),
    }
    for name, (points, attributes) in spaces.items():
        file.createDimension(name, len(points))
        variable = file.createVariable(name, "f8", (name,))
        about = {"long_name": f"{name} of the field", "coverage_content_type": "coordinate"}
        variable.setncatts(attributes | about)
        variable[:] = points
    name = property_of(field.sensor)
    unit, standard = PROPERTIES[name]
    shape = (1, *(len(axis) for axis in axes))
    for each, suffix, modifier in zip(values, ("", "_error"), ("", " standard_error"), strict=True):
        variable = file.createVariable(name + suffix, "f4", tuple(spaces), zlib=True)
        long_name = f"{name} as estimated from the samples of gliders{', its standard error' * bool(suffix)}"
        about = {"long_name": long_name, "coverage_content_type": "modelResult"}
        variable.setncatts({"units": unit, "standard_name": standard + modifier} | about)
        if not suffix:
            variable.setncatts({"ancillary_variables": f"{name}_error"})
        variable[:] = each.reshape(shape)


def _about(field: FleetField, t: float, axes: tuple[Array, Array, Array], now: float) -> dict[str, object]:
    """The global attributes of the file of a field."""
    from gliderwatch.export import netcdf  # noqa: PLC0415 (the daemon writes none)

    depth, lat, lon = axes
    common = netcdf.about("gliders", np.array([t]), lat, lon, now)
    common |= netcdf.vertical(float(depth[0]), float(depth[-1]))
    return common | {
        "title": f"{field.name}: field estimated from the samples of gliders",
        "summary": f"The field of {field.sensor} in a box of the sea at one time, and its standard error, "
        f"estimated from samples of underwater gliders by the estimator {field.params.estimator}.",
        "keywords": "EARTH SCIENCE > OCEANS",
        "id": f"gliderwatch-{field.name}-{common['time_coverage_start']}",
        "comment": "the error is of the estimate, not of a sample",
        "references": "Distributed estimation of 3D fields by underwater gliders, CMRE-PR-2019-095",
    }
