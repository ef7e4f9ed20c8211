"""The samples of one segment for a field: from what a file holds to what is kept, and sent to other relays.
Pure.

A batch is rounded when it is made: so all who have it have the same, to the bit.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import Literal

import gsw
import numpy as np

from gliderwatch.fleet.advice import Box
from gliderwatch.fleet.constants import LONGEST_STAND, MOST_SAMPLES, SAMPLE_STEP, SENSORS_OF_FIELDS
from gliderwatch.fleet.scalar_field import Batch, Estimator, FieldParams
from gliderwatch.model import Array, Segment, readonly

Sensor = Literal["sci_water_temp", "salinity", "density", "oxygen"]
_HEAD = struct.Struct("<dI")
_ROW = np.dtype([("t", "<u4"), ("place", "<u2", 3), ("value", "<f4"), ("stand", "<u2")])
_FULL = 65535
_MS_CM_PER_S_M, _PA_PER_DBAR = 10.0, 1e4


@dataclass(frozen=True, slots=True)
class Where:
    """Positions of a glider (degrees, (n,)) at increasing times (s, (n,)): between them it is taken to go
    straight."""

    t: Array
    lat: Array
    lon: Array


def property_of(sensor: Sensor) -> str:
    """What a sensor measures, as people and files call it."""
    return "temperature" if sensor == "sci_water_temp" else sensor


def params_of(sensor: Sensor, estimator: Estimator) -> FieldParams:
    """How a field of a sensor behaves, by `SENSORS_OF_FIELDS`."""
    deviation, mean, spread = SENSORS_OF_FIELDS[sensor]
    return FieldParams(estimator, deviation, mean, spread)


def whereabouts(segment: Segment) -> Where:
    """Where a glider was in a segment: its fixes, and its dead-reckoned positions before the first and after
    the last.

    Between two fixes the dead-reckoned positions do not count: they lead astray by the current.
    """
    fix_lat, fix_lon = segment.get("fix_lat"), segment.get("fix_lon")
    dr_lat, dr_lon = segment.get("dr_lat"), segment.get("dr_lon")
    outside = np.ones(len(dr_lat), dtype=np.bool_)
    if len(fix_lat):
        outside = (dr_lat.t < fix_lat.t[0]) | (dr_lat.t > fix_lat.t[-1])
    t = np.concatenate([fix_lat.t, dr_lat.t[outside]])
    order = np.argsort(t, kind="stable")
    lat, lon = np.concatenate([fix_lat.v, dr_lat.v[outside]]), np.concatenate([fix_lon.v, dr_lon.v[outside]])
    return Where(readonly(t[order]), readonly(lat[order]), readonly(lon[order]))


def batch_of(segment: Segment, sensor: Sensor, box: Box) -> Batch | None:
    """The samples that a segment has for a field in a box; None where it has none there."""
    where = whereabouts(segment)
    pressure = segment.get("science_pressure")
    t, value = _values(segment, sensor, where)
    if not len(t) or not len(where.t) or not len(pressure):
        return None
    known = (t >= where.t[0]) & (t <= where.t[-1]) & (t >= pressure.t[0]) & (t <= pressure.t[-1])
    lat, lon = _position(where, t)
    depth = -gsw.z_from_p(np.interp(t, pressure.t, pressure.v) / _PA_PER_DBAR, lat)
    place = box.place(lat, lon, depth)
    stand = np.minimum(np.diff(t, prepend=t[0] - LONGEST_STAND), LONGEST_STAND)
    good = known & np.isfinite(value) & ((place >= 0) & (place <= 1)).all(axis=1)
    if not good.any():
        return None
    name = f"{segment.id.name}@{segment.id.opened_at:.0f}"
    whole = Batch(name, segment.id.glider, *_averaged(t[good], place[good], value[good], stand[good]))
    return unpacked(packed(whole), whole.id, whole.glider)


def _averaged(t: Array, place: Array, value: Array, stand: Array) -> tuple[Array, Array, Array, Array]:
    """Samples finer than `SAMPLE_STEP` as means of that time; the time that they stand for adds up."""
    bins = np.floor(t / SAMPLE_STEP)
    starts = np.flatnonzero(np.diff(bins, prepend=np.nan) != 0)
    n = np.diff(np.append(starts, len(t)))
    t, value = (np.add.reduceat(each, starts) / n for each in (t, value))
    return t, np.add.reduceat(place, starts) / n[:, None], value, np.add.reduceat(stand, starts)


def packed(batch: Batch) -> bytes:
    """A batch as bytes: 16 bits a coordinate, a float of 32 bits a value, compressed."""
    start = float(np.floor(batch.t[0]))
    out = np.zeros(len(batch.t), dtype=_ROW)
    out["t"], out["value"] = np.round(batch.t - start), batch.value
    out["place"], out["stand"] = np.round(batch.place * _FULL), np.round(batch.stand)
    return zlib.compress(_HEAD.pack(start, len(out)) + out.tobytes())


def unpacked(data: bytes, identity: str, glider: str) -> Batch:
    """The batch of such bytes. Raises ValueError where they are none."""
    try:
        raw = zlib.decompressobj().decompress(data, _HEAD.size + MOST_SAMPLES * _ROW.itemsize)
        start, n = _HEAD.unpack_from(raw)
        found = np.frombuffer(raw, dtype=_ROW, offset=_HEAD.size)
    except (zlib.error, struct.error, ValueError) as error:
        raise ValueError(f"no batch of samples: {error}") from None
    if len(found) != n or not n or not np.isfinite(found["value"]).all() or not np.isfinite(start):
        raise ValueError("no batch of samples: cut or damaged")
    return Batch(
        identity,
        glider,
        readonly(start + found["t"]),
        readonly(found["place"] / _FULL),
        readonly(found["value"]),
        readonly(found["stand"]),
    )


def _values(segment: Segment, sensor: Sensor, where: Where) -> tuple[Array, Array]:
    """Times (s) and values of a sensor of a field; salinity (practical) and density (potential, at the
    surface, less 1000 kg/m3) by TEOS-10."""
    if sensor == "oxygen":
        series = segment.get("oxygen")
        return series.t, series.v
    temperature = segment.get("temperature")
    if sensor == "sci_water_temp":
        return temperature.t, temperature.v
    conductivity, pressure = segment.get("conductivity"), segment.get("science_pressure")
    t = temperature.t
    if not len(conductivity) or not len(pressure) or not len(where.t):
        return t[:0], t[:0]
    t = t[(t >= conductivity.t[0]) & (t <= conductivity.t[-1])]
    p = np.interp(t, pressure.t, pressure.v) / _PA_PER_DBAR
    warm = np.interp(t, temperature.t, temperature.v)
    salinity = gsw.SP_from_C(np.interp(t, conductivity.t, conductivity.v) * _MS_CM_PER_S_M, warm, p)
    if sensor == "salinity":
        return t, np.asarray(salinity)
    lat, lon = _position(where, t)
    absolute = gsw.SA_from_SP(salinity, p, lon, lat)
    return t, np.asarray(gsw.sigma0(absolute, gsw.CT_from_t(absolute, warm, p)))


def _position(where: Where, t: Array) -> tuple[Array, Array]:
    """Latitudes and longitudes (degrees) at times (s)."""
    return np.interp(t, where.t, where.lat), np.interp(t, where.t, np.unwrap(where.lon, period=360.0))
