"""What navigation makes of the samples of a segment."""

import numpy as np
import pytest

from gliderwatch.model import Series, readonly
from gliderwatch.navigation.constants import SPACING
from gliderwatch.navigation.flight import after, concatenated, downsample, get, joined, prepare
from missions import segment, series


def dense(name: str, values, step: float = 4.0) -> dict[str, Series]:
    return {name: Series(readonly(np.arange(len(values)) * step), readonly(values))}


def test_fine_samples_are_averaged_in_bins():
    out = downsample(dense("pitch", np.arange(60.0)))["pitch"]
    assert np.diff(out.t).max() < 1.2 * SPACING
    assert out.v[0] == pytest.approx(np.mean(np.arange(8.0)))  # 0 to 28 s
    assert out.v.mean() == pytest.approx(29.5, abs=1.0)


def test_coarse_samples_stay_as_they_are():
    coarse = dense("pitch", np.arange(10.0), step=SPACING)
    assert downsample(coarse)["pitch"] is coarse["pitch"]


def test_headings_around_north_average_to_north():
    out = downsample(dense("heading", np.radians([350.0, 10.0, 355.0, 5.0])))["heading"]
    assert np.sin(out.v[0]) == pytest.approx(0.0, abs=1e-12) and np.cos(out.v[0]) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["fix_lat", "current_x", "current_final_y"])
def test_every_fix_and_current_counts(name):
    whole = dense(name, np.arange(60.0))
    assert downsample(whole)[name] is whole[name]


@pytest.mark.parametrize("name", ["dr_lat", "dr_time", "waypoint_lon"])
def test_what_jumps_is_never_averaged(name):
    out = downsample(dense(name, [36.0] * 5 + [37.0] * 25))[name]
    assert set(out.v.tolist()) == {36.0, 37.0}


def test_thinning_twice_changes_nothing():
    rng = np.random.default_rng(3)
    t = readonly(np.sort(rng.uniform(0, 3e4, 3000)))
    names = ("pitch", "heading", "depth", "dr_lat", "fix_lat", "current_x")
    once = downsample({name: Series(t, readonly(rng.uniform(0, 6, 3000))) for name in names})
    twice = downsample(once)
    assert all(twice[name] is once[name] for name in names)


def test_four_seconds_cadence_and_thinned_data_lead_to_the_same():
    """A checkpoint does not depend on whether the file or what was kept of it is taken in."""
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 3600.0, 4.0)
    held = {n: list(zip(t, rng.uniform(0, 3, len(t)), strict=True)) for n in ("heading", "pitch", "depth")}
    whole = segment("a", 0.0, held)
    thin = segment(
        "a", 0.0, {k: list(zip(s.t, s.v, strict=True)) for k, s in downsample(whole.quantities).items()}
    )
    one, other = prepare(whole, 0.1), prepare(thin, 0.1)
    assert {k: s.v.tolist() for k, s in one.items()} == {k: s.v.tolist() for k, s in other.items()}


def test_headings_become_vectors_to_true_north():
    out = prepare(segment("a", 0.0, {"heading": [(1.0, np.radians(350.0))]}), np.radians(20.0))
    assert get(out, "heading_e").v == pytest.approx([np.sin(np.radians(10.0))])
    assert get(out, "heading_n").v == pytest.approx([np.cos(np.radians(10.0))])


def test_commanded_heading_stands_in_for_the_measured_one():
    both = {"heading": [(1.0, 0.0)], "heading_commanded": [(1.0, np.pi)]}
    assert get(prepare(segment("a", 0.0, both), 0.0), "heading_n").v == pytest.approx([1.0])
    only = {"heading_commanded": [(1.0, np.pi)]}
    assert get(prepare(segment("a", 0.0, only), 0.0), "heading_n").v == pytest.approx([-1.0])


def test_the_power_of_a_thruster_stands_in_for_its_setting():
    """Watts and per cent as electa-2022 reports them."""
    power = {"thruster_power": [(1.0, 0.0), (40.0, 2.9), (70.0, 8.6), (100.0, 30.0)]}
    out = prepare(segment("a", 0.0, power), 0.0)
    assert get(out, "thruster_on").v == pytest.approx([0.0, 0.35, 0.60, 1.0], abs=0.01)
    both = power | {"thruster_on": [(1.0, 0.5)]}
    assert get(prepare(segment("a", 0.0, both), 0.0), "thruster_on").v.tolist() == [0.5]


def test_positions_without_their_partner_are_left_out():
    held = {"fix_lat": [(1.0, 36.0), (2.0, 36.1)], "fix_lon": [(2.0, -70.0), (3.0, -70.1)]}
    out = prepare(segment("a", 0.0, held), 0.0)
    assert (get(out, "fix_lat").t.tolist(), get(out, "fix_lat").v.tolist()) == ([2.0], [36.1])
    assert get(out, "fix_lon").v.tolist() == [-70.0]


def test_nothing_in_nothing_out():
    assert dict(prepare(segment("a", 0.0, {}), 0.0)) == {}
    assert len(get({}, "depth")) == 0


def test_joined_takes_times_that_both_have():
    t, a, b = joined(series([(1, 1), (2, 2), (4, 4)]), series([(2, 20), (3, 30), (4, 40)]))
    assert (t.tolist(), a.tolist(), b.tolist()) == ([2, 4], [2, 4], [20, 40])


def test_concatenated_is_in_order_of_time_and_forgets_nothing():
    a, b = {"depth": series([(1, 1), (5, 5)])}, {"depth": series([(3, 3)]), "pitch": series([(2, 2)])}
    out = concatenated(a, b)
    assert get(out, "depth").t.tolist() == [1, 3, 5] and get(out, "pitch").v.tolist() == [2]
    assert get(concatenated(b, a), "depth").v.tolist() == [1, 3, 5]


def test_after_leaves_out_the_moment_itself():
    out = after({"depth": series([(1, 1), (2, 2), (3, 3)]), "pitch": series([(1, 0)])}, 2.0)
    assert get(out, "depth").t.tolist() == [3] and "pitch" not in out
