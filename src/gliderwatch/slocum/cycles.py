"""The structure of Dinkum binary data: the sensor list, and the cycles one after another. Pure.

dbdreader takes on trust that each cycle begins where the one before it ends; after one damaged
byte it gives garbage values without a word. Each cycle begins with a tag byte, though, and so
the intact ones can be told from the rest before dbdreader sees them.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

_LINE = re.compile(
    rb"s: ([TF]) +(\d{1,5}) +(-1|\d{1,5}) +([1248]) +(\w{1,80}) +[!-~]{1,40}[ \t\r]*\n", re.ASCII
)
_KNOWN_BYTES = 16
"""Length of the cycle of known values that tells the order of bytes."""
_CYCLE, _END = b"d", b"X"


@dataclass(frozen=True, slots=True)
class Sensors:
    """The sensors that a file holds, in the order of the file, and their sizes in bytes."""

    names: tuple[str, ...]
    sizes: tuple[int, ...]


def parse_sensor_list(data: bytes, start: int, n_sensors: int) -> tuple[Sensors, int]:
    """The sensors listed in `n_sensors` lines from byte `start`, and where the list ends.

    Raises `ValueError` with the reason where it is not a sensor list of that length.
    """
    names: list[str] = []
    sizes: list[int] = []
    for number in range(n_sensors):
        match = _LINE.match(data, start)
        if match is None or int(match[2]) != number:
            raise ValueError(f"line {number + 1} of {n_sensors} is missing or damaged")
        if match[1] == b"T":
            if int(match[3]) != len(names):
                raise ValueError(f"line {number + 1} is out of order")
            names.append(match[5].decode("ascii"))
            sizes.append(int(match[4]))
        start = match.end()
    return Sensors(tuple(names), tuple(sizes)), start


def intact(data: bytes, start: int, sensors: Sensors) -> tuple[int, int, int]:
    """Number of intact cycles from byte `start` on, where the last one ends, and bytes lost to damage.

    A cycle is intact when the next one, the end mark or the end of the data follows it. A last
    cycle that is only cut is not damage; what follows the end mark is padding.
    Raises `ValueError` where no known cycle begins at `start`.
    """
    known = data[start : start + 4]
    if known not in {struct.pack(order + "ccH", b"s", b"a", 0x1234)[: len(known)] for order in "<>"}:
        raise ValueError("the values do not begin where the header ends")
    n_state = (len(sensors.sizes) + 3) // 4
    lowest, masks = _masks(sensors.sizes, n_state)
    n, end, after = -1, start, start + _KNOWN_BYTES
    size = len(data)
    lengths: dict[bytes, int] = {}  # most cycles hold the same sensors as one before
    while after <= size:
        tag = data[after : after + 1]
        if tag not in (_CYCLE, _END, b""):
            return max(n, 0), end, size - end
        n, end = n + 1, after
        first = after + 1
        after = first + n_state
        if tag != _CYCLE or after > size:
            break
        state = data[first:after]
        if state not in lengths:
            lengths[state] = _length(state, lowest, masks)
        after += lengths[state]
    return max(n, 0), end, 0


def _length(state: bytes, lowest: int, masks: list[tuple[int, int]]) -> int:
    """Bytes of the values that follow the state bytes of a cycle; see `_masks`."""
    number = int.from_bytes(state, "big")
    high = (number >> 1) & lowest
    follows = high ^ (high & number)
    return sum(size * (follows & mask).bit_count() for size, mask in masks)


def _masks(sizes: tuple[int, ...], n_state: int) -> tuple[int, list[tuple[int, int]]]:
    """For state bytes read as one number: the lower bit of each sensor, and these bits by size of the sensor.

    Each sensor has two bits, the first sensor the highest; state 2 means that a value follows.
    """
    bits = [1 << (8 * n_state - 2 * (i + 1)) for i in range(4 * n_state)]
    by_size = [(size, sum(bits[i] for i, s in enumerate(sizes) if s == size)) for size in sorted(set(sizes))]
    return sum(bits), by_size
