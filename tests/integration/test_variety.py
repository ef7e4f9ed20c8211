"""Files of healthy gliders that are unlike the usual ones: what they hold, how often, and where from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gliderwatch.ingest.decode import decode
from gliderwatch.model import Assessment, Segment
from gliderwatch.simulate.dockserver import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.sensors import CADENCE
from missions import feed

AT_THE_SURFACE = (
    "m_gps_lat",
    "m_gps_lon",
    "m_water_vx",
    "m_water_vy",
    "m_final_water_vx",
    "m_final_water_vy",
)


def decoded(mission: Mission, folder: Path) -> list[Segment]:
    """The segments of a mission, as read from its files."""
    paths = write_mission(folder / "gliders", folder / "cache", mission)
    return sorted((decode(path, [folder / "cache"]) for path in paths), key=lambda s: s.id)


def assessed(segments: Sequence[Segment]) -> list[Assessment]:
    """What is said of the dives in the end."""
    return feed(segments).assessments(segments[0].id.glider)


def errors(mission: Mission, found: Sequence[Assessment]) -> np.ndarray:
    """Of each dive that has a speed, what that is too high (m/s)."""
    surfaced = np.array([dive.t_surface for dive in mission.truth])
    near = [(a, mission.truth[int(np.argmin(np.abs(surfaced - a.t_surface)))]) for a in found]
    return np.array([a.speed - dive.speed for a, dive in near if a.speed is not None])


def test_every_third_yo_tells_the_speed_as_well_as_all(tmp_path: Path) -> None:
    """What follows the last yo that is sent is flight: taken for a drift it made a glider 18 % too fast."""
    thinned = {name: 3 for name in CADENCE if name not in AT_THE_SURFACE}
    mission = simulate(Scenario(days=2.0, nth_yo=thinned))
    found = assessed(decoded(mission, tmp_path))
    assert len(found) == len(mission.truth)
    assert {a.flag for a in found} == {0}
    assert np.abs(errors(mission, found)).max() < 0.012
    assert max(a.evidence["drift_h"] for a in found) < 0.1
