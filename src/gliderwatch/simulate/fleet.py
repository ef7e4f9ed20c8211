"""Several gliders in one sea. Pure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gliderwatch.simulate.onboard import Point, offset
from gliderwatch.simulate.scenario import Scenario

_SPACING = 4000.0
_ROW = 5


def fleet(scenario: Scenario, n: int) -> list[Scenario]:
    """The scenarios of ``n`` gliders, 4 km apart in rows of five, each with waypoints of its own.

    They share the sea. The faults go to the gliders in turn: the first to the first glider, and so
    on; who gets none is healthy. One glider alone is the scenario itself.

    Raises:
        ValueError: not one glider.
    """
    if n < 1:
        raise ValueError("a fleet has at least one glider")
    if n == 1:
        return [scenario]
    return [_member(scenario, i, n) for i in range(n)]


def _member(scenario: Scenario, i: int, n: int) -> Scenario:
    east, north = np.array(_SPACING * (i % _ROW)), np.array(_SPACING * (i // _ROW))

    def moved(place: Point) -> Point:
        lat, lon = offset(place, east, north)
        return Point(float(lat), float(lon))

    return replace(
        scenario,
        glider=f"{scenario.glider}-{i + 1:02d}",
        member=i,
        place=moved(scenario.place),
        waypoints=tuple(map(moved, scenario.waypoints)),
        origin=scenario.place,
        faults=scenario.faults[i::n],
    )
