"""A map as inline SVG: land, tracks, places with their errors, currents; scale bar, graticule, north. Pure
but for the coast, which is read from the package once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from math import asinh, atan, ceil, cos, degrees, floor, hypot, pi, radians, sinh, tan

import numpy as np

from gliderwatch.figures import panel_svg
from gliderwatch.figures.coast import Box, Land, depth_lines_in, rings_in
from gliderwatch.incidents.notices import DriftEllipse
from gliderwatch.model import Array
from gliderwatch.navigation.geodesy import from_plane, radii

Place = tuple[float, float]
"""Latitude and longitude (degrees)."""
WIDTH, HEIGHT = 480.0, 360.0
"""Of the picture, in its own units."""
LEAST = 20_000.0
"""Metres that a map shows from north to south at least."""
MARGIN = 0.12
"""Of the picture that is left free on each side."""
POLAR = 84.0
"""Latitude (degrees) at which the map ends: Mercator's has no pole."""
GRIDS = (0.8, 1.6, 3.2)
"""Units of the picture to which the coast is rounded, and below two of which an island is left out: the first
with which it takes no more than `COAST` characters."""
COAST = 40_000
DEPTHS = 25_000
"""Characters that lines of equal depth take at the most."""
SPECK = 6.0
"""Units of the picture below which a line of equal depth is left out."""
STEPS = (30.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 1 / 6, 1 / 12, 1 / 30, 1 / 60)
"""Degrees between two lines of the graticule: whole minutes."""
ARROW = 300.0
"""Units of the picture for a current of 1 m/s, if the greatest one is not longer than `LONGEST`."""
LONGEST = 45.0
ROOM = (34.0, 13.0)
"""Units of the picture, across and down, between the labels of two areas."""
STYLE = """\
.map{background:var(--sea);font:12px system-ui,sans-serif}.map text{fill:var(--ink)}
.map .land{fill:var(--land);stroke:var(--shore);stroke-width:.8}
.map .cover{fill:var(--sea)}.map .depth{stroke:var(--shore);stroke-opacity:.45;stroke-width:.8;fill:none}
.map .grid{stroke:var(--ink);stroke-opacity:.18;fill:none}.map .faint{
fill-opacity:.65;font-size:10px}.map .track{fill:none;stroke:var(--quiet);
stroke-width:1.8}.map .track.ok{stroke:var(--ok)}.map .track.warn{stroke:var(--warn)}.map .track.bad{
stroke:var(--bad);stroke-width:2.6}.map .track.quiet{stroke-dasharray:3 3}.map .current{
stroke:var(--ok);stroke-width:1.4;fill:none}.map .area{fill:var(--warn);fill-opacity:.13;stroke:var(--warn);
stroke-width:1.4;stroke-dasharray:5 3}.map .next{fill:var(--ok);fill-opacity:.13;stroke:var(--ok);
stroke-width:1.4}.map .mark{stroke:var(--paper);stroke-width:1}.ok{fill:var(--ok)}.warn{fill:var(--warn)}
.bad{fill:var(--bad)}.quiet{fill:var(--quiet)}
.map .halo{paint-order:stroke;stroke:var(--sea);stroke-width:3px}
"""
"""How the parts of a map look, by the colours of its page."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A place with a ``label``: a ``shape`` (circle, triangle, square, cross, diamond) of a ``colour`` (ok,
    warn, bad, quiet), so that no meaning is in the colour alone. ``link`` leads to a page."""

    place: Place
    label: str = ""
    shape: str = "circle"
    colour: str = "quiet"
    link: str = ""


@dataclass(frozen=True, slots=True)
class Arrow:
    """A current (m/s, east and north) at a place."""

    place: Place
    u: float
    v: float


