"""The coast of the world, kept in the package: which land lies in a box, for maps without tiles."""

from __future__ import annotations

import lzma
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
import numpy.typing as npt

from gliderwatch.model import Array, readonly


@dataclass(frozen=True, slots=True)
class Box:
    """A part of the earth (degrees); ``east`` is greater than ``west`` also across the date line."""

    south: float
    north: float
    west: float
    east: float


@dataclass(frozen=True, slots=True)
class DepthLine:
    """A line of equal ``depth`` (m): ``points`` (n, 2) longitude, latitude (degrees)."""

    depth: float
    points: Array


@dataclass(frozen=True, slots=True)
class Land:
    """Closed rings of land and of lakes in it: ``points`` (n, 2) longitude, latitude (degrees), all in a row;
    ring i is points[starts[i]:starts[i + 1]], within ``bounds`` (rings, 4): west, south, east, north.

    Where files give them (`map_files`): ``finer`` land, each in place of all before it within its box, and
    lines of equal depth (``depths``).
    """

    points: Array
    starts: tuple[int, ...]
    bounds: Array
    finer: tuple[tuple[Box, Land], ...] = ()
    depths: tuple[DepthLine, ...] = ()


def land_of(rings: Sequence[Array]) -> Land:
    """Land of closed rings (n, 2) of longitude and latitude (degrees) without their first point again."""
    starts = np.concatenate([[0], np.cumsum([len(ring) for ring in rings])]).astype(int)
    points = np.concatenate(rings) if rings else np.zeros((0, 2))
    return Land(readonly(points), tuple(starts.tolist()), readonly(_bounds(points, starts)))


@cache
def world() -> Land:
    """Natural Earth's land at 1 : 10 million. Some 0.2 s the first time, 7 MB.

    The file (made by `docs/land.py`) is xz of: scale and translation of x and y (4 doubles), the number of
    rings, their lengths (uint32), their first points (int32 x, y), all steps in x, then all in y (int32).
    """
    raw = lzma.decompress(files("gliderwatch.figures").joinpath("land-10m.xz").read_bytes())
    scale, shift = np.frombuffer(raw, "<f8", 4).reshape(2, 2)
    n = int(np.frombuffer(raw, "<u4", 1, 32)[0])
    lengths = np.frombuffer(raw, "<u4", n, 36).astype(int)
    first = np.frombuffer(raw, "<i4", 2 * n, 36 + 4 * n).reshape(n, 2)
    steps = np.frombuffer(raw, "<i4", offset=36 + 12 * n).reshape(2, -1).T
    starts = np.concatenate([[0], np.cumsum(lengths)])
    whole = np.zeros((starts[-1], 2))
    is_first = np.zeros(len(whole), dtype=bool)
    is_first[starts[:-1]] = True
    whole[~is_first] = steps
    summed = np.cumsum(whole, axis=0)
    summed += np.repeat(first - summed[starts[:-1]], lengths, axis=0)
    points = summed * scale + shift
    return Land(readonly(points), tuple(starts.tolist()), readonly(_bounds(points, starts)))


def _bounds(points: Array, starts: npt.NDArray[np.int_]) -> Array:
    """West, south, east, north of each ring."""
    low, high = (np.asarray(f.reduceat(points, starts[:-1], axis=0)) for f in (np.minimum, np.maximum))
    return np.hstack([low, high]) if len(points) else np.zeros((0, 4))


def depth_lines_in(land: Land, box: Box) -> Iterator[DepthLine]:
    """The parts of lines of equal depth in a box, longitudes as those of the box."""
    for line in land.depths:
        for turn in (-360.0, 0.0, 360.0):
            points = line.points + np.array([turn, 0.0])
            x, y = points.T
            inside = (x >= box.west) & (x <= box.east) & (y >= box.south) & (y <= box.north)
            if not inside.any():
                continue
            kept = inside | np.append(inside[1:], False) | np.append(False, inside[:-1])  # and one beyond
            edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]])))
            for begin, end in zip(edges[::2], edges[1::2], strict=True):
                if end - begin > 1:
                    yield DepthLine(line.depth, points[begin:end])


def rings_in(land: Land, box: Box, least: float = 0.0) -> Iterator[Array]:
    """The rings of land cut to a box, (n, 2) longitude and latitude (degrees), longitudes as those of the
    box; without those less than `least` (degrees) across."""
    for turn in (-360.0, 0.0, 360.0):
        west, south, east, north = (land.bounds + np.array([turn, 0.0, turn, 0.0])).T
        is_near = (east > box.west) & (west < box.east) & (north > box.south) & (south < box.north)
        is_seen = np.maximum(east - west, north - south) >= least
        for i in np.flatnonzero(is_near & is_seen):
            ring = land.points[land.starts[i] : land.starts[i + 1]] + np.array([turn, 0.0])
            cut = clipped(ring, box)
            if len(cut) > 2:
                yield cut


def clipped(ring: Array, box: Box) -> Array:
    """A closed ring (n, 2) cut to a box, by Sutherland and Hodgman (1974), one edge of the box at a time.

    >>> square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    >>> clipped(square, Box(south=1, north=9, west=-9, east=2)).tolist()
    [[2.0, 1.0], [2.0, 4.0], [0.0, 4.0], [0.0, 1.0]]
    """
    for axis, bound, sign in ((0, box.west, 1), (0, box.east, -1), (1, box.south, 1), (1, box.north, -1)):
        inside = sign * (ring[:, axis] - bound) >= 0
        if inside.all():
            continue
        after, crosses = np.roll(ring, -1, axis=0), inside != np.roll(inside, -1)
        run = np.where(crosses, after[:, axis] - ring[:, axis], 1.0)
        at = ring + ((bound - ring[:, axis]) / run)[:, None] * (after - ring)
        kept = np.stack([inside, crosses], axis=1)
        ring = np.stack([ring, at], axis=1)[kept]
        if not len(ring):
            break
    return ring
