"""Each heuristic of layers at work, just below and just above where it decides."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gliderwatch.layers.advice import LayerParams, advise
from gliderwatch.layers.band import Band, Method, Mode, Tracking, _shifted, cost_slope, follow
from gliderwatch.layers.casts import Cast, bin_of, split
from gliderwatch.layers.composite import Composite, in_layer, layers_of
from gliderwatch.layers.flown import compare, methods
from gliderwatch.model import Segment, SegmentId, Series, readonly


def ways(*turns: float) -> Series:
    """A glider's depth, a sample each m and s, from turn to turn."""
    z = np.concatenate([np.arange(a, b, np.sign(b - a)) for a, b in pairwise(turns)])
    return Series(readonly(np.arange(len(z), dtype=float)), readonly(z))


@pytest.mark.parametrize(("back", "n"), [(2.0, 1), (4.0, 3)])
def test_a_turn_of_3_m_parts_casts(back: float, n: int) -> None:
    depth = ways(0.0, 20.0, 20.0 - back, 40.0)
    assert len(split(depth, depth)) == n


@pytest.mark.parametrize(("back", "n"), [(8.0, 1), (13.0, 3)])
def test_in_200_m_a_turn_of_10_m_does(back: float, n: int) -> None:
    depth = ways(0.0, 100.0, 100.0 - back, 200.0)
    assert len(split(depth, depth)) == n


def test_the_finest_bin_is_1_m() -> None:
    assert bin_of([]) == 1.0


def gradients(*values: float, error: float = 0.0, height: float = 2.0) -> Composite:
    return Composite(
        0.0, height, readonly(values), readonly([error] * len(values)), readonly([values, values, values])
    )


@pytest.mark.parametrize(("beside", "n"), [(0.23, 1), (0.27, 2)])
def test_a_quarter_of_the_peak_is_a_layer(beside: float, n: int) -> None:
    assert in_layer(gradients(0.0, beside, 1.0, 0.0), "temperature").sum() == n


@pytest.mark.parametrize(
    ("name", "floor"), [("temperature", 0.02), ("salinity", 0.005), ("density", 0.01), ("oxygen", 0.0)]
)
def test_a_gradient_below_the_floor_is_none(name: str, floor: float) -> None:
    assert in_layer(gradients(1.2 * floor + 1e-9, 0.0), name).any()
    assert not in_layer(gradients(0.8 * floor, 0.0), name).any()


def test_a_layer_differs_from_nothing_by_two_standard_errors() -> None:
    assert in_layer(gradients(0.22, error=0.1), "temperature").all()
    assert not in_layer(gradients(0.18, error=0.1), "temperature").any()


@pytest.mark.parametrize(("gap", "n"), [((0.0,), 1), ((0.0, 0.0), 2)])
def test_a_gap_of_one_bin_is_closed(gap: tuple[float, ...], n: int) -> None:
    assert len(layers_of(gradients(1.0, *gap, 1.0), "temperature")) == n


# ---------------------------------------------------------------------------- band


def casts(
    top: float, bottom: float, *, spacing: float = 1.0, difference: float = 8.0, t: float = 0.0
) -> list[Cast]:
    """Six casts from 0 to 200 m through a layer."""
    z = np.arange(0.0, 200.0, spacing)
    v = np.interp(z, [top, bottom], [20.0, 20.0 - difference])
    return [Cast(readonly(t + 1000.0 * i + z), readonly(z), readonly(v)) for i in range(6)]


KNOWN = Tracking(Mode.TRACK, Band(80.0, 120.0), 84.0, 116.0, 0.4, 0.0, 2.0)


def band(tracking: Tracking) -> tuple[float, float]:
    assert tracking.band is not None
    return tracking.band.top, tracking.band.bottom


def test_the_layer_is_extended_by_a_bin_and_2_m_at_least() -> None:
    assert band(follow(Tracking(), casts(100.0, 120.0), "temperature")) == (98.0, 122.0)
    assert band(follow(Tracking(), casts(100.0, 120.0, spacing=0.25), "temperature")) == (98.0, 122.0)
    assert band(follow(Tracking(), casts(100.0, 120.0, spacing=2.5), "temperature")) == (95.0, 125.0)


def test_limits_are_smoothed_and_extended_by_how_much_they_moved() -> None:
    """From 84 to 94 m: 0.7 of the way is 91, less an extension of 2 and the most for a move, 3 of them."""
    found = follow(KNOWN, casts(94.0, 126.0), "temperature")
    assert found.top == pytest.approx(91.0)
    assert band(found) == pytest.approx((91.0 - 2.0 - 6.0, 123.0 + 2.0 + 6.0))


