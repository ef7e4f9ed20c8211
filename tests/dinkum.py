"""A small writer of Dinkum binary files for tests, made from the format alone: no code of src is in it."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

import lz4.block

OPENED_AT = datetime(2024, 9, 7, 19, 32, 3, tzinfo=UTC).timestamp()
SENSORS = (
    ("m_present_time", 8, "timestamp"),
    ("m_gps_lat", 8, "lat"),
    ("m_gps_lon", 8, "lon"),
    ("m_lat", 8, "lat"),
    ("m_lon", 8, "lon"),
    ("m_heading", 4, "rad"),
    ("m_pitch", 4, "rad"),
    ("m_depth", 4, "m"),
    ("m_water_vx", 4, "m/s"),
    ("m_water_vy", 4, "m/s"),
    ("m_vacuum", 4, "inHg"),
    ("m_gps_status", 1, "enum"),
)
UNUSED = (("x_unused", 4, "nodim"),)
CRC = "0abc12ef"
"""The checksum of all sensor lists made here where it is not said otherwise."""

Row = Mapping[str, float]


def sensor_list(sensors: Sequence[tuple[str, int, str]] = SENSORS, crc: str = CRC) -> bytes:
    """The text of a cache file: the sensors held, then one that is not.

    Its unit is such that the checksum of the text is `crc`, so that any list can be put in place of another.
    """
    held = [f"s: T {i:4d} {i:4d} {size} {name} {unit}\n" for i, (name, size, unit) in enumerate(sensors)]
    rest = [
        f"s: F {i:4d}   -1 {size} {name} {unit}\n"
        for i, (name, size, unit) in enumerate(UNUSED, start=len(sensors))
    ]
    text = "".join(held + rest).encode().removesuffix(b"\n")
    return text + _tail(text, int(crc, 16)) + b"\n"


def checksum(text: bytes) -> int:
    """The checksum of a sensor list: CRC-32 without the complement at its end."""
    return zlib.crc32(text) ^ 0xFFFFFFFF


def _tail(text: bytes, aim: int) -> bytes:
    """Characters after which `text`, and a line end, have the checksum `aim`.

    Each of them is one of two: what the other one changes is the same whatever the rest is, so that 32 that
    change different things are found by elimination.
    """
    n = 35

    def changed(i: int) -> int:
        tail = bytearray(b"a" * n)
        tail[i] = ord("b")
        return checksum(text + tail + b"\n") ^ start

    start = checksum(text + b"a" * n + b"\n")
    basis: dict[int, tuple[int, int]] = {}  # highest bit: what is changed, and by which characters
    for i in range(n):
        value, places = changed(i), 1 << i
        while value and value.bit_length() in basis:
            other, by = basis[value.bit_length()]
            value, places = value ^ other, places ^ by
        if value:
            basis[value.bit_length()] = value, places
    value, places = start ^ aim, 0
    while value:
        other, by = basis[value.bit_length()]
        value, places = value ^ other, places ^ by
    return bytes(ord("b") if places >> i & 1 else ord("a") for i in range(n))


def header(
    full_name: str = "unit_7-2024-250-1-3",
    opened_at: float = OPENED_AT,
    crc: str = CRC,
    factored: bool = True,
    n_held: int = len(SENSORS),
    **tags: object,
) -> bytes:
    """The ASCII header; `tags` replace or add lines."""
    opened = datetime.fromtimestamp(opened_at, UTC).strftime("%a_%b_%e_%H:%M:%S_%Y").replace(" ", "_")
    lines = {
        "dbd_label": "DBD(dinkum_binary_data)file",
        "encoding_ver": 5,
        "num_ascii_tags": 14,
        "all_sensors": "F",
        "the8x3_filename": "00010003",
        "full_filename": full_name,
        "filename_extension": "sbd",
        "mission_name": "TEST.MI",
        "fileopen_time": opened,
        "total_num_sensors": n_held + len(UNUSED),
        "sensors_per_cycle": n_held,
        "state_bytes_per_cycle": math.ceil(n_held / 4),
        "sensor_list_crc": crc,
        "sensor_list_factored": int(factored),
        **tags,
    }
    return "".join(f"{key}:    {value}\n" for key, value in lines.items()).encode()


def cycles(rows: Sequence[Row], sensors: Sequence[tuple[str, int, str]] = SENSORS, order: str = "<") -> bytes:
    """The binary part; a value equal to the one before is written as the same, as gliders do."""
    out = bytearray(struct.pack(order + "ccHfd", b"s", b"a", 0x1234, 123.456, 123456789.12345))
    last: dict[str, float] = {}
    formats = {1: "b", 2: "h", 4: "f", 8: "d"}
    for row in rows:
        states, data = [], b""
        for name, size, _ in sensors:
            if name not in row:
                states.append(0)
            elif last.get(name) == row[name]:
                states.append(1)
            else:
                states.append(2)
                value = row[name] if size > 2 else int(row[name])
                data += struct.pack(order + formats[size], value)
                last[name] = row[name]
        states += [0] * (-len(states) % 4)
        packed = [
            states[i] << 6 | states[i + 1] << 4 | states[i + 2] << 2 | states[i + 3]
            for i in range(0, len(states), 4)
        ]
        out += b"d" + bytes(packed) + data
    return bytes(out + b"X")


def rows(n: int = 60, start: float = OPENED_AT, step: float = 60.0) -> list[Row]:
    """A dive between two fixes, everything within its range, the first cycle being of the segment before."""
    out: list[Row] = []
    for i in range(n):
        row = {"m_present_time": start + i * step, "m_heading": 1.0 + 0.001 * i, "m_pitch": -0.4}
        row |= {"m_lat": 2824.41 + 0.01 * i, "m_lon": -8014.3 - 0.01 * i, "m_depth": 2.0 * min(i, n - i)}
        if i < 4 or i > n - 4:
            row |= {"m_gps_lat": 2824.41 + 0.01 * i, "m_gps_lon": -8014.3 - 0.01 * i, "m_gps_status": 0}
        if i == n - 2:
            row |= {"m_water_vx": 0.12, "m_water_vy": -0.05, "m_vacuum": 8.5}
        out.append(row)
    return out


def compress(content: bytes) -> bytes:
    """Content as gliders compress it: LZ4 blocks of 32 kB, each after its size."""
    out = b""
    for i in range(0, len(content), 32768):
        block = lz4.block.compress(content[i : i + 32768], store_size=False)
        out += len(block).to_bytes(2, "big") + block
    return out
