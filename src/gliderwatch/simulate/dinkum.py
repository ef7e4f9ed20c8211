"""Writes Dinkum binary files of encoding version 5, as Slocum gliders do. Pure: values in, bytes out.

A file is an ASCII header of 14 tags, the list of sensors (or, factored, only its checksum: the
list is then in a cache file named after it), a cycle of fixed values that tells the byte order,
and one data cycle a line: `d`, two bits a sensor (0 not updated, 1 updated to the value it had,
2 updated and written), and the written values. Layout and checksum were taken from real files of
two generations of gliders: what is encoded here again from such a file has the same bytes.
"""

from __future__ import annotations

import struct
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import lz4.block  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

from gliderwatch.model import Array

BLOCK = 32 * 1024
_KINDS = {1: "i1", 2: "i2", 4: "f4", 8: "f8"}
_TIMES = ("present_time", "present_secs_into_mission")
_UNSET, _SAME, _NEW = 0, 1, 2


class Generation(Enum):
    """What the glider's processor makes of a file: byte order, and the tag at the end."""

    G2 = (">", b"X")
    G3 = ("<", b"")


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sensor: name, unit, and the size of its value (1, 2: integer, 4, 8: float; bytes)."""

    name: str
    unit: str
    size: int


@dataclass(frozen=True, slots=True)
class SensorList:
    """The sensors a glider knows, in its own order, and the names of those sent in a kind of file."""

    sensors: tuple[Sensor, ...]
    sent: frozenset[str]

    @property
    def columns(self) -> tuple[Sensor, ...]:
        """The sensors sent, in the order of a data cycle."""
        return tuple(sensor for sensor in self.sensors if sensor.name in self.sent)

    def text(self) -> bytes:
        """The list as it is in a cache file, or in a file that is not factored."""
        return b"".join(_list_lines(self))

    @property
    def crc(self) -> str:
        """The checksum that names the cache file: CRC-32 of the text, its last complement left out."""
        return f"{zlib.crc32(self.text()) ^ 0xFFFFFFFF:08x}"


def _list_lines(sensors: SensorList) -> Iterator[bytes]:
    column = 0
    for index, sensor in enumerate(sensors.sensors):
        sent = sensor.name in sensors.sent
        flag, place = ("T", column) if sent else ("F", -1)
        yield f"s: {flag} {index:4d} {place:4d} {sensor.size} {sensor.name} {sensor.unit}\n".encode("ascii")
        column += sent


@dataclass(frozen=True, slots=True)
class Header:
    """What a file says of itself: names, extension without the dot, mission, opening time (s)."""

    short_name: str
    full_name: str
    extension: str
    mission: str
    opened: float


def encode(
    header: Header,
    sensors: SensorList,
    values: Array,
    updated: NDArray[np.bool_],
    *,
    factored: bool = True,
    generation: Generation = Generation.G3,
) -> bytes:
    """The bytes of a file.

    Args:
        header: What the file says of itself.
        sensors: The list of sensors; factored, its `text` belongs into `<crc>.cac`.
        values: Shape (n cycles, m sensors sent). The first row is by custom the state at the
            end of the segment before, every sensor updated.
        updated: Shape of `values`: where a sensor was updated in a cycle.
        factored: Leave the list of sensors out of the file.
        generation: Byte order and end tag.

    Raises:
        ValueError: the shapes do not agree with the list, or a value does not fit its size.
    """
    columns = sensors.columns
    if values.shape != updated.shape or values.shape[1:] != (len(columns),):
        raise ValueError(
            f"values {values.shape} and updated {updated.shape}: need {len(columns)} columns, one a sensor"
        )
    order, end = generation.value
    fixed = b"sa" + struct.pack(f"{order}Hfd", 0x1234, 123.456, 123456789.12345)
    listed = b"" if factored else sensors.text()
    return _tags(header, sensors, factored) + listed + fixed + _cycles(columns, values, updated, order) + end


def _tags(header: Header, sensors: SensorList, factored: bool) -> bytes:
    """The ASCII header."""
    columns = sensors.columns
    tags = {
        "dbd_label": "DBD(dinkum_binary_data)file",
        "encoding_ver": 5,
        "num_ascii_tags": 14,
        "all_sensors": "F",
        "the8x3_filename": header.short_name,
        "full_filename": header.full_name,
        "filename_extension": header.extension,
        "mission_name": header.mission,
        "fileopen_time": time.asctime(time.gmtime(header.opened)).replace(" ", "_"),
        "total_num_sensors": len(sensors.sensors),
        "sensors_per_cycle": len(columns),
        "state_bytes_per_cycle": -(-len(columns) // 4),
        "sensor_list_crc": sensors.crc,
        "sensor_list_factored": int(factored),
    }
    return "".join(f"{tag}:    {value}\n" for tag, value in tags.items()).encode("ascii")


def _cycles(columns: tuple[Sensor, ...], values: Array, updated: NDArray[np.bool_], order: str) -> bytes:
    """All data cycles, made as one matrix of bytes of which the unwritten ones are masked out."""
    n = len(values)
    codes = np.zeros((n, -(-len(columns) // 4) * 4), dtype=np.uint8)
    cells, written = [], []
    for j, sensor in enumerate(columns):
        raw = _raw(sensor, values[:, j], updated[:, j], order)
        codes[:, j] = _states(sensor, raw, updated[:, j])
        cells.append(raw)
        written.append(np.repeat(codes[:, j, None] == _NEW, sensor.size, axis=1))
    weights = np.array([64, 16, 4, 1], dtype=np.uint8)
    states = (codes.reshape(n, -1, 4) * weights).sum(axis=2, dtype=np.uint8)
    tag = np.full((n, 1), ord("d"), dtype=np.uint8)
    always = np.ones((n, 1 + states.shape[1]), dtype=bool)
    mask = np.concatenate([always, *written], axis=1)
    written_bytes: NDArray[np.uint8] = np.concatenate([tag, states, *cells], axis=1)[mask]
    return written_bytes.tobytes()


def _raw(sensor: Sensor, values: Array, updated: NDArray[np.bool_], order: str) -> NDArray[np.uint8]:
    """The values of one sensor as bytes, shape (n, size)."""
    kind = np.dtype(order + _KINDS[sensor.size])
    filled = np.where(updated, values, 0.0)
    if kind.kind == "i":
        info = np.iinfo(kind)
        if not np.all((filled >= info.min) & (filled <= info.max)):
            raise ValueError(f"{sensor.name}: a value does not fit into {sensor.size} byte(s)")
    return filled.astype(kind).reshape(-1, 1).view(np.uint8)


def _states(sensor: Sensor, raw: NDArray[np.uint8], updated: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The two-bit code of one sensor in every cycle. Gliders write times whether new or not."""
    codes = np.where(updated, _NEW, _UNSET).astype(np.uint8)
    if not sensor.name.endswith(_TIMES):
        cycles = np.flatnonzero(updated)
        same = np.all(raw[cycles[1:]] == raw[cycles[:-1]], axis=1)
        codes[cycles[1:][same]] = _SAME
    return codes


def compress(data: bytes) -> bytes:
    """`data` as gliders compress it (scd, tcd, ...): blocks of 32 kB, each with its size before it."""
    packed = b""
    for i in range(0, len(data), BLOCK):
        block: bytes = lz4.block.compress(data[i : i + BLOCK], store_size=False)
        packed += len(block).to_bytes(2, "big") + block
    return packed