@dataclass(frozen=True, slots=True)
class Chart:
    """What a map shows: tracks (each of one of `track_colours`: ok, warn, bad, quiet; without any all are
    quiet), marks, currents, and where a glider is with 95 %, each with its class (`next`, `area`) and label.
    Coordinates in degrees."""

    title: str
    tracks: tuple[tuple[Place, ...], ...] = ()
    track_colours: tuple[str, ...] = ()
    marks: tuple[Mark, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    areas: tuple[tuple[DriftEllipse, str, str], ...] = ()

    def places(self) -> list[Place]:
        """All places that are to be seen."""
        found = [place for track in self.tracks for place in track] + [mark.place for mark in self.marks]
        return found + [place for area, _, _ in self.areas for place in outline(area)]


def outline(area: DriftEllipse, n: int = 36) -> list[Place]:
    """Points of the edge of an ellipse (degrees)."""
    turn = np.linspace(0.0, 2 * pi, n, endpoint=False)
    along, across = area.major * np.cos(turn), area.minor * np.sin(turn)
    north, east = cos(radians(area.bearing)), np.sin(radians(area.bearing))
    points = np.stack([along * east + across * north, along * north - across * east], axis=1)
    return [from_plane(point, area.lat, area.lon) for point in points]


# ----------------------------------------
# Where places lie in the picture.


@dataclass(frozen=True, slots=True)
class Frame:
    """The part of the earth in the picture, on Mercator's map: units of the picture ``per_radian``, from the
    point in the middle."""

    lat: float
    lon: float
    per_radian: float

    def xy(self, lat: Array | float, lon: Array | float) -> Array:
        """Places (degrees) in the picture, (..., 2), x to the right and y down."""
        turned = (np.asarray(lon, float) - self.lon + 180.0) % 360.0 - 180.0
        return self.straight(lat, turned + self.lon)

    def straight(self, lat: Array | float, lon: Array | float) -> Array:
        """The same of longitudes that are counted on beyond 180 degrees."""
        at = np.clip(np.asarray(lat, float), -POLAR, POLAR)
        up = np.arcsinh(np.tan(np.radians(at))) - asinh(tan(radians(self.lat)))
        x = WIDTH / 2 + self.per_radian * np.radians(np.asarray(lon, float) - self.lon)
        return np.stack([x, HEIGHT / 2 - self.per_radian * up], axis=-1)

    def box(self, more: float = 0.0) -> Box:
        """What the picture shows, and `more` units of it on each side."""
        half_x, half_y = ((side / 2 + more) / self.per_radian for side in (WIDTH, HEIGHT))
        middle = asinh(tan(radians(self.lat)))
        south, north = (degrees(atan(sinh(middle + sign * half_y))) for sign in (-1, 1))
        half = min(degrees(half_x), 180.0)
        return Box(south, north, self.lon - half, self.lon + half)

    @property
    def metres(self) -> float:
        """Metres of a unit of the picture, in its middle."""
        return float(radii(self.lat)[1]) / self.per_radian


def frame(places: Sequence[Place]) -> Frame:
    """The picture that holds all places (degrees, at least one), with a margin."""
    lat, lon = np.array(places, dtype=float).T
    turned = (lon - lon[0] + 180.0) % 360.0 - 180.0 + lon[0]
    west, east = float(turned.min()), float(turned.max())
    low, high = (asinh(tan(radians(min(max(float(x), -POLAR), POLAR)))) for x in (lat.min(), lat.max()))
    middle = degrees(atan(sinh((low + high) / 2)))
    least = LEAST / float(radii(middle)[1])
    room = 1 - 2 * MARGIN
    sizes = (WIDTH * room / max(radians(east - west), 1e-9), HEIGHT * room / max(high - low, 1e-9))
    per_radian = max(min(*sizes, HEIGHT / least), WIDTH / (2 * pi))
    return Frame(middle, (west + east) / 2, per_radian)


# ----------------------------------------
# The picture.


def svg(chart: Chart, land: Land) -> str:
    """The map as an `svg` element; empty where there is no place to show.

    Its classes are those of `STYLE`. Every label is escaped.
    """
    places = chart.places()
    if not places:
        return ""
    view = frame(places)
    role = "group" if any(mark.link for mark in chart.marks) else "img"  # an image holds no links
    parts = [
        f'<svg class="map" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="{role}" '
        f'aria-label="{escape(chart.title)}">',
        f"<title>{escape(chart.title)}</title>",
        f'<path class="land" fill-rule="evenodd" d="{_coast(view, land)}"/>',
        *_finer(view, land),
        *_depths(view, land),
        *_graticule(view),
        *_areas(view, chart.areas),
        *_tracks(view, chart),
        *_currents(view, chart.arrows),
        *_marks(view, chart.marks),
        *_scale(view),
        "</svg>",
    ]
    return "\n".join(parts)


def _coast(view: Frame, land: Land) -> str:
    """The land as one path of whole numbers of a grid, relative to the point before."""
    path = ""
    for grid in GRIDS:
        rings = rings_in(land, view.box(8.0), least=degrees(2 * grid / view.per_radian))
        path = "".join(_ring(view.straight(ring[:, 1], ring[:, 0]), grid) for ring in rings)
        if len(path) <= COAST:
            break
    return path


def _finer(view: Frame, land: Land) -> Iterable[str]:
    """Land of files: first the sea in the place of what lay there, then their coast."""
    for box, part in land.finer:
        for corners in covers(view, box):
            yield f'<path class="cover" d="{_ring(corners, 0.1)}"/>'
        yield f'<path class="land" fill-rule="evenodd" d="{_coast(view, part)}"/>'


def covers(view: Frame, box: Box) -> Iterable[Array]:
    """The corners (4, 2) of a box of the earth in the picture, wherever it is seen."""
    shown = view.box(8.0)
    for turn in (-360.0, 0.0, 360.0):
        west, east = max(box.west + turn, shown.west), min(box.east + turn, shown.east)
        south, north = max(box.south, shown.south), min(box.north, shown.north)
        if west < east and south < north:
            yield view.straight(np.array([south, north, north, south]), np.array([west, west, east, east]))


def _ring(xy: Array, grid: float) -> str:
    steps = np.round(xy / grid).astype(int)
    steps = steps[np.any(steps != np.roll(steps, 1, axis=0), axis=1)]
    if len(steps) < 3:
        return ""
    first, rest = steps[0] * grid, np.diff(steps, axis=0) * grid
    pairs = " ".join(f"{x:.4g} {y:.4g}" for x, y in rest.tolist())
    return f"M{first[0]:.1f} {first[1]:.1f}l{pairs.replace(' -', '-')}z"


def _depths(view: Frame, land: Land) -> Iterable[str]:
    """Lines of equal depth, one path for each depth, and how deep it is where there is room for that."""
    parts = depth_paths(view, land)
    grid = next((g for g in GRIDS if sum(map(len, _depth_texts(parts, g))) <= DEPTHS), None)
    if grid is None:
        return
    for text in _depth_texts(parts, grid):
        yield f'<path class="depth" d="{text}"/>'
    for (x, y), depth in depth_labels(parts):
        yield panel_svg.text(x, y, f"{depth:g} m", "middle", "halo faint")


def _depth_texts(parts: dict[float, list[Array]], grid: float) -> list[str]:
    return ["".join(_ring(xy, grid).removesuffix("z") for xy in lines) for lines in parts.values()]


def depth_paths(view: Frame, land: Land) -> dict[float, list[Array]]:
    """Lines of equal depth in the picture, by depth (m), without those that are only a speck."""
    parts: dict[float, list[Array]] = {}
    for line in depth_lines_in(land, view.box(8.0)):
        xy = view.straight(line.points[:, 1], line.points[:, 0])
        if np.ptp(xy, axis=0).max() >= SPECK:
            parts.setdefault(line.depth, []).append(xy)
    return parts


def depth_labels(parts: dict[float, list[Array]]) -> Iterable[tuple[tuple[float, float], float]]:
    """Where the depth (m) of lines can be written: in the middle of the longest, apart from others."""
    taken: list[tuple[float, float]] = []
    for depth, lines in parts.items():
        xy = max(lines, key=lambda line: float(np.ptp(line, axis=0).max()))
        x, y = xy[len(xy) // 2].tolist()
        is_inside = 30 < x < WIDTH - 40 and 20 < y < HEIGHT - 45
        if is_inside and all(abs(x - a) > 40 or abs(y - b) > 14 for a, b in taken):
            taken.append((x, y))
            yield (x, y), depth


def _line(view: Frame, places: Iterable[Place]) -> str:
    lat, lon = np.array(list(places)).T
    xy = view.xy(lat, lon)
    parts = []
    for i, (x, y) in enumerate(xy.tolist()):
        is_jump = i > 0 and abs(x - xy[i - 1, 0]) > WIDTH  # to the other side of the date line
        parts.append(f"{'M' if i == 0 or is_jump else 'L'}{x:.1f} {y:.1f}")
    return "".join(parts)


def _tracks(view: Frame, chart: Chart) -> Iterable[str]:
    colours = chart.track_colours or ("quiet",) * len(chart.tracks)
    for track, colour in zip(chart.tracks, colours, strict=True):
        if len(track) > 1:
            yield f'<path class="track {escape(colour)}" d="{_line(view, track)}"/>'


def _areas(view: Frame, areas: Sequence[tuple[DriftEllipse, str, str]]) -> Iterable[str]:
    """Ellipses, each with its label above or below it; without where another's is there."""
    taken: list[tuple[float, float]] = []
    for area, kind, label in areas:
        xy = view.xy(*np.array(outline(area)).T)
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in xy.tolist())
        yield f'<polygon class="{escape(kind)}" points="{points}"><title>{escape(label)}</title></polygon>'
        (top_x, top_y), (low_x, low_y) = xy[np.argmin(xy[:, 1])], xy[np.argmax(xy[:, 1])]
        for x, y in ((float(top_x), float(top_y) - 4), (float(low_x), float(low_y) + 12)):
            if label and all(abs(x - u) > ROOM[0] or abs(y - v) > ROOM[1] for u, v in taken):
                taken.append((x, y))
                yield panel_svg.text(x, y, label, "middle", "halo faint")
                break


def _currents(view: Frame, arrows: Sequence[Arrow]) -> Iterable[str]:
    """An arrow for each current, all of one scale, with the scale below."""
    per, shown = arrow_scale(arrows)
    if not per:
        return
    for arrow in arrows:
        x, y = view.xy(*arrow.place).tolist()
        yield _arrow(x, y, arrow.u * per, -arrow.v * per)
    yield _arrow(WIDTH - 12 - shown * per, HEIGHT - 30, shown * per, 0.0)
    yield panel_svg.text(WIDTH - 12, HEIGHT - 36, f"{shown:g} m/s", "end", "halo faint")


def arrow_scale(arrows: Sequence[Arrow]) -> tuple[float, float]:
    """Units of the picture for 1 m/s, and the current (m/s) that its scale shows; 0 where none flows."""
    greatest = max((hypot(a.u, a.v) for a in arrows), default=0.0)
    return (0.0, 0.0) if greatest < 0.005 else (min(ARROW, LONGEST / greatest), round_number(greatest))


def _arrow(x: float, y: float, dx: float, dy: float) -> str:
    length = hypot(dx, dy)
    if length < 1.5:
        return ""
    head = min(5.0, length / 2)
    ux, uy = dx / length, dy / length
    tip = (x + dx, y + dy)
    sides = [(tip[0] - head * (ux + s * uy * 0.6), tip[1] - head * (uy - s * ux * 0.6)) for s in (-1.0, 1.0)]
    (ax, ay), (bx, by) = sides
    way = f"M{x:.1f} {y:.1f}L{tip[0]:.1f} {tip[1]:.1f}M{ax:.1f} {ay:.1f}L{tip[0]:.1f} {tip[1]:.1f}"
    return f'<path class="current" d="{way}L{bx:.1f} {by:.1f}"/>'


_SHAPES = {
    "circle": "M-4 0a4 4 0 1 0 8 0a4 4 0 1 0-8 0z",
    "triangle": "M0-6L6 5L-6 5z",
    "square": "M-4-4H4V4H-4z",
    "diamond": "M0-6L6 0L0 6L-6 0z",
    "cross": "M-5-3L-3-5L0-2L3-5L5-3L2 0L5 3L3 5L0 2L-3 5L-5 3L-2 0z",
}


def _marks(view: Frame, marks: Sequence[Mark]) -> Iterable[str]:
    for mark in marks:
        x, y = view.xy(*mark.place).tolist()
        is_right = x > 0.7 * WIDTH
        shape = f'<path class="mark {escape(mark.colour)}" transform="translate({x:.1f} {y:.1f})" '
        shape += f'd="{_SHAPES[mark.shape]}"/>'
        if mark.label:
            anchor = "end" if is_right else "start"
            shape += panel_svg.text(x + (-8 if is_right else 8), y + 4, mark.label, anchor, "halo")
        yield f'<a href="{escape(mark.link)}">{shape}</a>' if mark.link else shape


def _graticule(view: Frame) -> Iterable[str]:
    for x, label in meridians(view):
        yield f'<path class="grid" d="M{x:.1f} 0V{HEIGHT:g}"/>'
        if 24 < x < WIDTH - 24:
            yield panel_svg.text(x, 11, label, "middle", "faint halo")
    for y, label in parallels(view):
        yield f'<path class="grid" d="M0 {y:.1f}H{WIDTH:g}"/>'
        if 24 < y < HEIGHT - 40:
            yield panel_svg.text(3, y - 3, label, "start", "faint halo")


def meridians(view: Frame) -> Iterable[tuple[float, str]]:
    """Where lines of equal longitude stand in the picture, and which they are."""
    box = view.box()
    step = next((s for s in STEPS if (box.east - box.west) / s >= 3), STEPS[-1])
    for k in range(ceil(box.west / step), floor(box.east / step) + 1):
        x = float(view.straight(view.lat, k * step)[0])
        yield x, angle((k * step + 180) % 360 - 180, "E", "W")


def parallels(view: Frame) -> Iterable[tuple[float, str]]:
    """Where lines of equal latitude lie in the picture, and which they are."""
    box = view.box()
    step = next((s for s in STEPS if (box.north - box.south) / s >= 2.5), STEPS[-1])
    for k in range(ceil(box.south / step), floor(box.north / step) + 1):
        yield float(view.straight(k * step, view.lon)[1]), angle(k * step, "N", "S")


def angle(value: float, positive: str, negative: str) -> str:
    """An angle (degrees) in degrees and whole minutes.

    >>> angle(-83.5, "E", "W"), angle(24.0, "N", "S"), angle(0.0, "N", "S")
    ('83°30′W', '24°N', '0°')
    """
    whole, minutes = divmod(round(abs(value) * 60), 60)
    sign = "" if value == 0 else positive if value > 0 else negative
    return f"{whole}°{f'{minutes:02d}′' if minutes else ''}{sign}"


def _scale(view: Frame) -> Iterable[str]:
    """A bar of a round number of kilometres, and which way is north."""
    km = round_number(WIDTH / 4 * view.metres / 1000)
    length = km * 1000 / view.metres
    y = HEIGHT - 12
    yield f'<path d="M12 {y - 5:g}V{y:g}H{12 + length:.1f}V{y - 5:g}" fill="none" stroke="currentColor"/>'
    yield panel_svg.text(16 + length, y, f"{km:g} km", "start", "halo")
    yield f'<path d="M{WIDTH - 16:g} 34V18M{WIDTH - 20:g} 23L{WIDTH - 16:g} 16L{WIDTH - 12:g} 23" '
    yield 'fill="none" stroke="currentColor" stroke-width="1.5"/>'
    yield panel_svg.text(WIDTH - 16, 46, "N", "middle", "halo")


def round_number(value: float) -> float:
    """The greatest of 1, 2 and 5 times a power of ten that is not above a value.

    >>> round_number(73.0), round_number(0.31), round_number(2.0)
    (50.0, 0.2, 2.0)
    """
    ten = 10.0 ** floor(np.log10(value * 1.0000001))
    return float(f"{max(k for k in (1, 2, 5) if k * ten <= value * 1.0000001) * ten:.3g}")
