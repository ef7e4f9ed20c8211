"""Missions as they would be, had the glider not sent some of its sensors. Pure but for the WMM."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from gliderwatch.ingest.segment import QUANTITIES, declination_of
from gliderwatch.model import Segment

_HEADING = ("heading",)
_ON_BOARD = ("speed_onboard",)
_DEPTH = ("depth", "depth_rate")
_FINAL = ("current_final_x", "current_final_y")
_INITIAL = ("current_initial_x", "current_initial_y")
_CURRENT = ("current_x", "current_y", *_INITIAL, *_FINAL)
_THRUSTER = ("thruster_on", "thruster_power")

LEFT_OUT: Mapping[str, tuple[str, ...]] = {
    "all sensors": (),
    "heading": _HEADING,
    "both headings": (*_HEADING, "heading_commanded"),
    "heading, speed": (*_HEADING, *_ON_BOARD),
    "heading, depth": (*_HEADING, *_DEPTH),
    "speed": _ON_BOARD,
    "depth": _DEPTH,
    "pitch": ("pitch",),
    "depth, pitch": (*_DEPTH, "pitch"),
    "roll": ("roll",),
    "current": _CURRENT,
    "final current": (*_INITIAL, *_FINAL),
    "variation": ("magnetic_variation",),
    "thruster": _THRUSTER,
    "dr positions": ("dr_lat", "dr_lon"),
    "least": (*_HEADING, *_ON_BOARD, *_DEPTH, "pitch", "roll", *_THRUSTER, "magnetic_variation"),
}
"""Quantities that the lists of sensors of real gliders leave out, by a short name of what is missing; `least`
leaves positions, the current and the commanded heading."""


def left_out(segments: Iterable[Segment], quantities: Iterable[str]) -> list[Segment]:
    """The segments without some quantities. Where the magnetic variation is among them, the declination is
    that of the World Magnetic Model, as it is for a file that has none."""
    gone = frozenset(quantities)
    out = []
    for segment in segments:
        kept = {name: series for name, series in segment.quantities.items() if name not in gone}
        declination, source = segment.declination, segment.declination_source
        if "magnetic_variation" in gone:
            declination, source = declination_of(kept)
        out.append(replace(segment, quantities=kept, declination=declination, declination_source=source))
    return out


def is_sent(segments: Iterable[Segment], quantities: Iterable[str]) -> bool:
    """Whether any of some quantities is in any of the segments; True where none is asked for."""
    wanted = frozenset(quantities)
    return not wanted or any(wanted & segment.quantities.keys() for segment in segments)


def cadence_without(cadence: Mapping[str, float], quantities: Iterable[str]) -> dict[str, float]:
    """A simulated glider's list of Slocum sensors (s) without those that some quantities are read from."""
    gone = frozenset(quantities)
    sensors = {sensor for row in QUANTITIES if row.name in gone for sensor in row.sensors}
    return {name: period for name, period in cadence.items() if name not in sensors}
