"""Casts, their composite, the layers in it, and the band for the next segment."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gliderwatch.layers import flown
from gliderwatch.layers.band import Band, Method, Mode, Tracking, cost_slope, costs_of, follow
from gliderwatch.layers.casts import Cast, bin_of, split
from gliderwatch.layers.composite import composite, layers_of
from gliderwatch.layers.constants import LEAST_BIN
from gliderwatch.layers.section import section
from gliderwatch.model import Series, readonly


def warm_above(top: float, bottom: float, deepest: float = 100.0, difference: float = 8.0) -> Series:
    """A profile (depths as times): 20 degrees above `top` m, `difference` less below `bottom`."""
    z = np.arange(0.0, deepest + 0.5, 0.5)
    return Series(readonly(z), readonly(np.interp(z, [top, bottom], [20.0, 20.0 - difference])))


def casts_in(water: Series, n: int = 6, noise: float = 0.0, t: float = 0.0) -> list[Cast]:
    """`n` casts, down first, with a sample each m."""
    out, chance = [], np.random.default_rng(1)
    for i in range(n):
        z = np.arange(2.0, 100.0, 1.0)[:: 1 if i % 2 == 0 else -1]
        times = t + 600.0 * i + 5.0 * np.arange(len(z))
        v = np.interp(z, water.t, water.v) + chance.normal(0.0, noise, len(z))
        out.append(Cast(readonly(times), readonly(z), readonly(v)))
    return out


def after(*segments: list[Cast], method: Method = Method.COMPOSITE) -> Tracking:
    tracking = Tracking()
    for casts in segments:
        tracking = follow(tracking, casts, "temperature", method)
    return tracking


# --------------------------------------------------------------------------- casts


def test_ways_down_and_up_are_casts() -> None:
    z = np.concatenate([np.zeros(5), np.arange(0.0, 31.0), np.arange(29.0, 4.0, -1.0), np.arange(6.0, 21.0)])
    t = np.arange(len(z)) * 10.0
    depth = Series(readonly(t), readonly(z))
    found = split(depth, depth)
    assert [(c.top, c.bottom) for c in found] == [(0.0, 30.0), (5.0, 30.0), (5.0, 20.0)]


def test_a_glider_that_drifts_at_depth_makes_no_casts() -> None:
    z = np.concatenate([np.arange(0.0, 300.0, 2.0), 300.0 + 4.0 * np.sin(np.arange(400) / 5.0)])
    depth = Series(readonly(np.arange(len(z)) * 10.0), readonly(z))
    assert len(split(depth, depth)) == 1


def test_no_samples_make_no_casts() -> None:
    empty = Series(readonly([]), readonly([]))
    assert split(empty, empty) == ()


def test_the_value_has_its_depth_between_samples_of_the_depth() -> None:
    depth = Series(readonly([0.0, 100.0]), readonly([0.0, 50.0]))
    (cast,) = split(depth, Series(readonly([10.0, 30.0, 90.0, 200.0]), readonly([1.0, 2.0, 3.0, 4.0])))
    assert cast.depth == pytest.approx([5.0, 15.0, 45.0])


# ----------------------------------------------------------------------- composite


def test_a_straight_layer_is_found_where_it_is() -> None:
    found = composite(casts_in(warm_above(40.0, 60.0)), 2.0)
    (layer,) = layers_of(found, "temperature")
    assert (layer.top, layer.bottom) == (40.0, 60.0)
    assert layer.strength == pytest.approx(-0.4)
    assert layer.confidence == 1.0


def test_two_layers_are_two() -> None:
    z = np.arange(0.0, 101.0)
    v = np.interp(z, [20, 24, 60, 70], [20.0, 18.0, 18.0, 14.0])
    found = composite(casts_in(Series(readonly(z), readonly(v))), 2.0)
    assert [(x.top, x.bottom) for x in layers_of(found, "temperature")] == [(20.0, 24.0), (60.0, 70.0)]


def test_even_water_with_noise_has_no_layer() -> None:
    even = warm_above(40.0, 60.0, difference=0.0)
    assert layers_of(composite(casts_in(even, noise=0.02), 2.0), "temperature") == ()


def test_one_cast_shows_no_layer() -> None:
    found = composite(casts_in(warm_above(40.0, 60.0), n=1), 2.0)
    assert found.peak == 0.0
    assert layers_of(found, "temperature") == ()


def test_confidence_is_the_part_of_casts_that_show_it() -> None:
    with_layer, without = warm_above(40.0, 60.0), warm_above(40.0, 60.0, difference=0.0)
    casts = casts_in(with_layer, n=3) + casts_in(without, n=1)
    (layer,) = layers_of(composite(casts, 2.0), "temperature")
    assert layer.confidence == pytest.approx(0.75)


def test_a_bin_is_two_samples_high_and_at_least_1_m() -> None:
    assert bin_of(casts_in(warm_above(40.0, 60.0))) == pytest.approx(2.0)
    assert bin_of([]) == LEAST_BIN


@given(st.floats(5.0, 60.0), st.floats(4.0, 30.0), st.permutations(range(6)))
def test_the_order_of_casts_does_not_matter(top: float, height: float, order: list[int]) -> None:
    casts = casts_in(warm_above(top, top + height), noise=0.01)
    one, other = composite(casts, 2.0), composite([casts[i] for i in order], 2.0)
    assert one.gradient == pytest.approx(other.gradient, nan_ok=True)
    assert layers_of(one, "temperature") == layers_of(other, "temperature")


# ---------------------------------------------------------------------------- band


def test_the_first_segment_is_complete_and_the_next_flies_the_band() -> None:
    assert Tracking().mode is Mode.COMPLETE
    assert Tracking().band is None
    found = after(casts_in(warm_above(40.0, 60.0)))
    assert found.mode is Mode.TRACK
    assert found.band == Band(38.0, 62.0)  # extended by a bin


def test_without_a_layer_it_says_so() -> None:
    found = after(casts_in(warm_above(40.0, 60.0, difference=0.0), noise=0.01))
    assert (found.mode, found.band, found.why) == (Mode.COMPLETE, None, "no layer")


def test_advice_does_not_flicker() -> None:
    before = after(casts_in(warm_above(40.0, 60.0)))
    assert before.band is not None
    seen = [c.within(before.band.top, before.band.bottom) for c in casts_in(warm_above(40.2, 60.2))]
    assert follow(before, seen, "temperature").band == before.band


def test_the_band_follows_a_layer_that_moves() -> None:
    tracking = after(casts_in(warm_above(40.0, 60.0)))
    for i in range(1, 9):
        assert tracking.band is not None
        water = casts_in(warm_above(40.0 + i, 60.0 + i))
        seen = [c.within(tracking.band.top, tracking.band.bottom) for c in water]
        tracking = follow(tracking, seen, "temperature")
    assert tracking.band is not None
    assert tracking.band.top <= 48.0
    assert tracking.band.bottom >= 68.0
    assert tracking.band.bottom - tracking.band.top < 45.0


def test_a_layer_that_is_gone_is_a_reset_and_then_complete() -> None:
    even = warm_above(40.0, 60.0, difference=0.1)
    tracking = after(casts_in(warm_above(40.0, 60.0)))
    lost = follow(tracking, [c.within(38.0, 62.0) for c in casts_in(even)], "temperature")
    assert (lost.mode, lost.band) == (Mode.RESET, None)
    assert follow(lost, casts_in(even), "temperature").mode is Mode.COMPLETE


def test_a_weaker_layer_is_a_reset() -> None:
    tracking = after(casts_in(warm_above(40.0, 60.0)))
    weak = casts_in(warm_above(40.0, 60.0, difference=3.0))
    lost = follow(tracking, weak, "temperature")
    assert lost.mode is Mode.RESET
    assert "38%" in lost.why


def test_a_day_and_a_half_without_all_depths_is_a_reset() -> None:
    water = warm_above(40.0, 60.0)
    tracking = after(casts_in(water))
    late = [c.within(38.0, 62.0) for c in casts_in(water, t=135_000.0)]
    assert follow(tracking, late, "temperature").mode is Mode.RESET


def test_one_cast_changes_nothing() -> None:
    tracking = after(casts_in(warm_above(40.0, 60.0)))
    assert follow(tracking, casts_in(warm_above(10.0, 20.0), n=1), "temperature") == tracking


def test_the_filter_moves_the_band_to_where_the_layer_goes() -> None:
    tracking = after(casts_in(warm_above(40.0, 60.0)))
    assert tracking.band is not None
    deeper = [c.within(38.0, 62.0) for c in casts_in(warm_above(52.0, 72.0))]
    assert cost_slope([costs_of(cast, tracking.peak) for cast in deeper]) > 0
    moved = follow(tracking, deeper, "temperature", Method.FILTER)
    assert moved.band is not None
    assert moved.band.top > tracking.band.top


def test_the_filter_is_reset_by_its_cost_alone() -> None:
    """Not by the composite: half of the casts show the layer, which the filter sees; none is a reset."""
    tracking = after(casts_in(warm_above(40.0, 60.0)))
    even = [c.within(38.0, 62.0) for c in casts_in(warm_above(40.0, 60.0, difference=0.5))]
    some = [*even[:4], *[c.within(38.0, 62.0) for c in casts_in(warm_above(40.0, 60.0))[:2]]]
    assert follow(tracking, some, "temperature").mode is Mode.RESET
    assert follow(tracking, some, "temperature", Method.FILTER).mode is Mode.TRACK
    lost = follow(tracking, even, "temperature", Method.FILTER)
    assert (lost.mode, lost.band, lost.why) == (Mode.RESET, None, "its cost stayed below 50% of the largest")


def test_samples_close_to_each_other_are_no_steps_of_the_filter() -> None:
    z = np.arange(0.0, 10.0, 0.0625)
    found = costs_of(Cast(readonly(z), readonly(z), readonly(0.4 * z)), 0.8)
    assert [d for d, _ in found] == pytest.approx([0.25] * len(found))
    assert [cost for _, cost in found] == pytest.approx([0.5] * len(found))
    assert costs_of(Cast(readonly(z), readonly(z), readonly(z)), 0.0) == []


def test_bins_stay_as_they_were_while_a_layer_is_tracked() -> None:
    """Gradients of coarser samples, in a band of few, are compared in the bins of the first segment."""
    tracking = after(casts_in(warm_above(40.0, 60.0)))
    coarse = [
        Cast(c.t[::4], c.depth[::4], c.value[::4]).within(38.0, 62.0)
        for c in casts_in(warm_above(40.0, 60.0))
    ]
    found = follow(tracking, coarse, "temperature")
    assert (found.mode, found.bin) == (Mode.TRACK, tracking.bin)


# --------------------------------------------------------------------------- flown


def test_full_yos_cover_all_at_full_travel() -> None:
    segments = [casts_in(warm_above(40.0, 60.0)) for _ in range(3)]
    whole = flown.total(flown.compare(segments, "temperature")["full yos"])
    assert (whole.coverage, whole.travel) == (1.0, 1.0)


def test_what_is_outside_the_band_is_not_seen() -> None:
    """The layer jumps out of the band: one segment covers nothing of it, the next flies all depths."""
    segments = [casts_in(warm_above(20.0, 30.0)), *[casts_in(warm_above(70.0, 80.0)) for _ in range(3)]]
    found = flown.compare(segments, "temperature")["composite"]
    assert [f.coverage for f in found] == [1.0, 0.0, 1.0, 1.0]
    assert [f.mode for f in found] == [Mode.COMPLETE, Mode.TRACK, Mode.RESET, Mode.TRACK]
    assert found[1].travel < 0.2


def test_full_casts_see_a_jump_at_once() -> None:
    segments = [casts_in(warm_above(20.0, 30.0)), *[casts_in(warm_above(70.0, 80.0)) for _ in range(3)]]
    found = flown.compare(segments, "temperature")["composite, two full casts"]
    assert [f.coverage for f in found] == [1.0, 1.0, 1.0, 1.0]


def test_a_section_is_the_mean_of_the_casts_of_each_segment() -> None:
    depth = readonly(np.arange(0.0, 40.0, 0.5))
    cold, warm = (Cast(depth, depth, readonly(np.full(len(depth), v))) for v in (10.0, 12.0))
    found = section([(cold, warm), (), (cold.within(0.0, 20.0),)])
    assert found.t == pytest.approx([19.75, 10.0])
    assert found.edges == pytest.approx(np.arange(0.0, 41.0, 1.0))
    assert found.value[0] == pytest.approx(11.0)
    assert np.isnan(found.value[1, 21:]).all()
    assert found.value[1, :20] == pytest.approx(10.0)


def test_a_section_of_nothing_has_no_profile() -> None:
    assert section([]).value.shape == (0, 1)


def test_a_section_of_a_deep_glider_has_coarser_bins() -> None:
    depth = readonly(np.arange(0.0, 1000.0, 0.5))
    assert len(section([(Cast(depth, depth, depth),)]).edges) == 201  # layers.constants.MOST_DEPTHS
