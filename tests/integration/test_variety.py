"""Files of healthy gliders that are unlike the usual ones: what they hold, how often, and where from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.ingest.decode import decode
from gliderwatch.model import Assessment, Kind, Segment, Series, readonly
from gliderwatch.simulate.dockserver import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Mission, Scenario
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


def commanded(segments: Sequence[Segment], off: float, since: float) -> list[Segment]:
    """The segments without measured headings; the commanded ones are `off` (rad) since a time (s)."""
    out = []
    for segment in segments:
        held = {name: s for name, s in segment.quantities.items() if not name.startswith("heading")}
        t, v = segment.get("heading").t, segment.get("heading").v
        held["heading_commanded"] = Series(t, readonly((v + np.where(t < since, 0.0, off)) % (2 * np.pi)))
        out.append(replace(segment, quantities=held))
    return out


def test_a_commanded_heading_that_is_not_flown_is_no_false_alarm(tmp_path: Path) -> None:
    """What is not measured cannot be wrong: the glider went where the current leaves its way to be."""
    mission = simulate(Scenario(days=2.5))
    fixed = mission.truth[10].t_dive - 60
    found = assessed(commanded(decoded(mission, tmp_path), 0.6, fixed))
    assert {a.flag for a in found} == {0}
    assert np.abs(errors(mission, found)).max() < 0.03


def without(segments: Sequence[Segment], *names: str) -> list[Segment]:
    """The segments without some quantities."""
    return [
        replace(s, quantities={n: q for n, q in s.quantities.items() if n not in names}) for s in segments
    ]


@pytest.mark.parametrize(
    "missing",
    [
        ("heading",),
        ("heading", "heading_commanded"),
        ("heading", "dr_lat", "dr_lon"),
        ("heading", "heading_commanded", "dr_lat", "dr_lon"),
        ("heading", "speed_onboard"),
        ("pitch", "speed_onboard"),
        ("depth", "speed_onboard"),
        ("roll", "thruster_on", "oil_volume", "ballast"),
    ],
)
def test_each_list_of_sensors_is_judged_and_tells_of_drag(missing: tuple[str, ...], tmp_path: Path) -> None:
    onset = Scenario().start + 2.5 * 86400
    mission = simulate(Scenario(days=3.5, faults=(Fault(FaultKind.REMORA, onset, 4.0),)))
    found = assessed(without(decoded(mission, tmp_path), *missing))
    healthy = [a for a in found if a.t_surface < onset]
    assert not {1, 2} & {a.flag for a in healthy}
    assert np.mean([a.flag == 0 for a in healthy]) >= 0.9
    slow = [a for a in found if a.t_dive > onset][:3]
    assert 1 in {a.flag for a in slow}


def test_a_slow_glider_is_told_by_commanded_headings_too(tmp_path: Path) -> None:
    onset = Scenario().start + 2 * 86400
    mission = simulate(Scenario(days=3.0, faults=(Fault(FaultKind.REMORA, onset, 4.0),)))
    found = assessed(commanded(decoded(mission, tmp_path), 0.0, onset))
    assert {a.flag for a in found if a.t_surface < onset} == {0}
    after = [a.flag for a in found if a.t_dive > onset]
    assert 1 in after[:2] and 2 not in after


def test_a_glider_that_surfaces_every_half_hour_learns_what_is_normal(tmp_path: Path) -> None:
    """Without a range of its own it was held against 0.15 to 0.75 m/s, and its alarm came and went."""
    onset = Scenario().start + 86400
    scenario = Scenario(
        days=1.4,
        depths=(2.0, 12.0),
        interval=1800.0,
        communications=(300.0, 600.0),
        faults=(Fault(FaultKind.REMORA, onset, 3.0),),
    )
    store = feed(decoded(simulate(scenario), tmp_path))
    found = store.assessments("sim")
    assert {a.flag for a in found if a.t_surface < onset} == {0}
    assert {a.speed_min for a in found[:8]} == {0.15}
    assert all(0.19 < a.speed_min < 0.21 for a in found[16:])
    (incident,) = store.incidents("sim")
    assert incident.kind == Kind.ANOMALY and incident.cleared_at is None
    assert incident.opened_at < onset + 2 * 3600


def only(segments: Sequence[Segment], *names: str) -> list[Segment]:
    """The segments with the quantities that begin with one of `names`."""
    return [
        replace(s, quantities={n: q for n, q in s.quantities.items() if n.startswith(names)})
        for s in segments
    ]


def test_positions_alone_tell_of_dives_and_why_nothing_is_said_of_them(tmp_path: Path) -> None:
    """A glider of which nothing was said at all looked as well as a healthy one."""
    mission = simulate(Scenario(days=1.0))
    found = assessed(only(decoded(mission, tmp_path), "fix_"))
    assert len(found) == len(mission.truth)
    assert all(a.flag is None and a.reason.startswith("no heading for ") for a in found)