def test_a_layer_at_the_edge_of_the_band_gets_two_extensions_more() -> None:
    seen = [c.within(80.0, 120.0) for c in casts(84.0, 140.0)]
    found = follow(replace(KNOWN, peak=0.15), seen, "temperature")
    assert found.bottom == pytest.approx(0.7 * 120.0 + 0.3 * 116.0)
    moved = found.bottom - 116.0
    assert band(found)[1] == pytest.approx(found.bottom + 2.0 + moved + 4.0)


@pytest.mark.parametrize(("by", "same"), [(0.8, True), (1.3, False)])
def test_a_band_that_would_change_by_less_than_a_metre_stays(by: float, same: bool) -> None:
    before = Tracking(Mode.TRACK, Band(82.0 - by, 118.0), 84.0, 116.0, 0.25, 0.0, 2.0)
    assert (follow(before, casts(84.0, 116.0), "temperature").band == before.band) is same


@pytest.mark.parametrize(("difference", "mode"), [(7.2, Mode.TRACK), (5.8, Mode.RESET)])
def test_half_of_the_reference_is_the_least(difference: float, mode: Mode) -> None:
    found = follow(KNOWN, casts(84.0, 116.0, difference=difference), "temperature")
    assert found.mode is mode


@pytest.mark.parametrize(("hours", "mode"), [(34.0, Mode.TRACK), (38.0, Mode.RESET)])
def test_a_day_and_a_half_in_the_band_is_the_most(hours: float, mode: Mode) -> None:
    seen = [c.within(80.0, 120.0) for c in casts(84.0, 116.0, t=hours * 3600.0 - 5000.0)]
    assert follow(KNOWN, seen, "temperature").mode is mode


def deep(*differences: float) -> list[Cast]:
    """Five casts that end in the layer, and deeper ones with these changes of temperature in it."""
    seen = [cast.within(0.0, 108.0) for cast in casts(100.0, 120.0)[:5]]
    return seen + [
        casts(100.0, 120.0, difference=each, t=1e4 + 1e3 * k)[0] for k, each in enumerate(differences)
    ]


@pytest.mark.parametrize(
    ("differences", "mode"), [((4.2, 4.2, 3.4), Mode.TRACK), ((4.2, 3.4, 3.4), Mode.COMPLETE)]
)
def test_half_of_the_casts_through_a_layer_must_show_it(differences: tuple[float, ...], mode: Mode) -> None:
    assert follow(Tracking(), deep(*differences), "temperature").mode is mode


def test_two_casts_show_a_layer() -> None:
    assert follow(Tracking(), casts(100.0, 120.0)[:2], "temperature").mode is Mode.TRACK


def test_the_first_step_of_the_filter() -> None:
    """By hand: 10 m at Q = 3e-5 and R = 0.03 give s = 2 R + 100 Q = 0.063, a gain of 10 Q / s."""
    assert cost_slope([[(10.0, 1.0)]]) == pytest.approx(1 / 210)


def test_the_filter_moves_the_band_by_a_quarter_of_its_half_squared_times_the_slope() -> None:
    """A band of 32 m and 2 m on either side: 18 squared over 4, times a slope of 1 / 210."""
    found = _shifted(KNOWN, [[(10.0, 1.0)]], 2.0)
    assert found.top == pytest.approx(84.0 + 81.0 / 210.0)


# ---------------------------------------------------------------------------- advice

PARAMS = LayerParams("temperature", 200.0, 0.0, 0.0, Method.COMPOSITE, 2)


def above(*bottoms: float) -> Segment:
    """A segment in which these depths of the bottom were measured."""
    series = Series(readonly(np.arange(float(len(bottoms)))), readonly(bottoms))
    return Segment(
        SegmentId(0.0, "sim", "sim-2026-1-1-1"), "", "sbd", 400.0, (0, 1, ""), {"water_depth": series}
    )


@pytest.mark.parametrize(("height", "mode"), [(2.8, Mode.COMPLETE), (3.2, Mode.TRACK)])
def test_a_band_of_3_m_is_the_least(height: float, mode: Mode) -> None:
    found = advise(
        replace(KNOWN, band=Band(100.0, 120.0)), above(), 0.0, replace(PARAMS, max_depth=100.0 + height)
    )
    assert found.mode is mode


@pytest.mark.parametrize(("wrong", "bottom"), [(2, 100.0), (3, 96.0)])
def test_one_depth_of_the_bottom_in_ten_may_be_too_shallow(wrong: int, bottom: float) -> None:
    found = advise(Tracking(), above(*[96.0] * wrong, *[100.0] * (21 - wrong)), 0.0, PARAMS)
    assert found.full.bottom == bottom


def test_two_full_casts_of_segments_of_six_are_compared() -> None:
    segments = [casts(84.0, 116.0)[:n] for n in (5, 6, 6)]
    assert len(compare(segments, "temperature")["full yos"]) == 2
    assert methods("temperature")["composite, two full casts"][1] == 2
