"""Which segments of a glider whose clock was set go to which time."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.model import Fix, Segment, SegmentId, Series, readonly
from gliderwatch.navigation.clock import (
    DAY,
    HOUR,
    ROLLOVER,
    Correction,
    Stamp,
    corrections,
    forward_step,
    is_same,
    moved,
    numbered,
)
from gliderwatch.navigation.flight import downsample

LONG = 3 * HOUR
PAUSE = 200.0


def mission(n: int, **set_by: float) -> list[Stamp]:
    """Segments of three hours; `set_by` gives what the clock is off from a number on (_5=-3600.0)."""
    out, off = [], 0.0
    for k in range(n):
        off = set_by.get(f"_{k}", off)
        out.append(Stamp(k, 1e9 + k * (LONG + PAUSE) + off, 1e9 + k * (LONG + PAUSE) + LONG + off))
    return out


@pytest.mark.parametrize("step", [HOUR, 2 * HOUR, 5 * HOUR, 10 * DAY, ROLLOVER, 33 * HOUR])
def test_a_clock_that_falls_back_by_whole_hours_is_put_right_exactly(step):
    found = corrections(mission(9, _5=-step))
    assert [c.offset for c in found] == [0.0] * 5 + [step] * 4
    assert [c.step for c in found] == [0.0] * 5 + [step] + [0.0] * 3


def test_one_that_falls_back_by_any_time_goes_on_after_the_segment_before():
    stamps = mission(9, _5=-9500.0)
    found = corrections(stamps)
    assert stamps[5].opened_at + found[5].offset == pytest.approx(stamps[4].last_t, abs=900.0)
    assert len({c.offset for c in found[5:]}) == 1


def test_a_clock_that_is_right_again_is_left_alone():
    found = corrections(mission(12, _4=-10 * DAY, _8=0.0))
    assert [c.offset for c in found] == [0.0] * 4 + [10 * DAY] * 4 + [0.0] * 4
    assert found[8].step == -10 * DAY


def test_it_may_fall_twice():
    found = corrections(mission(9, _3=-2 * HOUR, _6=-5 * HOUR))
    assert [c.offset for c in found] == [0.0] * 3 + [2 * HOUR] * 3 + [5 * HOUR] * 3


def test_the_order_in_which_they_come_does_not_matter():
    stamps = mission(9, _5=-10 * DAY)
    assert corrections(stamps[::-1]) == corrections(stamps)[::-1]


def test_where_segments_are_missing_a_rollover_is_still_known_for_one():
    found = corrections([s for s in mission(12, _5=-ROLLOVER) if s.number not in (4, 5, 6)])
    assert [c.offset for c in found] == [0.0] * 4 + [ROLLOVER] * 5


def test_where_segments_are_missing_any_other_step_is_not_put_right():
    found = corrections([s for s in mission(9, _5=-10 * DAY) if s.number != 4])
    assert [c.offset for c in found] == [0.0] * 8
    assert found[4].step > 9 * DAY


@pytest.mark.parametrize("lost", [(), (3,), (3, 4, 5)])
def test_a_clock_that_is_right_is_left_alone(lost):
    stamps = [s for s in mission(9) if s.number not in lost]
    assert corrections(stamps) == [Correction()] * len(stamps)


def test_a_wild_time_stamp_at_the_end_of_a_segment_is_no_clock_that_fell():
    stamps = mission(9)
    stamps[4] = replace(stamps[4], last_t=stamps[4].last_t + 3 * DAY)
    assert corrections(stamps) == [Correction()] * 9


def test_a_mission_counter_that_begins_again_is_no_clock_that_fell():
    again = [Stamp(s.number, s.opened_at + DAY, s.last_t + DAY) for s in mission(4)]
    assert corrections(mission(9) + again) == [Correction()] * 13


def test_what_is_not_kept_any_more_is_not_forgotten():
    """`state.keep_days` has removed the segments in which the clock fell."""
    stamps = mission(9, _2=-10 * DAY)[4:]
    assert {c.offset for c in corrections(stamps, Correction(10 * DAY))} == {10 * DAY}


def test_one_name_and_openings_far_apart_are_two_segments():
    one = SegmentId(1e9, "unit", "unit-2023-318-0-4")
    assert is_same(one, SegmentId(1e9 + 5.0, "unit", "unit-2023-318-0-4"))
    assert not is_same(one, SegmentId(1e9 + 12 * HOUR, "unit", "unit-2023-318-0-4"))
    assert not is_same(one, SegmentId(1e9, "unit", "unit-2023-318-0-5"))


def test_names_that_are_none_have_no_number():
    assert numbered("unit-2023-318-0-41") == ("unit-2023-318-0", 41)
    assert numbered("whatever") == ("whatever", 0)


def forward(hours: float, *, name: str = "unit-2023-318-0-5", fix_after: float = 60.0, moved: float = 0.0005):
    opened = 1e9 + hours * HOUR + PAUSE
    return forward_step(
        "unit-2023-318-0-4",
        1e9,
        Fix(1e9 - 120.0, 36.0, -70.0),
        SegmentId(opened, "unit", name),
        Fix(opened + fix_after, 36.0 + moved, -70.0),
    )


def test_a_clock_set_forward_between_two_segments_is_seen():
    assert forward(5.0) == pytest.approx(5 * HOUR, abs=PAUSE)
    assert forward(0.2) == 0.0, "a long call"
    assert forward(5.0, name="unit-2023-318-0-6") == 0.0, "a segment is missing"
    assert forward(5.0, name="unit-2023-318-1-5") == 0.0, "another mission"
    assert forward(5.0, fix_after=2 * HOUR) == 0.0, "it may have dived"
    assert forward(5.0, moved=0.1) == 0.0, "11 km in a few minutes: the hours were real"


def test_a_segment_at_hand_is_moved_to_what_the_one_that_was_kept_is_moved_to():
    """By a time that is no whole number of the 30 s over which samples are averaged."""
    t = 1e9 + np.arange(0.0, 600.0, 20.0)
    pitch = Series(readonly(t), readonly(np.arange(float(len(t)))))
    at_hand = Segment(
        SegmentId(1e9, "unit", "unit-2001-1-1-1"), "m", "sbd", 1e9 + 700, (0, 1, ""), {"pitch": pitch}
    )
    kept = replace(at_hand, quantities=downsample(at_hand.quantities))
    one, other = (moved(each, 15736.0).quantities["pitch"] for each in (at_hand, kept))
    assert one.t.tolist() == other.t.tolist() == (kept.quantities["pitch"].t + 15736.0).tolist()
    assert len(one) < len(pitch)
