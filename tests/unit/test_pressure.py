"""A depth sensor whose zero is off: the offset is seen at the fixes, taken off and said."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.model import Series, readonly
from gliderwatch.navigation.constants import ZERO_LEAST
from gliderwatch.navigation.fixes import new_fixes, zeroed
from gliderwatch.navigation.flight import prepare
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.slocum.decode import decode
from missions import Leg, feed, mission, segment

LEGS = [Leg(hours=2.0, heading=1.0 + 0.05 * (k % 3)) for k in range(12)]


def with_surface_depths(offset: float):
    """A mission whose files hold depths at the surface too, all too great by `offset` (m)."""
    out = []
    for s in mission(LEGS):
        depth, fixes = s.get("depth"), s.get("fix_lat").t
        t = np.concatenate([fixes, depth.t])
        v = np.concatenate([0.3 + 0.2 * (np.arange(len(fixes)) % 2), depth.v])
        order = np.argsort(t)
        moved = Series(readonly(t[order]), readonly(v[order] + offset))
        out.append(replace(s, quantities={**s.quantities, "depth": moved}))
    return out


@pytest.mark.parametrize("offset", [3.5, 5.0, 9.0, -4.0])
def test_dives_are_those_of_a_sensor_that_is_right(offset):
    right, off = (feed(with_surface_depths(x)).assessments("unit") for x in (0.0, offset))
    assert [(a.t_dive, a.t_surface, a.flag) for a in off] == [(a.t_dive, a.t_surface, a.flag) for a in right]
    assert all(a.speed == pytest.approx(b.speed, abs=1e-6) for a, b in zip(off, right, strict=True))
    note = f"depth is {offset + 0.3:.1f} m at the surface: taken off (the pressure was not zeroed)"
    assert all(note in a.notes for a in off)
    assert all("depth_max" not in a.evidence or a.evidence["depth_max"] < 206 for a in off)


@pytest.mark.parametrize("period", [4.0, 40.0])
def test_drift_at_the_surface_is_no_dive(tmp_path, period):
    """Files with many depths at the surface: with the offset they looked like 9 and 15 dives more."""
    cadence = {**Scenario().cadence, "m_depth": period}
    flown = simulate(Scenario(days=3.0, seed=3, cadence=cadence))
    paths = write_mission(tmp_path / "gliders", tmp_path / "cache", flown)
    segments = [decode(path, [tmp_path / "cache"]) for path in paths]
    off = [
        replace(s, quantities={**s.quantities, "depth": Series(d.t, readonly(d.v + 3.5))})
        for s, d in ((s, s.get("depth")) for s in segments)
    ]
    dives, right = feed(off).assessments("sim"), feed(segments).assessments("sim")
    assert [a.flag for a in dives] == [0] * len(flown.truth)
    assert [a.t_dive for a in dives] == pytest.approx([a.t_dive for a in right], abs=60.0)
    assert [a.t_surface for a in dives] == pytest.approx([a.t_surface for a in right], abs=60.0)


def test_waves_are_no_offset():
    notes = {note for a in feed(with_surface_depths(1.0)).assessments("unit") for note in a.notes}
    assert not any("surface" in note for note in notes)


def test_an_old_fix_that_is_reported_under_water_is_none():
    """All depths near it are deep, but elsewhere the glider is at the surface."""
    depths = [(float(t), 0.2 if t < 60 else 30.0) for t in range(0, 600, 10)]
    s = segment(
        "unit-2023-318-0-0",
        0.0,
        {
            "depth": depths,
            "fix_lat": [(300.0, 36.0), (310.0, 36.001)],
            "fix_lon": [(300.0, -70.0), (310.0, -70.0)],
        },
    )
    samples = prepare(s, 0.0)
    assert zeroed(samples, new_fixes(samples, None), 0.0)[1] == 0.0


def test_a_segment_without_a_fix_has_the_offset_of_the_one_before():
    s = segment("unit-2023-318-0-1", 0.0, {"depth": [(float(t), 5.0) for t in range(0, 600, 30)]})
    samples, known = zeroed(prepare(s, 0.0), [], 5.0)
    assert known == 5.0
    assert np.abs(samples["depth"].v).max() < ZERO_LEAST
